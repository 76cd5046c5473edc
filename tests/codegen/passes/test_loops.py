"""Closed loops: many of them, ones that repeat each other, ones that can be laid flat."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from codegen.passes import program
from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load, load_text
from derive.model.records import Model
from derive.states import system
from derive.states.closing import Kinematics
from derive.states.sampling import states
from hamel.verify import verification
from tests.loops import KITE, RHOMBUS, four_bars
from tests.scenes import MODELS

G = 9.81
# hamel verify measures lengths in metres: at a megametre roundoff alone exceeds its tolerances
EXTREMES = sorted(
    path for path in (MODELS / "extremes").glob("*.yaml") if path.stem != "scale_megametre"
)


def swing(n: int, angle: float) -> float:
    """θ̈ of n upright four-bars in a row, all links uniform and of length one: one degree of
    freedom."""
    return -((n + 1) / 2 + n) / ((n + 1) / 3 + n) * G * np.cos(angle)


def on_branch(e: Equations, n: int, angle: float, rate: float) -> np.ndarray:
    """ẋ of the row of parallelograms with its cranks at `angle`."""
    dynamics = next(f for f in e.functions if f.name == "dynamics")
    f = ca.Function("f", [a.symbols for a in e.arguments], [dynamics.result.value])
    names = [c.name for c in e.system.model.coordinates]
    q = [angle if name.startswith("a") else -angle for name in names]
    return f(0.0, [*q, rate], [], e.parameters).full().ravel()


SIZES = [
    1,
    2,
    10,
    20,
    pytest.param(40, marks=pytest.mark.slow),
    pytest.param(100, marks=pytest.mark.slow),
]


@pytest.mark.parametrize("n", SIZES)
def test_four_bars_in_a_row(n: int) -> None:
    """Few operations per loop, and the closed form at every state of the branch."""
    e = equations(system(load_text(four_bars(n)), "all"), "crank")
    assert program(e, ("dynamics",)).kernels[0].operations["total"] <= 115 * n
    for angle, rate in ((1.2, -1.0), (2.5, 3.0), (-0.4, 0.7), (4.0, -2.0)):
        found = on_branch(e, n, angle, rate)
        assert found[-1] == pytest.approx(swing(n, angle), abs=1e-9)
        assert np.allclose(np.abs(found[:-1]), abs(rate), atol=1e-10)


def test_states_keep_to_the_branch_they_start_from() -> None:
    """A row of parallelograms has many branches, which meet where it lies flat."""
    s = system(load_text(four_bars(10)))
    found = states(s, 30, seed=3)
    assert len(found.t) == 30
    a, b = found.q[:, :11], found.q[:, 11:]
    assert np.max(np.abs(a - a[:, :1])) < 1e-9 and np.max(np.abs(b + a[:, :1])) < 1e-9
    assert np.min(np.abs(np.sin(a))) > 0.05 and np.ptp(a) > 2.0


@pytest.mark.parametrize("text", [KITE, RHOMBUS], ids=["kite", "rhombus"])
def test_linkages_that_can_be_laid_flat(text: str) -> None:
    assert_verified(load_text(text), 8)


@pytest.mark.parametrize("path", EXTREMES, ids=lambda path: path.stem)
def test_extreme_models(path: Path) -> None:
    assert_verified(load(path), 8)


def test_bricard_is_rigid_by_count_and_moves() -> None:
    s = system(load(MODELS / "extremes" / "bricard.yaml"))
    found = states(s, 20, seed=1)
    A, _ = Kinematics(s).rows(found.t, found.q, found.p)
    assert set(np.linalg.matrix_rank(A, tol=1e-7)) == {4}


def assert_verified(model: Model, count: int) -> None:
    """Every choice against the reference, its code left out."""
    s = system(model)
    for choice in model.choices:
        found = verification(model, equations(s, choice.name), states=count)
        assert found.passed and found.states == count, [c for c in found.checks if not c.passed]


TIP = """
model: tip
plane: xy
parameters: {m: 1 kg, l: 0.3 m}
bodies: {a: {mass: m, com: [l/2, 0], inertia: 0.1}, tip: {mass: 0}}
joints: {A: {type: revolute, parent: ground, child: a}, T: {type: revolute, parent: a, child: tip, at: [l, 0]}}
inputs: {push: {joint: A}}
loads: {d: {type: damper, joint: T, coefficient: 0.1 N*m*s/rad}}
"""
HELD = {
    "rod": "constraints: {c: {type: distance, between: [tip, ground], at: [[l/2, 0], [l, 0]], length: l}}\n",
    "gear": "constraints: {c: {type: gear, joints: [T, A], ratio: 2}}\n",
    "angle": "constraints: {c: {holonomic: T - 1}}\n",
    "nothing_moves": "closures: {C: {type: revolute, between: [tip, ground], at: [[l/2, 0], [1.2*l, 0]]}}\n",
}
LOOSE = {  # the row does not feel how the tip is turned
    "closed_at_its_joint": "closures: {C: {type: revolute, between: [tip, ground], at: [[0, 0], [l, 0]]}}\n",
    "tied_at_its_joint": "constraints: {c: {type: distance, between: [tip, ground], at: [[0, 0], [l, 0]], length: l}}\n",
}


@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("choice", ["auto", "orthonormal"])
def test_a_massless_tip_moves_with_what_holds_it(held: str, choice: str) -> None:
    model = load_text(TIP + HELD[held])
    found = verification(model, equations(system(model), choice), states=8)
    assert found.passed, [c for c in found.checks if not c.passed]


@pytest.mark.parametrize("loose", LOOSE)
def test_a_massless_tip_that_nothing_turns_is_refused_by_name(loose: str) -> None:
    with pytest.raises(
        AssumptionError, match=r"nothing determines the acceleration of body tip \(der\(T\)\)"
    ):
        equations(system(load_text(TIP + LOOSE[loose])), "auto")
