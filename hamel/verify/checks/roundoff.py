"""How far roundoff alone moves the results of a straight-line program: a bound, and an estimate.

Every operation z = f(a, b) adds half a unit in the last place of z and passes on what its operands
carry. The bound takes all of it at its worst,
    δz = |∂f/∂a| δa + |∂f/∂b| δb + ε |z|          (Wilkinson; Higham, Accuracy and Stability of
    Numerical Algorithms, §3.3)
and grows with every link of a chain, to any size: what cancels in a recursion does not cancel in
it. The estimate draws a number σ between -1 and 1 for every operation,
    δz = ∂f/∂a δa + ∂f/∂b δb + σ ε |z|,           (to first order; Parker, Monte Carlo arithmetic)
and takes the largest of several draws, which is never above the bound.
Two orderings of the same sums and products agree within a small multiple of either, a wrong sign
does not. For that a sum counts as large as its largest term in the bound: a − b of two near numbers
is exact, but a − b + c may be added up as a + c − b, which is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from codegen.reals import FLOAT64, Real
from derive.expressions.instructions import Instruction, listing, run

Array = np.ndarray
EPSILON = float(np.finfo(float).eps) / 2
DRAWS = 8  # the largest of them is below an eighth of the standard deviation once in 10⁸ times
EXACT = (ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_ASSIGN)
SUMS = (ca.OP_ADD, ca.OP_SUB)

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
    nothing = np.zeros(len(states))

    def passed(slope: Any, error: Array) -> Array:
        return abs(slope) * error

    def added(code: int, z: Array, operands: list[Array]) -> Array:
        terms = operands if code in SUMS else []
        return EPSILON * np.max(np.abs([z, *terms]), axis=0)

    errors = _Errors(lambda _: nothing, lambda x: nothing + _lost(x, real), passed, added)
    return _carried(arguments, value, states, errors, nothing)


def estimate(
    arguments: list[ca.SX], value: ca.SX, states: Array, real: Real = FLOAT64, seed: int = 0
) -> Array:
    """The largest roundoff of each entry of a dense `value` in DRAWS draws; arguments, result and
    unit are those of `bound`. Arguments that `real` rounds carry one unit, too."""
    random = np.random.default_rng(seed)
    nothing = np.zeros((DRAWS, len(states)))

    def drawn(size: Array) -> Array:
        return size * random.uniform(-1.0, 1.0, nothing.shape) if np.any(size) else nothing

    def argument(column: Array) -> Array:
        return drawn(np.array([_lost(x, real) for x in column.tolist()]))

    def number(constant: float) -> Array:
        return drawn(np.full(len(states), _lost(constant, real)))

    errors = _Errors(argument, number, np.multiply, lambda _, z, __: drawn(EPSILON * abs(z)))
    return np.max(np.abs(_carried(arguments, value, states, errors, nothing)), axis=0)


def _lost(number: float, real: Real) -> float:
    """What a number may be off by where `real` cannot hold it."""
    return EPSILON * abs(number) if real.nearest(number) != number else 0.0


@dataclass(frozen=True)
class _Errors:
    """What arguments and constants carry, what an operation passes on, and what it adds."""

    argument: Callable[[Array], Array]
    number: Callable[[float], Array]
    passed: Callable[[Any, Array], Array]
    added: Callable[[int, Array, list[Array]], Array]


def _carried(
    arguments: list[ca.SX], value: ca.SX, states: Array, errors: _Errors, nothing: Array
) -> Array:
    """The error of each entry, entries last; `nothing` has the shape of the error of one."""
    program = listing(ca.Function("program", [ca.vertcat(*arguments)], [value.T]))
    columns = states.T

    def operation(read: Instruction, operands: list[tuple[Array, Array]]) -> tuple[Array, Array]:
        z, *slopes = formula(read.code, len(operands))(*(value for value, _ in operands))
        # an exact operand passes nothing on, however steep: √0, or 0^1.5 over its exponent
        parts = [
            np.where(error == 0.0, 0.0, errors.passed(slope, error))
            for slope, (_, error) in zip(slopes, operands)
        ]
        total = parts[0] if len(parts) == 1 else parts[0] + parts[1]
        if read.code in EXACT:
            return z, total
        return z, total + errors.added(read.code, z, [value for value, _ in operands])

    with np.errstate(all="ignore"):
        (results,) = run(
            program,
            entry=lambda _, nonzero: (columns[nonzero], errors.argument(columns[nonzero])),
            number=lambda constant: (np.full(len(states), constant), errors.number(constant)),
            operation=operation,
        )
    entries = np.array([error for _, error in results]).reshape(len(results), *nothing.shape)
    return np.moveaxis(entries, 0, -1)


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
