"""Which of several steady motions is found: one near the guess, and what is said where it is far.

Of derive.linearize: balance.
"""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

import hamel
from hamel.verbs import linearize as verb

# A light body at the end of two heavy links, turned by a spring: what is not balanced gives it some
# 500 rad/s², and rates of speeds bend at once where links turn.
HANGING = """
model: hanging
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  cart: {mass: 2 kg}
  a: {mass: 1 kg, com: [0, -0.2], inertia: 0.0133}
  b: {mass: 1 kg, com: [0, -0.2], inertia: 0.0133}
  weight: {mass: 0.5 kg}
joints:
  rail: {type: prismatic, parent: ground, child: cart, axis: [-3, 4], coordinate: s, spring: {stiffness: 40}}
  A: {type: revolute, parent: cart, child: a, at: [0, -0.1], coordinate: qa}
  B: {type: revolute, parent: a, child: b, at: [0, -0.4], coordinate: qb}
  H: {type: planar, parent: ground, child: weight, coordinates: [hx, hy, ht]}
closures: {tip: {type: revolute, between: [b, weight], at: [[0, -0.4], [0.05, 0]]}}
loads: {twist: {type: spring, coordinate: ht, stiffness: 3, rest: 0.2}}
initial: {qa: 0.1, guess: {hy: -1 m}}
"""
MOTIONS = {
    "rest": "{rest: {}}",
    "guess": "",
    "angle": "{guessed: {guess: {qa: 0.1}}}",
    "below": "{guessed: {guess: {hy: -1 m}}}",
    "sunk": "{guessed: {guess: {s: -0.8 m}}}",
    "rates": "{still: {guess: {qa: 0.1}, der(s): 0, der(qa): 0, der(qb): 0, H.w: 0}}",
}
# 75° from where it hangs.
PENDULUM = """
model: pendulum
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {a: {mass: 1 kg, com: [0, -1 m], inertia: 0.1}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q}}
initial: {q: START deg}
"""


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_equilibrium_near_by_is_found(motion: str, tmp_path: Path) -> None:
    """Links were turned over, or none was found: along rates Newton's first step turned them by a
    radian."""
    file = tmp_path / "hanging.yaml"
    steady = f"steady_motion: {MOTIONS[motion]}\n" if MOTIONS[motion] else ""
    file.write_text(HANGING + steady)
    record = hamel.linearize(file, out=tmp_path)
    assert record.steady["qa"] == pytest.approx(0.0, abs=1e-9)
    assert record.steady["qb"] == pytest.approx(0.0, abs=1e-9)
    # 40 N/m · s = −0.8 · 4.5 kg · g along the rail, the weights of all below it
    assert record.steady["s"] == pytest.approx(-0.8 * 4.5 * 9.81 / 40, abs=1e-9)
    assert not record.strayed


@pytest.mark.parametrize(("start", "far"), [(30, False), (75, True)])
def test_a_motion_far_from_the_guess_is_told(start: int, far: bool, tmp_path: Path) -> None:
    file = tmp_path / "pendulum.yaml"
    file.write_text(PENDULUM.replace("START", str(start)))
    record = hamel.linearize(file, out=tmp_path)
    out = StringIO()
    verb.show(record, Console(file=out, width=300))
    assert record.steady["q"] == pytest.approx(0.0, abs=1e-9)
    assert ("far from the guess: q 1.309 → " in out.getvalue()) == far
