// Pinocchio's own algorithms in double precision. bench_open("FUNCTION TREE"), then rows of (q, v, u or v̇) in, results out.
#include "tree.hpp"
#include <memory>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <sstream>

static std::unique_ptr<pinocchio::Model> model;
static std::unique_ptr<pinocchio::Data> data;
static std::string function;

extern "C" int bench_open(const char * argument)
{
    std::string path;
    std::istringstream(argument) >> function >> path;
    model = std::make_unique<pinocchio::Model>(tree(path));
    data = std::make_unique<pinocchio::Data>(*model);
    return 0;
}

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Map = Eigen::Map<const Eigen::VectorXd>;
    const int nq = model->nq, nv = model->nv;
    const auto convention = function == "aba_world" ? pinocchio::Convention::WORLD : pinocchio::Convention::LOCAL;
    if (function.substr(0, 3) == "aba")
        for (long i = 0; i < n; i++, in += in_size, out += out_size)
            Eigen::Map<Eigen::VectorXd>(out, nv) =
                pinocchio::aba(*model, *data, Map(in, nq), Map(in + nq, nv), Map(in + nq + nv, nv), convention);
    else if (function == "rnea")
        for (long i = 0; i < n; i++, in += in_size, out += out_size)
            Eigen::Map<Eigen::VectorXd>(out, nv) = pinocchio::rnea(*model, *data, Map(in, nq), Map(in + nq, nv), Map(in + nq + nv, nv));
    else
        for (long i = 0; i < n; i++, in += in_size, out += out_size) // the upper triangle, as crba leaves it
            Eigen::Map<Eigen::MatrixXd>(out, nv, nv) = pinocchio::crba(*model, *data, Map(in, nq), pinocchio::Convention::WORLD);
}
