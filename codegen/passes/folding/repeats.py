"""repeats: statements that come again and again with other operands become one body of code and a
table of the places of its operands.

A row of equal loops gives the same operations for each of them. Unrolled, its code grows with the
number of loops; here it grows with the number of kinds of them. Two stretches are alike where their
expressions are, and where each reads the same of what it makes itself: what else they read and what
others read of them stands in arguments, results and the workspace, at places that a rule or a table
gives.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush
from itertools import groupby

import numpy as np

from codegen.passes.schedule import TURNS
from codegen.program import Expression, Section, Statement

FEWEST = 16  # iterations: below it straight-line code is as short
LONGEST_BODY = 256  # statements
TOGETHER = 4  # sines and cosines that are computed at a time for one state

# numbers of these operations are operands like others; what else works on a number needs to see it
_FREE = {"add", "sub", "mul", "div"}

Leaf = str | float


@dataclass(frozen=True)
class Stretch:
    """Blocks of statements that are alike, one after the other in a section."""

    title: str
    blocks: tuple[tuple[Statement, ...], ...]
    leaves: tuple[tuple[Leaf, ...], ...]  # of each block, in the order in which they are read


Stage = Section | Stretch


def stages(sections: Sequence[Section], inputs: Mapping[str, str]) -> list[Stage]:
    """The sections in their order, cut where a stretch of blocks begins or ends. `inputs` says
    which argument an input is an entry of."""
    paired = (_paired(section) if section.title == TURNS else section for section in sections)
    return [stage for section in paired for stage in _of_section(section, inputs)]


def _paired(section: Section) -> Section:
    """Sine and cosine of an angle next to each other: they are computed at once, and in blocks
    apart they would be computed twice."""
    waiting: dict[Expression | None, list[Statement]] = {}
    for statement in section.statements:
        waiting.setdefault(_angle(statement), []).append(statement)
    ordered: list[Statement] = []
    for statement in section.statements:
        angle = _angle(statement)
        ordered += [statement] if angle is None else waiting.pop(angle, [])
    return replace(section, statements=tuple(ordered))


def _angle(statement: Statement) -> Expression | None:
    """Of a sine or a cosine."""
    value = statement.value
    return value[1] if isinstance(value, tuple) and value[0] in ("sin", "cos") else None


def _of_section(section: Section, inputs: Mapping[str, str]) -> Iterator[Stage]:
    statements = section.statements
    known: dict[object, int] = {}
    shapes = np.array([known.setdefault(_shape(s.value), len(known)) for s in statements])
    rest = 0
    for start, length, several in _alike(shapes):
        shift = _shift(statements[start : start + length * several], length)
        first, count = start + shift, several - bool(shift)
        body = _widened(section, first, length, count)
        blocks = [
            statements[first + i * body : first + (i + 1) * body]
            for i in range(length * count // body)
        ]
        for begin, end, leaves in _bound(blocks, inputs):
            if end - begin < FEWEST * length / body:
                continue
            place = first + begin * body
            if place > rest:
                yield Section(section.title, statements[rest:place])
            yield Stretch(section.title, tuple(blocks[begin:end]), tuple(leaves))
            rest = first + end * body
    if rest < len(statements):
        yield Section(section.title, statements[rest:])


def _shape(value: Expression, free: bool = False) -> object:
    """The expression without its operands."""
    if isinstance(value, str):
        return "name"
    if isinstance(value, tuple):
        name = value[0]
        return (name, *(_shape(operand, name in _FREE) for operand in value[1:]))
    return "number" if free else value


def _alike(shapes: np.ndarray) -> list[tuple[int, int, int]]:
    """(first statement, length of a block, number of blocks) of runs that do not overlap, in order:
    those that cover most are taken first, and of others what is left of them."""
    waiting = [
        (-length * count, length, start, count)
        for length in range(1, min(LONGEST_BODY, len(shapes) // FEWEST) + 1)
        for start, count in _runs(shapes, length)
    ]
    heapify(waiting)
    taken = np.zeros(len(shapes), dtype=bool)
    found: list[tuple[int, int, int]] = []
    while waiting:
        _, length, start, count = heappop(waiting)
        here = taken[start : start + length * count]
        if not here.any():
            here[:] = True
            found.append((start, length, count))
            continue
        for first, last in _stretches(~here).tolist():
            rest = (last - first) // length
            if rest >= FEWEST:
                heappush(waiting, (-length * rest, length, start + first, rest))
    return sorted(found)


def _runs(shapes: np.ndarray, length: int) -> Iterator[tuple[int, int]]:
    """First statement and number of blocks of that length, each like the one before."""
    stretches = _stretches(shapes[length:] == shapes[:-length])
    counts = (stretches[:, 1] - stretches[:, 0]) // length + 1
    enough = counts >= FEWEST  # most are short
    yield from zip(stretches[enough, 0].tolist(), counts[enough].tolist())


def _stretches(holds: np.ndarray) -> np.ndarray:
    """Where it holds without a gap, one a row: first, and behind the last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], holds.astype(np.int8), [0]])))
    return edges.reshape(-1, 2)


