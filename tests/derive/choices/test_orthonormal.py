"""Orthonormal directions: their guards tell where the constraints lose rank, in units of any size.

Of derive.choices: orthonormal.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.choices import orthonormal
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states

# three legs that carry a plate: stretched, all reach for its centre, and a row depends on others
PLATE = """
model: plate
plane: xy
parameters: {k: 0.3 m, l: 0.27 m}
repeat: {i: 1..3}
bodies:
  p: {mass: 2 kg, com: [0.01, 0.02], inertia: 0.03}
  "a{i}": {mass: 0.5*i, com: [0.14, 0], inertia: 0.01}
  "b{i}": {mass: 0.4 kg, com: [0.13, 0.01], inertia: 0.012}
joints:
  base: {type: planar, parent: ground, child: p, coordinates: [x, y, turn]}
  "A{i}": {type: revolute, parent: ground, child: "a{i}", at: ["(0.7 m)*cos((120 deg)*i)", "(0.7 m)*sin((120 deg)*i)"], coordinate: "q{i}"}
  "B{i}": {type: revolute, parent: "a{i}", child: "b{i}", at: [k, 0], coordinate: "r{i}"}
closures:
  "C{i}": {type: revolute, between: ["b{i}", p], at: [[l, 0], ["(0.15 m)*cos((120 deg)*i)", "(0.15 m)*sin((120 deg)*i)"]]}
quasi_velocities: {even: orthonormal}
initial: {x: 0 m, y: 0 m, turn: 0.1, guess: {q1: 310 deg, q2: 70 deg, q3: 190 deg, r1: -20 deg, r2: -20 deg, r3: -20 deg}}
"""
FOUR_BAR = """
model: bars
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {s: SIZE, m: 1 kg}
bodies:
  crank: {mass: m, com: [s, 0], inertia: m*s^2}
  coupler: {mass: m, com: [2*s, 0], inertia: m*s^2}
  rocker: {mass: m, com: [2*s, 0], inertia: m*s^2}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: a}
  B: {type: revolute, parent: crank, child: coupler, at: [2*s, 0], coordinate: b}
  D: {type: revolute, parent: ground, child: rocker, at: [6*s, 0], coordinate: c}
closures: {C: {type: revolute, between: [coupler, rocker], at: [[5*s, 0], [4*s, 0]]}}
quasi_velocities: {even: orthonormal}
initial: {a: 1 rad, guess: {b: -0.5, c: 2}}
"""


def clearances(e: Equations, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """|value| over tolerance of every guard of `dynamics`, states × guards: refused below one."""
    found, guards = e.system, e.function("dynamics").guards
    every = ca.vertcat(*[guard.value / guard.tolerance for guard in guards])
    at = ca.Function("guards", [found.t, found.q, found.p], [every])
    return np.abs(at.map(len(t))(t[None, :], q.T, p.T).full().T)


@pytest.mark.parametrize("most", [12, 3], ids=["by rows", "by their products"])
def test_stretched_legs_are_refused(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """By Gram–Schmidt of the rows, or, with more rows than `most`, by A Aᵀ."""
    monkeypatch.setattr(orthonormal, "ROWS", most)
    found = system(load_text(PLATE))
    e, p = equations(found, "even"), np.array([0.28, 0.27])
    turned = {f"q{i}": 2.0 * np.pi / 3.0 * i + np.pi for i in (1, 2, 3)}
    stretched = np.array([turned.get(c.name, 0.0) for c in found.model.coordinates])
    assert clearances(e, np.zeros(1), stretched[None], p[None]).min() < 1.0
    usual = states(found, 20, seed=2)
    assert clearances(e, usual.t, usual.q, usual.p).min() > 1e3


def test_a_motion_that_rows_decide_is_refused_where_they_lose_rank() -> None:
    """A driven crank: with all bars on one line nothing holds coupler and rocker."""
    drive = "c: {type: prescribed, coordinate: a, motion: (0.5 rad/s)*t}"
    text = FOUR_BAR.replace("SIZE", "1 m").replace("closures: {", "constraints: {" + drive + "}\nclosures: {")  # fmt: skip
    found = system(load_text(text))
    e, p = equations(found, "even"), np.array(found.parameters)
    guards = [guard.name for guard in e.function("dynamics").guards]
    assert guards == ["pivot of C.x", "pivot of C.y", "pivot of c"]
    stretched = np.array([[0.0, 0.0, np.pi]])
    assert clearances(e, np.zeros(1), stretched, p[None]).min() < 1.0


@pytest.mark.parametrize("size", ["1 um", "1 m", "1 km"])
def test_guards_know_the_size_of_a_mechanism(size: str) -> None:
    found = system(load_text(FOUR_BAR.replace("SIZE", size)))
    e, usual = equations(found, "even"), states(found, 20, seed=2)
    clear = clearances(e, usual.t, usual.q, usual.p)
    assert clear.min() > 1e3 and clear.max() < 1e8
