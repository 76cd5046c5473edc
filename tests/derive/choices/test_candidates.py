"""Sets of generalized velocities that are looked at first can be carried through.

Of derive.choices: candidates, ranking.
"""

from __future__ import annotations

import casadi as ca

from derive.choices.candidates import candidates
from derive.choices.resolution import ranked_partitions
from derive.choices.survey import survey_of
from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from tests.mechanisms import mechanism

# a bar between two bodies, and two more that it says nothing of
TREE = [("ball", 0), ("free", 1), ("free", 5), ("revolute", 0)]


def test_sets_that_are_singular_everywhere_come_last() -> None:
    """They lose no inertia, for there is no state where they could; they took all places, and the
    model was refused."""
    mechanics = system(mechanism(TREE, (), [("distance", (0, 2))], seed=7))
    survey = survey_of(mechanics)
    found = sorted(candidates(survey), key=lambda x: x[0])
    assert found[-1][0][0] and not found[0][0][0]
    assert not any(order[0] for order, _, _ in found[:3])
    assert equations(mechanics).w


ON_ROD = """
model: on_rod
gravity: [0, 0, -9.81 m/s^2]
bodies: {a: {mass: 1 kg, inertia: [0.1, 0.2, 0.15]}}
joints: {A: {type: free, parent: ground, child: a}}
constraints: {C: {type: distance, between: [ground, a], at: [[0, 0, 0], [0.2, 0, 0]], length: 1 m}}
initial: {A_x: 0.8 m, A_y: 0, A_z: 0}
"""


def _square() -> str:
    """Four free bodies at the corners of a square, with rods between."""
    corners = {"a": (0, 0), "b": (1, 0), "c": (1, 1), "d": (0, 1)}
    body = "{mass: 0.1 kg, com: [0.01, 0, 0.02], inertia: [0.001, 0.001, 0.0015]}"
    rod = "type: distance, at: [[0, 0, 0], [0, 0, 0]], length: 1 m"
    lines = ["model: square", "gravity: [0, 0, -9.81 m/s^2]", "bodies:"]
    lines += [f"  {x}: {body}" for x in corners]
    lines += ["joints:"]
    lines += [f"  J{x}: {{type: free, parent: ground, child: {x}}}" for x in corners]
    lines += ["constraints:"]
    lines += [f"  R{x}{y}: {{{rod}, between: [{x}, {y}]}}" for x, y in zip("abcd", "bcda")]
    lines += ["initial:"]
    lines += [f"  J{x}_x: {i} m\n  J{x}_y: {j} m" for x, (i, j) in corners.items()]
    return "\n".join(lines) + "\n"


def test_what_is_singular_where_the_motion_begins_comes_last() -> None:
    """The start is no random state, and no sampled one: of a body on a rod that lies along x there,
    velocities across it were taken to follow from the others, with pivots of zero at the start."""
    found = ranked_partitions(survey_of(system(load_text(ON_ROD))))
    singular = [x.ranking.singular_at_start for x in found]
    assert singular == sorted(singular)
    assert not singular[0] and singular[-1]


def test_where_all_that_is_greedy_is_singular_at_the_start_that_counts_too() -> None:
    """Four free bodies in a square of rods: of 24 velocities not every set is tried."""
    survey = survey_of(system(load_text(_square())))
    best = min(candidates(survey), key=lambda x: x[0])
    B = ca.SX(len(best[2]), survey.system.v.numel())
    for k, row in enumerate(best[2]):
        for j, x in row.coefficients:
            B[k, j] = x
    assert not survey.is_singular_at_start(B)
