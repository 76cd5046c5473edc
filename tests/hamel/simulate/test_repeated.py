"""Rows that repeat others with the values of the file, and not with other ones: no motion lets them
break.

Of hamel.simulate: compiled.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hamel
from codegen.loader import part
from derive.choices.redundancy import check_repeated
from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError
from derive.model import load_text
from derive.states import system
from tests.loops import IN_SPACE

# Bennett's linkage: sin al/a = sin be/b, else it closes at single positions alone.
BENNETT = """
model: bennett
gravity: [1, 2, -9.81 m/s^2]
parameters: {a: 0.3 m, b: 0.5 m, al: 30 deg, be: 56.44269023807929 deg}
bodies:
  b1: {mass: 1 kg, com: [a/2, 0, 0.01], inertia: [0.001, 0.01, 0.01]}
  b2: {mass: 2 kg, com: [b/2, 0.02, 0], inertia: [0.002, 0.04, 0.04]}
  b3: {mass: 1.5 kg, com: [a/2, 0, 0], inertia: [0.001, 0.01, 0.01]}
joints:
  A: {type: revolute, parent: ground, child: b1, axis: z, coordinate: q1}
  B: {type: revolute, parent: b1, child: b2, at: {parent: {position: [a, 0, 0], rpy: [al, 0, 0]}}, axis: z, coordinate: q2}
  C: {type: revolute, parent: b2, child: b3, at: {parent: {position: [b, 0, 0], rpy: [be, 0, 0]}}, axis: z, coordinate: q3}
closures:
  D:
    type: revolute
    between: [b3, ground]
    at: [{position: [a, 0, 0], rpy: [al, 0, 0]}, {position: [-b, 0, 0], rpy: [-be, 0, 0]}]
    axis: z
initial: {q1: 50 deg, der(q1): 2 rad/s, guess: {q2: 300 deg, q3: 50 deg}}
"""


@pytest.fixture
def bennett(tmp_path: Path) -> Path:
    file = tmp_path / "bennett.yaml"
    file.write_text(BENNETT)
    return file


def test_a_loop_that_does_not_close_with_other_values_does_not_move(bennett: Path) -> None:
    """It went on with what was left of it, 24 mm open."""
    with pytest.raises(
        AssumptionError, match=r"the rank of the constraints is 3, not 2"
    ) as refused:
        hamel.simulate(bennett, time=0.1, values={"be": "60 deg"})
    assert "0 speeds are free, not 1" in str(refused.value)


def test_a_loop_that_closes_with_other_values_moves(bennett: Path) -> None:
    twice = hamel.simulate(bennett, time=0.1, values={"a": "0.6 m", "b": "1 m"})
    assert twice.position_violation < 1e-12


def test_rows_that_say_nothing_are_none_that_have_ceased_to_repeat() -> None:
    """What rounding leaves of them is as long as any other row where each is made one long."""
    found = survey_of(system(load_text(IN_SPACE)))
    A = found.plain_rows[0]
    check_repeated(found.system, A + 1e-17, found.kept)
    A[2] = 1.0
    with pytest.raises(AssumptionError, match=r"row 3 of closure C \(C.z\) repeats other rows"):
        check_repeated(found.system, A, found.kept)


def test_the_module_says_that_dropped_rows_are_missed(bennett: Path, tmp_path: Path) -> None:
    """They were 5 mm off, with success."""
    hamel.build(bennett, out=tmp_path / "bennett")
    module = hamel.load(tmp_path / "bennett")
    p = np.array(module.defaults)
    assert module.project(0.0, module.initial, None, p) == pytest.approx(module.initial, abs=1e-11)
    p[list(module.parameters).index("be")] = np.radians(60)
    for project in (module.project, part(module, "_numpy").project):
        with pytest.raises(FloatingPointError, match="not converged"):
            project(0.0, module.initial, None, p)
    with pytest.raises(Exception, match="could not be projected"):
        module.simulate((0.0, 0.1), module.initial, None, p)
