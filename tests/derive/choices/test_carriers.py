"""A free body that rolls, walked in a frame that does not spin with its wheel, against the
reference in numbers.

Of derive.mechanics: carriers.
Of derive.choices: resolution, reduction.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from derive.choices import resolution
from derive.choices.named import carried_through, declared
from derive.choices.reduction import Reduction, Task, Way, by_elimination
from derive.choices.resolution import speed_rows
from derive.choices.survey import survey_of
from derive.expressions.deferred import changed
from derive.formulations import equations
from derive.mechanics.records import Spinless, System
from derive.model import load, load_text
from derive.states import system
from derive.states.sampling import States, states
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

MODELS = Path(__file__).parents[3] / "models"
SEQUENCES = ("zxy", "zyx", "zxz", "zyz", "xyz", "yxz", "xzx", "yzy", "xyx", "yxy", "xzy", "yzx")
ALONE = """
model: alone
gravity: [0, 0, -9.81]
parameters: {{m: 2 kg, r: 0.35 m, J: 0.1 kg*m^2, K: 0.2 kg*m^2}}
bodies: {{wheel: {{mass: m, inertia: [{inertia}]}}}}
joints:
  base: {{type: free, parent: ground, child: wheel, position: [x, y, z],
          orientation: {{euler: {sequence}, angles: [a, b, c]}}}}
constraints:
  contact: {{type: rolling, body: wheel, shape: {{{shape}, axis: {axis}}}}}, plane: {{normal: z}}}}
quasi_velocities: {{body: [base.wx, base.wy, base.wz]}}
initial: {{a: 0.3 rad, b: 0.4 rad, c: 0.2 rad, guess: {{z: 0.3 m}}}}
"""
# a wheel away from the body's origin, one steered, and a body that is no wheel on a plane that tilts
UNICYCLE = """
model: unicycle
gravity: [0, 0, -9.81]
parameters: {d: 0.2 m, h: 0.4 m, r: 0.3 m, m: 5 kg}
bodies:
  body: {mass: m, com: [0.1, 0.05, h], inertia: [0.4, 0.5, 0.3, 0.02, -0.03, 0.01]}
  wheel: {mass: 1 kg, inertia: [0.05, 0.1, 0.05]}
  arm: {mass: 1 kg, com: [0.2, 0, 0.1], inertia: [0.01, 0.02, 0.03]}
joints:
  base: {type: free, parent: ground, child: body, position: [x, y, z],
         orientation: {euler: zxy, angles: [yaw, lean, pitch]}}
  axle: {type: revolute, parent: body, child: wheel, at: [d, 0, -h], axis: y, coordinate: spin}
  elbow: {type: revolute, parent: body, child: arm, at: [0, 0, 0.5], axis: [0.6, 0, 0.8], coordinate: turn}
constraints:
  contact: {type: rolling, body: wheel, shape: {torus: {radius: r, tube: 0.05, axis: y}}, plane: {normal: z}}
inputs: {drive: {joint: axle}}
loads: {drag: {type: damper, coordinate: turn, coefficient: 0.3}}
quasi_velocities:
  rates: [der(lean), der(pitch), der(spin), der(turn), der(yaw)]
  best: auto
initial: {x: 0 m, lean: 0.1 rad, pitch: 0.2 rad, guess: {z: 0.7 m}}
"""
SHAPES = {"disk": "disk: {radius: r", "torus": "torus: {radius: r, tube: 0.1"}


def alone(sequence: str, shape: str = "disk") -> str:
    axis = sequence[2]
    inertia = ", ".join("K" if letter == axis else "J" for letter in "xyz")
    return ALONE.format(sequence=sequence, shape=SHAPES[shape], axis=axis, inertia=inertia)


def reduction_of(mechanics: System, choice: str | None = None) -> Reduction:
    return carried_through(survey_of(mechanics), declared(mechanics, choice)).reduction


def preferred(monkeypatch: pytest.MonkeyPatch) -> None:
    """The further frame also where it does not pay."""
    monkeypatch.setattr(resolution, "_risk", lambda reduction: (reduction.tree is None, 0))


def failed(mechanics: System, choice: str | None = None) -> list[str]:
    seen = evidence(reference(mechanics.model), equations(mechanics, choice), None, 6)
    return [check.name for check in results(seen, QUICK) if not check.passed]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("sequence", SEQUENCES)
def test_every_sequence_of_angles_rolls_as_the_reference_does(
    sequence: str, shape: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    preferred(monkeypatch)
    mechanics = system(load_text(alone(sequence, shape)))
    assert reduction_of(mechanics).tree is not None
    assert failed(mechanics) == []


@pytest.mark.parametrize("tilted", [False, True])
@pytest.mark.parametrize("choice", ["rates", "best"])
@pytest.mark.parametrize("constants", ["all", ()])
def test_a_wheel_away_from_the_origin_of_a_body_with_an_arm(
    constants: str | tuple[str, ...], choice: str, tilted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The body in its own axes, and in those of the arm's joint."""
    preferred(monkeypatch)
    mechanics = system(load_text(UNICYCLE), constants)
    assert len(mechanics.carried) == 2
    mechanics = changed(mechanics, carried=(mechanics.carried[tilted],))
    assert reduction_of(mechanics, choice).tree is not None
    assert failed(mechanics, choice) == []


def test_a_frame_that_does_not_turn_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Spinless, "rate", lambda own, beside: 0.0 * beside)
    assert failed(system(load_text(UNICYCLE))) != []


def test_a_spin_that_is_not_relative_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Spinless, "relative", lambda own, v: list(v))
    assert failed(system(load_text(UNICYCLE))) != []


@pytest.mark.parametrize("name", ["bicycle", "waveboard", "rolling_torus"])
def test_all_ways_of_writing_a_contact_say_the_same(name: str) -> None:
    """v and σ come out alike, whichever rows and pivots they were found with."""
    mechanics = system(load(str(MODELS / f"{name}.yaml")))
    survey = survey_of(mechanics)
    rows = speed_rows(mechanics, declared(mechanics, None))
    B = reduction_of(mechanics).B
    task = Task(tuple(x.name for x in rows), B, survey.kept, survey.sampled, [1.0] * B.size2())
    assert len(survey.forms) == 3 ** len(mechanics.blocks)
    found = [by_elimination(task, Way(mechanics, way, rows)) for way in survey.forms]
    w, at = np.random.default_rng(0).normal(size=len(rows)), states(mechanics, 1, seed=3)
    values = [_motion(mechanics, x, at, w) for x in found]
    for other in values[1:]:
        np.testing.assert_allclose(other, values[0], rtol=1e-8, atol=1e-8)


def _motion(mechanics: System, x: Reduction, at: States, w: np.ndarray) -> np.ndarray:
    s = mechanics
    function = ca.Function("x", [s.t, s.q, x.w, s.p], [ca.vertcat(x.v, x.sigma)])
    return function(at.t[0], at.q[0], w, at.p[0]).full().ravel()


def test_a_body_without_such_a_wheel_has_no_further_frame() -> None:
    assert system(load(str(MODELS / "waveboard.yaml"))).carried == ()
