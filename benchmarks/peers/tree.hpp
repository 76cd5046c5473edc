// A tree of joints from a text file, for Pinocchio. First line: gravity. Then one joint a line:
// parent kind ax ay az  R (9, row by row)  p (3)  mass  com (3)  inertia about com (9).
// The text is what Pinocchio's own readers made of the robot (benchmarks/peers/pinocchio.py); nothing of Pinocchio's compiled
// libraries is used, so that all of it is compiled for this processor.
#pragma once
#include <fstream>
#include <pinocchio/fwd.hpp>
#include <pinocchio/multibody.hpp>
#include <stdexcept>
#include <string>

inline pinocchio::JointModel joint_of(const std::string & kind, const Eigen::Vector3d & axis)
{
    using namespace pinocchio;
    if (kind == "RX") return JointModelRX();
    if (kind == "RY") return JointModelRY();
    if (kind == "RZ") return JointModelRZ();
    if (kind == "PX") return JointModelPX();
    if (kind == "PY") return JointModelPY();
    if (kind == "PZ") return JointModelPZ();
    if (kind == "R") return JointModelRevoluteUnaligned(axis);
    if (kind == "P") return JointModelPrismaticUnaligned(axis);
    if (kind == "Free") return JointModelFreeFlyer();
    throw std::runtime_error("no such joint: " + kind);
}

inline pinocchio::Model tree(const std::string & path)
{
    std::ifstream in(path);
    pinocchio::Model model;
    Eigen::Vector3d g, axis, p, com;
    Eigen::Matrix3d R, I;
    double mass;
    int parent;
    std::string kind;
    in >> g[0] >> g[1] >> g[2];
    model.gravity.linear(g);
    while (in >> parent >> kind) {
        for (int i = 0; i < 3; i++) in >> axis[i];
        for (int i = 0; i < 9; i++) in >> R(i / 3, i % 3);
        for (int i = 0; i < 3; i++) in >> p[i];
        in >> mass;
        for (int i = 0; i < 3; i++) in >> com[i];
        for (int i = 0; i < 9; i++) in >> I(i / 3, i % 3);
        const std::string name = "j" + std::to_string(model.njoints);
        const auto id = model.addJoint(parent, joint_of(kind, axis), pinocchio::SE3(R, p), name);
        model.appendBodyToJoint(id, pinocchio::Inertia(mass, com, pinocchio::Symmetric3(I)), pinocchio::SE3::Identity());
    }
    return model;
}
