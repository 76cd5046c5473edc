"""Power series of everything in a CasADi function, in fixed-point numbers of as many bits as asked
for.

A series holds integers: term k is the coefficient of sᵏ times 2ᵇⁱᵗˢ, where s runs from 0 to 1 over
one step. Every operation of the graph gives its next term from those before it (R. E. Moore:
Interval Analysis, 1966; A. Griewank, A. Walther: Evaluating Derivatives, 2008, table 13.2), so that
a differential equation grows its own solution.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from operator import mul
from typing import Any

import casadi as ca
import mpmath

from derive.expressions.instructions import listing, run

Rule = Callable[[int], int]  # k → term k


class NotAnalytic(Exception):
    """Something without a power series here; the message says what."""


@dataclass
class Series:
    """A constant has one term and grows no more."""

    terms: list[int] = field(default_factory=list)
    constant: bool = False

    def __getitem__(self, k: int) -> int:
        return self.terms[k] if k < len(self.terms) else 0


@dataclass(frozen=True)
class Fixed:
    """Numbers as multiples of 2⁻ᵇⁱᵗˢ."""

    bits: int

    def of(self, value: float | Fraction) -> int:
        """The integer ⌊value · 2ᵇⁱᵗˢ⌋; a double is a fraction and is taken as it is."""
        fraction = Fraction(value)
        return (fraction.numerator << self.bits) // fraction.denominator

    def fraction(self, number: int) -> Fraction:
        """The exact value of a fixed-point number, number/2ᵇⁱᵗˢ."""
        return Fraction(number, 1 << self.bits)

    def call(self, function: Callable[..., Any], *numbers: int) -> int:
        """A function of mpmath at fixed-point numbers."""
        largest = max(abs(number).bit_length() for number in numbers)
        with mpmath.workprec(2 * self.bits + largest):
            value = function(*[mpmath.ldexp(x, -self.bits) for x in numbers])
            if not isinstance(value, mpmath.mpf) or not mpmath.isfinite(value):
                raise NotAnalytic("a function outside of where it is real and finite")
            return int(mpmath.floor(mpmath.ldexp(value, self.bits)))


class Graph:
    """The instructions of an SX function over series: `outputs` grow by one term at a time, as the
    inputs do."""

    def __init__(
        self, function: ca.Function, fixed: Fixed, inputs: Sequence[Sequence[Series]]
    ) -> None:
        self.fixed, self.bits, self.one = fixed, fixed.bits, 1 << fixed.bits
        self.growing: list[tuple[list[int], Rule]] = []
        self.outputs = run(
            listing(function),
            entry=lambda argument, nonzero: inputs[argument][nonzero],
            number=self.number,
            operation=lambda read, operands: self._result(read.code, operands),
        )

    def grow(self, k: int) -> None:
        """Term k of everything; the inputs must have theirs."""
        for terms, rule in self.growing:
            terms.append(rule(k))

    def number(self, value: float) -> Series:
        """A constant: one term, which is the value itself."""
        return Series([self.fixed.of(value)], True)

    def _result(self, code: int, x: list[Series]) -> Series:
        method = _OPERATIONS.get(code)
        if method is None:
            raise NotAnalytic(f"CasADi's operation {code}")
        return method(self, *x)

    def _grown(self, operands: Sequence[Series], rule: Rule, z: Series | None = None) -> Series:
        """The series of a rule; finished at once where all operands are constants."""
        z = z or Series()
        z.constant = all(x.constant for x in operands)
        if z.constant:
            z.terms.append(rule(0))
        else:
            self.growing.append((z.terms, rule))
        return z

    # ---- Σ over terms

    def _convolved(self, x: Series, y: Series, k: int, first: int = 0) -> int:
        """Σ xᵢ yₖ₋ᵢ, i from `first` to k − `first`."""
        low, high = max(first, k - len(y.terms) + 1), min(k - first, len(x.terms) - 1)
        return (
            sum(map(mul, x.terms[low : high + 1], reversed(y.terms[k - high : k - low + 1])))
            if low <= high
            else 0
        )

    def _weighted(self, x: Series, y: Series, k: int, last: int) -> int:
        """Σ i xᵢ yₖ₋ᵢ, i from 1 to `last`."""
        low, high = max(1, k - len(y.terms) + 1), min(last, len(x.terms) - 1)
        return sum(i * x.terms[i] * y.terms[k - i] for i in range(low, high + 1))

    # ---- operations

    def same(self, x: Series) -> Series:
        """CasADi's assignment: the series itself, not a copy, so that it grows once."""
        return x

    def sum(self, x: Series, y: Series) -> Series:
        """zₖ = xₖ + yₖ."""
        return self._grown((x, y), lambda k: x[k] + y[k])

    def difference(self, x: Series, y: Series) -> Series:
        """zₖ = xₖ − yₖ."""
        return self._grown((x, y), lambda k: x[k] - y[k])

    def negative(self, x: Series) -> Series:
        """zₖ = −xₖ."""
        return self._grown((x,), lambda k: -x[k])

    def twice(self, x: Series) -> Series:
        """zₖ = 2 xₖ."""
        return self._grown((x,), lambda k: 2 * x[k])

    def product(self, x: Series, y: Series) -> Series:
        """zₖ = Σ xᵢ yₖ₋ᵢ, i from 0 to k; one product alone where one of the two is a constant."""
        if y.constant:
            x, y = y, x
        # two numbers with `bits` behind the point make one with twice as many: hence the shift
        if x.constant:
            return self._grown((x, y), lambda k: x.terms[0] * y[k] >> self.bits)
        return self._grown((x, y), lambda k: self._convolved(x, y, k) >> self.bits)

    def square(self, x: Series) -> Series:
        """zₖ = Σ xᵢ xₖ₋ᵢ."""
        return self.product(x, x)

    def quotient(self, x: Series, y: Series) -> Series:
        """y z = x: y₀ zₖ = xₖ − Σ zᵢ yₖ₋ᵢ, i < k. Raises NotAnalytic where y₀ is zero."""
        z = Series()

        def rule(k: int) -> int:
            return ((x[k] << self.bits) - (self._convolved(z, y, k) if k else 0)) // _nonzero(
                y.terms[0]
            )

        return self._grown((x, y), rule, z)

    def inverse(self, x: Series) -> Series:
        """x z = 1, as a quotient."""
        return self.quotient(self.number(1.0), x)

    def root(self, x: Series) -> Series:
        """z² = x: 2 z₀ zₖ = xₖ − Σ zᵢ zₖ₋ᵢ, 0 < i < k. Raises NotAnalytic where x₀ is negative, and
        where it is zero and x varies."""
        z = Series()

        def rule(k: int) -> int:
            if k:
                return ((x[k] << self.bits) - self._convolved(z, z, k, 1)) // (
                    2 * _nonzero(z.terms[0])
                )
            if x.terms[0] < 0:
                raise NotAnalytic("the root of a negative number")
            # z₀² = x₀ in units of 2⁻ᵇⁱᵗˢ: rounded down to a whole number
            return math.isqrt(x.terms[0] << self.bits)

        return self._grown((x,), rule, z)

    def power(self, x: Series, y: Series) -> Series:
        """xʸ: a product for small whole y, else x z′ = y z x′ for a constant y, else exp(y log
        x)."""
        whole = self.fixed.fraction(y.terms[0]) if y.constant else Fraction(1, 2)
        if whole.denominator == 1 and abs(whole) <= 64:
            return self._whole_power(x, int(whole))
        if not y.constant:
            return self.exp(self.product(y, self.log(x)))
        z, a = Series(), y.terms[0]

        def rule(k: int) -> int:
            if k == 0:
                return self.fixed.call(lambda b, c: b**c, x.terms[0], a)
            total = sum(
                (a * i - ((k - i) << self.bits)) * x[i] * z.terms[k - i] for i in range(1, k + 1)
            )
            return (total >> self.bits) // (k * _nonzero(x.terms[0]))

        return self._grown((x,), rule, z)

    def _whole_power(self, x: Series, n: int) -> Series:
        if n < 0:
            return self.inverse(self._whole_power(x, -n))
        result = self.number(1.0)
        for bit in bin(n)[2:]:
            result = self.product(result, result)
            result = self.product(result, x) if bit == "1" else result
        return result

    def _follows(
        self,
        x: Series,
        slope: Series,
        sign: int,
        start: Callable[..., Any],
        z: Series | None = None,
    ) -> Series:
        """z with z′ = ± slope · x′."""

        def rule(k: int) -> int:
            return (
                (sign * self._weighted(x, slope, k, k) >> self.bits) // k
                if k
                else self.fixed.call(start, x.terms[0])
            )

        return self._grown((x,), rule, z)

    def _resists(self, x: Series, w: Series, start: Callable[..., Any]) -> Series:
        """z with w z′ = x′."""
        z = Series()

        def rule(k: int) -> int:
            if k == 0:
                return self.fixed.call(start, x.terms[0])
            return ((k * x[k] << self.bits) - self._weighted(z, w, k, k - 1)) // (
                k * _nonzero(w.terms[0])
            )

        return self._grown((x,), rule, z)

    def exp(self, x: Series) -> Series:
        """z′ = z x′."""
        z = Series()
        return self._follows(x, z, 1, mpmath.exp, z)

    def log(self, x: Series) -> Series:
        """x z′ = x′."""
        return self._resists(x, x, mpmath.log)

    def _pair(
        self, x: Series, sign: int, first: Callable[..., Any], second: Callable[..., Any]
    ) -> list[Series]:
        """s and c with s′ = c x′ and c′ = ± s x′: term k of each needs the other's terms below k
        alone."""
        s, c = Series(), Series()
        self._follows(x, c, 1, first, s)
        self._follows(x, s, sign, second, c)
        return [s, c]

    def sin(self, x: Series) -> Series:
        """The first of the pair s′ = c x′, c′ = −s x′."""
        return self._pair(x, -1, mpmath.sin, mpmath.cos)[0]

    def cos(self, x: Series) -> Series:
        """The second of that pair."""
        return self._pair(x, -1, mpmath.sin, mpmath.cos)[1]

    def tan(self, x: Series) -> Series:
        """sin x/cos x; a division by zero where the cosine vanishes at the start of the step."""
        return self.quotient(*self._pair(x, -1, mpmath.sin, mpmath.cos))

    def sinh(self, x: Series) -> Series:
        """The first of the pair s′ = c x′, c′ = s x′."""
        return self._pair(x, 1, mpmath.sinh, mpmath.cosh)[0]

    def cosh(self, x: Series) -> Series:
        """The second of that pair."""
        return self._pair(x, 1, mpmath.sinh, mpmath.cosh)[1]

    def tanh(self, x: Series) -> Series:
        """1 − 2/(e²ˣ + 1): nothing overflows where it saturates in the negative, and integers never
        do."""
        denominator = self.sum(self.exp(self.twice(x)), self.number(1.0))
        return self.difference(self.number(1.0), self.quotient(self.number(2.0), denominator))

    def _complement(self, x: Series) -> Series:
        return self.root(self.difference(self.number(1.0), self.square(x)))

    def asin(self, x: Series) -> Series:
        """√(1 − x²) z′ = x′."""
        return self._resists(x, self._complement(x), mpmath.asin)

    def acos(self, x: Series) -> Series:
        """π/2 − asin x, π/2 in all bits."""
        half = Series([self.fixed.call(lambda one: mpmath.pi / 2, self.one)], True)
        return self.difference(half, self.asin(x))

    def atan(self, x: Series) -> Series:
        """(1 + x²) z′ = x′."""
        return self._resists(x, self.sum(self.number(1.0), self.square(x)), mpmath.atan)

    def atan2(self, y: Series, x: Series) -> Series:
        """Its value from mpmath, its terms from those of the quotient that stays finite."""
        flat = abs(y.terms[0]) <= abs(x.terms[0]) if y.terms and x.terms else True
        z = (
            self.atan(self.quotient(y, x))
            if flat
            else self.negative(self.atan(self.quotient(x, y)))
        )

        def rule(k: int) -> int:
            return z[k] if k else self.fixed.call(mpmath.atan2, y.terms[0], x.terms[0])

        return self._grown((y, x), rule)

    def hypot(self, x: Series, y: Series) -> Series:
        """√(x² + y²): integers do not overflow, so that nothing has to be scaled first."""
        return self.root(self.sum(self.square(x), self.square(y)))

    # ---- in pieces: as it is at the start of the step

    def absolute(self, x: Series) -> Series:
        """zₖ = ± xₖ with the sign of x₀."""
        return self._grown((x,), lambda k: _sign(x) * x[k])

    def sign(self, x: Series) -> Series:
        """The sign of x₀, without further terms."""
        return self._grown((x,), lambda k: 0 if k else _sign(x) * self.one)

    def least(self, x: Series, y: Series) -> Series:
        """The terms of the one that is less at the start of the step; x where both are the same."""
        return self._grown((x, y), lambda k: x[k] if x.terms[0] <= y.terms[0] else y[k])

    def greatest(self, x: Series, y: Series) -> Series:
        """The terms of the one that is greater at the start of the step; x where both are the
        same."""
        return self._grown((x, y), lambda k: x[k] if x.terms[0] >= y.terms[0] else y[k])

    def _truth(self, operands: Sequence[Series], holds: Callable[[], bool]) -> Series:
        return self._grown(operands, lambda k: self.one * holds() if k == 0 else 0)

    def less(self, x: Series, y: Series) -> Series:
        """1 where x₀ < y₀, else 0; without further terms."""
        return self._truth((x, y), lambda: x.terms[0] < y.terms[0])

    def at_most(self, x: Series, y: Series) -> Series:
        """1 where x₀ ≤ y₀, else 0; without further terms."""
        return self._truth((x, y), lambda: x.terms[0] <= y.terms[0])

    def no(self, x: Series) -> Series:
        """1 where x₀ is zero, else 0; without further terms."""
        return self._truth((x,), lambda: x.terms[0] == 0)

    def where(self, condition: Series, x: Series) -> Series:
        """The terms of x where the condition holds at the start of the step, else zeros."""
        return self._grown((condition, x), lambda k: x[k] if condition.terms[0] else 0)


