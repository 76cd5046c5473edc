"""Modes of eigenvalues that are the same, and linear equations exactly on a kink.

Of derive.linearize: sensitivity, kinks.
Of derive.expressions: beside.
Of hamel.verbs: linearize.
"""

import re
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
    told = re.compile("a force (bends|jumps) exactly here")
    assert any(told.search(str(x.message)) for x in recwarn) == warns


TWO = """
model: two
plane: xy
parameters: {k: 100 N/m}
bodies: {a: {mass: 1 kg}, b: {mass: 2 kg}}
joints:
  A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: x}
  B: {type: prismatic, parent: ground, child: b, axis: x, coordinate: y}
constraints: {gear: {holonomic: x + y}}
loads:
  LOADS
steady_motion: {rest: {der(x): 0}}
"""


def on(*formulas: str) -> str:
    """Loads on a, one for each formula."""
    return "\n  ".join(
        f'l{k}: {{type: expression, coordinate: x, expression: "{formula}"}}'
        for k, formula in enumerate(formulas)
    )


@pytest.mark.parametrize(
    ("loads", "stiffness", "warns"),  # of both sides, or their mean
    [
        (on("-k*ramp(x)", "k*ramp(-x)"), 1.0, None),
        (on("-k*ramp(x)", "k*ramp(y)"), 1.0, None),  # one kink by the names of two coordinates
        (on("-k*clip(x, 0 m, 1 m) - k*clip(x, -1 m, 0 m)"), 1.0, None),
        (on("-k*x*step(x) - k*x*step(-x)"), 1.0, None),
        (on("-k*max(x, 0 m) - k*min(x, 0 m)"), 1.0, None),
        (on("-k*x/2*(1 + sign(x)^2)"), 1.0, None),
        (on("-k*ramp(x) + 3*k*ramp(-x)"), 2.0, "bends exactly here: slopes are the mean"),
        (on("-k*x + 0.5*k*abs(x)"), 1.0, "bends exactly here"),
        (on("-k*x - (1 N)*sign(x)"), 1.0, "jumps exactly here"),
        (on("-k*x - k*x*ramp(x)/(1 m)"), 1.0, None),  # its slope has the kink, it has not
        (on("-k*x - k*max(x, 0 m)^1.5/sqrt(1 m)"), 1.0, None),
    ],
)
def test_the_slope_at_a_kink_is_that_of_both_sides(
    loads: str, stiffness: float, warns: str | None, tmp_path: Path, recwarn
) -> None:
    """All terms take the same side at once, also where constraints tie their coordinates; the
    unreduced form, which differentiates M v̇ + h = Q + Aᵀλ, agrees."""
    file = tmp_path / "two.yaml"
    file.write_text(TWO.replace("LOADS", loads), encoding="utf-8")
    result = hamel.linearize(file, at="rest")
    squares = [complex(*mode.eigenvalue) ** 2 for mode in result.modes]
    assert squares == pytest.approx([-stiffness * 100 / 3], rel=1e-9)
    said = [str(x.message) for x in recwarn]
    assert any(warns in message for message in said) if warns else not said
    assert result.unreduced is not None
    assert result.unreduced.difference < 1e-9


def test_two_contacts_that_just_touch_are_a_kink_each(tmp_path: Path) -> None:
    """Independent kinks: half of each stiffness, whatever the other side is called."""
    loads = on("-k*ramp(x)", "-k*ramp(x - (1e-3)*y^2/(1 m))")
    file = tmp_path / "two.yaml"
    file.write_text(TWO.replace("LOADS", loads), encoding="utf-8")
    with pytest.warns(RuntimeWarning, match="bends exactly here"):
        result = hamel.linearize(file, at="rest")
    (mode,) = result.modes
    assert complex(*mode.eigenvalue) ** 2 == pytest.approx(-100 / 3, rel=1e-9)
