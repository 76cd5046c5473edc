"""Sets of generalized velocities that are looked at first can be carried through.

Of derive.choices: candidates, ranking.
"""

from __future__ import annotations

from derive.choices.candidates import candidates
from derive.choices.survey import survey_of
from derive.formulations import equations
from derive.states import system
from tests.mechanisms import mechanism

# a bar between two bodies, and two more that it says nothing of
TREE = [("ball", 0), ("free", 1), ("free", 5), ("revolute", 0)]


def test_sets_that_are_singular_everywhere_come_last() -> None:
    """They lose no inertia, for there is no state where they could; they took all places, and the
    model was refused."""
    mechanics = system(mechanism(TREE, (), [("distance", (0, 2))], seed=7))
    survey = survey_of(mechanics)
    found = sorted(candidates(survey), key=lambda x: x[0])
    assert found[-1][0][0] and not found[0][0][0]
    assert not any(order[0] for order, _, _ in found[:3])
    assert equations(mechanics).w
