"""Sums and products of formulas that keep the units of their numbers, for what is checked for
dimensions afterwards."""

from __future__ import annotations

import math

from derive.expressions.dimensions import infer
from derive.expressions.tree import ZERO, Expression, Number, Product, Sum
from derive.expressions.units import NUMBER, pretty
from derive.model import algebra


def negated(a: Expression) -> Expression:
    """−a; of a number a number, of −b again b."""
    if isinstance(a, Number) and a.unit:
        return Number(-a.value, a.unit, a.at)
    return algebra.negated(a)


def times(*factors: Expression) -> Expression:
    """The product, numbers first and folded, in the product of their units."""
    numbers = [factor for factor in factors if isinstance(factor, Number)]
    if not any(number.unit for number in numbers):
        return algebra.times(*factors)
    value = math.prod(number.value for number in numbers)
    if value == 0.0:
        return ZERO
    rest = [factor for factor in factors if not isinstance(factor, Number)]
    first = next(number for number in numbers if number.unit)
    quantity = Number(value, _unit(numbers), first.at)
    return Product((quantity, *rest), first.at) if rest else quantity


def _unit(numbers: list[Number]) -> str:
    """Of their product."""
    dimension = infer(Product(tuple(numbers)), {})
    return pretty(dimension) if isinstance(dimension, tuple) and dimension != NUMBER else ""


def plus(*terms: Expression) -> Expression:
    """The sum, numbers last; they are folded where at most one unit is among them."""
    numbers = [term for term in terms if isinstance(term, Number)]
    units = {number.unit for number in numbers if number.unit}
    if not units:
        return algebra.plus(*terms)
    rest: list[Expression] = [term for term in terms if not isinstance(term, Number)]
    if len(units) == 1:
        value = math.fsum(number.value for number in numbers)
        numbers = [Number(value, units.pop(), numbers[0].at)] if value != 0.0 else []
    parts = [*rest, *numbers]
    return ZERO if not parts else parts[0] if len(parts) == 1 else Sum(tuple(parts), parts[0].at)


def minus(a: Expression, b: Expression) -> Expression:
    """a − b, likewise."""
    return plus(a, negated(b))
