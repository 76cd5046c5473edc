// Closed loops in Pinocchio: bench_open("lcaba TREE LOOPS" or "constraintDynamics TREE LOOPS"). A line of LOOPS is two joints and the
// point they share in the frame of each: a b  xa ya za  xb yb zb. Rows of (q, v, u) in, accelerations out.
#include "tree.hpp"
#include <memory>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/algorithm/loop-constrained-aba.hpp>
#include <sstream>

using Closure = pinocchio::RigidConstraintModel;
using ClosureData = pinocchio::RigidConstraintData;

static std::unique_ptr<pinocchio::Model> model;
static std::unique_ptr<pinocchio::Data> data;
static std::vector<Closure, Eigen::aligned_allocator<Closure>> closures;
static std::vector<ClosureData, Eigen::aligned_allocator<ClosureData>> closure_data;
static bool recursive;

extern "C" int bench_open(const char * argument)
{
    std::string function, path, loops;
    std::istringstream(argument) >> function >> path >> loops;
    recursive = function == "lcaba";
    model = std::make_unique<pinocchio::Model>(tree(path));
    std::ifstream in(loops);
    int a, b;
    Eigen::Vector3d on_a, on_b;
    while (in >> a >> b >> on_a[0] >> on_a[1] >> on_a[2] >> on_b[0] >> on_b[1] >> on_b[2])
        closures.emplace_back(
            pinocchio::CONTACT_3D, *model, a, pinocchio::SE3(Eigen::Matrix3d::Identity(), on_a), b,
            pinocchio::SE3(Eigen::Matrix3d::Identity(), on_b), pinocchio::LOCAL);
    for (const auto & closure : closures) closure_data.emplace_back(closure);
    data = std::make_unique<pinocchio::Data>(*model);
    if (recursive)
        pinocchio::computeJointMinimalOrdering(*model, *data, closures);
    else
        pinocchio::initConstraintDynamics(*model, *data, closures, closure_data);
    return 0;
}

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Map = Eigen::Map<const Eigen::VectorXd>;
    const int nq = model->nq, nv = model->nv;
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        pinocchio::ProximalSettings settings(1e-11, 1e-8, 10); // accuracy, mu: with none, planar loops closed in space give NaN
        const Map q(in, nq), v(in + nq, nv), u(in + nq + nv, nv);
        Eigen::Map<Eigen::VectorXd>(out, nv) =
            recursive ? pinocchio::lcaba(*model, *data, q, v, u, closures, closure_data, settings)
                      : pinocchio::constraintDynamics(*model, *data, q, v, u, closures, closure_data, settings);
    }
}
