"""Sums of products with exact coefficients: what trigonometric terms of mechanics collapse in, at
bounded cost.

A term is coefficient · monomial of atoms · (1, cos a or sin a). In Fourier form products of sines
and cosines become sines and cosines of sums, so sin² + cos² = 1 and the addition theorems are
applied by adding equal terms; in product form they are atoms like any other. Everything that is not
polynomial (roots, quotients, calls) is an atom that knows what it is made of.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, isqrt, lcm
from typing import Any

import sympy

Monomial = tuple[tuple[int, int], ...]  # (atom, exponent), sorted
# a whole number where it can be: arithmetic with those is many times as fast
Exact = int | Fraction
Frequencies = tuple[tuple[int, Exact], ...]  # (atom, coefficient), sorted
Trig = tuple[()] | tuple[str, Frequencies]  # 1, or "c" or "s" of an angle
Key = tuple[Monomial, Trig]
Poly = dict[Key, Exact]
Frozen = tuple[tuple[Key, Exact], ...]
UNIT: Key = ((), ())
# divisors of fractions that stay fractions: masses of rods, balls (2/5, 5/7) and rings give these
PLAIN = frozenset((1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 14, 15, 16, 18, 21, 24, 28, 30, 32, 35, 36, 48))

ROUNDING = 1e-14  # of a number: what a few roundings change
SHORT = 8  # digits of a number that no computed one is so near to by chance
FINE = 10**8  # a denominator above that is one of a computed number


class TooBig(Exception):
    """The sum has more terms, or took more work, than is worth printing."""


@dataclass(frozen=True)
class Atom:
    """`kind` is "symbol" (content: a SymPy symbol), "sum" (a Poly, met as a divisor), "root" (a
    Poly) or a function's name."""

    kind: str
    content: Any


def frozen(poly: Poly) -> Frozen:
    """A polynomial as a key for a table: dictionaries cannot be hashed."""
    return tuple(sorted(poly.items()))


def over(x: Exact, y: Exact) -> Exact:
    """x / y."""
    if y in (1, -1):
        return x * y
    quotient = Fraction(x, y)
    return quotient.numerator if quotient.denominator == 1 else quotient


def rational(x: float) -> Exact:
    """The number meant: 1/3 for 0.333…, 981/100 for 9.81, 1 for 1.0000000000000002; else the
    shortest decimal that reads back the same."""
    if x.is_integer():
        return int(x)
    near = Fraction(x).limit_denominator(max(PLAIN))
    if near.denominator not in PLAIN or not _is_rounded(near, x):
        near = Fraction(f"{x:.{SHORT}g}")
    if _is_rounded(near, x):
        return near.numerator if near.denominator == 1 else near
    near = Fraction(x).limit_denominator(1_000_000)
    return near if abs(float(near) - x) <= 2e-16 * abs(x) else Fraction(repr(x))


def _is_rounded(near: Fraction, x: float) -> bool:
    """Whether x may be that number, a few roundings later."""
    return abs(float(near) - x) <= ROUNDING * abs(x)


def meant(x: Exact) -> Exact:
    """The number meant by a coefficient that was computed."""
    return x if x.denominator <= FINE else rational(float(x))


