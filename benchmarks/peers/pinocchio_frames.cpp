// Pinocchio's pose and geometric Jacobian of a frame. bench_open("TREE JOINT r11 … r33 px py pz"), then rows of q in; the rows of [R p]
// and of J (LOCAL_WORLD_ALIGNED) out.
#include "tree.hpp"
#include <memory>
#include <pinocchio/algorithm/frames.hpp>
#include <sstream>

static std::unique_ptr<pinocchio::Model> model;
static std::unique_ptr<pinocchio::Data> data;
static pinocchio::FrameIndex frame;

extern "C" int bench_open(const char * argument)
{
    std::istringstream in(argument);
    std::string path;
    pinocchio::JointIndex joint;
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    in >> path >> joint;
    for (int i = 0; i < 9; i++) in >> R(i / 3, i % 3);
    for (int i = 0; i < 3; i++) in >> p[i];
    if (!in) return 1;
    model = std::make_unique<pinocchio::Model>(tree(path));
    frame = model->addFrame(pinocchio::Frame("hand", joint, 0, pinocchio::SE3(R, p), pinocchio::OP_FRAME));
    data = std::make_unique<pinocchio::Data>(*model);
    return 0;
}

extern "C" void bench_loop(long n, const double * in, long in_size, double * out, long out_size)
{
    using Vector = Eigen::Map<const Eigen::VectorXd>;
    using Rows = Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
    using Jacobian = Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>>;
    pinocchio::Data::Matrix6x J(6, model->nv);
    for (long i = 0; i < n; i++, in += in_size, out += out_size) {
        J.setZero();
        pinocchio::computeFrameJacobian(*model, *data, Vector(in, model->nq), frame, pinocchio::LOCAL_WORLD_ALIGNED, J);
        Rows pose(out);
        pose.leftCols<3>() = data->oMf[frame].rotation();
        pose.col(3) = data->oMf[frame].translation();
        Jacobian(out + 12, 6, model->nv) = J;
    }
}
