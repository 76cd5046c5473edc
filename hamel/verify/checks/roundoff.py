"""Running error analysis: how far roundoff alone can move the results of a straight-line program.

Every operation z = f(a, b) adds half a unit in the last place of z and passes on what its operands
carry:
    δz = |∂f/∂a| δa + |∂f/∂b| δb + ε |z|          (Wilkinson; Higham, Accuracy and Stability of
    Numerical Algorithms, §3.3)
Two orderings of the same sums and products agree within a small multiple of the bound, a wrong sign
does not.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np

from codegen.reals import FLOAT64, Real
from derive.expressions.instructions import listing, run

Array = np.ndarray
EPSILON = float(np.finfo(float).eps) / 2
EXACT = (ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_ASSIGN)

# operands → z, then ∂z/∂operand of each; the rest is differentiated by CasADi
COMMON: dict[int, Callable[..., tuple]] = {
    ca.OP_ADD: lambda a, b: (a + b, 1.0, 1.0),
    ca.OP_SUB: lambda a, b: (a - b, 1.0, -1.0),
    ca.OP_MUL: lambda a, b: (a * b, b, a),
    ca.OP_DIV: lambda a, b: (a / b, 1.0 / b, -a / b**2),
    ca.OP_NEG: lambda a: (-a, -1.0),
    ca.OP_SQ: lambda a: (a * a, 2.0 * a),
    ca.OP_TWICE: lambda a: (2.0 * a, 2.0),
    ca.OP_INV: lambda a: (1.0 / a, -1.0 / a**2),
    ca.OP_SIN: lambda a: (np.sin(a), np.cos(a)),
    ca.OP_COS: lambda a: (np.cos(a), -np.sin(a)),
    ca.OP_SQRT: lambda a: (np.sqrt(a), 0.5 / np.sqrt(a)),
}


def bound(arguments: list[ca.SX], value: ca.SX, states: Array, real: Real = FLOAT64) -> Array:
    """The bound of each entry of a dense `value` (row by row), states × entries.

    `value` is an expression over the arguments; `states` holds their entries, states × all
    arguments, and counts as exact. The bound is in terms of double's unit of rounding, whatever the
    precision `real`; constants that it rounds carry one unit.
    """
    program = listing(ca.Function("program", [ca.vertcat(*arguments)], [value.T]))
    columns, nothing = states.T, np.zeros(len(states))

    def number(constant: float) -> tuple[Array, Array]:
        carried = EPSILON * abs(constant) if real.nearest(constant) != constant else 0.0
        return np.full(len(states), constant), nothing + carried

    with np.errstate(all="ignore"):
        (results,) = run(
            program,
            entry=lambda _, nonzero: (columns[nonzero], nothing),
            number=number,
            operation=lambda read, operands: _operation(read.code, operands),
        )
    bounds = [error for _, error in results]
    return np.array(bounds).reshape(len(bounds), len(states)).T


def _operation(operation: int, operands: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """z and the bound of its error."""
    z, *slopes = formula(operation, len(operands))(*(value for value, _ in operands))
    carried = [abs(slope) * error for slope, (_, error) in zip(slopes, operands)]
    passed = carried[0] if len(carried) == 1 else carried[0] + carried[1]
    return z, passed if operation in EXACT else passed + EPSILON * abs(z)


def formula(operation: int, count: int) -> Callable[..., tuple]:
    """Operands → z and its derivative by each, as arrays."""
    return COMMON.get(operation) or _differentiated(operation, count)


@cache
def _differentiated(operation: int, count: int) -> Callable[..., tuple]:
    symbols = [ca.SX.sym(name) for name in "ab"[:count]]
    z = ca.SX.unary(operation, *symbols) if count == 1 else ca.SX.binary(operation, *symbols)
    function = ca.Function(
        "slopes", symbols, [z, *(ca.densify(ca.jacobian(z, symbol)) for symbol in symbols)]
    )
    return lambda *operands: tuple(
        np.ravel(np.array(x)) for x in function(*(operand[np.newaxis, :] for operand in operands))
    )
