"""Units of measure and the dimensions of formulas."""

import math
from fractions import Fraction

import pytest

from derive.expressions.dimensions import BARE, UNKNOWN, infer
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.quantities import quantity, unit
from derive.expressions.tree import Name, Quotient
from derive.expressions.units import (
    ENERGY,
    FORCE,
    LENGTH,
    MASS,
    NUMBER,
    TIME,
    UNITS,
    named,
    power_of,
    pretty,
    product_of,
    quotient_of,
)


@pytest.mark.parametrize(
    ("text", "factor", "si"),
    [
        ("m", 1.0, "m"),
        ("mm", 1e-3, "m"),
        ("cm", 1e-2, "m"),
        ("km", 1e3, "m"),
        ("g", 1e-3, "kg"),
        ("mg", 1e-6, "kg"),
        ("min", 60.0, "s"),
        ("h", 3600.0, "s"),
        ("ms", 1e-3, "s"),
        ("deg", math.pi / 180, "rad"),
        ("rev", 2 * math.pi, "rad"),
        ("rpm", 2 * math.pi / 60, "rad/s"),
        ("bar", 1e5, "Pa"),
        ("deg/s", math.pi / 180, "rad/s"),
        ("kN", 1e3, "N"),
        ("mN*m", 1e-3, "N*m"),
        ("N/mm", 1e3, "N/m"),
        ("g*cm^2", 1e-7, "kg*m^2"),
        ("km/h", 1e3 / 3600, "m/s"),
        ("m/s^2", 1.0, "m/s^2"),
        ("m/s**2", 1.0, "m/s^2"),
        ("m*s^-2", 1.0, "m/s^2"),
        ("N*m*s/rad", 1.0, "N*m*s/rad"),
        ("N/m^1.5", 1.0, "N/m^1.5"),
        ("N/mm^(3/2)", 1e3**1.5, "N/m^1.5"),
        ("m^-(1/3)", 1.0, "1/m^(1/3)"),
        ("m^12", 1.0, "m^12"),
        ("kPa", 1e3, "Pa"),
        ("1", 1.0, ""),
        ("", 1.0, ""),
        ("1/s", 1.0, "1/s"),
        ("m/m", 1.0, ""),
    ],
)
def test_units(text: str, factor: float, si: str) -> None:
    found = unit(text)
    assert found.factor == pytest.approx(factor, rel=1e-15)
    assert found.si == si
    assert unit(si).factor == 1.0 and unit(si).dimension == found.dimension


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("metre", ""),
        ("KG", "'kg'"),
        ("Nm", "'N*m'"),
        ("Nms", "'N*m*s'"),
        ("pN", "1e-12 N"),
        ("GN", "1e+09 N"),
        ("m s", ""),
        ("m/", ""),
        ("m^", ""),
        ("2", ""),
        ("m^2.55", ""),
        ("m^(1/0)", ""),
        (f"m^({'1' * 5000}/1)", ""),
        (f"m^{'1' * 5000}", ""),
        ("m^(1/2", ""),
        ("mm^10", ""),
        ("m^100", ""),
        ("degree", "'deg'"),
        ("m" * 3000, ""),  # of which there are millions of ways to split it in three
    ],
)
def test_refused(text: str, hint: str) -> None:
    with pytest.raises(FormulaError) as caught:
        unit(text)
    assert hint in caught.value.detail[2]


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("10 N*m/(rad*s)", "10 N*m/rad/s"),
        ("2 kg/(m*s^2)", "2 kg/m/s^2"),
        ("3 N*(m/s)", "3 N*m/s"),
        ("1 1/(m*s)", "1 1/m/s"),
    ],
)
def test_units_take_brackets(text: str, same: str) -> None:
    assert quantity(text) == quantity(same) is not None


def test_a_bracket_of_the_models_own_names_is_a_formula() -> None:
    """(10 N)/(m) where m is a parameter, not a unit."""
    divided = expression("10 N/(m)", names=["m"])
    assert isinstance(divided, Quotient) and divided.denominator == Name("m")


def test_every_unit_is_finite_and_coherent_after_conversion() -> None:
    for symbol in UNITS:
        found = unit(symbol)
        assert 0.0 < found.factor < math.inf
        assert unit(found.si).factor == 1.0


