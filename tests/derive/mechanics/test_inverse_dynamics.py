"""M v̇ + h in few operations is M v̇ + h of plain Newton–Euler.

Of derive.mechanics.inverse: dynamics, layouts, stems, base_parameters, moments.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from codegen.passes import program
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations import equations
from derive.joints.rotations import cross, dot, is_zero, rotated, sum_of
from derive.mechanics.inverse import dynamics as inverse_dynamics
from derive.mechanics.inverse.dynamics import joint_forces_of_motion
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.recursions.accelerations import State, accelerations
from derive.mechanics.recursions.tree import Wrench, joint_forces
from derive.model import load
from derive.robots.reading import imported
from derive.states import system
from tests.scenes import MODELS

ROBOTS = Path(__file__).parents[2] / "robots"
TREES = sorted(
    {path.stem for path in MODELS.glob("*.yaml")} | {path.name for path in ROBOTS.glob("*.urdf")}
)

QUICK = ("stanford_arm", "bicycle", "four_bar", "arm.urdf", "quadruped.urdf")


def newton_euler(
    links: Sequence[Link],
    inertias: Sequence[Inertia],
    v: Sequence[Scalar],
    vdot: Sequence[Scalar],
    gravity: Vector,
) -> list[Wrench]:
    """(n, f) at each link's origin: f = m a + U mc, n = I ω̇ + ω × I ω + mc × a."""
    states = accelerations(links, v, vdot, gravity)
    return [_wrench(body, state) for body, state in zip(inertias, states)]


def _wrench(body: Inertia, state: State) -> Wrench:
    omega, alpha, a, U = state
    force = rotated(U, body.moment)
    if not is_zero(body.mass):
        force = sum_of(force, [dot([body.mass], [x]) for x in a])
    moment = sum_of(_turning(body.tensor, omega, alpha, U), cross(body.moment, a))
    return moment, force


def _turning(I: Matrix, omega: Vector, alpha: Vector, U: Matrix) -> Vector:
    """I ω̇ + ω × I ω."""
    spin = [dot(row, omega) for row in I]
    return sum_of([dot(row, alpha) for row in I], cross(omega, spin))


def mechanics_of(name: str, constants: str) -> System:
    if name.endswith(".urdf"):
        return system(imported(ROBOTS / name, True).model, constants)
    return system(load(MODELS / f"{name}.yaml"), constants)


def both(s: System) -> tuple[np.ndarray, np.ndarray]:
    """At random numbers; plain Newton–Euler with inertias as given."""
    n = s.v.numel()
    vdot = ca.SX.sym("vdot", n)
    v, rates = ([x[j] for j in range(n)] for x in (s.v, vdot))
    plain = newton_euler(s.links, [x.inertia for x in s.links], v, rates, s.gravity)
    ways = [
        joint_forces(s.links, plain, n),
        joint_forces_of_motion(s.layouts, v, rates, s.gravity),
    ]
    at = ca.Function("f", [s.t, s.q, s.v, vdot, s.p], [ca.vertcat(*x) for x in ways])
    rng = np.random.default_rng(3)
    values = [
        [np.array(x).ravel() for x in at(0.3, *numbers, s.parameters)]
        for numbers in ([rng.normal(size=k) for k in (s.q.numel(), n, n)] for _ in range(5))
    ]
    return np.array([x for x, _ in values]), np.array([x for _, x in values])


@pytest.mark.parametrize("constants", ["all", ""])
@pytest.mark.parametrize(
    "name",
    [pytest.param(x, marks=[] if x in QUICK else pytest.mark.slow) for x in TREES],
)
def test_the_forces_are_those_of_plain_newton_euler(name: str, constants: str) -> None:
    s = mechanics_of(name, constants)
    plain, few = both(s)
    assert np.abs(few - plain).max() <= 1e-11 * max(1.0, np.abs(plain).max())


@pytest.mark.parametrize("name", ["snake3", "bicycle", "stanford_arm", "free_body", "arm.urdf"])
def test_the_points_of_the_file_do_as_well(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever it is not the cheapest way, too."""
    monkeypatch.setattr(inverse_dynamics, "cheapest", lambda ways: ways[-1])
    s = mechanics_of(name, "")
    plain, few = both(s)
    assert np.abs(few - plain).max() <= 1e-11 * max(1.0, np.abs(plain).max())


def test_a_snake_takes_no_more_operations_than_it_did() -> None:
    found = program(equations(mechanics_of("snake3", "")), ["inverse_dynamics"])
    assert found.kernel("inverse_dynamics").operations["total"] <= 77
