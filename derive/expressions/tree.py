"""The expression tree: what a formula in a model file is after parsing, before any library sees it.

Nodes are frozen, compare by value, and carry `at`, the offset in the source text, for messages only.
Sums and products are n-ary so that a formula of ten thousand terms is one node, not ten thousand levels.
Numbers are already in SI units. Names are resolved by derive.model, never here.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Number:
    value: float
    unit: str = ""
    at: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Name:
    """A parameter, coordinate, input, definition, `t`, or a base velocity such as `base.vx`."""

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
