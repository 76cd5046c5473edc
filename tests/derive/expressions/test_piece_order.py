"""What functions in pieces take for granted is looked at where values are known.

Of derive.expressions: piece_order.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import hamel
from derive.diagnostics import ModelError
from derive.model import load_text

SLIDER = """
model: slider
plane: xy
parameters: {lo: LOW m, hi: HIGH m, w: WIDTH m, c: 0.1 m/s}
bodies: {b: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: x}}
loads:
  L: {type: expression, joint: j, expression: "FORMULA"}
  R: {type: friction, joint: j, coulomb: 1 N, smoothing: c}
"""


def text(formula: str, low: float = 1.0, high: float = 2.0, width: float = 0.1) -> str:
    changed = {"LOW": low, "HIGH": high, "WIDTH": width, "FORMULA": formula}
    result = SLIDER
    for word, value in changed.items():
        result = result.replace(word, str(value))
    return result


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("(1 N)*step(x, 0 m)", r"width of step\(\) is 0"),
        ("(1 N)*step(x, -0.1 m)", r"width of step\(\) is -0.1"),
        ("(1 N/m)*ramp(x, lo - 1 m)", r"width of ramp\(\) is 0"),
        ("(1 N/m)*clip(x, lo, hi, 0 m)", r"width of clip\(\) is 0"),
        ("(1 N/m)*clip(x, 2 m, lo)", r"bounds of clip\(\) are 2 and 1"),
        ("piecewise(x, 1 N, hi, 2 N, lo, 3 N)", r"places of piecewise\(\) are 2 and 1"),
        ("piecewise(x, 1 N, lo, 2 N, lo, 3 N)", r"places of piecewise\(\) are 1 and 1"),
    ],
)
def test_widths_bounds_and_places_are_in_order(formula: str, message: str) -> None:
    """A step of width zero was the constant of one side, built and verified; others were refused
    when code and reference took another piece each, without a place in the file."""
    with pytest.raises(ModelError, match=message) as error:
        load_text(text(formula))
    assert ":8:" in str(error.value) and "^" in str(error.value)


def test_outputs_are_looked_at() -> None:
    with pytest.raises(ModelError, match=r":11:.*bounds of clip\(\) are 2 and 1"):
        load_text(text("0*(1 N)") + 'outputs:\n  o: "clip(x, hi, lo)"\n')


def test_values_that_are_set_are_looked_at(tmp_path: Path) -> None:
    path = tmp_path / "slider.yaml"
    path.write_text(text("(1 N)*step(x, w) + (1 N/m)*clip(x, lo, hi)"))
    with pytest.raises(ModelError, match=r"bounds of clip\(\) are 3 and 2"):
        hamel.simulate(path, time=0.1, values={"lo": 3.0})
    with pytest.raises(ModelError, match=r"width of step\(\) is 0"):
        hamel.simulate(path, time=0.1, values={"w": "0 m"})


def test_what_is_in_order_is_taken() -> None:
    """Also what is not known when the file is read: bounds that move, and a clip to one value."""
    for formula in (
        "(1 N/m)*clip(x, lo, hi, w) + (1 N)*step(x, w)",
        "(1 N/m)*clip(x, lo, lo)",
        "(1 N/m)*clip(x, der(x)*(1 s), hi - x)",
        "piecewise(x, 1 N, lo, 2 N, hi, 3 N)",
    ):
        load_text(text(formula))


def test_fixed_values_are_looked_at_again(tmp_path: Path) -> None:
    path = tmp_path / "slider.yaml"
    path.write_text(text("(1 N)*step(x, w) + (1 N/m)*clip(x, lo, hi)"))
    for name, value, message in (
        ("w", "0 m", r"slider.yaml:8:.*width of step\(\) is 0"),
        ("hi", "0.5 m", r"slider.yaml:8:.*bounds of clip\(\) are 1 and 0.5"),
        ("c", "0 m/s", "slider.yaml:9:.*smoothing of 'R' is 0"),
    ):
        with pytest.raises(ModelError, match=message):
            hamel.build(path, out=tmp_path / "out", fix={name: value})


def test_definitions_are_known_where_values_are_set(tmp_path: Path) -> None:
    """A width by a definition was an internal error where anything was set."""
    path = tmp_path / "slider.yaml"
    defined = text("(1 N)*step(x, v)").replace("smoothing: c", "smoothing: s")
    path.write_text(defined + "where: {v: 2*w, s: 2*c, far: x + w}\n")
    hamel.simulate(path, time=0.1, values={"lo": 0.5})
    with pytest.raises(ModelError, match=r"width of step\(\) is 0"):
        hamel.simulate(path, time=0.1, values={"w": 0.0})
    with pytest.raises(ModelError, match="smoothing of 'R' is 0"):
        hamel.simulate(path, time=0.1, values={"c": 0.0})
