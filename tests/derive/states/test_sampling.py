"""Random admissible states, and where there are none that a motion could start from.

Of derive.states: gimbal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from derive.diagnostics import AssumptionError, ModelError
from derive.model import load, load_text
from derive.states import system
from derive.states.initial import initial_state
from derive.states.sampling import Walk, states

PLATE = """
model: plate
bodies: {{c: {{mass: 3, inertia: [0.2, 0.3, 0.4]}}}}
joints:
  C: {{type: free, parent: ground, child: c, position: [x, y, z],
       orientation: {{euler: zxy, angles: [e1, e2, e3]}}}}
constraints: {{k: {{holonomic: e2 - {held} deg}}}}
"""


def test_gimbal_lock_wherever_the_constraints_hold_is_refused_in_words() -> None:
    """Every admissible state has e2 = 90 deg, so that no one of them stands out."""
    with pytest.raises(AssumptionError, match=r"e1, e3 .*gimbal lock") as caught:
        states(system(load_text(PLATE.format(held=90))), 5)
    assert "quaternion" in str(caught.value)


@pytest.mark.parametrize(
    "rates, refused", [(", der(a): 1", True), (", J.wx: 1", False), ("", False)]
)
def test_rates_of_locked_angles_are_no_start(rates: str, refused: bool) -> None:
    """cos 90 deg is 6e-17: nothing is infinite there, and no v has such rates."""
    text = (
        "model: m\nbodies: {b: {mass: 1 kg, inertia: [0.2, 0.3, 0.4]}}\n"
        "joints: {J: {type: ball, parent: ground, child: b, orientation: {euler: xyz, angles: [a, b1, c]}}}\n"
        f"initial: {{b1: 90 deg{rates}}}\n"
    )
    found = system(load_text(text))
    if not refused:
        assert np.isfinite(initial_state(found).v).all()
        return
    with pytest.raises(ModelError, match="a, c change without bound") as told:
        initial_state(found)
    assert told.value.diagnostics[0].line == 3


def test_near_gimbal_lock_is_no_gimbal_lock() -> None:
    found = states(system(load_text(PLATE.format(held=89))), 5)
    assert len(found.t) == 5


def test_not_every_rank_of_many_rows_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forty bars folded flat: the rank is 40 at the start and 80 next to it."""
    closings: list[int] = []
    closed = Walk.closed

    def counted(walk: Walk, *given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        closings.append(walk.rank)
        return closed(walk, *given)

    monkeypatch.setattr(Walk, "closed", counted)
    mechanics = system(load(Path(__file__).parents[2] / "findings" / "folded_bars.yaml"))
    closings.clear()
    assert len(states(mechanics, 4).q)
    assert closings[0] == 40 and len(closings) < 12


TRACK = """
model: track
plane: xy
bodies: {{a: {{mass: 1 kg}}}}
joints: {{A: {{type: point, parent: ground, child: a, coordinates: [x, y]}}}}
constraints: {{c: {{holonomic: {formula}}}}}
initial: {{x: 1e-5 m, y: {y} m}}
"""


@pytest.mark.parametrize("formula", ["(y - x)^2", "(y - x)^3", "x^2 - 2*x*y + y^2"])
def test_a_formula_without_a_slope_where_it_is_zero_is_refused(formula):
    model = load_text(TRACK.format(formula=formula, y=1e-5))
    with pytest.raises(AssumptionError, match="the slope of c vanishes wherever c is zero") as told:
        states(system(model), 5)
    assert (told.value.diagnostics[0].line, told.value.diagnostics[0].column) == (6, 15)


@pytest.mark.parametrize(
    ("formula", "y"),
    [
        ("x^2 + y^2 - 1e-10", 0.0),
        ("x*y", 0.0),
        ("(y - x)*(1 + (y - x)^2)", 1e-5),
        ("y^3 - x*(1 m^2)", 0.1),
    ],
)
def test_a_formula_whose_slope_is_small_or_vanishes_at_one_place_is_not(formula, y):
    assert len(states(system(load_text(TRACK.format(formula=formula, y=y))), 5).t) == 5
