"""How a formula depends on the velocities: the lowest and highest degree of its terms, read off the
structure.

Structural means that (a + der(x))**2 - der(x)**2 counts as quadratic although its squares cancel:
write it out.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

from derive.expressions import tree
from derive.expressions.tree import Expression


class Degree(NamedTuple):
    """Degrees in the velocities of the terms of a formula; (0, 0) without velocities, highest = inf
    where it is no polynomial."""

    lowest: float
    highest: float


FREE = Degree(0, 0)
NONLINEAR = Degree(0, math.inf)
_NOTHING = Degree(math.inf, -math.inf)  # a sum without terms: the number zero


def degree(
    expression: Expression,
    velocities: Collection[str] = (),
    definitions: Mapping[str, Degree] | None = None,
) -> Degree:
    """Degree in all rates der(q) and in the names in `velocities`; `definitions` gives the degree
    of defined names. A row of constraints or quasi-velocities is to be of degree one at most."""
    stack: list[Degree] = []
    for node in tree.walk(expression):
        count = len(tree.children(node))
        operands = stack[len(stack) - count :] if count else []
        if count:
            del stack[len(stack) - count :]
        stack.append(_of(node, operands, velocities, definitions or {}))
    result = stack[0]
    return FREE if result == _NOTHING else result


def _of(
    node: Expression,
    operands: list[Degree],
    velocities: Collection[str],
    definitions: Mapping[str, Degree],
) -> Degree:
    match node:
        case tree.Number(value):
            return _NOTHING if value == 0.0 else FREE
        case tree.Rate():
            return Degree(1, 1)
        case tree.Name(name):
            return Degree(1, 1) if name in velocities else definitions.get(name, FREE)
        case tree.Sum() | tree.Vector():
            return Degree(min(d.lowest for d in operands), max(d.highest for d in operands))
        case tree.Negative():
            return operands[0]
        case tree.Product():
            return _product(operands)
        case tree.Quotient():
            return _quotient(operands[0], operands[1])
        case tree.Power(_, exponent):
            return _power(operands[0], operands[1], exponent)
        case _:
            pass
    return FREE if all(d.highest <= 0 for d in operands) else NONLINEAR


def _product(factors: list[Degree]) -> Degree:
    if _NOTHING in factors:
        return _NOTHING
    return Degree(sum(d.lowest for d in factors), sum(d.highest for d in factors))


def _quotient(above: Degree, below: Degree) -> Degree:
    return above if below.highest <= 0 else NONLINEAR


def _power(base: Degree, exponent: Degree, written: Expression) -> Degree:
    if base.highest <= 0 and exponent.highest <= 0:
        return FREE
    if isinstance(written, tree.Number) and written.value.is_integer() and written.value >= 0:
        return Degree(base.lowest * written.value, base.highest * written.value)
    return NONLINEAR
