"""A start at which the constraints themselves lose rank: no choice of quasi-velocities is regular.

Of hamel.simulate: compiled, motion.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hamel
from derive.diagnostics import AssumptionError

PARALLELOGRAM = """
model: bars
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.3 m, w: 0.5 m}
bodies:
  c1: {mass: 1 kg, com: [0, -l/2], inertia: 0.01}
  c2: {mass: 1 kg, com: [0, -l/2], inertia: 0.01}
  bar: {mass: 2 kg, com: [w/2, 0], inertia: 0.02}
joints:
  A: {type: revolute, parent: ground, child: c1, coordinate: a}
  B: {type: revolute, parent: ground, child: c2, at: [w, 0], coordinate: b}
  C: {type: revolute, parent: c1, child: bar, at: [0, -l], coordinate: c}
closures:
  K: {type: revolute, between: [bar, c2], at: [[w, 0], [0, -l]]}
initial: {a: 20 deg, der(a): 1 rad/s, guess: {b: 20 deg, c: -20 deg}}
"""
EXACT = PARALLELOGRAM.replace("20", "90")  # the guesses are the stretched position itself


@pytest.mark.parametrize(
    ("text", "values"),
    [(PARALLELOGRAM, {"a": "90 deg"}), pytest.param(EXACT, {}, marks=pytest.mark.slow)],
    ids=["found", "given"],
)
def test_a_stretched_parallelogram_may_go_on_in_two_ways(
    text: str, values: dict[str, float | str], tmp_path: Path
) -> None:
    """Another choice was advised, or a force without a value suspected: the position is found to
    half the digits, and rows of rounding were made one long."""
    file = tmp_path / "bars.yaml"
    file.write_text(text)
    with pytest.raises(AssumptionError, match=r"at the start, row 1 of closure K") as refused:
        hamel.simulate(file, time=0.1, values=values)
    assert "more than one way, in any choice" in str(refused.value)
