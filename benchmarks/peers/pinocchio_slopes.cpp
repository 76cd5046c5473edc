// Forward dynamics of Pinocchio on casadi::SX with its Jacobians, (q, v, u) → v̇, ∂v̇/∂q, ∂v̇/∂v, ∂v̇/∂u, written as C by CasADi's
// generator: program TREE makes slopes.c and slopes_world.c here.
#include <pinocchio/autodiff/casadi.hpp>

#include "tree.hpp"
#include <iostream>
#include <pinocchio/algorithm/aba.hpp>

using casadi::SX;
using Model = pinocchio::ModelTpl<SX>;
using Data = pinocchio::DataTpl<SX>;
using Vector = Eigen::Matrix<SX, Eigen::Dynamic, 1>;

static Vector symbols(const SX & s)
{
    Vector made(s.size1());
    for (int i = 0; i < s.size1(); i++) made[i] = s(i);
    return made;
}

int main(int, char ** argv)
{
    const Model model = tree(argv[1]).cast<SX>();
    const SX q = SX::sym("q", model.nq), v = SX::sym("v", model.nv), u = SX::sym("u", model.nv);
    for (const auto & [name, convention] : {std::pair{"slopes", pinocchio::Convention::LOCAL}, {"slopes_world", pinocchio::Convention::WORLD}}) {
        Data data(model);
        const Vector vdot = pinocchio::aba(model, data, symbols(q), symbols(v), symbols(u), convention);
        SX a(model.nv, 1);
        for (int i = 0; i < model.nv; i++) a(i) = vdot[i];
        casadi::Function f(name, {q, v, u}, {a, SX::jacobian(a, q), SX::jacobian(a, v), SX::jacobian(a, u)});
        f.generate(std::string(name) + ".c");
        std::cout << name << " " << f.n_instructions() << std::endl;
    }
}