@dataclass
class Ring:
    """Arithmetic with a budget: at most `most` terms a sum, `work` products of terms in all."""

    fourier: bool
    most: int = 80
    work: int = 16_000
    atoms: list[Atom] = field(default_factory=list[Atom])
    index: dict[tuple[str, Hashable], int] = field(default_factory=dict[tuple[str, Hashable], int])

    def atom(self, kind: str, content: Any, key: Hashable = None) -> int:
        """The number of an atom: what is the same has the same number, so that equal terms meet and
        cancel."""
        name = (kind, content if key is None else key)
        if name not in self.index:
            self.index[name] = len(self.atoms)
            self.atoms.append(Atom(kind, content))
        return self.index[name]

    def symbol(self, symbol: sympy.Expr) -> Poly:
        """The polynomial that is this symbol alone."""
        return {(((self.atom("symbol", symbol), 1),), ()): 1}

    def number(self, x: float) -> Poly:
        """A number as a fraction, zero as the empty polynomial. Exact coefficients let terms cancel
        without a tolerance."""
        return {UNIT: rational(x)} if x else {}

    def sum(self, a: Poly, b: Poly, sign: int = 1) -> Poly:
        """a + b, or a − b with sign = −1. Raises TooBig where it has too many terms."""
        result = dict(a)
        for key, x in b.items():
            self._accumulate(result, key, sign * x)
        return self._checked(result)

    def _accumulate(self, poly: Poly, key: Key, x: Exact) -> None:
        before = poly.get(key, 0)
        total = before + x
        if total and not _cancels(total, before):
            poly[key] = total
        else:
            poly.pop(key, None)

    def _checked(self, poly: Poly) -> Poly:
        if len(poly) > self.most:
            raise TooBig
        return poly

    def scaled(self, a: Poly, k: Exact) -> Poly:
        """k a with an exact number k."""
        return {key: k * x for key, x in a.items()} if k else {}

    def product(self, a: Poly, b: Poly) -> Poly:
        """a b, every term with every other; products of sines and cosines become those of sums of
        angles. Raises TooBig where the work or the result grows beyond bounds."""
        self.work -= len(a) * len(b)
        if self.work < 0:
            raise TooBig
        result: Poly = {}
        for (m, trig), x in a.items():
            for (n, other), y in b.items():
                self._add_product(result, _merged(m, n), trig, other, x * y)
        return self._checked(result)

    def _add_product(self, result: Poly, monomial: Monomial, a: Trig, b: Trig, x: Exact) -> None:
        rest, extra = self._tidied(monomial)
        for trig, sign in _trig_product(a, b):
            if extra is None:
                self._accumulate(result, (rest, trig), sign * x)
                continue
            for key, y in self.product({(rest, trig): sign * x}, extra).items():
                self._accumulate(result, key, y)

    def _tidied(self, monomial: Monomial) -> tuple[Monomial, Poly | None]:
        """Squares of roots and positive powers of sums are multiplied out."""
        extra: Poly | None = None
        rest: list[tuple[int, int]] = []
        for k, e in monomial:
            kind, content = self.atoms[k].kind, self.atoms[k].content
            if kind == "sum" and e > 0:
                extra = self.product(extra or {UNIT: 1}, self.power(content, e))
            elif kind == "root" and abs(e) > 1:
                whole, odd = int(e / 2), e - 2 * int(e / 2)
                extra = self.product(extra or {UNIT: 1}, self.power(content, whole))
                rest += [(k, odd)] if odd else []
            elif kind == "abs" and e < 0 and self._covers(monomial, content[0]):
                extra = self.product(
                    extra or {UNIT: 1}, {(((k, e + 2),) if e != -2 else (), ()): 1}
                )
                extra = self.product(extra, self.power(self.inverse(content[0]), 2))
            else:
                rest.append((k, e))
        return tuple(rest), extra

    def _covers(self, monomial: Monomial, inside: Poly) -> bool:
        """Whether the monomial holds the square of what stands in |…|, a single atom: x² / |x| is
        |x|."""
        ((inner, _),) = inside
        return len(inner) == 1 and dict(monomial).get(inner[0][0], 0) >= 2 * inner[0][1]

    def power(self, a: Poly, n: int) -> Poly:
        """aⁿ by repeated products; for negative n the power of the inverse."""
        if n < 0:
            return self.power(self.inverse(a), -n)
        result: Poly = {UNIT: 1}
        for _ in range(n):
            result = self.product(result, a)
        return result

    def inverse(self, a: Poly) -> Poly:
        """A single term turns over; a sum becomes an atom to the power −1, its common factor taken
        out."""
        if not a:
            raise TooBig  # a division by zero is not a formula
        factor, monomial, rest = parted(a)
        if (shorter := self.pythagorean(rest)) != rest:
            return self.product(
                {(tuple((k, -e) for k, e in monomial), ()): over(1, factor)}, self.inverse(shorter)
            )
        reciprocal = tuple((k, -e) for k, e in monomial)
        if rest == {UNIT: 1}:
            return self.product({(reciprocal, ()): over(1, factor)}, {UNIT: 1})
        below = self.atom("sum", rest, frozen(rest))
        return {(_merged(reciprocal, ((below, -1),)), ()): over(1, factor)}

    def quotient(self, a: Poly, b: Poly) -> Poly:
        """a / b: a number where a is a multiple of b, else a times the inverse of b."""
        ratio = _ratio(a, b)
        return {UNIT: ratio} if ratio is not None else self.product(a, self.inverse(b))

    def root(self, a: Poly) -> Poly:
        """√a, with exact squares taken out: √(4 l²) is 2 |l|, as the sign of l is not known."""
        if not a:
            return {}
        factor, monomial, rest = parted(self.pythagorean(a))
        square = _square_root(factor)
        inner = self.product({(monomial, ()): 1 if square else factor}, rest)
        if inner == {UNIT: 1}:
            return {UNIT: square or 1}
        if (half := _halved(inner)) is not None:
            return self.scaled(self.call("abs", (half,)), square or 1)
        return {(((self.atom("root", inner, frozen(inner)), 1),), ()): square or 1}

    def pythagorean(self, poly: Poly) -> Poly:
        """sin² = 1 − cos² or cos² = 1 − sin², as often as that leaves fewer terms."""
        before, squared = None, _squared(poly)
        while before is None or len(poly) < before:
            before = len(poly)
            for sine, cosine in self._pairs():
                # whatever is not there squared is not replaced; most pairs are not
                if squared.isdisjoint((sine, cosine)):
                    continue
                poly = min(
                    poly,
                    self._replaced(poly, sine, cosine),
                    self._replaced(poly, cosine, sine),
                    key=len,
                )
                squared = _squared(poly)
        return poly

    def over_roots(self, poly: Poly) -> Poly:
        """b/√b is √b: for terms that together are a multiple of what stands under the root that
        divides them."""
        for k in sorted({k for monomial, _ in poly for k, e in monomial if e == -1}):
            if self.atoms[k].kind != "root":
                continue
            divided = {key: x for key, x in poly.items() if dict(key[0]).get(k) == -1}
            simple = self.pythagorean(divided)
            if not simple:  # they cancel, or an earlier root took them
                poly = {key: x for key, x in poly.items() if key not in divided}
                continue
            factor, monomial, rest = parted(simple)
            below, inside, same = parted(self.atoms[k].content)
            if rest == same:
                beside = _merged(tuple((i, -e) for i, e in inside), ((k, 2),))
                whole = {(_merged(monomial, beside), ()): over(factor, below)}
                poly = {key: x for key, x in poly.items() if key not in divided} | whole
        return poly

    def _pairs(self) -> list[tuple[int, int]]:
        """Atoms sin x and cos x of the same x; there are none in Fourier form."""
        cosines = {name[1]: k for name, k in self.index.items() if name[0] == "cos"}
        sines = {name[1]: k for name, k in self.index.items() if name[0] == "sin"}
        return [(k, cosines[angle]) for angle, k in sines.items() if angle in cosines]

    def _replaced(self, poly: Poly, old: int, new: int) -> Poly:
        """Even powers of `old` written with `new`: x² = 1 − y²."""
        squares = [key for key in poly if dict(key[0]).get(old, 0) > 1]
        result = {key: x for key, x in poly.items() if key not in squares}
        square: Poly = {UNIT: 1, (((new, 2),), ()): -1}
        for monomial, trig in squares:
            powers = dict(monomial)
            pairs, powers[old] = divmod(powers[old], 2)
            rest = tuple(sorted((k, e) for k, e in powers.items() if e))
            for key, x in self.product(
                {(rest, trig): poly[monomial, trig]}, self.power(square, pairs)
            ).items():
                self._accumulate(result, key, x)
        return result

    def in_fourier_form(self, poly: Poly, other: Ring) -> Poly:
        """The same sum in the ring `other`. Raises TooBig where it holds more than symbols, sines
        and cosines."""
        result: Poly = {}
        for (monomial, _), x in poly.items():
            term: Poly = {UNIT: x}
            for k, e in monomial:
                term = other.product(term, other.power(self._carried(k, other), e))
            result = other.sum(result, term)
        return result

    def _carried(self, k: int, other: Ring) -> Poly:
        kind, content = self.atoms[k].kind, self.atoms[k].content
        if kind == "symbol":
            return other.symbol(content)
        if kind not in ("sin", "cos"):
            raise TooBig
        argument = self.in_fourier_form(content[0], other)
        return other.sine(argument) if kind == "sin" else other.cosine(argument)

    def call(self, name: str, arguments: tuple[Poly, ...]) -> Poly:
        """A function of polynomials as an atom: nothing is known of it but that equal arguments
        give equal values."""
        key = tuple(frozen(x) for x in arguments)
        return {(((self.atom(name, arguments, key), 1),), ()): 1}

    def sine(self, a: Poly) -> Poly:
        """sin a: a Fourier term where a is an integer combination of angles, else an atom. sin(−a)
        is written −sin a, so that both meet."""
        if not a:
            return {}
        sign = -1 if a[min(a)] < 0 else 1
        angle = self.scaled(a, sign)
        freq = self._frequencies(angle)
        if self.fourier and freq:
            return {((), ("s", freq)): sign}
        return self.scaled(self.call("sin", (angle,)), sign)

    def cosine(self, a: Poly) -> Poly:
        """cos a: a Fourier term where a is an integer combination of angles, else an atom. cos(−a)
        is written cos a."""
        if not a:
            return {UNIT: 1}
        angle = self.scaled(a, -1) if a[min(a)] < 0 else a
        freq = self._frequencies(angle)
        if self.fourier and freq:
            return {((), ("c", freq)): 1}
        return self.call("cos", (angle,))

    def _frequencies(self, a: Poly) -> Frequencies:
        """((atom, coefficient), …) of a sum of symbols, () for anything else."""
        frequencies: list[tuple[int, Exact]] = []
        for (monomial, trig), x in a.items():
            if trig or len(monomial) != 1:
                return ()
            ((atom, exponent),) = monomial
            if exponent != 1 or self.atoms[atom].kind != "symbol":
                return ()
            frequencies.append((atom, x))
        return _oriented(tuple(sorted(frequencies)))[0]


