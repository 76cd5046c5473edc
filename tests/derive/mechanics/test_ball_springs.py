"""Springs in ball joints: the torque −k φ, φ the rotation vector as SciPy has it, at rest, beyond
half a turn of the quaternion, and in loops.

Of derive.mechanics.loads: spring. Of derive.model.loads: in_joint, spring.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from codegen.passes import program
from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from hamel.verify.reference.vectors import rotation_vector
from tests.evaluation import functions

INERTIA = np.array([0.1, 0.2, 0.25])
BALL = """
model: ball
parameters: {k: 3 N*m/rad, d: 0.5}
bodies: {b: {mass: 2, inertia: [0.1, 0.2, 0.25]}}
joints: {J: {type: ball, parent: ground, child: b, rpy: [0.3, 0.4, 0.5]IN_JOINT}}
LOADS
"""
IN_JOINT = ", spring: {stiffness: k}, damper: d"
LOADS = """loads:
  s: {type: spring, joint: J, stiffness: k}
  x: {type: damper, velocity: J.wx, coefficient: d}
  y: {type: damper, velocity: J.wy, coefficient: d}
  z: {type: damper, velocity: J.wz, coefficient: d}
"""
ROD = """
model: rod
gravity: [0, 0, -9.81 m/s^2]
parameters: {k: 2 N*m/rad}
repeat: {i: 0..5, j: 1..5}
bodies:
  "b{i}": {mass: 0.05, com: [0.05, 0, 0], inertia: [1e-5, 5e-5, 5e-5]}
joints:
  J0: {type: ball, parent: ground, child: b0, spring: {stiffness: k}, damper: 0.002}
  "J{j}": {type: ball, parent: "b{j-1}", child: "b{j}", at: [0.1, 0, 0], spring: {stiffness: k}, damper: 0.002}
"""


def turned(rng: np.random.Generator, angle: float) -> np.ndarray:
    """A quaternion (w, x, y, z) about some axis."""
    axis = rng.normal(size=3)
    half = 0.5 * angle
    return np.array([np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis))])


@pytest.mark.parametrize(("inside", "loads"), [(IN_JOINT, ""), ("", LOADS)])
def test_the_torque_is_along_the_rotation_vector(inside: str, loads: str) -> None:
    s = system(load_text(BALL.replace("IN_JOINT", inside).replace("LOADS", loads)))
    e, rng = equations(s), np.random.default_rng(5)
    found = functions(e)
    for angle in (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.4, 2.0, 3.1, 3.2, 4.0, 6.2):
        q, w = turned(rng, angle), rng.normal(size=3)
        turn = Rotation.from_quat([*q[1:], q[0]]).as_rotvec()
        torque = -3.0 * turn - 0.5 * w
        x = np.array([*q, *w])
        wanted = (torque - np.cross(w, INERTIA * w)) / INERTIA
        got = found["dynamics"](0.0, x, [], [3.0, 0.5]).full().ravel()[4:]
        assert np.abs(got - wanted).max() < 1e-13 * (1.0 + np.abs(wanted).max())
        kinetic, stored = found["energy"](0.0, x, [], [3.0, 0.5]).full().ravel()[:2]
        assert kinetic == pytest.approx(0.5 * w @ (INERTIA * w), rel=1e-13)
        assert stored == pytest.approx(1.5 * turn @ turn, rel=1e-13, abs=1e-30)
        assert np.abs(rotation_vector(q) - turn).max() < 1e-14 * (1.0 + np.abs(turn).max())


def test_a_damper_acts_about_all_axes_of_a_ball_by_euler_angles_too() -> None:
    text = BALL.replace("IN_JOINT", ", orientation: {euler: zyx}, damper: d").replace("LOADS", "")
    e = equations(system(load_text(text)))
    w = np.array([0.3, -0.4, 0.7])
    got = functions(e)["dynamics"](0.0, [0.1, 0.2, 0.3, *w], [], [3.0, 0.5]).full().ravel()[3:]
    assert got == pytest.approx((-0.5 * w - np.cross(w, INERTIA * w)) / INERTIA, rel=1e-13)


def test_a_stiffness_about_each_axis_is_the_slope_of_what_it_stores() -> None:
    """By central differences of ½ Σ kᵢ φᵢ² along turns about the body's axes."""
    k = np.array([1.0, 2.0, 5.0])
    loads = "loads: {s: {type: spring, joint: J, stiffness: [1, 2, 5]}}"
    e = equations(system(load_text(BALL.replace("IN_JOINT", "").replace("LOADS", loads))))
    dynamics, rng = functions(e)["dynamics"], np.random.default_rng(6)

    def stored(turn: Rotation) -> float:
        return 0.5 * float(k @ turn.as_rotvec() ** 2)

    for angle in (1e-3, 0.4, 2.0, 3.0, 4.0):
        q = turned(rng, angle)
        turn = Rotation.from_quat([*q[1:], q[0]])
        steps = [Rotation.from_rotvec(1e-5 * axis) for axis in np.eye(3)]
        wanted = [(stored(turn * x.inv()) - stored(turn * x)) / 2e-5 for x in steps]
        got = dynamics(0.0, [*q, 0, 0, 0], [], [3.0, 0.5]).full().ravel()[4:] * INERTIA
        assert got == pytest.approx(wanted, abs=1e-8)
    still = dynamics(0.0, [1.0, *[0.0] * 6], [], [3.0, 0.5]).full().ravel()[4:]
    assert not still.any()


def test_slopes_have_values_at_rest() -> None:
    """∂ẇ/∂q along a small turn about x is −k/I."""
    s = system(load_text(BALL.replace("IN_JOINT", IN_JOINT).replace("LOADS", "")))
    e = equations(s)
    at = ca.Function("f", [a.symbols for a in e.arguments], [
        ca.jacobian(e.function("dynamics").result.value, e.argument("x").symbols)
    ])  # fmt: skip
    slopes = at(0.0, [1.0, *[0.0] * 6], [], [3.0, 0.5]).full()
    assert slopes[4:, 1:4] == pytest.approx(np.diag(-2.0 * 3.0 / INERTIA), abs=1e-12)


def test_rods_are_loops() -> None:
    """Six balls with springs take no more code than two."""
    made = program(equations(system(load_text(ROD))), ["dynamics"], roll="always")
    assert made.kernels[0].rolled is not None
