"""Inputs that arrive late: Padé's approximation of a pure delay, with first-order states.

    u_late/u = e^(−sT) ≈ N(s)/D(s),  D = Σ dₖ (sT)ᵏ,  N = Σ (−1)ᵏ dₖ (sT)ᵏ,
    dₖ = (2n − k)! n!/((2n)! k! (n − k)!)

of order n over n: every frequency passes with its full size, and the phase is right to order 2n + 1
(Padé 1892). With D y = u the states are zₖ = Tᵏ y⁽ᵏ⁾, in the unit of the input:

    T żₖ = zₖ₊₁,   T żₙ₋₁ = (u − Σ dₖ zₖ)/dₙ,   u_late = (−1)ⁿ u + Σ ((−1)ᵏ − (−1)ⁿ) dₖ zₖ
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import factorial
from typing import TYPE_CHECKING

from derive.expressions.tree import ZERO, Expression, Name, Number, Quotient
from derive.model import algebra
from derive.model.document import Scalar
from derive.model.language.entries import InputEntry
from derive.model.load_records import GeneralisedForce
from derive.model.reader import Reader
from derive.model.records import FirstOrderState, Input, Model, Span
from derive.model.scope import INPUT, STATE, Symbol

if TYPE_CHECKING:
    from derive.model.language.shape import Document

USUAL, MOST = 2, 10  # order: of a delay that says none, and at most: then coefficients are 1e-12


def late(name: str) -> str:
    """What formulas call an input as it arrives."""
    return f"{name}_late"


def _state(name: str, k: int) -> str:
    return f"{late(name)}{k + 1}"


@dataclass(frozen=True)
class Delay:
    """An input that arrives after `time` (s), by an approximation of some order."""

    input: Input
    time: Expression
    order: int

    @property
    def names(self) -> tuple[tuple[str, Span], ...]:
        """What it brings: the input as it arrives, and its states."""
        name, span = self.input.name, self.input.span
        return ((late(name), span), *((_state(name, k), span) for k in range(self.order)))


def delays(reader: Reader, document: Document, inputs: Sequence[Input]) -> tuple[Delay, ...]:
    """Those of the file, made known to formulas. A delay that is no time above zero, and an order
    that is no whole number, are reported."""
    found = (_delay(reader, entry, x) for entry, x in zip(document.inputs.values(), inputs))
    result = tuple(each for each in found if each is not None)
    for each in result:
        symbol = reader.scope.symbols[each.input.name]
        kinds = frozenset({INPUT, STATE})
        reader.scope.add(late(each.input.name), Symbol(kinds, symbol.dimension))
    return result


def _delay(reader: Reader, entry: InputEntry, given: Input) -> Delay | None:
    if entry.delay is None:
        if entry.delay_order is not None:
            message = f"an order without a delay of '{given.name}'"
            reader.report(entry.delay_order.span, message, "delay: a time, such as 20 ms")
        return None
    time = reader.of_parameters(entry.delay, f"the delay of {given.name}", "s")
    value = reader.value(time, entry.delay)
    if value is not None and value <= 0.0:
        message = f"the delay of '{given.name}' is {value:g} s"
        reader.report(entry.delay.span, message, "more than zero; without a delay leave it out")
    return Delay(given, time, _order(reader, given, entry.delay_order))


def _order(reader: Reader, given: Input, scalar: Scalar | None) -> int:
    if scalar is None:
        return USUAL
    value = reader.value(reader.of_parameters(scalar, "an order", ""), scalar)
    if value is not None and (value != int(value) or not 1 <= value <= MOST):
        message = f"the order of the delay of '{given.name}' is {value:g}"
        reader.report(scalar.span, message, f"a whole number from 1 to {MOST}")
        return USUAL
    return int(value or USUAL)


def coefficients(n: int) -> tuple[float, ...]:
    """d₀ … dₙ, d₀ = 1."""
    whole = factorial(2 * n)
    return tuple(
        factorial(2 * n - k) * factorial(n) / (whole * factorial(k) * factorial(n - k))
        for k in range(n + 1)
    )


def with_delays(model: Model, found: Sequence[Delay]) -> Model:
    """The model with the states of its delays; what drives a velocity is the input as it
    arrives."""
    driving = [x for x in found if x.input.velocity]
    inert = {x.input.name for x in driving}
    forces = (
        GeneralisedForce(
            late(x.input.name),
            x.input.velocity,
            algebra.times(x.input.gear, Name(late(x.input.name))),
            x.input.span,
        )
        for x in driving
    )
    return replace(
        model,
        inputs=tuple(replace(x, velocity="") if x.name in inert else x for x in model.inputs),
        definitions=(*((late(x.input.name), _arriving(x)) for x in found), *model.definitions),
        states=(*model.states, *(state for x in found for state in _states(x))),
        loads=(*model.loads, *forces),
    )


def _arriving(delay: Delay) -> Expression:
    d, sign = coefficients(delay.order), (-1.0) ** delay.order
    u = algebra.times(Number(sign), Name(delay.input.name))
    return algebra.plus(
        u,
        *(
            algebra.times(Number(((-1.0) ** k - sign) * d[k]), Name(_state(delay.input.name, k)))
            for k in range(delay.order)
        ),
    )


def _states(delay: Delay) -> tuple[FirstOrderState, ...]:
    name, n, d = delay.input.name, delay.order, coefficients(delay.order)
    z = [Name(_state(name, k)) for k in range(n)]
    held = algebra.plus(*(algebra.times(Number(d[k]), z[k]) for k in range(n)))
    last = algebra.times(Number(1.0 / d[n]), algebra.minus(Name(name), held))
    rates = [Quotient(x, delay.time) for x in (*z[1:], last)]
    about = f"of the delay of {name}"
    unit, span = delay.input.unit, delay.input.span
    return tuple(
        FirstOrderState(z[k].name, rates[k], ZERO, None, unit, about, span) for k in range(n)
    )
