"""Exact derivatives of a straight-line program by dual numbers: every operation passes on the
tangents of its operands, in NumPy and with derivatives from the table of `roundoff`.

Differences of a fast system lose digits that the derivative has; here only rounding is left.
Source: A. Griewank, A. Walther, Evaluating Derivatives, SIAM 2008, §3.1 (forward propagation).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.expressions.instructions import listing, run
from hamel.verify.checks.roundoff import formula
from hamel.verify.reference.vectors import Array


def tangents(
    arguments: Sequence[ca.SX], value: ca.SX, place: Sequence[Array], directions: Array
) -> Array:
    """d value/dh at place + h · direction for each direction, entries of `value` × directions.

    `value` is an expression over the arguments, columns that together have as many entries as
    each row of `directions`; `place` holds their values.
    """
    column = ca.Function("program", [ca.vertcat(*arguments)], [ca.densify(ca.vec(value))])
    given = np.concatenate([np.ravel(part) for part in place])
    still = np.zeros(len(directions))
    with np.errstate(all="ignore"):
        (results,) = run(
            listing(column),
            lambda _, entry: (given[entry : entry + 1], directions[:, entry]),
            lambda number: (np.full(1, number), still),
            lambda read, operands: _passed_on(read.code, operands),
        )
    result = np.zeros((value.numel(), len(directions)))
    for row, (_, tangent) in zip(result, results):
        row[:] = tangent
    return result


def _passed_on(operation: int, operands: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """z and its tangents, Σ ∂z/∂operand · tangent; a slope that is infinite does not reach what
    stands still."""
    z, *slopes = formula(operation, len(operands))(*(value for value, _ in operands))
    parts = [
        np.where(tangent == 0.0, 0.0, slope * tangent)
        for slope, (_, tangent) in zip(slopes, operands)
    ]
    return z, np.sum(parts, axis=0)
