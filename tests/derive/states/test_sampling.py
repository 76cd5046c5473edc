"""Random admissible states, and where there are none that a motion could start from."""

from __future__ import annotations

import pytest

from derive.diagnostics import AssumptionError
from derive.model import load_text
from derive.states import system
from derive.states.sampling import states

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


def test_near_gimbal_lock_is_no_gimbal_lock() -> None:
    found = states(system(load_text(PLATE.format(held=89))), 5)
    assert len(found.t) == 5
