"""Roots of what is kept from falling below zero, such as √max(x, 0): the flow out of a tank.

Below zero their derivative is 0 · ∞ as differentiation writes it, and is 0. With the least number
that a model may have in the place of zero it is finite, and comes out as 0.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from derive.expressions.instructions import Instruction, Listing, listing, run

LEAST = 1e-60  # in SI units, as of numbers in a model: its root and the root's slopes are finite
ROOTS = (ca.OP_SQRT, ca.OP_POW, ca.OP_CONSTPOW)
# zero where an operand is; of a quotient, where its first one is
PASSING = (ca.OP_MUL, ca.OP_DIV, ca.OP_SQ, ca.OP_NEG, ca.OP_TWICE, ca.OP_FMIN, ca.OP_FMAX)


def has_bounded_roots(value: ca.SX) -> bool:
    """Whether a root is taken of what max(…, 0) or ramp(…) keeps from falling below zero."""
    return any(_bounds(_program(value)))


def finite_jacobian(value: ca.SX, by: ca.SX) -> ca.SX:
    """∂value/∂by, n × m, with slopes that are numbers."""
    slopes = ca.jacobian(value, by)
    return with_finite_slopes(slopes) if has_bounded_roots(value) else slopes


def with_finite_slopes(value: ca.SX) -> ca.SX:
    """The same derivative, r × c, with LEAST in the place of zero where a root is taken of
    max(…, 0)."""
    program = _program(value)
    bounds = set(_bounds(program))
    if not bounds:
        return value
    symbols = ca.vertcat(*ca.symvar(value))
    made: list[ca.SX] = []  # by the number of the instruction, for these are run in order

    def kept(x: ca.SX) -> ca.SX:
        made.append(x)
        return x

    def operation(read: Instruction, operands: list[ca.SX]) -> ca.SX:
        if len(made) in bounds:
            operands = [ca.SX(LEAST) if x.is_zero() else x for x in operands]
        one = len(operands) == 1
        made_of = ca.SX.unary(read.code, *operands) if one else ca.SX.binary(read.code, *operands)
        return kept(made_of)

    (entries,) = run(program, lambda _, k: kept(symbols[k]), lambda x: kept(ca.SX(x)), operation)
    return ca.reshape(ca.vertcat(*entries), value.size1(), value.size2())


def _program(value: ca.SX) -> Listing:
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(value))
    return listing(ca.Function("value", [symbols], [ca.densify(ca.vec(value))]))


def _bounds(program: Listing) -> Iterator[int]:
    """The max(…, 0) that roots are taken of, by their numbers."""
    read = program.instructions
    seen: set[int] = set()
    left = [x.operands[0] for x in read if x.code in ROOTS]
    while left:
        k = left.pop()
        if k in seen or read[k].code not in PASSING:
            continue
        seen.add(k)
        left += read[k].operands[: 1 if read[k].code == ca.OP_DIV else None]
        zeros = [i for i in read[k].operands if read[i].code == ca.OP_CONST and not read[i].number]
        if read[k].code == ca.OP_FMAX and zeros:
            yield k
