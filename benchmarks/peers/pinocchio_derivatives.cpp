// Pinocchio's own derivatives of forward dynamics. bench_open("TREE"), then rows of (q, v, u) in; v̇, ∂v̇/∂q, ∂v̇/∂v and the upper
// triangle of M⁻¹ out, matrices column by column.
#include "open_tree.hpp"
#include <pinocchio/algorithm/aba-derivatives.hpp>

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Vector = Eigen::Map<const Eigen::VectorXd>;
    using Matrix = Eigen::Map<Eigen::MatrixXd>;
    const int nq = model->nq, nv = model->nv, size = nv * nv;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        Matrix by_q(out + nv, nv, nv), by_v(out + nv + size, nv, nv), inverse(out + nv + 2 * size, nv, nv);
        pinocchio::computeABADerivatives(*model, *data, Vector(in, nq), Vector(in + nq, nv), Vector(in + nq + nv, nv), by_q, by_v, inverse);
        Eigen::Map<Eigen::VectorXd>(out, nv) = data->ddq;
    }
}
