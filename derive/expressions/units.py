"""Units of measure: a small table of symbols, their factor to SI and their dimension. Angles are
plain numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache

Dimension = tuple[Fraction, Fraction, Fraction, Fraction]  # exponents of m, kg, s, A
Factor = tuple[str, int | Fraction]  # a symbol and its exponent
BASE = ("m", "kg", "s", "A")


def _dimension(m: int = 0, kg: int = 0, s: int = 0, A: int = 0) -> Dimension:
    return (Fraction(m), Fraction(kg), Fraction(s), Fraction(A))


NUMBER = _dimension()
LENGTH, MASS, TIME = _dimension(m=1), _dimension(kg=1), _dimension(s=1)
FORCE = _dimension(m=1, kg=1, s=-2)
ENERGY = _dimension(m=2, kg=1, s=-2)


@dataclass(frozen=True)
class Unit:
    """One of the unit is `factor` of the coherent SI unit that `si` spells."""

    factor: float
    dimension: Dimension
    si: str


def product_of(a: Dimension, b: Dimension) -> Dimension:
    """The dimension of a product: the powers of metre, kilogram, second and ampere add."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3])


def quotient_of(a: Dimension, b: Dimension) -> Dimension:
    """The dimension of a quotient: powers of the base units subtract."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3])


def power_of(a: Dimension, n: Fraction) -> Dimension:
    """The dimension of a power. The exponent is a fraction, as the root of an area is a length."""
    return (a[0] * n, a[1] * n, a[2] * n, a[3] * n)


_SI: dict[str, Dimension] = {
    "m": LENGTH,
    "kg": MASS,
    "s": TIME,
    "A": _dimension(A=1),
    "rad": NUMBER,
    "N": FORCE,
    "J": ENERGY,
    "W": _dimension(m=2, kg=1, s=-3),
    "Pa": _dimension(m=-1, kg=1, s=-2),
    "Hz": _dimension(s=-1),
    "C": _dimension(s=1, A=1),
    "V": _dimension(m=2, kg=1, s=-3, A=-1),
    "ohm": _dimension(m=2, kg=1, s=-3, A=-2),
    "H": _dimension(m=2, kg=1, s=-2, A=-2),
    "F": _dimension(m=-2, kg=-1, s=4, A=2),
}
_TURN = 2.0 * math.pi
# symbol: (factor, what it is in symbols of _SI)
_OTHER: dict[str, tuple[float, dict[str, int]]] = {
    "g": (1e-3, {"kg": 1}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "deg": (math.pi / 180.0, {"rad": 1}),
    "rev": (_TURN, {"rad": 1}),
    "rpm": (_TURN / 60.0, {"rad": 1, "s": -1}),
    "bar": (1e5, {"Pa": 1}),
}
_PREFIXED = {
    "km cm mm um nm": "m",
    "mg ug ng pg": "g",
    "ms us ns": "s",
    "mrad": "rad",
    "kN MN mN uN nN": "N",
    "kJ MJ mJ": "J",
    "kW MW mW": "W",
    "kPa MPa GPa": "Pa",
    "kHz MHz": "Hz",
    "mA kV mV kohm mH uF nF pF": "",
}
PREFIXES = {"G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}


def _table() -> dict[str, tuple[float, dict[str, int]]]:
    table = {symbol: (1.0, {symbol: 1}) for symbol in _SI} | _OTHER
    for symbols in _PREFIXED:
        for symbol in symbols.split():
            factor, parts = table[symbol[1:]]
            table[symbol] = (PREFIXES[symbol[0]] * factor, parts)
    return table


UNITS = _table()
SI = frozenset(_SI)


def compound(parts: Iterable[Factor]) -> Unit:
    """The unit Π symbolⁿ; every symbol must be in UNITS."""
    return _compound(tuple(parts))


@lru_cache(maxsize=1024)
def _compound(parts: tuple[Factor, ...]) -> Unit:
    factor, dimension = 1.0, NUMBER
    exponents: dict[str, int | Fraction] = {}
    for symbol, n in parts:
        scale, pieces = UNITS[symbol]
        factor *= scale**n
        for piece, k in pieces.items():
            exponents[piece] = exponents.get(piece, 0) + k * n
            dimension = product_of(dimension, power_of(_SI[piece], Fraction(k * n)))
    return Unit(factor, dimension, spelled(exponents.items()))


def spelled(exponents: Iterable[Factor]) -> str:
    """Text such as `kg*m^2/s`; "" for a plain number."""
    above = [_raised(symbol, n) for symbol, n in exponents if n > 0]
    below = [_raised(symbol, -n) for symbol, n in exponents if n < 0]
    if not above and not below:
        return ""
    return "/".join(["*".join(above) or "1", *below])


def _raised(symbol: str, n: int | Fraction) -> str:
    """As formulas read it: m, m^2, m^1.5, m^(1/3)."""
    if n == 1:
        return symbol
    tenths = 10 * n == int(10 * n)
    return f"{symbol}^{float(n):g}" if tenths else f"{symbol}^({n})"


_PRETTY = ("N", "N*m", "N/m", "W", "N*s/m", "N*m*s", "Pa", "V", "ohm")


def pretty(dimension: Dimension) -> str:
    """A unit people use for the dimension: N, N*m, m/s …; "" for a plain number."""
    return _pretty_table().get(dimension) or spelled(
        [(s, n) for s, n in zip(("kg", "m", "s", "A"), _ordered(dimension))]
    )


def _ordered(d: Dimension) -> Dimension:
    return (d[1], d[0], d[2], d[3])


@cache
def _pretty_table() -> dict[Dimension, str]:
    # the first spelling wins: N*m rather than J, since torques are commoner in messages than
    # energies
    return {compound(_parts(text)).dimension: text for text in reversed(_PRETTY)}


def _parts(text: str) -> list[tuple[str, int]]:
    above, *below = text.split("/")
    return [(symbol, 1) for symbol in above.split("*")] + [(symbol, -1) for symbol in below]


def named(dimension: Dimension) -> str:
    """For messages: the unit, or words where there is none."""
    return pretty(dimension) or "a plain number or an angle"
