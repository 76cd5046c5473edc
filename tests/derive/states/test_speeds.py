"""Declared quasi-velocities are held and guessed by name where motions begin.

Of derive.states: speeds.
Of derive.model.motion: initial, speeds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from derive.diagnostics import ModelError
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.many import starter

SKATE = """
model: skate
plane: xy
parameters: {w: 2 rad/s, a: 0.1 m}
bodies: {sled: {mass: 4 kg, com: [0.2, 0], inertia: 0.3}}
joints: {base: {type: planar, parent: ground, child: sled, coordinates: [x, y, heading]}}
constraints: {skate: {type: no_slip, body: sled, at: [0, 0], direction: y}}
quasi_velocities:
  body: {speed: base.vx, spin: base.w}
  other: {speed: base.vx + a*base.w, north: der(y)}
initial: {heading: 30 deg, body.speed: 1 m/s, spin: w}
"""
# coordinates in micrometres: the model's own units are not SI
SMALL = SKATE.replace("0.2, 0", "0.2 mm, 0").replace("4 kg", "4 mg").replace("inertia: 0.3", (
    "inertia: 1e-6 g*mm^2"
))  # fmt: skip


@pytest.mark.parametrize("text", [SKATE, SMALL], ids=["metres", "millimetres"])
def test_they_are_initial_values(text: str) -> None:
    mechanics = system(load_text(text))
    assert initial_state(mechanics).v == pytest.approx([1.0, 0.0, 2.0], abs=1e-12)
    changes = {"other.speed": 1.5, "spin": 3.0}
    asked = text.replace("body.speed: 1 m/s, spin: w", "spin: w")
    found = initial_state(system(load_text(asked)), changes)
    assert found.v == pytest.approx([1.2, 0.0, 3.0], abs=1e-12) and not found.moved
    north = initial_state(system(load_text(asked)), {"north": 0.5})
    assert north.v == pytest.approx([1.0, 0.0, 2.0], abs=1e-12)


def test_what_gives_way_is_told() -> None:
    """Two degrees of freedom hold no three values."""
    found = initial_state(system(load_text(SKATE)), {"other.speed": 3.0})
    assert {name for name, _, _ in found.moved} == {"body.speed", "spin", "other.speed"}


def test_guesses_say_what_is_not_held() -> None:
    """Rates of coordinates that are no generalized velocities, too: they were passed over."""
    for guess, v in (
        ("body.speed: 1 m/s, spin: w", [1.0, 0.0, 2.0]),
        ("der(y): 0.5 m/s", [1.0, 0.0, 0.0]),
    ):
        text = SKATE.replace("body.speed: 1 m/s, spin: w", f"guess: {{{guess}}}")
        mechanics = system(load_text(text))
        one = initial_state(mechanics)
        if "der" not in guess:
            assert one.v == pytest.approx(v, abs=1e-12)
        assert one.v[0] > 0.2
        several = starter(mechanics, ("spin",))(
            {"spin": np.array([2.0, -1.0])}, np.array([[2, 0.1]] * 2)
        )
        alone = [initial_state(mechanics, {"spin": x}).v for x in (2.0, -1.0)]
        np.testing.assert_allclose(several.v, alone, atol=1e-12)
        assert several.v[:, 2] == pytest.approx([2.0, -1.0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("body.speed: 1", "speed: 1", "'speed' is a quasi-velocity of several choices"),
        ("spin: w", "spun: w", "did you mean 'spin'"),
        ("spin: w", "spin: a", ":11:53: error: the initial spin in m"),
        ("spin: w", "guess: {body.speed: 1 m/s}", "held and guessed"),
    ],
)
def test_mistakes_are_told_where_they_are(old: str, new: str, message: str) -> None:
    assert old in SKATE
    with pytest.raises(ModelError, match=message):
        load_text(SKATE.replace(old, new, 1))


def test_names_of_the_model_keep_their_meaning() -> None:
    """A choice `base` with a row `vx` does not take the place of the velocity base.vx."""
    text = SKATE.replace("  body: {speed", "  base: {vx: 2*base.vx, turns: base.w}\n  body: {speed")
    mechanics = system(load_text(text))
    assert "base.vx" not in [x.name for x in mechanics.model.speeds]
    held = initial_state(mechanics, {"base.vx": 0.5, "body.speed": 0.5})
    assert held.v[0] == pytest.approx(0.5)


def test_a_part_has_no_quasi_velocities_to_start_with(tmp_path: Path) -> None:
    (tmp_path / "skate.yaml").write_text(SKATE)
    (tmp_path / "two.yaml").write_text(
        "model: two\nplane: xy\nsubmodels: {a: {use: skate.yaml}, b: {use: skate.yaml}}\n"
    )
    message = "the initial value of the quasi-velocity 'body.speed' in a submodel"
    with pytest.raises(ModelError, match=message) as error:
        load(tmp_path / "two.yaml")
    assert "where a is used at" in str(error.value) and "der(q)" in str(error.value)
