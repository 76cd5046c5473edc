"""About oblique axes rows that hold identically are told from constraints, as about the ground's.

Of derive.mechanics: silent.
Of derive.expressions: roundoff.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from derive.choices.survey import survey_of
from derive.expressions.roundoff import vanishing
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

AXES = ("[1, 0, 0]", "[0, 0.6, 0.8]", "[1, 2, 3]", "[-0.3, 0.1, 0.7]")
DOOR = """model: door
gravity: [0, 0, -9.81 m/s^2]
bodies:
  d: {{mass: 5 kg, com: [0.4, 0.1, 0], inertia: [0.5, 0.4, 0.3]}}
  e: {{mass: 1 kg, com: [0, 0.1, 0.2], inertia: 0.1}}
joints:
  H: {{type: {joint}, parent: ground, child: d, at: [0.2, 0.1, 0.3], axis: {axis}, coordinate: q}}
  P: {{type: revolute, parent: d, child: e, at: [0.3, 0, 0.1], axis: x, coordinate: r}}
closures: {{K: {{type: {closure}, between: [ground, d], at: [[0.2, 0.1, 0.3], [0, 0, 0]], axis: {axis}}}}}
initial: {{q: 0.3, der(q): 1}}
"""
SPINDLE = """model: spindle
parameters: {{h: 0.02 m}}
bodies:
  sp: {{mass: 1, com: [0.01, 0, 0.2], inertia: [0.1, 0.1, 0.02]}}
  tab: {{mass: 3, com: [0.1, 0, 0], inertia: 0.2}}
  nut: {{mass: 0.3, com: [0.01, 0.01, 0], inertia: 0.001}}
joints:
  S: {{type: revolute, parent: ground, child: sp, at: [0.2, 0.1, 0], axis: {axis}, coordinate: q}}
  T: {{type: prismatic, parent: ground, child: tab, axis: {axis}, coordinate: s}}
  N: {{type: revolute, parent: tab, child: nut, at: [0.2, 0.1, 0], axis: {axis}, coordinate: n}}
closures:
  K: {{type: screw, between: [sp, nut], at: [[0, 0, 0], [0, 0, 0]], axis: {axis}, pitch: h}}
"""
TILTED = """model: tilted
gravity: [0, 0, 0]
bodies:
  c: {{mass: 1 kg, com: [0.1, 0, 0], inertia: 0.01}}
  k: {{mass: 2 kg, com: [0.25, 0, 0], inertia: 0.06}}
  r: {{mass: 2 kg, com: [0.2, 0, 0], inertia: 0.03}}
  frame: {{mass: 0}}
joints:
  W: {{type: fixed, parent: ground, child: frame, at: {{parent: {{position: [0, 0, 0], rpy: {rpy}}}}}}}
  A: {{type: revolute, parent: frame, child: c, axis: z, coordinate: q1}}
  B: {{type: revolute, parent: c, child: k, at: [0.2, 0, 0], axis: z, coordinate: q2}}
  D: {{type: revolute, parent: frame, child: r, at: [0.55, 0, 0], axis: z, coordinate: q3}}
closures:
  C: {{type: {kind}, between: [k, r], at: [[0.5, 0, 0], [0.4, 0, 0]], axis: z}}
initial: {{q1: 0.3, der(q1): 2, guess: {{q2: 0.6, q3: 2.0}}}}
"""
REPEATED = [("revolute", x) for x in ("revolute", "cylindrical")] + [
    ("prismatic", x) for x in ("prismatic", "cylindrical")
]


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("joint, closure", REPEATED)
def test_a_joint_said_twice_ties_nothing(joint: str, closure: str, axis: str) -> None:
    """1e-17 was counted as a constraint: a door on two hinges had no freedom left."""
    s = system(load_text(DOOR.format(joint=joint, closure=closure, axis=axis)))
    assert survey_of(s).rank == 0
    start = initial_state(s)
    assert start.v.tolist() == [1.0, 0.0]


def test_rows_that_hold_with_some_parameters_alone_are_none_of_them() -> None:
    """A hinge that may be set off its line: where it is on it, x and z repeat and say nothing."""
    text = DOOR.format(joint="revolute", closure="revolute", axis="[0, 0, 1]")
    offset = text.replace("bodies:", "parameters: {e: 0 m}\nbodies:")
    off_line = offset.replace("[[0.2, 0.1, 0.3], [0, 0, 0]]", "[[0.2 + e, 0.1, 0.3], [e, 0, 0]]")
    s = system(load_text(off_line))
    assert not system(load_text(text)).A.nnz() and s.A.nnz() == 2
    A = ca.Function("A", [s.t, s.q, s.p], [s.A])
    assert np.abs(A(0, [0.3, 0], [0]).full()).max() == 0.0
    assert np.abs(A(0, [0.3, 0], [0.1]).full()).max() > 0.02


@pytest.mark.parametrize("axis", AXES)
def test_a_nut_on_its_spindle_is_one_row(axis: str) -> None:
    s = system(load_text(SPINDLE.format(axis=axis)))
    assert survey_of(s).rank == 1


@pytest.mark.parametrize("kind", ["revolute", "cylindrical"])
def test_a_four_bar_moves_alike_however_it_is_turned(kind: str) -> None:
    """`project` divided by the size of rows that are nothing, and did not converge."""
    motions = []
    for rpy in ("[0, 0, 0]", "[0.3, 0.4, 0.5]", "[0.7, -0.2, 1.1]", "[1.2, 0.9, -0.3]"):
        s = system(load_text(TILTED.format(rpy=rpy, kind=kind)))
        of, start = evaluator(equations(s)), initial_state(s)
        given = np.zeros(0), np.array(of.equations.parameters)
        x = of("state", 0.0, np.r_[start.q, start.v], *given)
        moved = of.iterated("project", 0.0, x + 1e-3 * np.r_[1, -1, 1, 0], *given)
        assert float(of.residuals["project"](0.0, moved, *given)) < 1e-12
        motions.append([*of("dynamics", 0.0, x, *given), *moved])
    assert np.abs(np.array(motions) - motions[0]).max() < 1e-11


def test_a_linkage_may_stand_far_from_the_ground_s_origin() -> None:
    """Its gap is the difference of places kilometres away, and is known to their last digits."""
    text = TILTED.format(rpy="[0.3, 0.4, 0.5]", kind="revolute")
    s = system(load_text(text.replace("position: [0, 0, 0]", "position: [2000, -5000, 1000]")))
    seen = evidence(reference(s.model), equations(s), None, 4)
    assert [check.name for check in results(seen, QUICK) if not check.passed] == []


def test_rounding_is_told_from_what_is_small() -> None:
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    places = [np.random.default_rng(0).uniform(-1, 1, (4, 1)) for _ in "xp"]
    column = ca.vertcat(
        ca.sin(x) ** 2 + ca.cos(x) ** 2 - 1,
        0.6 * (0.8 * x) - 0.8 * (0.6 * x),
        4.6e-17 * x,
        1e-12 * x,
        x * p - p * (x + 1e-12),
        ca.fabs(x) - ca.fabs(x),
        ca.atan(x) * 1e-17,
    )
    # of what is no sum of products nothing is told
    assert vanishing(column, [x, p], places).tolist() == [*[True] * 3, False, False, True, False]
