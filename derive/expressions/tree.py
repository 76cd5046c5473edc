"""The expression tree: what a formula in a model file is after parsing, before any library sees it.

Nodes are frozen, compare by value, and carry `at`, the offset in the source text, for messages
only. Sums and products are n-ary so that a formula of ten thousand terms is one node, not ten
thousand levels. Numbers are already in SI units. Names are resolved by derive.model, never here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any


@dataclass(frozen=True)
class Number:
    """A number in SI, and the SI unit that was written with it."""

    value: float
    unit: str = ""
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Name:
    """A parameter, coordinate, input, definition, `t`, or a generalized velocity such as
    `base.vx`."""

    name: str
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Rate:
    """der(q): the time derivative of the coordinate `name`."""

    name: str
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Sum:
    terms: tuple[Expression, ...]
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Product:
    factors: tuple[Expression, ...]
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Quotient:
    numerator: Expression
    denominator: Expression
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Power:
    base: Expression
    exponent: Expression
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Negative:
    argument: Expression
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Call:
    """A function of FUNCTIONS (derive.expressions.functions) applied to its arguments."""

    function: str
    arguments: tuple[Expression, ...]
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Vector:
    """[a, b] or [a, b, c]: a point or direction inside an output such as position(body, [a, b])."""

    entries: tuple[Expression, ...]
    at: int = field(default=0, compare=False)


Expression = Number | Name | Rate | Sum | Product | Quotient | Power | Negative | Call | Vector

ZERO = Number(0.0)
ONE = Number(1.0)


def children(expression: Expression) -> tuple[Expression, ...]:
    """The direct operands, left to right."""
    operands = _OPERANDS.get(type(expression))
    return operands(expression) if operands else ()


def _argument(negative: Negative) -> tuple[Expression, ...]:
    return (negative.argument,)


# by type: leaves, which have none, are asked most
_OPERANDS: dict[type, Callable[[Any], tuple[Expression, ...]]] = {
    Sum: attrgetter("terms"),
    Product: attrgetter("factors"),
    Quotient: attrgetter("numerator", "denominator"),
    Power: attrgetter("base", "exponent"),
    Negative: _argument,
    Call: attrgetter("arguments"),
    Vector: attrgetter("entries"),
}


def walk(expression: Expression) -> Iterator[Expression]:
    """Every node, operands before the node they belong to; no recursion."""
    stack = [(expression, False)]
    while stack:
        node, expanded = stack.pop()
        if expanded or not (operands := children(node)):
            yield node
            continue
        stack.append((node, True))
        stack.extend((operand, False) for operand in reversed(operands))


def rebuilt(expression: Expression, leaf: Callable[[Expression], Expression]) -> Expression:
    """The same tree with every leaf replaced by leaf(leaf)."""
    operands = tuple(rebuilt(operand, leaf) for operand in children(expression))
    match expression:
        case Sum(_, at):
            return Sum(operands, at)
        case Product(_, at):
            return Product(operands, at)
        case Quotient(_, _, at):
            return Quotient(operands[0], operands[1], at)
        case Power(_, _, at):
            return Power(operands[0], operands[1], at)
        case Negative(_, at):
            return Negative(operands[0], at)
        case Call(function, _, at):
            return Call(function, operands, at)
        case Vector(_, at):
            return Vector(operands, at)
        case _:
            pass
    return leaf(expression)
