"""How large and how small a number of a model may be: the one place that says so.

In SI units. Sixty decades either way hold every mechanism from an electron (1e-30 kg) to a galaxy
(1e42 kg) and leave room in double precision (308 decades) for the products of a few of them that a
mass matrix is made of.
"""

from __future__ import annotations

import math

LARGEST = 1e60
SMALLEST = 1e-60
BELOW = f"a magnitude below {LARGEST:g} in SI units"
ABOVE = f"0, or a magnitude above {SMALLEST:g} in SI units"
MOST_POWER, MOST_SI = 9, 99  # of a unit, and of one that is of the SI without a factor

# settled
SETTLED = 1e-12  # what is nowhere farther than this from 0, 1 or −1 is that number
TRIED = 20  # random values of the symbols at which that is seen

# roundoff
ERRORS = 2.0  # times the bound of half an ε for each operation
FOLDED = 8.0  # ε of the largest number: what is smaller may be what is left of such


def too_large(value: float) -> bool:
    """Also of what is no finite number."""
    return not abs(value) <= LARGEST


def too_small(value: float) -> bool:
    """Not zero, yet nothing in a mechanism is as small."""
    return 0.0 < abs(value) < SMALLEST


def objection(value: float) -> tuple[str, str] | None:
    """(problem, what was expected) of a number that no model may have; None where it may."""
    if not math.isfinite(value):
        return "the value is not a finite number", BELOW
    if too_large(value):
        return f"the number {value:g} is too large", BELOW
    if too_small(value):
        return f"the number {value:g} is too small to tell from zero", ABOVE
    return None
