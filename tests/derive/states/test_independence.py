"""Rows that are kept where others repeat them are independent wherever all rows have full rank.

Of derive.states: axes, independence.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.choices.survey import Survey, survey_of
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load
from derive.states import system
from derive.states.independence import independent, share
from derive.states.limits import POOR
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

FINDINGS = Path(__file__).resolve().parents[2] / "findings"
# at each of three states another two of three rows are independent
ROWS = np.array(
    [[[1, 0], [0, 1], [0, 0]], [[1, 0], [0, 0], [0, 1]], [[0, 0], [1, 0], [0, 1]]], dtype=float
)
TWICE = """model: twice
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  a: {mass: 1, com: [0.3, 0.1], inertia: 0.1}
  b: {mass: 2, com: [0.2, 0], inertia: 0.2}
joints:
  A: {type: revolute, parent: ground, child: a}
  B: {type: revolute, parent: a, child: b, at: [0.4, 0]}
closures:
  C: {type: revolute, between: [a, b], at: [[0.4, 0.3], [0, 0.3]]}
initial: {A: 0.3, guess: {B: 0}}
"""
# rods that turn in bushes, in a mechanism that else moves in a plane; KIND of one is a screw
RODS = """model: rods
gravity: [0, 0, -9.81 m/s^2]
bodies:
  crank: {mass: 1, com: [0.05, 0, 0], inertia: [0.001, 0.002, 0.002]}
  rod: {mass: 1, com: [0.2, 0, 0], inertia: [0.001, 0.02, 0.02]}
  bush: {mass: 0.5, inertia: 0.001}
  rod2: {mass: 1, com: [0.2, 0, 0], inertia: [0.001, 0.02, 0.02]}
  bush2: {mass: 0.5, inertia: 0.001}
joints:
  A: {type: revolute, parent: ground, child: crank, axis: y, coordinate: a}
  B: {type: universal, parent: crank, child: rod, at: [0.1, 0, 0], axis: y, axis2: x, coordinates: [b, turn]}
  B2: {type: universal, parent: crank, child: rod2, at: [0.05, 0, 0], axis: y, axis2: x, coordinates: [b2, turn2]}
  D: {type: revolute, parent: ground, child: bush, at: [0.3, 0, 0], axis: y, coordinate: d}
  D2: {type: revolute, parent: ground, child: bush2, at: [0.25, 0, -0.2], axis: y, coordinate: d2}
closures:
  C: {KIND, between: [rod, bush], at: [[0, 0, 0], [0, 0, 0]], axis: x}
  C2: {type: cylindrical, between: [bush2, rod2], at: [[0, 0, 0], [0, 0, 0]], axis: x}
initial: {a: -60 deg, turn: 40 deg, turn2: 10 deg, der(turn2): 3, der(turn): 5, guess: {b: 40 deg, d: -20 deg}}
"""

# a spool on a rocker and the end of a rod, pinned to each other along the axis that both turn about
SPOOL = """model: spool
gravity: [0, 0, -9.81 m/s^2]
bodies:
  base: {mass: 5, inertia: 1}
  crank: {mass: 1, com: [0.05, 0, 0], inertia: [0.001, 0.002, 0.002]}
  rod: {mass: 1, com: [0.2, 0, 0], inertia: [0.001, 0.02, 0.02]}
  rocker: {mass: 0.5, com: [0.1, 0, 0], inertia: 0.001}
  spool: {mass: 0.5, com: [0.1, 0, 0], inertia: 0.001}
joints:
  F: {type: free, parent: ground, child: base}
  A: {type: revolute, parent: base, child: crank, axis: y, coordinate: a}
  B: {type: universal, parent: crank, child: rod, at: [0.1, 0, 0], axis: y, axis2: x, coordinates: [b, turn]}
  D: {type: revolute, parent: base, child: rocker, at: [0.3, 0, 0], axis: y, coordinate: d}
  E: {type: universal, parent: rocker, child: spool, at: [0, 0, 0.15], axis: y, axis2: x, coordinates: [e, roll]}
closures:
  C: {KIND, between: [rod, spool], at: [[0.25, 0, 0], [0, 0, 0]], axis: x}
initial: {a: 90 deg, turn: 90 deg, guess: {b: 0, d: 0, e: 0}}
"""

# a loop in a plane that a spindle turns at a given rate
GOVERNOR = """model: governor
gravity: [0, 0, -9.81 m/s^2]
parameters: {Om: RATE rad/s}
bodies:
  shaft: {mass: 0, inertia: 0.05}
  ball: {mass: 1}
  arm: {mass: 0.1, inertia: 0.001}
  sleeve: {mass: 3}
joints:
  A: {type: revolute, parent: ground, child: shaft, axis: z, coordinate: phi}
  B: {type: revolute, parent: shaft, child: ball, axis: y, at: [[0, 0, 0], [0, 0, 0.3]], coordinate: u}
  D: {type: prismatic, parent: shaft, child: sleeve, axis: z, coordinate: s}
  E: {type: revolute, parent: ball, child: arm, axis: y, coordinate: w}
