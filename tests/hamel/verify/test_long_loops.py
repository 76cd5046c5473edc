"""Many loops are verified by the balance of forces along their closures: no matrix over all of
them, and an error in any function is seen.

Of hamel.verify: long, long_trees, long_loops.
Of hamel.verify.reference: ties.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.evaluate import evaluator, function_of
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from hamel.verify.long import FEWEST, drawn, is_long, long_verification, own_velocities
from hamel.verify.long_loops import made
from hamel.verify.reference.balance import balance
from hamel.verify.reference.outcome import evaluate, reference
from hamel.verify.reference.ties import (
    accelerations,
    carried_back,
    factored,
    forces,
    rows_over_velocities,
    ties,
    violation,
)
from tests.loops import four_bars

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore::FutureWarning")

FUNCTIONS = (
    *("dynamics", "bias", "inverse_dynamics", "power", "energy", "velocity", "state"),
    *("reactions", "constraints", "project", "mass", "guards", "constraint_rows"),
)
SPATIAL = """
model: ladder
gravity: [0, 0, -9.81 m/s^2]
bodies:
  a: {mass: 2 kg, com: [0.1, 0.3, 0.2], inertia: [0.2, 0.3, 0.4]}
  b: {mass: 1 kg, com: [0.2, 0.1, 0], inertia: [0.1, 0.2, 0.15]}
  c: {mass: 3 kg, com: [0.3, 0.1, 0.1], inertia: [0.3, 0.2, 0.25]}
joints:
  A: {type: revolute, parent: ground, child: a, axis: y, coordinate: q1}
  B: {type: ball, parent: a, child: b, at: [1, 0, 0.2]}
  C: {type: revolute, parent: ground, child: c, axis: x, at: [1, 1, 0], coordinate: q2}
closures:
  D: {type: ball, between: [b, c], at: [[0.9, 0.1, 0], [0, -0.2, 1]]}
loads:
  s: {type: spring, between: [a, c], stiffness: 30 N/m, length: 1 m, at: [[0, 0, 0.5], [0.1, 0, 0]]}
