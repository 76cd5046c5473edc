"""How many operations a graph needs, after finding equal subexpressions by value numbering.

Counts adds, multiplies, divisions, roots, sines, cosines and other calls once each; signs, copies
and constants not at all. A quick estimate for comparing derivations; the figures in manifests are
those of the emitted program.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import casadi as ca

Nested = TypeVar("Nested", bound=Sequence[Any])

FREE = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}
LEAVES = {ca.OP_CONST, ca.OP_INPUT}
COMMUTES = {ca.OP_ADD, ca.OP_MUL}


def operations(*results: ca.SX) -> int:
    """Distinct counted operations of the graph that gives all the results."""
    return alternatives([ca.vertcat(*[ca.vec(x) for x in results])])[0]


def alternatives(results: Sequence[ca.SX]) -> list[int]:
    """Distinct counted operations that each result needs by itself; what they have in common is
    looked at once."""
    values, users = _numbered(results)
    shares: dict[int, int] = {}  # by who uses them, one bit per result: how many counted values
    for number in reversed(range(len(values))):
        counts, operands = values[number]
        for k in operands:
            users[k] |= users[number]
        shares[users[number]] = shares.get(users[number], 0) + counts
    return [
        sum(count for who, count in shares.items() if who >> k & 1) for k in range(len(results))
    ]


def _numbered(results: Sequence[ca.SX]) -> tuple[list[tuple[bool, tuple[int, ...]]], list[int]]:
    """Of each distinct value, operands before what is made of them: whether it counts, its
    operands, and which results it is an entry of, one bit each."""
    graphs = [ca.vec(ca.SX(x)) for x in results]  # a result of numbers alone may come as a DM
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(ca.vertcat(*graphs)))
    function = ca.Function("count", [symbols], graphs)
    numbers: dict[tuple, int] = {}
    values: list[tuple[bool, tuple[int, ...]]] = []
    slots: dict[int, int] = {}
    entries: list[int] = []
    for k in range(function.n_instructions()):
        op, inputs, outputs = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if op == ca.OP_OUTPUT:
            entries[slots[inputs[0]]] |= 1 << outputs[0]
            continue
        key = _key(function, k, op, inputs, slots)
        number = numbers.setdefault(key, len(values))
        if number == len(values):
            values.append((op not in FREE, () if op in LEAVES else key[1:]))
            entries.append(0)
        slots[outputs[0]] = number
    return values, entries


def _key(function: ca.Function, k: int, op: int, inputs: list[int], slots: dict[int, int]) -> tuple:
    if op == ca.OP_CONST:
        return op, function.instruction_constant(k)
    if op == ca.OP_INPUT:
        return op, *inputs
    operands = [slots[i] for i in inputs]
    return op, *(sorted(operands) if op in COMMUTES else operands)


def cheapest(candidates: Iterable[Nested]) -> Nested:
    """Of equivalent results, each a list of scalars or of rows of scalars, the one that needs the
    fewest operations."""
    known = list(candidates)
    if len(known) == 1:
        return known[0]
    counts = alternatives([_column(entries) for entries in known])
    return known[counts.index(min(counts))]


def _column(entries: Sequence[Any]) -> ca.SX:
    """A list of scalars, or of rows of scalars, as one column."""
    flat = [x for row in entries for x in (row if isinstance(row, list) else [row])]
    return ca.vertcat(*[ca.SX(x) for x in flat])
