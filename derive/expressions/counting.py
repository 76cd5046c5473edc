"""How many operations a graph needs, after finding equal subexpressions by value numbering.

Counts adds, multiplies, divisions, roots, sines, cosines and other calls once each; signs, copies and constants not at all.
A quick estimate for comparing derivations; the figures in manifests are those of the emitted program.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import casadi as ca

Nested = TypeVar("Nested", bound=Sequence[Any])

FREE = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_PARAMETER}
COMMUTES = {ca.OP_ADD, ca.OP_MUL}


def operations(symbols: Sequence[ca.SX], results: Sequence[ca.SX]) -> int:
    """Distinct counted operations of the graph that gives `results` from `symbols`."""
    function = ca.Function("count", list(symbols), list(results), {"allow_free": True})
    numbers: dict[tuple, int] = {}
    slots: dict[int, int] = {}
    counted = 0
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            continue
        key = _key(function, k, op, inputs, slots)
        fresh = key not in numbers
        slots[outputs[0]] = numbers.setdefault(key, len(numbers))
        counted += fresh and op not in FREE
    return counted


def _key(function: ca.Function, k: int, op: int, inputs: list[int], slots: dict[int, int]) -> tuple:
    if op == ca.OP_CONST:
        return op, function.instruction_constant(k)
    if op in (ca.OP_INPUT, ca.OP_PARAMETER):
        return op, *inputs
    operands = [slots[i] for i in inputs]
    return op, *(sorted(operands) if op in COMMUTES else operands)


def cheapest(candidates: Iterable[Nested]) -> Nested:
    """Of equivalent results, each a list of scalars or of rows of scalars, the one that needs the fewest operations."""
    known = list(candidates)
    return known[0] if len(known) == 1 else min(known, key=lambda entries: operations([], [_column(entries)]))


def _column(entries: Sequence[Any]) -> ca.SX:
    flat = [x for row in entries for x in (row if isinstance(row, list) else [row])]
    return ca.vertcat(*[ca.SX(x) for x in flat])
