"""Small changes, carried through a straight-line program: what an operation z = f(a, b) makes of
the changes δa and δb of its operands,

    δz = ∂f/∂a δa + ∂f/∂b δb + what it adds.

Roundoff and tangents are changes. Operations that do not wait for each other are computed at once,
for all states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from derive.expressions.instructions import Listing, listing
from hamel.verify.reference.vectors import Array

AT_ONCE = 2**24  # numbers that are held at once

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


@dataclass(frozen=True)
class Changes:
    """What arguments (the values of all of them → changes) and constants change by, what an
    operation passes on (code, slope, change), and what it adds (code, z, operands, their changes).
    Values are operations × 1 × states, changes operations × kinds × states."""

    argument: Callable[[Array], Array]
    number: Callable[[Array], Array]
    passed: Callable[[int, Any, Array], Array]
    added: Callable[[int, Array, list[Array], list[Array]], Array]


def carried(
    arguments: Sequence[ca.SX], value: ca.SX, states: Array, changes: Changes, kinds: int
) -> Array:
    """The change of each entry of a dense `value` (row by row), kinds × states × entries; `states`
    holds the arguments' entries, states × all arguments."""
    program = listing(ca.Function("program", [ca.vertcat(*arguments)], [ca.densify(value.T)]))
    steps, size = _steps(program), len(program.instructions) * (1 + kinds)
    parts = np.array_split(states, min(max(1, len(states)), 1 + size * len(states) // AT_ONCE))
    with np.errstate(all="ignore"):
        found = [_at(program, steps, part, changes, kinds) for part in parts]
    return np.concatenate(found, axis=1)


@dataclass(frozen=True)
class _Step:
    """Operations of one code none of which waits for another: where their results and their
    operands stand."""

    code: int
    results: Array
    operands: tuple[Array, ...]


def _steps(program: Listing) -> list[_Step]:
    """The operations of a program, operands before what is made of them, in as few steps as there
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


def _at(
    program: Listing, steps: Sequence[_Step], states: Array, changes: Changes, kinds: int
) -> Array:
    read, count = program.instructions, len(program.instructions)
    values, changed = np.empty((count, 1, len(states))), np.zeros((count, kinds, len(states)))
    inputs = [k for k, x in enumerate(read) if x.code == ca.OP_INPUT]
    places = [read[k].entry[1] for k in inputs]
    given = states.T[:, np.newaxis]
    values[inputs], changed[inputs] = given[places], changes.argument(given)[places]
    numbers = [k for k, x in enumerate(read) if x.code == ca.OP_CONST]
    values[numbers] = np.reshape([read[k].number for k in numbers], (-1, 1, 1))
    changed[numbers] = changes.number(values[numbers])
    for step in steps:
        operands = [values[these] for these in step.operands]
        z, *slopes = formula(step.code, len(operands))(*operands)
        total = np.zeros((len(step.results), kinds, len(states)))
        given_changes = [changed[these] for these in step.operands]
        for slope, change in zip(slopes, given_changes):
            # what does not change passes nothing on, however steep: √0, or 0^1.5 over its exponent
            total += np.where(change == 0.0, 0.0, changes.passed(step.code, slope, change))
        values[step.results] = z
        changed[step.results] = total + changes.added(step.code, z, operands, given_changes)
    return np.moveaxis(changed[list(program.outputs[0])], 0, -1)


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
