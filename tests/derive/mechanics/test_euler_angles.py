"""Ball joints by Euler angles: Lagrange's top in closed form, and any sequence in turned frames as
the reference has it.

Of derive.joints: ball, euler.
"""

from __future__ import annotations

import numpy as np
import pytest

from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from tests.agreement import disagreement
from tests.evaluation import functions

TOP = """
model: top
gravity: [0, 0, -9.81 m/s^2]
parameters: {m: 0.5 kg, l: 0.1 m, A: 0.006 kg*m^2, C: 0.002 kg*m^2}
bodies: {top: {mass: m, com: [0, 0, l], inertia: [A - m*l^2, A - m*l^2, C]}}
joints: {tip: {type: ball, parent: ground, child: top, orientation: {euler: zxz, angles: [a, b, c]}}}
quasi_velocities:
  rates: [der(a), der(b), der(c)]
  body: [tip.wx, tip.wy, tip.wz]
initial: {b: 0.4 rad}
"""
ARM = """
model: arm
gravity: [0.3 m/s^2, 0, -9.81 m/s^2]
bodies:
  arm: {mass: 2 kg, com: [0.1, 0.2, 0.3], inertia: [0.1, 0.12, 0.15, 0.01, 0.02, -0.01]}
  hand: {mass: 1 kg, com: [0.05, 0, 0.1], inertia: 0.01}
joints:
  shoulder: {type: ball, parent: ground, child: arm, orientation: {euler: SEQUENCE}, at: [[0.1, 0.2, 0.3], [0.3, 0, 0]], rpy: [0.3, 0.4, 0.5]}
  wrist: {type: revolute, parent: arm, child: hand, at: [0.2, 0, 0.4], axis: [0, 3, 4], coordinate: q}
loads: {d: {type: damper, joint: wrist, coefficient: 0.2}}
outputs: {hand: position(hand), turn: "angle(arm, z)"}
"""


def lagrange(angles: np.ndarray, rates: np.ndarray, p: np.ndarray) -> np.ndarray:
    """ä, b̈, c̈ of the symmetric top: the momenta of a and c are constant."""
    (_, b, _), (da, db, dc), (m, l, A, C) = angles, rates, p
    spin = dc + da * np.cos(b)
    dda = (C * spin * db - 2.0 * A * da * db * np.cos(b)) / (A * np.sin(b))
    ddb = (A * da**2 * np.cos(b) - C * spin * da + m * 9.81 * l) * np.sin(b) / A
    return np.array([dda, ddb, da * db * np.sin(b) - dda * np.cos(b)])


def test_lagrange_s_top_in_rates_of_its_angles() -> None:
    found = system(load_text(TOP))
    dynamics = functions(equations(found, "rates"))["dynamics"]
    rng, p = np.random.default_rng(7), np.array(found.parameters)
    for _ in range(20):
        angles, rates = rng.uniform(0.3, 2.8, 3), rng.normal(size=3)
        got = dynamics(0.0, np.concatenate([angles, rates]), [], p).full().ravel()
        np.testing.assert_allclose(got[:3], rates, rtol=1e-12)
        np.testing.assert_allclose(got[3:], lagrange(angles, rates, p), rtol=1e-9, atol=1e-9)


def test_euler_s_equations_of_a_top_know_the_attitude_by_its_weight_alone() -> None:
    """A ω̇x = (A − C) ωy ωz + m g l e·y and so on, e the vertical in the body."""
    found = system(load_text(TOP))
    dynamics = functions(equations(found, "body"))["dynamics"]
    rng, (m, l, A, C) = np.random.default_rng(8), np.array(found.parameters)
    for _ in range(20):
        angles, w = rng.uniform(0.3, 2.8, 3), rng.normal(size=3)
        up = [np.sin(angles[1]) * np.sin(angles[2]), np.sin(angles[1]) * np.cos(angles[2])]
        wanted = [
            ((A - C) * w[1] * w[2] + m * 9.81 * l * up[1]) / A,
            ((C - A) * w[0] * w[2] - m * 9.81 * l * up[0]) / A,
            0.0,
        ]
        got = dynamics(0.0, np.concatenate([angles, w]), [], found.parameters).full().ravel()
        np.testing.assert_allclose(got[3:], wanted, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("sequence", ["zxz", "zyx", "yxy", "xyz"])
def test_any_sequence_agrees_with_the_reference(sequence: str) -> None:
    apart = disagreement(ARM.replace("SEQUENCE", sequence))
    assert max(apart.values()) < 1e-10, apart