def _nonzero(x: int) -> int:
    if x == 0:
        raise NotAnalytic("a division by zero")
    return x


def _sign(x: Series) -> int:
    return (x.terms[0] > 0) - (x.terms[0] < 0)


_OPERATIONS: dict[int, Callable[..., Series]] = {
    ca.OP_ASSIGN: Graph.same,
    ca.OP_ADD: Graph.sum,
    ca.OP_SUB: Graph.difference,
    ca.OP_MUL: Graph.product,
    ca.OP_DIV: Graph.quotient,
    ca.OP_NEG: Graph.negative,
    ca.OP_EXP: Graph.exp,
    ca.OP_LOG: Graph.log,
    ca.OP_POW: Graph.power,
    ca.OP_CONSTPOW: Graph.power,
    ca.OP_SQRT: Graph.root,
    ca.OP_SQ: Graph.square,
    ca.OP_TWICE: Graph.twice,
    ca.OP_SIN: Graph.sin,
    ca.OP_COS: Graph.cos,
    ca.OP_TAN: Graph.tan,
    ca.OP_ASIN: Graph.asin,
    ca.OP_ACOS: Graph.acos,
    ca.OP_ATAN: Graph.atan,
    ca.OP_ATAN2: Graph.atan2,
    ca.OP_SINH: Graph.sinh,
    ca.OP_COSH: Graph.cosh,
    ca.OP_TANH: Graph.tanh,
    ca.OP_INV: Graph.inverse,
    ca.OP_HYPOT: Graph.hypot,
    ca.OP_FABS: Graph.absolute,
    ca.OP_SIGN: Graph.sign,
    ca.OP_FMIN: Graph.least,
    ca.OP_FMAX: Graph.greatest,
    ca.OP_LT: Graph.less,
    ca.OP_LE: Graph.at_most,
    ca.OP_NOT: Graph.no,
    ca.OP_IF_ELSE_ZERO: Graph.where,
}