def _cancels(total: Exact, before: Exact) -> bool:
    """Whether what is left of a difference of computed numbers is their rounding."""
    return total.denominator > FINE and abs(total) < abs(before) * Fraction(ROUNDING)


def tidied(poly: Poly) -> Poly:
    """The numbers meant, in place of those computed."""
    return {key: meant(x) for key, x in poly.items()}


def _squared(poly: Poly) -> set[int]:
    """The atoms that stand squared, or in a higher power, in some term."""
    return {k for monomial, _ in poly for k, e in monomial if e > 1}


def _merged(a: Monomial, b: Monomial) -> Monomial:
    if not a or not b:
        return a or b
    exponents = dict(a)
    for k, e in b:
        exponents[k] = exponents.get(k, 0) + e
    return tuple(sorted((k, e) for k, e in exponents.items() if e))


def _oriented(freq: Frequencies) -> tuple[Frequencies, int]:
    """The frequencies with the first one positive, and the sign that took."""
    if freq and freq[0][1] < 0:
        return tuple((k, -x) for k, x in freq), -1
    return freq, 1


_HALF = Fraction(1, 2)


def _trig_product(a: Trig, b: Trig) -> list[tuple[Trig, Exact]]:
    """Products as sums: cos a cos b = ½ (cos(a − b) + cos(a + b)), and so on."""
    if not a or not b:
        return [(a or b, 1)]
    less, more = _combined(a[1], b[1], -1), _combined(a[1], b[1], 1)
    match a[0] + b[0]:
        case "cc":
            return [_even(less, _HALF), _even(more, _HALF)]
        case "ss":
            return [_even(less, _HALF), _even(more, -_HALF)]
        case "sc":
            return [*_odd(more, _HALF), *_odd(less, _HALF)]
        case _:
            pass
    return [*_odd(more, _HALF), *_odd(less, -_HALF)]


