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

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from codegen.reals import FLOAT64, Real
from derive.expressions.instructions import Listing, listing

Array = np.ndarray
EPSILON = float(np.finfo(float).eps) / 2
DRAWS = 8  # the largest of them is below an eighth of the standard deviation once in 10⁸ times
AT_ONCE = 2**24  # numbers that are held at once
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

    def passed(slope: Any, error: Array) -> Array:
        return abs(slope) * error

    def added(code: int, z: Array, operands: list[Array]) -> Array:
        terms = operands if code in SUMS else []
        return EPSILON * np.max(np.abs([z, *terms]), axis=0)

    errors = _Errors(np.zeros_like, lambda numbers: _lost(numbers, real), passed, added)
    return _carried(arguments, value, states, errors, 1)[0]


def estimate(
    arguments: list[ca.SX], value: ca.SX, states: Array, real: Real = FLOAT64, seed: int = 0
) -> Array:
    """The largest roundoff of each entry of a dense `value` in DRAWS draws; arguments, result and
    unit are those of `bound`. Arguments that `real` rounds carry one unit, too."""
    random = np.random.default_rng(seed)

    def drawn(size: Array) -> Array:
        many = np.broadcast_to(size, (len(size), DRAWS, size.shape[-1]))
        return many * random.uniform(-1.0, 1.0, many.shape) if np.any(size) else many

    def given(numbers: Array) -> Array:
        return drawn(_lost(numbers, real))

    errors = _Errors(given, given, np.multiply, lambda _, z, __: drawn(EPSILON * abs(z)))
    return np.max(np.abs(_carried(arguments, value, states, errors, DRAWS)), axis=0)


def _lost(numbers: Array, real: Real) -> Array:
    """What numbers may be off by where `real` cannot hold them."""
    kept = np.reshape([real.nearest(number) for number in numbers.flat], numbers.shape)
    return np.where(kept != numbers, EPSILON * abs(numbers), 0.0)


@dataclass(frozen=True)
class _Errors:
    """What arguments and constants carry, what an operation passes on, and what it adds: all of
    many operations at once, operations × draws × states, where values have one draw."""

    argument: Callable[[Array], Array]
    number: Callable[[Array], Array]
    passed: Callable[[Any, Array], Array]
    added: Callable[[int, Array, list[Array]], Array]


@dataclass(frozen=True)
class _Step:
    """Operations of one code none of which waits for another: where their results and their
    operands stand."""

    code: int
    results: Array
    operands: tuple[Array, ...]


def _steps(program: Listing) -> list[_Step]:
    """The operations of a program, operands before what is made of them, as few steps as there
    are."""
    depths: list[int] = []
    groups: dict[tuple[int, int], list[int]] = {}
    for k, read in enumerate(program.instructions):
        depths.append(1 + max([depths[i] for i in read.operands], default=-1))
        if read.operands:
            groups.setdefault((depths[-1], read.code), []).append(k)
    steps: list[_Step] = []
    for (_, code), members in sorted(groups.items()):
        operands = zip(*[program.instructions[k].operands for k in members])
        steps.append(_Step(code, np.array(members), tuple(map(np.array, operands))))
    return steps


def _carried(
    arguments: list[ca.SX], value: ca.SX, states: Array, errors: _Errors, draws: int
) -> Array:
    """The error of each entry, draws × states × entries."""
    program = listing(ca.Function("program", [ca.vertcat(*arguments)], [value.T]))
    steps, size = _steps(program), len(program.instructions) * (1 + draws)
    parts = np.array_split(states, min(len(states), 1 + size * len(states) // AT_ONCE))
    with np.errstate(all="ignore"):
        found = [_errors_at(program, steps, part, errors, draws) for part in parts]
    return np.concatenate(found, axis=1)


def _errors_at(
    program: Listing, steps: Sequence[_Step], states: Array, errors: _Errors, draws: int
) -> Array:
    read, count = program.instructions, len(program.instructions)
    values, carried = np.empty((count, 1, len(states))), np.zeros((count, draws, len(states)))
    inputs = [k for k, x in enumerate(read) if x.code == ca.OP_INPUT]
    values[inputs, 0] = states.T[[read[k].entry[1] for k in inputs]]
    carried[inputs] = errors.argument(values[inputs])
    numbers = [k for k, x in enumerate(read) if x.code == ca.OP_CONST]
    values[numbers] = np.reshape([read[k].number for k in numbers], (-1, 1, 1))
    carried[numbers] = errors.number(values[numbers])
    for step in steps:
        operands = [values[places] for places in step.operands]
        z, *slopes = formula(step.code, len(operands))(*operands)
        total = np.zeros((len(step.results), draws, len(states)))
        for slope, places in zip(slopes, step.operands):
            error = carried[places]
            # an exact operand passes nothing on, however steep: √0, or 0^1.5 over its exponent
            total += np.where(error == 0.0, 0.0, errors.passed(slope, error))
        values[step.results] = z
        if step.code not in EXACT:
            total += errors.added(step.code, z, operands)
        carried[step.results] = total
    return np.moveaxis(carried[list(program.outputs[0])], 0, -1)


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

    def evaluated(*operands: Array) -> tuple[Array, ...]:
        shape = np.shape(operands[0])
        found = function(*(np.reshape(operand, (1, -1)) for operand in operands))
        return tuple(np.reshape(np.array(x), shape) for x in found)

    return evaluated
