"""Reactions in the formulas of outputs: friction that is needed, and where contact is lost.

Of derive.mechanics: outputs. Of derive.textbook: outputs.
"""

from __future__ import annotations

import re

import numpy as np

import hamel
from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states
from derive.textbook.derivation import derivation
from tests.agreement import disagreement
from tests.evaluation import arguments, functions

HILL = """
model: hill
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {R: 2 m, m: 3 kg}
bodies: {ball: {mass: m}}
joints: {centre: {type: point, parent: ground, child: ball, coordinates: [x, y]}}
constraints: {hill: {holonomic: sqrt(x^2 + y^2) - R}}
outputs:
  normal: reaction.hill
  share: "abs(reaction.hill)/(m*(9.81 m/s^2)) + y/R"
events: {lift: {formula: normal, direction: falling, stop: true}}
initial: {x: 1 mm, guess: {y: 2 m}}
"""
WHEEL = """
model: wheel
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {r: 0.3 m, mu: 0.5}
bodies:
  frame: {mass: 8 kg, com: [0.1, 0.1], inertia: 0.2}
  wheel: {mass: 1 kg, inertia: 0.05}
  caster: {mass: 0.5 kg, inertia: 0.01}
joints:
  base: {type: planar, parent: ground, child: frame, coordinates: [x, y, tilt]}
  axle: {type: revolute, parent: frame, child: wheel, coordinate: turn}
  axle2: {type: revolute, parent: frame, child: caster, at: [1, 0], coordinate: turn2}
constraints:
  front: {type: rolling, body: wheel, shape: {wheel: {radius: r}}, plane: {normal: [0, 1]}}
  rear: {type: rolling, body: caster, shape: {wheel: {radius: r}}, plane: {normal: [0, 1]}}
inputs: {drive: {joint: axle}}
outputs:
  need: reaction.front.forward/(mu*reaction.front.normal)
  both: reaction.front.normal + reaction.rear.normal
events: {slips: need - 1}
initial: {guess: {y: 0.3}}
"""


def test_the_normal_force_of_a_hill_in_closed_form() -> None:
    """N = m (g y/R − v²/R), outwards."""
    found = system(load_text(HILL))
    e, sampled = equations(found), states(found, 20, seed=4)
    f = functions(e)
    for given, q, v in zip(arguments(f, sampled), sampled.q, sampled.v):
        R, m = given[3]
        wanted = m * (9.81 * q[1] - v @ v) / R
        got = f["outputs"](*given).full().ravel()
        np.testing.assert_allclose(got[0], wanted, rtol=1e-10)
        np.testing.assert_allclose(got[1], abs(wanted) / (m * 9.81) + q[1] / R, rtol=1e-10)
        np.testing.assert_allclose(f["events"](*given), wanted, rtol=1e-10)


def test_outputs_and_events_agree_with_the_reference() -> None:
    for text in (HILL, WHEEL):
        apart = disagreement(text)
        assert max(apart.values()) < 1e-9, apart


def test_a_ball_leaves_the_hill_at_two_thirds_of_its_height(tmp_path) -> None:
    (tmp_path / "hill.yaml").write_text(HILL)
    record = hamel.simulate(tmp_path / "hill.yaml", time=10.0, rtol=1e-10)
    assert record.stopped_by == "lift"
    start = np.sqrt(4.0 - 1e-6)
    assert abs(record.final["y"] - 2.0 / 3.0 * start) < 1e-8


def test_pages_print_the_formulas_and_say_what_their_multipliers_are() -> None:
    document = derivation(equations(system(load_text(WHEEL))), ["block_inversion"])
    assert {"output need", "output both"} <= {x.name for x in document.printed}
    told = re.findall(r"multiplier of .*?(front\.\w+|rear\.\w+)", str(document))
    assert {"front.normal", "front.forward", "rear.normal"} <= set(told)