def _combined(a: Frequencies, b: Frequencies, sign: int) -> Frequencies:
    total = dict(a)
    for k, x in b:
        total[k] = total.get(k, 0) + sign * x
    return tuple(sorted((k, x) for k, x in total.items() if x))


def _even(freq: Frequencies, x: Exact) -> tuple[Trig, Exact]:
    return (("c", _oriented(freq)[0]) if freq else (), x)


def _odd(freq: Frequencies, x: Exact) -> list[tuple[Trig, Exact]]:
    oriented, sign = _oriented(freq)
    return [(("s", oriented), sign * x)] if freq else []


def parted(a: Poly) -> tuple[Exact, Monomial, Poly]:
    """factor · monomial · rest: what all terms have in common taken out, the first coefficient of
    the rest positive."""
    monomial = common_monomial(list(a))
    factor = common_factor([a[key] for key in sorted(a)])
    reciprocal = tuple((k, -e) for k, e in monomial)
    rest = {(_merged(m, reciprocal), trig): over(x, factor) for (m, trig), x in a.items()}
    return factor, monomial, rest


def common_monomial(keys: list[Key]) -> Monomial:
    """Every atom to its lowest power in any term: what is left are true polynomials without a
    common atom."""
    powers = [dict(monomial) for monomial, _ in keys]
    lowest = {k: min(p.get(k, 0) for p in powers) for k in {k for p in powers for k in p}}
    return tuple(sorted((k, e) for k, e in lowest.items() if e))


def common_factor(values: list[Exact]) -> Exact:
    """The largest number that leaves small whole coefficients; 1 where the coefficients are no
    plain fractions."""
    sign = -1 if values[0] < 0 else 1
    if len({abs(x) for x in values}) == 1:
        return values[0]
    if any(x.denominator not in PLAIN for x in values):
        return sign
    return over(sign * gcd(*[x.numerator for x in values]), lcm(*[x.denominator for x in values]))


def _ratio(a: Poly, b: Poly) -> Exact | None:
    """a / b where that is a number."""
    if not a or a.keys() != b.keys():
        return None
    ratios = {over(a[key], b[key]) for key in a}
    return ratios.pop() if len(ratios) == 1 else None


def _halved(a: Poly) -> Poly | None:
    """x of a single term x²."""
    ((monomial, trig), x), *more = a.items()
    if more or trig or x != 1 or any(e % 2 for _, e in monomial):
        return None
    return {(tuple((k, e // 2) for k, e in monomial), ()): x}


def _square_root(x: Exact) -> Exact | None:
    if (
        x <= 0
        or isqrt(x.numerator) ** 2 != x.numerator
        or isqrt(x.denominator) ** 2 != x.denominator
    ):
        return None
    return over(isqrt(x.numerator), isqrt(x.denominator))
