"""Terms as expressions: which numbers are read as gravity.

Of derive.textbook: convert.
"""

import random

import sympy

from derive.textbook.convert import Gravity

G = Gravity(sympy.Symbol("g"), 9.81)


def test_products_of_gravity_are_read_as_such() -> None:
    for share in (2.0, 0.5, 1.25, 0.98574, 12.3456):
        times = G.times(share * 9.81)
        assert times is not None and float(times) == share


def test_a_measured_number_is_no_gravity_by_chance() -> None:
    """Of numbers with sixteen digits one in fifty has a share with two digits less."""
    draw = random.Random(1)
    numbers = [draw.uniform(0.01, 0.02) for _ in range(2000)]
    assert not any(G.times(number) for number in numbers)
