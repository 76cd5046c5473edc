"""The passes change rounding only, and the operations they save are counted.

Of codegen.passes: hoist, initial, names, schedule, selection, turns, watch.
Of codegen.passes.rewriting: improve, plain.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codegen.passes import program
from codegen.passes.names import RESERVED
from codegen.passes.rewriting.balance import balance
from codegen.passes.rewriting.factor import factor
from codegen.passes.rewriting.graph import Work
from codegen.passes.rewriting.improve import PASSES, count, used_operations
from codegen.passes.rewriting.invert import invert
from codegen.passes.rewriting.lower import Lowered, Operation, lower
from codegen.passes.rewriting.share import share
from codegen.passes.rewriting.trace import record, trace
from codegen.text import TEMPLATES
from derive.diagnostics import HamelError
from tests.toy import toy

TEMPLATES_WITH_LOCALS = (
    *("batch.c.j2", "external.c.j2", "includes.c.j2", "inline.h.j2", "jax.c.j2", "kernels.c.j2"),
    *("long.c.j2", "rolled.c.j2", "taylor.c.j2", "taylor_lanes.c.j2", "wasm.c.j2"),
)

X = ca.SX.sym("x", 5)
a, b, c, d, e = (X[i] for i in range(5))
POINT = np.array([0.7, -1.3, 0.4, 2.1, -0.6])


def traced(*roots: Any) -> Work:
    return trace(record([("x", X)], [ca.SX(root) for root in roots]))


def total(work: Work) -> int:
    return count(lower(work).code.operations)["total"]


def operations(*roots: Any) -> int:
    """Operations after all passes."""
    work = traced(*roots)
    totals = [total(work)]
    for _ in range(3):
        for _, improve in PASSES:
            work = improve(work)
            totals.append(total(work))
    return min(totals)


def values(work: Work, x: np.ndarray) -> list[float]:
    """The roots, evaluated through the lowered operations."""
    return evaluated(lower(work), x)


def evaluated(lowered: Lowered, x: np.ndarray) -> list[float]:
    done: list[float] = []
    for operation in lowered.code.operations:
        done.append(_evaluated(operation, done, x))
    return [done[root] if isinstance(root, int) else root for root in lowered.roots]


def _evaluated(operation: Operation, done: list[float], x: np.ndarray) -> float:
    name = operation.name
    if name == "input":
        return float(x[operation.slot[1]])
    numbers = [done[o] if isinstance(o, int) else o for o in operation.operands]
    plain = {
        "add": lambda p, q: p + q,
        "sub": lambda p, q: p - q,
        "mul": lambda p, q: p * q,
        "div": lambda p, q: p / q,
    }
    return (
        plain[name](*numbers)
        if name in plain
        else -numbers[0]
        if name == "neg"
        else getattr(math, name)(*numbers)
    )


@pytest.mark.parametrize(
    ("expression", "most"),
    [
        (a * 0 + b * 1 - (-c), 1),
        ((a - b) * (b - a), 2),
        (ca.vertcat(a - b, c * (b - a)), 3),
        (-a * -b, 1),
        (a - (-b), 1),
        (2 * (3 * (a * 0.5)), 1),
        (a * b + a * c, 2),
        (a * b + a * c + a * d + e, 4),
        (0.3 * a + 0.3 * b, 2),
        (a / c + b / c, 2),
        ((a * 3 + a) / a, 0),
        (b * (a / b), 0),
        (ca.sin(a) ** 2 * b + ca.cos(a) ** 2 * b, 0),
        (b - b * ca.sin(a) ** 2 + ca.cos(a), 4),
        (ca.vertcat(a * b * c, a * b * d), 3),
        (ca.vertcat(a + b + c, d - a - b), 3),
        (ca.vertcat(0.5 * a * b - c, 0.5 * a * c - d), 5),
        (ca.vertcat(2 * b, b * b, a * b), 3),
        (ca.sin(-a) + ca.sin(a) + ca.cos(-b) - ca.cos(b), 0),
    ],
)
def test_counts(expression: ca.SX, most: int) -> None:
    assert operations(*ca.vertsplit(ca.SX(expression))) <= most


def leaves() -> st.SearchStrategy[Any]:
    return st.one_of(
        st.sampled_from([a, b, c, d, e]), st.sampled_from([0.0, 1.0, -1.0, 2.0, 0.3, 9.81])
    )


def trees() -> st.SearchStrategy[Any]:
    def grow(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
        return st.one_of(
            st.tuples(inner, inner).map(lambda p: p[0] + p[1]),
            st.tuples(inner, inner).map(lambda p: p[0] - p[1]),
            st.tuples(inner, inner).map(lambda p: p[0] * p[1]),
            st.tuples(inner, inner).map(lambda p: p[0] / (2 + ca.SX(p[1]) ** 2)),
            inner.map(lambda p: ca.sin(ca.SX(p))),
            inner.map(lambda p: ca.cos(ca.SX(p))),
            inner.map(lambda p: -ca.SX(p)),
        )

    return st.recursive(leaves(), grow, max_leaves=25)


@settings(max_examples=150, deadline=None)
@given(st.lists(trees(), min_size=1, max_size=3))
def test_passes_change_rounding_only(roots: list[Any]) -> None:
    roots = [ca.SX(root) for root in roots]
    x = POINT
    expected = np.array(ca.Function("f", [X], [ca.vertcat(*roots)])(x)).ravel()
    work = trace(record([("x", X)], roots))
    size = 1 + max((abs(value) for value in _all_values(work, x)), default=0.0)
    for improve in (factor, share, factor, share):
        np.testing.assert_allclose(values(work, x), expected, rtol=1e-11, atol=1e-12 * size)
        np.testing.assert_allclose(
            evaluated(balance(lower(work)), x), expected, rtol=1e-11, atol=1e-12 * size
        )
        work = improve(work)
    np.testing.assert_allclose(values(work, x), expected, rtol=1e-11, atol=1e-12 * size)


@pytest.mark.parametrize("size", [1e-4, 1e4])
def test_constants_along_a_long_recursion_are_no_overflow(size: float) -> None:
    """Each step multiplies by a constant that the variables make up for: the constants alone come
    to 1e±480, the values stay near one."""
    y, z = a, 0.3 * a
    for _ in range(120):
        y, z = size * (y * b + 3 * z * c), size * (y * c - 2 * z * b)
    x = np.array([0.7, 0.4 / size, 0.3 / size, 0.0, 0.0])
    expected = float(ca.Function("f", [X], [y + z])(x))
    assert 1e-9 < abs(expected) < 1e9
    work = traced(y + z)
    for improve in (factor, share, factor):
        assert values(work, x) == pytest.approx([expected], rel=1e-11)
        work = improve(work)
    assert values(work, x) == pytest.approx([expected], rel=1e-11)


def test_constants_of_one_product_are_no_overflow() -> None:
    tiny = 1e-200 * a
    x = np.array([3e199, 2.0, 0.0, 0.0, 0.0])
    expected = float(ca.Function("f", [X], [tiny * tiny * b])(x))
    assert values(traced(tiny * tiny * b), x) == pytest.approx([expected], rel=1e-12)


def _all_values(work: Work, x: np.ndarray) -> list[float]:
    lowered = lower(work)
    done: list[float] = []
    for operation in lowered.code.operations:
        done.append(_evaluated(operation, done, x))
    return done


def test_shared_nodes_are_not_opened() -> None:
    shared = a * b + c
    assert operations(shared * d, shared * e, shared) == 4


def test_long_chains_are_no_trouble() -> None:
    total_sum, step = ca.SX(0), ca.SX(1)
    for i in range(5000):
        step = ca.sin(step * X[i % 5] + 0.1)
        total_sum = total_sum + step
    work = traced(total_sum)
    assert len(share(factor(work)).live) > 10_000


def test_program_of_toy() -> None:
    toy_program = program(toy())
    dynamics = toy_program.kernel("dynamics")
    assert dynamics.operations["total"] <= 47 and dynamics.operations["divide"] == 1
    assert dynamics.operations["total"] == sum(
        n for kind, n in dynamics.operations.items() if kind != "total"
    )
    assert dynamics.uses == ("x", "u", "p")
    titles = [section.title for section in dynamics.sections]
    assert (
        titles[0].startswith("angles: ")
        and titles[1] == "M: joint-space mass matrix"
        and titles[-1].startswith("xdot")
    )
    assert toy_program.kernel("constant").uses == ()
    assert {entry.step for entry in toy_program.ledger} >= {"fold", "factor", "share"}
    assert all(entry.before >= 0 for entry in toy_program.ledger)


def test_functions_are_chosen_by_name() -> None:
    chosen = program(toy(), ["energy"])
    assert [kernel.name for kernel in chosen.kernels] == ["energy"]
    assert "function dynamics" in chosen.left_out and "argument t" in chosen.left_out
    with pytest.raises(HamelError, match="no function 'nonsense'"):
        program(toy(), ["nonsense"])


def test_guard_tolerance_follows_the_scale() -> None:
    guard = program(toy()).kernel("dynamics").guards[0]
    assert guard.limit == 1e-12 and guard.tolerance > 0


def test_names_that_would_clash() -> None:
    equations = toy()
    labels = ("sin", "x", "while", "der(q1)")
    argument = replace(equations.arguments[1], labels=labels)
    arguments = (equations.arguments[0], argument, *equations.arguments[2:])
    renamed = replace(equations, arguments=arguments)
    names = program(renamed, ["dynamics", "odd"]).argument("x").names
    assert len(set(names)) == 4 and not {"sin", "x", "while"} & set(names)


@pytest.mark.parametrize(
    ("name", "choice", "most"), [("snake3", "head", 110), ("four_bar", "crank", 75)]
)
def test_operation_counts_of_the_founding_examples(name: str, choice: str, most: int) -> None:
    """The targets are 150 and 120; a hand-made recursion has 131, a hand-made four-bar 80."""
    from derive.formulations import equations
    from derive.model import load
    from derive.states import system

    model = load(Path(__file__).parents[3] / "models" / f"{name}.yaml")
    assert (
        program(equations(system(model, "all"), choice)).kernel("dynamics").operations["total"]
        <= most
    )


def test_divisors_are_divided_by_once() -> None:
    lowered = lower(traced(a / (b + c), d / (b + c), e / b, 2 / (b + c)))
    inverted = invert(lowered)
    names = [operation.name for operation in inverted.code.operations]
    assert names.count("div") == 2 and names.count("mul") == 3
    assert invert(inverted) is inverted


def test_work_with_parameters_alone_is_hoisted() -> None:
    kernel = program(toy()).kernel("dynamics")
    hoisted = kernel.hoisted
    assert (
        hoisted is not None and hoisted.precompute.uses == ("p",) and "p" not in hoisted.rest.uses
    )
    saved = kernel.operations["total"] - hoisted.rest.operations["total"]
    assert 0 < saved <= hoisted.precompute.operations["total"]
    assert {load.argument for load in hoisted.rest.loads} == {"x", "u", "c"}
    assert program(toy(), ["energy"]).kernel("energy").hoisted is None


def test_what_is_known_late_is_multiplied_and_added_last() -> None:
    """As many operations, the same values, and one operation after the latest operand where there
    were two."""
    late = 1 / (a + b)
    lowered = lower(traced(d * (late * c), d - (e - late)))
    balanced = balance(lowered)
    assert count(used_operations(balanced)) == count(used_operations(lowered))
    np.testing.assert_allclose(evaluated(balanced, POINT), evaluated(lowered, POINT), rtol=1e-14)
    for root in balanced.roots[:2]:
        assert isinstance(root, int)
        last = [balanced.code.operations[o].name for o in balanced.code.operations[root].operands]
        assert "div" in last
    assert evaluated(balance(balanced), POINT) == evaluated(balanced, POINT)
    named = balance(lowered, range(len(lowered.code.operations)))
    assert named is lowered


@pytest.mark.parametrize("file", TEMPLATES_WITH_LOCALS)
def test_no_local_is_called_like_a_macro(file: str) -> None:
    text = (TEMPLATES / file).read_text(encoding="utf-8")
    macros = set(re.findall(r"#define (\w+)", text))
    assert macros <= RESERVED