closures: {C: {type: revolute, between: [arm, sleeve], at: [[0, 0, -0.3], [0, 0, 0]], axis: y}}
constraints: {spin: {type: prescribed, joint: A, motion: Om*t}}
initial: {u: 0.6, guess: {w: -1.2, s: -0.5}}
"""


def surveyed(tmp_path: Path, text: str) -> Survey:
    (tmp_path / "m.yaml").write_text(text)
    return survey_of(system(load(tmp_path / "m.yaml")))


def whole_share(survey: Survey) -> float:
    s = survey.many
    A = survey.solver.rows(s.t, s.q, s.p)[0]
    return share(A / np.linalg.norm(A, axis=2).max(), survey.kept, range(A.shape[1]))


def failed(mechanics: System) -> list[str]:
    seen = evidence(reference(mechanics.model), equations(mechanics), None, 6)
    return [check.name for check in results(seen, QUICK) if not check.passed]


def turning(count: int) -> np.ndarray:
    """Two rows that say one thing: along axes that turn, each of them says nothing somewhere."""
    angle = np.linspace(0.0, 3.0, count)
    rows = np.zeros((count, 3, 4))
    rows[:, 0, 0], rows[:, 1, 0] = np.cos(angle), np.sin(angle)
    rows[:, 2, 1] = 1.0
    return rows


def test_share_is_the_part_that_is_left_at_the_worst_state() -> None:
    rows = turning(100)
    assert share(rows, (0, 2), (0, 1, 2)) < 0.02
    assert share(rows, (2,), (2,)) == 1.0


def test_share_is_of_the_directions_that_are_told_of() -> None:
    """Where all rows are nearly dependent another way, what a kept row loses shows all the same."""
    rows = turning(20)
    rows[:, 2] *= 0.05
    assert share(rows, (0, 2), (0, 1, 2)) == pytest.approx(np.abs(rows[:, 0, 0]).min())


@pytest.mark.parametrize("rate", [3, 12, 24])
def test_rows_turn_with_a_spindle_at_any_speed(rate: int, tmp_path: Path) -> None:
    """At some, no sampled state was where x of the ground says nothing and the others much."""
    survey = surveyed(tmp_path, GOVERNOR.replace("RATE", str(rate)))
    assert [x.along >= 0 for x in survey.system.model.closures] == [True]
    assert whole_share(survey) > POOR
    assert failed(survey.system) == []


def test_rows_that_came_first_stay_where_they_serve() -> None:
    rows = np.tile(np.eye(3), (5, 1, 1))[:, [0, 0, 1]]
    assert independent(rows, range(3)) == (0, 2)


@pytest.mark.parametrize("before", [(), (0,)])
def test_others_are_kept_where_the_first_fail(before: tuple[int, ...]) -> None:
    """Even where rows that ought to come before others fail themselves."""
    rows = turning(100)
    rows[:, 1, 0] = 1.0
    assert independent(rows, range(3), before) == (1, 2)


def test_points_meet_along_axes_in_which_one_row_repeats_everywhere(tmp_path: Path) -> None:
    """Along the ground's neither row is of use all the way round."""
    survey = surveyed(tmp_path, TWICE)
    assert survey.rank == 1
    assert [x.along for x in survey.system.model.closures] == [0]
    assert whole_share(survey) > POOR
    assert failed(survey.system) == []


@pytest.mark.parametrize(
    "kind", ["type: cylindrical", pytest.param("type: screw, pitch: 0.04", marks=pytest.mark.slow)]
)
def test_rows_do_not_turn_with_a_body_that_spins(kind: str, tmp_path: Path) -> None:
    """Across a rod that turns about its axis no row is of use all the way round."""
    survey = surveyed(tmp_path, RODS.replace("KIND", kind))
    assert survey.rank == (5 if "screw" in kind else 4)
    assert whole_share(survey) > POOR
    assert failed(survey.system) == []


@pytest.mark.parametrize("kind", ["type: revolute", "type: cylindrical", "type: screw, pitch: 0.1"])
@pytest.mark.parametrize("base", ["base", "ground"])
def test_rows_lie_across_axes_of_what_carries_two_bodies_that_spin(
    base: str, kind: str, tmp_path: Path
) -> None:
    """Across either of them no row is of use all the way round."""
    text = SPOOL.replace("KIND", kind).replace("parent: base", f"parent: {base}")
    survey = surveyed(tmp_path, text)
    (closure,) = survey.system.model.closures
    assert closure.along > 1
    assert closure.seen_from == base
    assert whole_share(survey) > POOR
    assert failed(survey.system) == []


def test_reactions_along_the_ground_stay_there(tmp_path: Path) -> None:
    survey = surveyed(tmp_path, TWICE + "outputs: {pin: reaction(C)}\n")
    assert [x.along for x in survey.system.model.closures] == [-1]


def test_a_motion_goes_on_where_the_ground_s_axes_fail() -> None:
    """It made thousands of steps, and stopped."""
    mechanics = system(load(FINDINGS / "rnd21.yaml"))
    assert [x.along for x in mechanics.model.closures] == [0]
    assert whole_share(survey_of(mechanics)) > POOR


@pytest.mark.slow
def test_steps_are_as_long_as_elsewhere() -> None:
    """A hundred where a module of several choices took eight hundred, and one alone stopped."""
    found = hamel.simulate(FINDINGS / "rnd21.yaml", time=1.0, step=0.5, rtol=1e-9)
    assert found.simulation.steps < 200


def test_no_more_rows_are_kept_than_there_are_velocities() -> None:
    assert len(independent(ROWS, range(3))) == 2
