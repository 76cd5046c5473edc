"""What is nothing but rounding: sums that cancel identically, to some last digits.

Beside each value of a program runs a bound on its error, as rounding of every operation and of
every constant makes it (Wilkinson, Rounding Errors in Algebraic Processes, 1963). A value within
its own error, whatever the arguments are, is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from derive.expressions.instructions import Instruction, listing, run
from derive.expressions.limits import ERRORS, FOLDED

Pair = tuple[np.ndarray, np.ndarray]  # values at some places, and bounds on their errors in ε


def vanishing(
    column: ca.SX, arguments: Sequence[ca.SX], places: Sequence[np.ndarray]
) -> np.ndarray:
    """Which entries of a column are rounding at all places (one row each for every argument)."""
    program = listing(ca.Function("entries", list(arguments), [ca.densify(column)]))
    count, epsilon = len(places[0]), np.finfo(float).eps
    largest = max((abs(i.number) for i in program.instructions), default=0.0)

    def entry(argument: int, nonzero: int) -> Pair:
        return places[argument][:, nonzero], np.zeros(count)

    def number(value: float) -> Pair:
        """A tiny one may be what is left of larger ones, which cancelled before."""
        left = FOLDED * max(1.0, largest)
        error = left if abs(value) <= epsilon * left else abs(value)
        return np.full(count, value), np.full(count, error)

    with np.errstate(all="ignore"):
        (found,) = run(program, entry, number, _operation)
        return np.array([bool(np.all(np.abs(x) <= ERRORS * epsilon * e)) for x, e in found])


# of a and b, with errors da and db: the value, and its error before it is rounded itself
OPERATIONS: dict[int, Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], Pair]] = {
    ca.OP_ADD: lambda a, da, b, db: (a + b, da + db),
    ca.OP_SUB: lambda a, da, b, db: (a - b, da + db),
    ca.OP_NEG: lambda a, da, b, db: (-a, da),
    ca.OP_MUL: lambda a, da, b, db: (a * b, np.abs(a) * db + np.abs(b) * da),
    ca.OP_SQ: lambda a, da, b, db: (a * a, 2 * np.abs(a) * da),
    ca.OP_TWICE: lambda a, da, b, db: (2 * a, 2 * da),
    ca.OP_DIV: lambda a, da, b, db: (a / b, (da + np.abs(a / b) * db) / np.abs(b)),
    ca.OP_INV: lambda a, da, b, db: (1 / a, da / (a * a)),
    ca.OP_SQRT: lambda a, da, b, db: (np.sqrt(a), da / np.sqrt(np.abs(a))),
    ca.OP_SIN: lambda a, da, b, db: (np.sin(a), np.abs(np.cos(a)) * da),
    ca.OP_COS: lambda a, da, b, db: (np.cos(a), np.abs(np.sin(a)) * da),
}


def _operation(read: Instruction, operands: list[Pair]) -> Pair:
    """One operation and its error; no number where it is none of those that closures are made of,
    so that nothing is told."""
    (a, da), (b, db) = operands[0], operands[-1]
    if read.code not in OPERATIONS:
        return np.full_like(a, np.nan), np.zeros_like(a)
    value, error = OPERATIONS[read.code](a, da, b, db)
    return value, error + np.abs(value)
