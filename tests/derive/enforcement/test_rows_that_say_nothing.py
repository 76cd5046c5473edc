"""A loop of bodies that cannot move has constraint rows, and none of them says anything: what needs
one that does is refused in words, and the rest runs.

Of derive.enforcement: feedback.
"""

from pathlib import Path

import pytest

import hamel
from derive.choices.survey import survey_of
from derive.diagnostics import HamelError
from derive.model import load
from derive.states import system
from derive.states.sampling import states

FINDINGS = Path(__file__).resolve().parents[2] / "findings"
MODEL = """model: dead
bodies:
  a: {mass: 1, inertia: 0.1}
  b: {mass: 1, inertia: 0.1}
joints:
  A: {type: fixed, parent: ground, child: a}
  B: {type: revolute, parent: ground, child: b, axis: z}
closures:
  C: {type: revolute, between: [a, ground], at: [[0, 0, 0], [0, 0, 0]], axis: z}
initial: {B: 0.3, der(B): 1}
"""


@pytest.fixture
def dead(tmp_path):
    file = tmp_path / "dead.yaml"
    file.write_text(MODEL)
    return file


@pytest.mark.parametrize("formulation", ["quasi_velocities", "maggi"])
def test_feedback_says_that_nothing_can_drift(dead, formulation):
    with pytest.raises(HamelError, match="no row of the position constraints says anything"):
        hamel.simulate(dead, time=0.2, enforcement="feedback", formulation=formulation)


def test_multipliers_of_a_library_are_none(dead):
    found = hamel.simulate(dead, time=0.2, integrator="idas", formulation="augmented")
    assert abs(found.simulation.x[-1][0] - 0.5) < 1e-9


def test_rows_of_rounding_do_not_keep_states_from_being_found():
    """Rows of 1e-16 beside rows of 0.6 are not stretched to unit length."""
    own = system(load(FINDINGS / "rnd29.yaml"))
    assert len(states(own, 10).q) == 10
    assert survey_of(own).freedom == 4


def test_rows_of_rounding_are_no_contradictions_in_other_units():
    """Divided by its own size rounding of φ was 40 m: the file closed nowhere."""
    own = system(load(FINDINGS / "rnd210.yaml"))
    assert len(states(own, 10).q) == 10
    assert survey_of(own).freedom == 3