def test_derived_units_have_the_dimension_of_their_definition() -> None:
    for short, long in [
        ("N", "kg*m/s^2"),
        ("J", "N*m"),
        ("W", "J/s"),
        ("Pa", "N/m^2"),
        ("V", "W/A"),
        ("ohm", "V/A"),
        ("H", "V*s/A"),
        ("F", "C/V"),
    ]:
        assert unit(short).dimension == unit(long).dimension


@pytest.mark.parametrize(
    "text",
    ["N", "N*m", "N/m", "N*s/m", "N*m*s", "kg", "m", "m/s", "m/s^2", "kg*m^2", "1/s", "kg*m", ""],
)
def test_pretty_spells_what_it_reads(text: str) -> None:
    dimension = unit(text).dimension
    assert unit(pretty(dimension)).dimension == dimension
    assert pretty(dimension) == text
    assert named(dimension) == text or named(dimension).startswith("a plain number")


@pytest.mark.parametrize("n", ["1/2", "-3/2", "1/3", "22/5", "17"])
def test_units_of_every_power_are_read_again(n: str) -> None:
    """Those of formulas, too: a file of FMI names the units of outputs."""
    dimension = power_of(product_of(LENGTH, MASS), Fraction(n))
    assert unit(pretty(dimension)).dimension == dimension


def test_algebra() -> None:
    assert (
        quotient_of(product_of(MASS, power_of(LENGTH, Fraction(2))), power_of(TIME, Fraction(2)))
        == ENERGY
    )
    assert power_of(ENERGY, Fraction(0)) == NUMBER


KNOWN = {
    "m": MASS,
    "l": LENGTH,
    "q": NUMBER,
    "f": FORCE,
    "k": UNKNOWN,
    "der(q)": quotient_of(NUMBER, TIME),
    "t": TIME,
}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("m", MASS),
        ("2*m", MASS),
        ("m/2", MASS),
        ("-m", MASS),
        ("m*l**2/12", unit("kg*m^2").dimension),
        ("f*l", ENERGY),
        ("m*l^2*der(q)^2/2", ENERGY),
        ("l + 1", LENGTH),
        ("1 + l", LENGTH),
        ("l + 1 mm", LENGTH),
        ("1 + 2*3", BARE),
        ("2^3", BARE),
        ("30 deg", NUMBER),
        ("q + 1", NUMBER),
        ("l/l", NUMBER),
        ("sin(q)*l", LENGTH),
        ("sin(2)", BARE),
        ("sqrt(l^2 + (2 m)^2)", LENGTH),
        ("(l^2)^0.5", LENGTH),
        ("l^(1/2)", power_of(LENGTH, Fraction(1, 2))),
        ("l^-1", unit("1/m").dimension),
        ("q^q", NUMBER),
        ("atan2(l, 2*l)", NUMBER),
        ("abs(l)", LENGTH),
        ("sign(l)", NUMBER),
        ("min(l, 2 m)", LENGTH),
        ("k*l", UNKNOWN),
        ("k + l", LENGTH),
        ("k + 1", UNKNOWN),
        ("sin(k)", NUMBER),
        ("l^k", None),
        ("unheard", UNKNOWN),
        ("der(q)*t", NUMBER),
    ],
)
def test_dimensions(text: str, expected: object) -> None:
    if text == "l^k":
        with pytest.raises(FormulaError, match="not a number"):
            infer(expression(text), KNOWN, text)
    else:
        assert infer(expression(text), KNOWN, text) == expected


@pytest.mark.parametrize(
    ("text", "at", "message"),
    [
        ("m + l", 4, "cannot add m to kg"),
        ("l + 2*l*q + m*l", 12, "cannot add kg*m to m"),
        ("q + l", 4, "cannot add m to a plain number or an angle"),
        ("k + m + l", 8, "cannot add m to kg"),
        ("sin(l)", 4, "sin() of a quantity in m"),
        ("exp(1 s)", 4, "exp() of a quantity in s"),
        ("2^l", 2, "an exponent in m"),
        ("l^q", 2, "m to a power that is not a number"),
        ("atan2(l, m)", 9, "cannot compare kg with m"),
        ("max(1 m, 2 kg)", 9, "cannot compare kg with m"),
        ("2*(l + f)", 7, "cannot add N to m"),
    ],
)
def test_mismatches(text: str, at: int, message: str) -> None:
    with pytest.raises(FormulaError) as caught:
        infer(expression(text), KNOWN, text)
    assert (caught.value.at, caught.value.detail[0]) == (at, message)
