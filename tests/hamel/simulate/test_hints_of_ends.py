"""What a motion that could not go on is told to try.

Of hamel.simulate: motion, method, limits.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.diagnostics import AssumptionError
from tests.scenes import RACER

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
# Laid flat all its bars are parallel, and it may fold.
PARALLEL = """
model: par
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m}
bodies:
  a: {mass: 1 kg, com: [l/2, 0], inertia: 0.02}
  b: {mass: 1 kg, com: [l, 0], inertia: 0.05}
  c: {mass: 1 kg, com: [l/2, 0], inertia: 0.02}
joints:
  A: {type: revolute, parent: ground, child: a, coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [l, 0], coordinate: q2}
  C: {type: revolute, parent: ground, child: c, at: [2*l, 0], coordinate: q3}
closures: {K: {type: revolute, between: [b, c], at: [[2*l, 0], [l, 0]]}}
initial: {q1: 60 deg, q2: -60 deg, q3: 60 deg, der(q1): 0.01 rad/s}
"""


def hint_of(text: str, folder: Path, **options: object) -> str:
    path = folder / "model.yaml"
    path.write_text(text)
    with pytest.raises(AssumptionError) as caught:
        hamel.simulate(path, **options)  # type: ignore[arg-type]
    return caught.value.diagnostics[0].hint


@pytest.mark.slow
@pytest.mark.parametrize("way", [{}, {"formulation": "augmented", "enforcement": "partitioning"}])
def test_where_branches_meet_no_choice_is_advised(way: dict[str, str], tmp_path: Path) -> None:
    hint = hint_of(PARALLEL, tmp_path, time=2.0, **way)
    assert "branches of the motion meet: no choice of quasi-velocities is regular" in hint
    assert "may be regular" not in hint


@pytest.mark.slow
def test_where_coordinates_are_singular_no_choice_is_advised(tmp_path: Path) -> None:
    """The constraints are independent, and the formulation makes no choice."""
    way = {"formulation": "augmented", "enforcement": "selective", "rtol": 1e-6}
    hint = hint_of(RACER, tmp_path, time=3.0, values={"a": np.radians(60.0)}, **way)
    assert "branches" not in hint and "quasi-velocities" not in hint


@pytest.mark.slow
def test_a_tolerance_beyond_rounding_is_noted(tmp_path: Path) -> None:
    """It was raised without a word."""
    path = tmp_path / "model.yaml"
    path.write_text(RACER)
    with pytest.warns(RuntimeWarning, match="1e-17 is finer than float64 can hold: 1e-15 is used"):
        hamel.simulate(path, time=0.1, step=0.1, rtol=1e-17)


STUCK = """
model: stuck_by_a_sign
plane: xy
parameters: {m: 2 kg, k: 50 N/m, F: 3 N}
bodies: {b: {mass: m}}
joints: {r: {type: prismatic, parent: ground, child: b, axis: x, coordinate: x}}
loads:
  s: {type: spring, joint: r, stiffness: k}
  f: {type: expression, joint: r, expression: -F*sign(der(x))}
initial: {x: 1 m}
"""


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["dop853", "verner9", "radau", "rosenbrock"])
def test_dry_friction_that_sticks_ends_with_the_formula_that_jumps(
    integrator: str, tmp_path: Path
) -> None:
    """It went on, by steps of 1e-11 s, for the rest of the 8 s."""
    (tmp_path / "model.yaml").write_text(STUCK)
    with pytest.raises(AssumptionError) as caught:
        hamel.simulate(tmp_path / "model.yaml", time=8.0, integrator=integrator)
    found = caught.value.diagnostics[0]
    assert found.line == 9 and "dry friction by sign" in found.message
    assert "sign() in 'f'" in found.message and "tanh(v/eps)" in found.expected


@pytest.mark.slow
def test_an_event_without_end_is_named(tmp_path: Path) -> None:
    """The rate is zero where the mass sticks; no load is without a value."""
    text = STUCK.replace("stuck_by_a_sign", "stuck_with_an_event")
    (tmp_path / "model.yaml").write_text(f"{text}events: {{rest: der(x), far: x - 5 m}}\n")
    with pytest.raises(AssumptionError, match="'rest' happened 100") as caught:
        hamel.simulate(tmp_path / "model.yaml", time=8.0)
    hint = caught.value.diagnostics[0].hint
    assert "leaves zero again" in hint and "where sign() in 'f' holds the motion" in hint
    assert "no value" not in hint