initial: {guess: {q1: 0.1, q2: 0.1}}
"""


@pytest.fixture(autouse=True)
def _three_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.import_module("hamel.verify.long"), "LONG", 3)


@pytest.fixture(scope="module")
def row() -> Equations:
    return equations(system(load_text(four_bars(6))))


def module(of: Equations, wrong: str = "", entry: int = -1, part: float = 0.0) -> ModuleType:
    """What stands for a module: the equations as CasADi evaluates them, one entry off."""
    result = ModuleType("nothing")
    known, evaluated = {x.name for x in of.functions}, evaluator(of)
    for name in FUNCTIONS:
        function = of.function(name) if name in known else made(of, name)
        own = evaluated.iterated if name == "project" else None
        call = partial(own, name) if own else function_of(of, function)
        vars(result)[name] = _call(call, entry, part * (name == wrong))
    vars(result)["defaults"] = np.zeros(len(of.parameters))
    return result


def _call(f: Callable[..., Any], entry: int, part: float) -> Callable[..., np.ndarray]:
    def call(t: Any, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        if np.ndim(t):
            return np.array([call(*each) for each in zip(t, x, u, p)])
        value = np.array(f(t, x, u, p)).ravel()
        if part:
            value[entry] *= 1.0 + part
        return value

    return call


def test_what_is_right_passes(row: Equations) -> None:
    assert own_velocities(row) == (0,) and is_long(row, module(row))
    result = long_verification(row.system.model, row, module(row), FEWEST)
    assert result.passed and len(result.checks) > 12


@pytest.mark.parametrize(
    ("wrong", "check"),
    [
        ("dynamics", "balance"),
        ("bias", "bias"),
        ("inverse_dynamics", "forces"),
        ("energy", "energy"),
        ("velocity", "velocity"),
        ("state", "state"),
        ("reactions", "reactions"),
        ("constraints", "constraints"),
        ("project", "project"),
        ("mass", "mass"),
        ("guards", "guards"),
        ("constraint_rows", "rows"),
    ],
)
def test_a_wrong_entry_is_seen(row: Equations, wrong: str, check: str) -> None:
    entry = 4 if wrong in ("constraints", "constraint_rows", "bias", "energy") else -1
    entry = 0 if wrong == "energy" else entry
    result = long_verification(row.system.model, row, module(row, wrong, entry, 1e-4), 4)
    assert check in {x.name for x in result.checks if not x.passed}


def test_a_guard_that_refuses_is_seen(row: Equations) -> None:
    result = long_verification(row.system.model, row, module(row, "guards", 1, -1 + 1e-9), 4)
    assert "guards" in {x.name for x in result.checks if not x.passed}


def test_other_speeds_take_the_usual_suite() -> None:
    text = four_bars(3).replace("crank: [der(a0)]", "crank: [2*der(a0) + der(b0)]")
    other = equations(system(load_text(text)))
    assert own_velocities(other) is None and not is_long(other, module(other))


@pytest.mark.parametrize("text", [four_bars(4), SPATIAL])
def test_ties_are_those_of_the_dense_reference(text: str) -> None:
    """Rows, accelerations and forces of a mechanism with constraint forces in space, too."""
    of = equations(system(load_text(text)))
    ref = reference(of.system.model)
    for place in drawn(ref, of, 2, seed=1):
        s, dense = place.state, evaluate(ref, place.state)
        found = ties(ref.model, s)
        A = rows_over_velocities(s, found)
        full = np.array([[row.get(j, 0.0) for j in range(len(s.v))] for row in A])
        np.testing.assert_allclose(full, dense.kinematics.A, atol=1e-13)
        seen = violation(s, found)
        np.testing.assert_allclose(seen.phi, dense.kinematics.phi, atol=1e-13)
        np.testing.assert_allclose(seen.rate, dense.kinematics.violation(s.v), atol=1e-13)
        free = _free(full)
        vdot, left = accelerations(s, found, A, {j: float(dense.vdot[j]) for j in free})
        np.testing.assert_allclose(vdot, dense.vdot, rtol=1e-9, atol=1e-9)
        assert left < 1e-12
        unbalanced = balance(ref, s, vdot)
        lam = forces(A, unbalanced)
        np.testing.assert_allclose(lam, dense.lam, rtol=1e-8, atol=1e-8)
        held = carried_back(A, lam, len(s.v))
        np.testing.assert_allclose(held, unbalanced.left, rtol=1e-9, atol=1e-9)


def _free(A: np.ndarray) -> list[int]:
    """Velocities that tell the others: one by one the last that leaves the rank of the rest."""
    free: list[int] = []
    for j in reversed(range(A.shape[1])):
        rest = [k for k in range(A.shape[1]) if k not in (j, *free)]
        if np.linalg.svd(A[:, rest], compute_uv=False)[len(A) - 1 : len(A)].sum() > 1e-3:
            free.append(j)
        if len(free) == A.shape[1] - len(A):
            break
    return free


def test_rows_that_repeat_others_are_passed_over() -> None:
    A = [{0: 1.0, 1: 2.0}, {1: 1.0, 2: -1.0}, {0: 2.0, 1: 4.0}, {2: 1.0, 3: 1.0}]
    full = np.array([[row.get(j, 0.0) for j in range(4)] for row in A])
    factors = factored(A)
    assert sum(pivot == 0.0 for _, pivot, _ in factors.steps) == 1
    b = full @ full.T @ np.array([1.0, -2.0, 0.5, 3.0])
    y = factors.solution(b)
    np.testing.assert_allclose(full @ full.T @ y, b, atol=1e-12)


def test_factors_have_as_many_entries_as_loops() -> None:
    """A ring: every row meets two others, and the order of elimination leaves no more."""
    for n in (50, 200):
        ring = [{k: 1.0, (k + 1) % n: -2.0} for k in range(n)]
        entries = sum(len(below) for _, _, below in factored(ring).steps)
        assert entries <= 3 * n
