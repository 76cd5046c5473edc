"""Modes of eigenvalues that are the same, and linear equations exactly on a kink.

Of derive.linearize: sensitivity. Of hamel.verbs: linearize.
"""

from pathlib import Path

import pytest

import hamel

TWINS = """
model: twins
plane: xy
bodies: {A: {mass: 1 kg}, B: {mass: 1 kg}}
joints:
  j1:
    {type: prismatic, axis: x, parent: ground, child: A, coordinate: x1,
     spring: {stiffness: 100 N/m}, damper: 1 N*s/m}
  j2:
    {type: prismatic, axis: x, parent: ground, child: B, coordinate: x2,
     spring: {stiffness: 100 N/m}, damper: 1 N*s/m}
"""
STOP = """
model: stop
bodies: {b: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: x}}
inputs: {u: {joint: j}}
loads:
  s: {type: spring, joint: j, stiffness: 10 N/m}
  hit: {type: expression, joint: j, expression: "FORCE"}
steady_motion: {at: {x: PLACE, der(x): 0, u: free}}
"""


def test_modes_of_one_eigenvalue_are_independent(tmp_path: Path) -> None:
    file = tmp_path / "twins.yaml"
    file.write_text(TWINS, encoding="utf-8")
    modes = hamel.linearize(file, at="guess").modes
    assert sorted(mode.shape for mode in modes) == ["x1 1", "x2 1"]


@pytest.mark.parametrize(
    ("force", "place", "warns"),
    [
        ("-(100 N/m)*max(0 m, x - 0.2 m)", "0.2 m", True),
        ("-(100 N/m)*max(0 m, x - 0.2 m)", "0.2001 m", False),
        ("-(100 N/m)*max(0 m, x - 0.2 m)", "0.1 m", False),
        ("-(2 N)*sign(der(x))", "0 m", True),
        ("-(3 N*s^2/m^2)*abs(der(x))*der(x)", "0 m", False),  # smooth, though |v| is not
        ("-(3 N/m^2)*max(0 m, x - 0.2 m)^2", "0.2 m", False),
    ],
)
def test_a_kink_is_told(force: str, place: str, warns: bool, tmp_path: Path, recwarn) -> None:
    file = tmp_path / "stop.yaml"
    file.write_text(STOP.replace("PLACE", place).replace("FORCE", force), encoding="utf-8")
    hamel.linearize(file, at="at")
    assert any("jumps or bends exactly here" in str(x.message) for x in recwarn) == warns
