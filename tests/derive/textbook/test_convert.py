"""Terms as expressions: which numbers are read as gravity.

Of derive.textbook.formulas: convert.
"""

import random

import casadi as ca
import sympy

from derive.textbook.formulas.compose import operations
from derive.textbook.formulas.convert import Gravity, Reader

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


def test_a_term_over_the_root_of_itself_is_the_root() -> None:
    """(a² + b² c²)/√(a² + b² c²) − a, as rolling disks have it."""
    a, b, c = (ca.SX.sym(name) for name in "abc")
    under = a**2 + b**2 * c**2
    names = sympy.symbols("a b c", real=True)
    reader = Reader(ca.vertcat(a, b, c), names, False)
    (found,) = reader.whole(3 * (under / ca.sqrt(under) - a))
    assert operations(found) <= 9
    square = names[0] ** 2 + names[1] ** 2 * names[2] ** 2
    assert sympy.expand(found - 3 * (sympy.sqrt(square) - names[0])) == 0
