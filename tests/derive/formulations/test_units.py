"""Units of quasi-velocities: of the formula in the file where there is one.

Of derive.formulations: units.
"""

from __future__ import annotations

import pytest

from tests.scenes import derived


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("rolling_disk", {"u1": "rad/s", "u2": "rad/s", "u3": "rad/s"}),
        ("chaplygin_sleigh", {"v": "m/s", "om": "rad/s"}),
    ],
)
def test_quasi_velocities_are_in_the_unit_their_formula_says(
    model: str, expected: dict[str, str]
) -> None:
    """A rate plus the sine of an angle times a rate is in rad/s too."""
    argument = derived(model).argument("x")
    units = dict(zip(argument.labels, argument.units))
    assert {name: units[name] for name in expected} == expected
