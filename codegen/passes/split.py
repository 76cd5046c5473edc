"""split: a long function as parts over a workspace, because a compiler's time grows faster than the
length of a function.

What one part computes and another needs is kept in a slot of the workspace, which is given to other
values after its last use.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from codegen.program import Expression, Kernel, Load, Pivot, Section, Statement

WHOLE = 1_000  # statements that a function may have and stay in one piece
READ = 1_000  # entries of arguments that it may read, likewise
LONGEST = 250  # statements in one part of a longer one
COPIED = 500  # results from which on a loop copies them

Slot = tuple[str, int]  # a local name and its place in the workspace


@dataclass(frozen=True)
class Copy:
    """`count` results from `first` on are the entries of an argument from `index` on."""

    first: int
    argument: str
    index: int
    count: int


@dataclass
class Part:
    """Statements with what they take from the workspace and what they leave in it; `outputs` are
    numbered, `copies` are further ones."""

    loads: tuple[Load, ...] = ()
    taken: list[Slot] = field(default_factory=list[Slot])
    sections: tuple[Section, ...] = ()
    outputs: list[tuple[int, Expression]] = field(default_factory=list[tuple[int, Expression]])
    guards: list[Pivot] = field(default_factory=list[Pivot])
    kept: list[Slot] = field(default_factory=list[Slot])
    residual: Expression | None = None
    copies: tuple[Copy, ...] = ()


@dataclass(frozen=True)
class Parts:
    """`size` is the length of the workspace; a short function is one part without any."""

    parts: tuple[Part, ...]
    size: int


def split(kernel: Kernel) -> Parts:
    """The kernel in parts of at most LONGEST statements, or as it is where it is short.

    A result or guard belongs to the first part after which all that it needs is known; the residual
    of a loop to the last. The sequence of statements is that of the kernel.
    """
    parts = [Part(sections=sections) for sections in _cut(kernel)]
    parts[-1].copies = _copies(kernel)
    copied = {i for copy in parts[-1].copies for i in range(copy.first, copy.first + copy.count)}
    home = {
        s.name: k
        for k, part in enumerate(parts)
        for section in part.sections
        for s in section.statements
    }
    for i, value in enumerate(kernel.computed):
        if i not in copied:
            parts[_ready(value, home)].outputs.append((i, value))
    for guard in kernel.guards:
        parts[_ready(guard.value, home)].guards.append(guard)
    if kernel.loop:
        parts[-1].residual = kernel.loop.residual
    first = len(kernel.solving.values) if kernel.solving else 0
    reads = [list(dict.fromkeys(_read(part))) for part in parts]
    order = {load.name: k for k, load in enumerate(kernel.loads)}
    for part, names in zip(parts, reads):
        places = sorted(order[name] for name in names if name in order)
        part.loads = tuple(kernel.loads[k] for k in places)
    return Parts(tuple(parts), _share_slots(parts, reads, home, first))


def is_long(kernel: Kernel) -> bool:
    """Is it cut into parts?"""
    return _count(kernel) > 1


def _count(kernel: Kernel) -> int:
    """Of parts. A long function of few statements is one that sums up very many entries."""
    total = sum(len(section.statements) for section in kernel.sections)
    entries = len(kernel.loads) - sum(copy.count for copy in _copies(kernel))
    lines = total + entries if entries > READ else total
    return min(total, -(-lines // LONGEST)) if lines > WHOLE else 1


def _copies(kernel: Kernel) -> tuple[Copy, ...]:
    """Where a result repeats an argument at length, as the velocities of a long chain do."""
    if kernel.loop or kernel.solving:
        return ()
    loads = {load.name: load for load in kernel.loads if load.argument != "t"}
    copies: list[Copy] = []
    for i, value in enumerate(kernel.outputs):
        load = loads.get(value) if isinstance(value, str) else None
        if load is None:
            continue
        last = copies[-1] if copies else None
        if last and last.argument == load.argument and _follows(last, i, load.index):
            copies[-1] = replace(last, count=last.count + 1)
        else:
            copies.append(Copy(i, load.argument, load.index, 1))
    return tuple(copy for copy in copies if copy.count >= COPIED)


def _follows(copy: Copy, i: int, index: int) -> bool:
    return (copy.first + copy.count, copy.index + copy.count) == (i, index)


def _cut(kernel: Kernel) -> list[tuple[Section, ...]]:
    """Sections cut into pieces of nearly equal length."""
    total = sum(len(section.statements) for section in kernel.sections)
    count = _count(kernel)
    pieces: list[list[Section]] = [[] for _ in range(count)]
    done = 0
    for section in kernel.sections:
        rest = section.statements
        while rest:
            k = done * count // total
            most = -(-(k + 1) * total // count) - done
            pieces[k].append(Section(section.title, rest[:most]))
            done, rest = done + len(rest[:most]), rest[most:]
    return [tuple(piece) for piece in pieces]


def names(value: Expression) -> Iterator[str]:
    """The local names in an expression."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, tuple):
        for operand in value[1:]:
            yield from names(operand)


def _ready(value: Expression, home: dict[str, int]) -> int:
    """The first part after which everything in the expression is known."""
    return max((home.get(name, 0) for name in names(value)), default=0)


def _read(part: Part) -> Iterator[str]:
    statements: Iterable[Statement] = (s for section in part.sections for s in section.statements)
    last = [part.residual] if part.residual is not None else []
    for value in (
        *(s.value for s in statements),
        *(v for _, v in part.outputs),
        *(g.value for g in part.guards),
        *last,
    ):
        yield from names(value)


def _share_slots(
    parts: Sequence[Part], reads: Sequence[Sequence[str]], home: dict[str, int], first: int
) -> int:
    """Give slots from `first` on to values that cross parts; a slot is free again in the part after
    its last use. Returns how many there are."""
    last = {name: k for k, names in enumerate(reads) for name in names if home.get(name, k) < k}
    slots: dict[str, int] = {}
    free: list[int] = []
    size = first
    for k, part in enumerate(parts):
        part.taken = [(name, slots[name]) for name in reads[k] if name in slots and home[name] < k]
        for name in (
            s.name for section in part.sections for s in section.statements if s.name in last
        ):
            size += not free
            slots[name] = heapq.heappop(free) if free else size - 1
            part.kept.append((name, slots[name]))
        # freed after this part has got its own slots: a part may store a value before it loads
        # another
        for name, slot in part.taken:
            if last[name] == k:
                heapq.heappush(free, slot)
    return size