def _shift(run: Sequence[Statement], length: int) -> int:
    """Where in a run blocks had better begin: where they read least of what others made."""
    middle = (len(run) // length - 2) // 2 * length
    made = {s.name: k for k, s in enumerate(run)}

    def foreign(shift: int) -> int:
        first = middle + shift
        read = {leaf for s in run[first : first + length] for leaf in _leaves(s.value)}
        places = (made.get(leaf, first) for leaf in read if isinstance(leaf, str))
        return sum(place < first for place in places)

    return min(range(length), key=foreign)


def _widened(section: Section, first: int, length: int, count: int) -> int:
    """So many statements that sines and cosines are computed by fours."""
    if section.title != TURNS:
        return length
    angles = {
        s.value[1]
        for s in section.statements[first : first + length]
        if isinstance(s.value, tuple) and s.value[0] in ("sin", "cos")
    }
    several = TOGETHER // math.gcd(len(angles), TOGETHER) if angles else 1
    return length * several if count >= FEWEST * several else length


def _bound(
    blocks: Sequence[tuple[Statement, ...]], inputs: Mapping[str, str]
) -> Iterator[tuple[int, int, list[tuple[Leaf, ...]]]]:
    """Which neighbours are alike in what they read, too: first, last, and their leaves."""
    read = [tuple(leaf for s in block for leaf in _leaves(s.value)) for block in blocks]
    kinds = [_kinds(block, leaves, inputs) for block, leaves in zip(blocks, read)]
    begin = 0
    for _, group in groupby(kinds):
        end = begin + len(list(group))
        yield begin, end, read[begin:end]
        begin = end


def _kinds(
    block: Sequence[Statement], leaves: Sequence[Leaf], inputs: Mapping[str, str]
) -> tuple[object, ...]:
    """Of each leaf: its place in the block, its argument, or that it is a number or something
    else's."""
    own = {s.name: k for k, s in enumerate(block)}
    return tuple(
        own.get(leaf, inputs.get(leaf, "")) if isinstance(leaf, str) else 0.5 for leaf in leaves
    )


def _leaves(value: Expression, free: bool = False) -> Iterator[Leaf]:
    """Names, and numbers that may differ from block to block."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple):
        for operand in value[1:]:
            yield from _leaves(operand, value[0] in _FREE)
    elif free:
        yield value


def with_leaves(value: Expression, leaves: Iterator[Leaf], free: bool = False) -> Expression:
    """The expression with others in their place."""
    if isinstance(value, str):
        return next(leaves)
    if isinstance(value, tuple):
        return (value[0], *(with_leaves(x, leaves, value[0] in _FREE) for x in value[1:]))
    return next(leaves) if free else value
