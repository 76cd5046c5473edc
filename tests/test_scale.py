"""Long chains and large trees: never more operations than the graph has, and everything else in proportion to them."""

from __future__ import annotations

import random
from functools import cache
from pathlib import Path

import pytest

from codegen.passes import program
from codegen.passes.pipeline import _roots, _slots
from derive.expressions.counting import operations
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics import system
from derive.model import load

MODELS = Path(__file__).parents[1] / "models"


def chain(n: int) -> str:
    """A planar pendulum of n equal links."""
    lines = ["model: chain", "plane: xy", "gravity: [0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  b{i}: {{mass: 1.0, com: [0.5, 0], inertia: 0.08}}" for i in range(n)]
    lines.append("joints:")
    for i in range(n):
        parent, at = (f"b{i - 1}", 1.0) if i else ("ground", 0.0)
        lines.append(f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: [{at}, 0], coordinate: q{i}}}")
    return "\n".join(lines) + "\n"


def tree(n: int, seed: int) -> str:
    """A spatial tree with random numbers and axes."""
    draw = random.Random(seed)

    def vector(size: float) -> str:
        return "[" + ", ".join(f"{draw.uniform(-size, size):.3f}" for _ in range(3)) + "]"

    lines = ["model: tree", "gravity: [0, 0, -9.81 m/s^2]", "bodies:"]
    for i in range(n):
        inertia = ", ".join(f"{draw.uniform(0.5, 0.7):.3f}" for _ in range(3))
        lines.append(f"  b{i}: {{mass: {draw.uniform(1, 3):.3f}, com: {vector(0.3)}, inertia: [{inertia}]}}")
    lines.append("joints:")
    for i in range(n):
        parent = f"b{draw.randrange(max(0, i - 4), i)}" if i else "ground"
        axis = draw.choice(["x", "y", "z"])
        lines.append(
            f"  j{i}: {{type: revolute, parent: {parent}, child: b{i}, at: {vector(0.5)}, axis: {axis}, coordinate: q{i}}}"
        )
    return "\n".join(lines) + "\n"


@cache
def derived(text: str, folder: Path) -> Equations:
    path = folder / "model.yaml"
    path.write_text(text)
    return equations(system(load(path), "all"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scale")


def assert_never_worse(found: Equations) -> None:
    for kernel in program(found).kernels:
        function = next(f for f in found.functions if f.name == kernel.name)
        most = operations([slot.symbols for slot in _slots(found, function)], _roots(function))
        assert kernel.operations["total"] <= most, kernel.name


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_models_need_no_more_than_their_graph(path: Path) -> None:
    assert_never_worse(equations(system(load(path), "all")))


@pytest.mark.parametrize("text", [chain(10), chain(30), tree(12, 4)], ids=["chain of 10", "chain of 30", "tree of 12"])
def test_trees_need_no_more_than_their_graph(text: str, folder: Path) -> None:
    assert_never_worse(derived(text, folder))
