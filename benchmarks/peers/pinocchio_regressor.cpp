// Pinocchio's regressor of joint torques. bench_open("TREE"), then rows of (q, v, v̇) in; Y column by column out.
#include "open_tree.hpp"
#include <pinocchio/algorithm/regressor.hpp>

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Map = Eigen::Map<const Eigen::VectorXd>;
    const int nq = model->nq, nv = model->nv;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        const auto & Y = pinocchio::computeJointTorqueRegressor(*model, *data, Map(in, nq), Map(in + nq, nv), Map(in + nq + nv, nv));
        Eigen::Map<Eigen::MatrixXd>(out, Y.rows(), Y.cols()) = Y;
    }
}
