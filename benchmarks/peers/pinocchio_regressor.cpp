// Pinocchio's regressor of joint torques. bench_open("TREE"), then rows of (q, v, v̇) in; Y column by column out.
#include "tree.hpp"
#include <memory>
#include <pinocchio/algorithm/regressor.hpp>

static std::unique_ptr<pinocchio::Model> model;
static std::unique_ptr<pinocchio::Data> data;

extern "C" int bench_open(const char * argument)
{
    model = std::make_unique<pinocchio::Model>(tree(argument));
    data = std::make_unique<pinocchio::Data>(*model);
    return 0;
}

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Map = Eigen::Map<const Eigen::VectorXd>;
    const int nq = model->nq, nv = model->nv;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        const auto & Y = pinocchio::computeJointTorqueRegressor(*model, *data, Map(in, nq), Map(in + nq, nv), Map(in + nq + nv, nv));
        Eigen::Map<Eigen::MatrixXd>(out, Y.rows(), Y.cols()) = Y;
    }
}
