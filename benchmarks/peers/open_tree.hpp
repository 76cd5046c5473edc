// Pinocchio's model and data of a tree: bench_open("TREE") of all whose argument is a tree alone.
#pragma once
#include "tree.hpp"
#include <memory>

static std::unique_ptr<pinocchio::Model> model;
static std::unique_ptr<pinocchio::Data> data;

extern "C" int bench_open(const char * argument)
{
    model = std::make_unique<pinocchio::Model>(tree(argument));
    data = std::make_unique<pinocchio::Data>(*model);
    return 0;
}
