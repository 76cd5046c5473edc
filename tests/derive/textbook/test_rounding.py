"""What rounding left is not printed, and no number of a model is taken for it.

Of derive.textbook.formulas: constants, rounding.
"""

import math

import pytest
import sympy

from derive.formulations import equations
from derive.model import load, load_text
from derive.states import system
from derive.textbook.derivation import derivation
from derive.textbook.formulas.compose import number
from derive.textbook.formulas.constants import Constants
from derive.textbook.formulas.ring import Ring, rational
from derive.textbook.formulas.rounding import leftovers
from derive.textbook.writing.latex import article
from tests.scenes import MODELS

TURNED = """
model: turned
plane: xy
parameters: {e: 0.1 m}
bodies: {a: {mass: 1 kg, inertia: 0.1}, b: {mass: MASS, inertia: 0.1}}
joints:
  s: {type: revolute, parent: ground, child: a, coordinate: p}
  r: {type: revolute, parent: a, child: b, at: [e*sin(180 deg), 2*e*cos(60 deg)], coordinate: q}
"""


def test_a_sine_that_is_zero_and_a_factor_that_is_one_are_not_printed() -> None:
    text = article(derivation(equations(system(load_text(TURNED.replace("MASS", "1 kg"))))))
    assert r"$(0,\; \allowbreak e)$" in text
    assert r"v_{b,x} &= -e \, \omega_{a} \, \cos q" in text
    assert r"\kappa" not in text


@pytest.mark.parametrize(
    "x, meant",
    [
        (1.0000000000000002, 1),
        (-1.0000000000000002, -1),
        (0.000400000000000001, sympy.Float("0.0004")),
        (math.sqrt(0.5) ** 2, sympy.Rational(1, 2)),
        (1 / 3 + 1e-16, sympy.Rational(1, 3)),
        (1.000000000001, sympy.Float("1.000000000001")),  # a number of its own
    ],
)
def test_a_number_is_the_short_one_beside_it(x: float, meant: sympy.Expr) -> None:
    assert number(rational(x), False) == meant


def test_what_is_left_of_a_difference_is_zero() -> None:
    ring = Ring(False)
    root = rational(math.sqrt(0.5))
    a = ring.symbol(sympy.Symbol("a"))
    assert ring.sum(ring.scaled(a, root * root), ring.scaled(a, rational(0.5)), -1) == {}
    assert ring.sum(ring.scaled(a, rational(1e-20)), ring.scaled(a, rational(3e-20)), -1)


def test_small_numbers_of_a_file_are_numbers() -> None:
    left = leftovers(load_text(TURNED.replace("MASS", "1 kg")))
    assert left(math.sin(math.pi)) and left(-3e-17) and not left(1e-9) and not left(0.0)
    left = leftovers(load_text(TURNED.replace("MASS", "1e-16 kg")))
    assert left(math.sin(math.pi)) and not left(1e-16) and not left(3e-17)


def test_numbers_that_differ_by_their_rounding_have_one_name() -> None:
    constants = Constants(lambda k, n: sympy.Symbol(f"kappa{k}"))
    x = sympy.Symbol("x")
    near = sympy.Float(0.866025403784439, 15) * x, -sympy.Float(0.866025403784438, 15) * x
    assert constants.named(near[0]) == -constants.named(near[1]) == sympy.Symbol("kappa1") * x


def test_a_governor_has_no_rounding_in_its_equations() -> None:
    text = article(derivation(equations(system(load(MODELS / "gallery" / "governor.yaml")))))
    assert r"\cdot 10^{-16}" not in text and r"\cdot 10^{-33}" not in text
