// Pinocchio's algorithms on casadi::SX, written as C by CasADi's generator: program TREE makes {aba,…}.c here.
#include <pinocchio/autodiff/casadi.hpp>

#include "tree.hpp"
#include <iostream>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

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

template<typename Matrix>
static SX dense(const Matrix & m)
{
    SX made(m.rows(), m.cols());
    for (int i = 0; i < m.rows(); i++)
        for (int j = 0; j < m.cols(); j++) made(i, j) = m(i, j);
    return made;
}

static void write(const std::string & name, const SX & in, const SX & out)
{
    casadi::Function f(name, {in}, {casadi::SX::densify(out)});
    f.generate(name + ".c");
    std::cout << name << " " << f.n_instructions() << std::endl;
}

int main(int, char ** argv)
{
    const Model model = tree(argv[1]).cast<SX>();
    const int nq = model.nq, nv = model.nv;
    const SX in = SX::sym("in", nq + 2 * nv);
    const Vector all = symbols(in);
    const Vector q = all.head(nq), v = all.segment(nq, nv), u = all.tail(nv);
    for (const auto & [name, convention] : {std::pair{"aba", pinocchio::Convention::LOCAL}, {"aba_world", pinocchio::Convention::WORLD}}) {
        Data data(model);
        write(name, in, dense(pinocchio::aba(model, data, q, v, u, convention)));
    }
    Data data(model);
    write("rnea", in, dense(pinocchio::rnea(model, data, q, v, u)));
    for (const auto & [name, convention] : {std::pair{"crba", pinocchio::Convention::LOCAL}, {"crba_world", pinocchio::Convention::WORLD}}) {
        Data fresh(model);
        write(name, in, SX::triu(dense(pinocchio::crba(model, fresh, q, convention))));
    }
}
