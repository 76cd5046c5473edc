"""How many operations a graph needs, after finding equal subexpressions by value numbering.

Counts adds, multiplies, divisions, roots, sines, cosines and other calls once each; signs, copies
and constants not at all. A quick estimate for comparing derivations; the figures in manifests are
those of the emitted program.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeVar

import casadi as ca

from derive.expressions.instructions import listing
from derive.expressions.scalars import Scalar, Vector

Key = tuple[int, tuple[int, int], float, tuple[int, ...]]  # what makes two values the same
Nested = TypeVar("Nested", bound=Sequence[Scalar] | Sequence[Vector])

FREE = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT}
COMMUTES = {ca.OP_ADD, ca.OP_MUL}


def operations(*results: ca.SX) -> int:
    """Distinct counted operations of the graph that gives all the results."""
    return alternatives([ca.vertcat(*[ca.vec(x) for x in results])])[0]


def instructions(result: ca.SX) -> int:
    """What CasADi runs for a result: like `operations`, but equal subexpressions that were written
    twice count twice. For graphs of which there is no other to compare with, it takes no time."""
    symbols = ca.vertcat(ca.SX(0, 1), *ca.symvar(result))
    function = ca.Function("count", [symbols], [result])
    return function.n_instructions() - symbols.numel() - function.nnz_out(0)


def alternatives(results: Sequence[ca.SX]) -> list[int]:
    """Distinct counted operations that each result needs by itself; what they have in common is
    looked at once. Equal subexpressions count once, also where a + b stands as b + a."""
    if not results:  # CasADi makes no function without results
        return []
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
    program = listing(function)
    numbers: dict[Key, int] = {}
    values: list[tuple[bool, tuple[int, ...]]] = []
    numbered: list[int] = []  # for every instruction the number of its value
    for read in program.instructions:
        operands = [numbered[k] for k in read.operands]
        if read.code in COMMUTES:
            operands.sort()
        key = (read.code, read.entry, read.number, tuple(operands))
        number = numbers.setdefault(key, len(values))
        if number == len(values):
            values.append((read.code not in FREE, key[3]))
        numbered.append(number)
    users = [0] * len(values)
    for bit, output in enumerate(program.outputs):
        for k in output:
            users[numbered[k]] |= 1 << bit
    return values, users


def cheapest(candidates: Iterable[Nested]) -> Nested:
    """Of equivalent results, each a list of scalars or of rows of scalars, the one that needs the
    fewest operations."""
    known = list(candidates)
    if len(known) == 1:
        return known[0]
    counts = alternatives([_column(entries) for entries in known])
    return known[counts.index(min(counts))]


def _column(entries: Sequence[Scalar] | Sequence[Vector]) -> ca.SX:
    """A list of scalars, or of rows of scalars, as one column."""
    flat: list[ca.SX] = []
    for row in entries:
        flat += [ca.SX(x) for x in row] if isinstance(row, list) else [ca.SX(row)]
    return ca.vertcat(*flat)
