"""What the pass taylor makes of a function: the recurrences of its Taylor coefficients, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

from codegen.program import Expression, Load, Pivot, Statement


class NoSeries(Exception):
    """An operation without recurrence, or a function that is too long; the message says which."""


@dataclass(frozen=True)
class Slot:
    """Σ lⱼ rₙ₋ⱼ, where lⱼ is that of `left`, times j where `weighted`."""

    left: str
    right: str
    weighted: bool = False


@dataclass(frozen=True)
class Term:
    """sign · factor · coefficient n of `of`; of a number: the sum of that slot, over n where it is
    weighted. The factor is a value at the start of the step."""

    of: str | int
    factor: Expression = 1.0
    sign: int = 1

    def times(self, other: Term, factor: Expression) -> Term:
        """This term of what `other` takes, `factor` being the product of both factors."""
        return Term(self.of, factor, self.sign * other.sign)


@dataclass(frozen=True)
class Step:
    """Coefficient n of `name`: the sum of its terms, of which there is one alone, counted only
    where `condition` (a value at the start) is not zero, if there is a condition."""

    name: str
    terms: tuple[Term, ...]
    condition: Expression | None = None


@dataclass(frozen=True)
class Series:
    """`start` are the values at the start of a step, `steps` the coefficients n > 0 of those that
    have any, `rates` the derivative of the state (then of the work) at the start and in order n."""

    loads: tuple[Load, ...]
    start: tuple[Statement, ...]
    guards: tuple[Pivot, ...]
    steps: tuple[Step, ...]
    slots: tuple[Slot, ...]
    states: tuple[tuple[str, int], ...]  # local names of the state's entries
    inputs: tuple[tuple[str, int], ...]  # and of the inputs', whose coefficients n <= 3 are given
    time: str  # local name of t; empty where it does not occur
    coefficients: dict[str, str] = field(repr=False)
    rates: tuple[tuple[Expression, Expression], ...] = ()
    in_pieces: bool = False  # not analytic everywhere

    def coefficient(self, name: str) -> str:
        """The local that is coefficient n > 0 of a value that varies."""
        return self.coefficients[name]
