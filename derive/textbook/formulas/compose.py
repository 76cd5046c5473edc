"""Polynomials of the ring back to SymPy, common factors taken out greedily: what most terms share
comes first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from itertools import combinations
from math import inf
from typing import Any

import sympy
from sympy import Expr

from derive.textbook.formulas.ring import (
    PLAIN,
    UNIT,
    Exact,
    Frequencies,
    Key,
    Monomial,
    Poly,
    Ring,
    TooBig,
    Trig,
    common_factor,
    meant,
    over,
    parted,
)

Part = tuple[str, int, bool] | tuple[str, Frequencies]  # of a term, see _parts
DIGITS = 15
HOPELESS = 4  # times too long


def number(x: Exact, decimal: bool) -> Expr:
    """A whole number, a plain fraction, else a decimal of at most 15 digits."""
    x = meant(x)
    if x.denominator == 1 and abs(x.numerator) < 10**DIGITS:
        return sympy.Integer(x.numerator)
    short = len(repr(float(x)).replace("-", "").replace("0.", "").lstrip("0")) <= 6
    if x.denominator in PLAIN and not (decimal and short):
        return sympy.Rational(x.numerator, x.denominator)
    return sympy.Float(repr(float(x)), DIGITS)


class Composer:
    """SymPy expressions for a ring's polynomials; `decimal` prefers 0.5 to 1/2 (nothing but
    numbers is given)."""

    def __init__(self, ring: Ring, decimal: bool) -> None:
        self.ring, self.decimal = ring, decimal
        self.atoms: dict[int, Expr] = {}
        self.powers: dict[tuple[int, int], Expr] = {}
        self.trigs: dict[Trig, Expr] = {}

    def shortest(self, poly: Poly, most: float = inf) -> Expr:
        """Term by term or over a common denominator, whichever has fewer operations.

        Where the first has far more than `most` operations, the second is not looked at.
        """
        plain = self.expression(poly)
        if len(poly) < 2 or operations(plain) > HOPELESS * most:
            return plain
        factor, monomial, rest = parted(poly)
        if self._is_parted_alike(poly, factor):
            other = self._in_angles(rest)
        else:
            try:
                rest = self.ring.product(rest, {UNIT: 1})  # multiplies out what was a divisor
            except TooBig:
                return plain
            other = self._polynomial(rest)
        if other is None:
            return plain
        over = sympy.Mul(number(factor, self.decimal), *self._factors(monomial), other)
        return min(plain, over, key=operations)

    def _is_parted_alike(self, poly: Poly, factor: Exact) -> bool:
        """Whether `expression` takes out of the sum what `parted` does: without divisors both are
        one form."""
        if any(e < 0 for monomial, _ in poly for _, e in monomial):
            return False
        return self._factor([poly[key] for key in sorted(poly)]) == factor

    def _polynomial(self, poly: Poly) -> Expr:
        """A sum without divisors, in product or in Fourier form."""
        product_form, fourier_form = self.expression(poly), self._in_angles(poly)
        if fourier_form is None:
            return product_form
        return min(product_form, fourier_form, key=operations)

    def _in_angles(self, poly: Poly) -> Expr | None:
        """A sum of products in Fourier form; None where that is nothing new, or too big."""
        if self.ring.fourier or not self._has_products(poly):
            return None
        other = Ring(fourier=True)
        try:
            sum_of_angles = self.ring.in_fourier_form(poly, other)
        except TooBig:
            return None
        return Composer(other, self.decimal).expression(sum_of_angles)

    def _has_products(self, poly: Poly) -> bool:
        """Whether some term is a product of sines and cosines, which sums of angles could stand
        for."""
        return any(self._degree_of_trig(monomial) > 1 for monomial, _ in poly)

    def _degree_of_trig(self, monomial: Monomial) -> int:
        kinds = [(self.ring.atoms[k].kind, e) for k, e in monomial]
        return sum(abs(e) for kind, e in kinds if kind in ("sin", "cos"))

    def expression(self, poly: Poly) -> Expr:
        """A polynomial as a SymPy expression: the common factor outside, and the sum of what is
        left. A sum of negative terms alone gets its minus outside."""
        if not poly:
            return sympy.Integer(0)
        keys = list(poly)
        monomial, trig = _shared(keys), _common_trig(keys)
        factor = self._factor([poly[key] for key in sorted(poly)])
        if all(x < 0 for x in (over(v, factor) for v in poly.values())):
            factor = -factor
        rest = {_divided(key, monomial, trig): over(x, factor) for key, x in poly.items()}
        outside = [number(factor, self.decimal), *self._factors(monomial), *self._trig(trig)]
        return sympy.Mul(*outside, self._sum(rest))

    def _factor(self, values: list[Exact]) -> Exact:
        """Decimals keep their coefficients."""
        if self.decimal and len({abs(x) for x in values}) > 1:
            return -1 if values[0] < 0 else 1
        return common_factor(values)

    def _sum(self, poly: Poly) -> Expr:
        """A sum without common factor: what occurs in most terms is taken out of those."""
        if len(poly) == 1:
            ((key, x),) = poly.items()
            return sympy.Mul(number(x, self.decimal), *self._factors(key[0]), *self._trig(key[1]))
        if (root := _square_of(poly)) is not None:
            return self.expression(root) ** 2
        part = _most_shared(poly)
        if part is None:
            return sympy.Add(*[self._sum({key: x}) for key, x in poly.items()])
        inside = {key: x for key, x in poly.items() if part in _parts(key)}
        outside = {key: x for key, x in poly.items() if key not in inside}
        return sympy.Add(self.expression(inside), self._sum_or_factored(outside))

    def _sum_or_factored(self, poly: Poly) -> Expr:
        return self.expression(poly) if poly else sympy.Integer(0)

    def _factors(self, monomial: Monomial) -> list[Expr]:
        return [self._power(k, e) for k, e in monomial]

    def _power(self, k: int, e: int) -> Expr:
        if (k, e) not in self.powers:
            self.powers[k, e] = self._atom(k) ** e
        return self.powers[k, e]

    def _atom(self, k: int) -> Expr:
        if k not in self.atoms:
            self.atoms[k] = self._composed(self.ring.atoms[k].kind, self.ring.atoms[k].content)
        return self.atoms[k]

    def _composed(self, kind: str, content: Any) -> Expr:
        if kind == "symbol":
            return content
        if kind == "sum":
            return self._polynomial(content)
        if kind == "root":
            return sympy.sqrt(self.shortest(content))
        return FUNCTIONS[kind](*[self.expression(x) for x in content])

    def _trig(self, trig: Trig) -> list[Expr]:
        if not trig:
            return []
        if trig not in self.trigs:
            angle = sympy.Add(*[number(x, self.decimal) * self._atom(k) for k, x in trig[1]])
            self.trigs[trig] = sympy.cos(angle) if trig[0] == "c" else sympy.sin(angle)
        return [self.trigs[trig]]


def _shared(keys: list[Key]) -> Monomial:
    """Atoms in all terms with the same sign, each to the power nearest to zero."""
    shared = dict(keys[0][0])
    for monomial, _ in keys[1:]:
        here = dict(monomial)
        shared = {
            k: min(e, here[k], key=abs) for k, e in shared.items() if k in here and here[k] * e > 0
        }
    return tuple(sorted(shared.items()))


def _common_trig(keys: list[Key]) -> Trig:
    trigs = {trig for _, trig in keys}
    return trigs.pop() if len(trigs) == 1 else ()


def _divided(key: Key, monomial: Monomial, trig: Trig) -> Key:
    exponents = dict(key[0])
    for k, e in monomial:
        exponents[k] -= e
    return tuple((k, e) for k, e in sorted(exponents.items()) if e), () if trig else key[1]


def _parts(key: Key) -> list[Part]:
    """What could be taken out of a term: each atom by the sign of its exponent, and its sine or
    cosine."""
    return [("atom", k, e > 0) for k, e in key[0]] + ([key[1]] if key[1] else [])


def _square_of(poly: Poly) -> Poly | None:
    """a + b + … of a poly a² + 2ab + b² + …, of two to four symbols."""
    squares = [key for key in poly if _is_square(key)]
    n = len(squares)
    if n not in (2, 3, 4) or len(poly) != n * (n + 1) // 2 or any(poly[k] != 1 for k in squares):
        return None
    symbols = [monomial[0][0] for monomial, _ in squares]
    first = min(symbols)
    signs = {k: -1 if k != first and poly.get(_crossed(first, k), 0) <= 0 else 1 for k in symbols}
    for a, b in combinations(sorted(symbols), 2):
        if poly.get(_crossed(a, b)) != 2 * signs[a] * signs[b]:
            return None
    return {(((k, 1),), ()): sign for k, sign in signs.items()}


def _is_square(key: Key) -> bool:
    """x² of one atom, without a sine or cosine."""
    monomial, trig = key
    return not trig and len(monomial) == 1 and monomial[0][1] == 2


def _crossed(a: int, b: int) -> Key:
    return ((min(a, b), 1), (max(a, b), 1)), ()


def _most_shared(poly: Poly) -> Part | None:
    """A sine or cosine counts double: what it multiplies then stands together, often as a
    square."""
    counts = Counter(part for key in poly for part in _parts(key))
    best = min(
        counts.items(), key=lambda item: (-_weight(*item), len(item[0]), item[0]), default=(None, 0)
    )
    return best[0] if best[1] > 1 else None


def _weight(part: Part, count: int) -> int:
    return count if part[0] == "atom" else 2 * count


FUNCTIONS: dict[str, Callable[..., Expr]] = {
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tan": sympy.tan,
    "asin": sympy.asin,
    "acos": sympy.acos,
    "atan": sympy.atan,
    "atan2": sympy.atan2,
    "sinh": sympy.sinh,
    "cosh": sympy.cosh,
    "tanh": sympy.tanh,
    "exp": sympy.exp,
    "log": sympy.log,
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "min": sympy.Min,
    "max": sympy.Max,
    "pow": sympy.Pow,
    "floor": sympy.floor,
    "ceil": sympy.ceiling,
}


def operations(expression: Expr) -> int:
    """Additions, products, powers and calls."""
    count = 0
    waiting = [expression]
    while waiting:
        x = waiting.pop()
        if x.is_Add or x.is_Mul:
            count += len(x.args) - 1
        elif not x.is_Atom:
            count += 1
        waiting.extend(x.args)
    return count
