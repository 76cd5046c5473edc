"""split: a long function as parts over a workspace, because a compiler's time grows faster than the
length of a function.

What one part computes and another needs is kept in a slot of the workspace, which is given to other
values after its last use. Statements that come again and again with other operands are one part
with a table (passes/tables.py).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from codegen.passes.folding.repeats import Stretch, stages
from codegen.passes.folding.tables import Repeat, carry, repeated, take_guards, take_results, vary
from codegen.program import Expression, Kernel, Load, Pivot, Section, Statement

WHOLE = 1_000  # statements that a function may have and stay in one piece
READ = 1_000  # entries of arguments that it may read, likewise
LONGEST = 250  # statements in one part of a longer one
COPIED = 500  # results from which on a loop copies them

Slot = tuple[str, int]  # a local name and its place in the workspace
Reads = Mapping[str, tuple[str, ...]]  # by local name, what it is in each block


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
    repeat: Repeat | None = None

    @property
    def makes(self) -> Iterator[str]:
        """Its locals, of all blocks."""
        if self.repeat:
            yield from (name for block in self.repeat.makes for name in block)
        else:
            yield from (s.name for section in self.sections for s in section.statements)

    @property
    def places(self) -> Iterator[int]:
        """Which results it has, of all blocks."""
        for i, _ in self.outputs:
            yield from self.repeat.columns[i].places if self.repeat else (i,)


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
    parts = _parts(kernel)
    parts[-1].copies = _copies(kernel)
    home = {name: k for k, part in enumerate(parts) for name in part.makes}
    _give_results(kernel, parts, home)
    _give_guards(kernel, parts, home)
    if kernel.loop:
        parts[-1].residual = kernel.loop.residual
    reads = _give_loads(kernel, parts)
    foreign = [_foreign(part, read, home, k) for k, (part, read) in enumerate(zip(parts, reads))]
    if not kernel.solving:
        return Parts(tuple(parts), _share_slots(parts, foreign, {}, 0))
    standing = _standing(kernel, parts)
    return Parts(tuple(parts), _share_slots(parts, foreign, standing, len(kernel.solving.values)))


def _standing(kernel: Kernel, parts: Sequence[Part]) -> dict[str, int]:
    """Where in the workspace the locals are that solving takes: whoever else needs them finds them
    there."""
    places: dict[str, int] = {}
    for part in parts:
        made = set(part.makes)
        left: list[tuple[int, Expression]] = []
        for i, value in part.outputs:
            if i >= kernel.size and value in made and value not in places:
                places[value] = i - kernel.size
            else:
                left.append((i, value))
        part.outputs = left
    return places


def _give_results(kernel: Kernel, parts: Sequence[Part], home: Mapping[str, int]) -> None:
    """Results to the parts that have them."""
    copied = {i for copy in parts[-1].copies for i in range(copy.first, copy.first + copy.count)}
    left = {i: value for i, value in enumerate(kernel.computed) if i not in copied}
    for part in parts:
        if part.repeat:
            part.outputs, left = take_results(part.repeat, left)
    plain = _without_table(parts)
    for i, value in left.items():
        parts[_next(plain, _ready(value, home))].outputs.append((i, value))


def _give_guards(kernel: Kernel, parts: Sequence[Part], home: Mapping[str, int]) -> None:
    """Guards to the parts after which they are known."""
    left = list(kernel.guards)
    for part in parts:
        if part.repeat:
            part.guards, left = take_guards(part.repeat, left)
    plain = _without_table(parts)
    for guard in left:
        parts[_next(plain, _ready(guard.value, home))].guards.append(guard)


def _without_table(parts: Sequence[Part]) -> list[int]:
    """Numbers of the parts that are no blocks."""
    return [k for k, part in enumerate(parts) if not part.repeat]


def _give_loads(kernel: Kernel, parts: Sequence[Part]) -> list[Reads]:
    """Entries of arguments to the parts that read them; what each part reads."""
    of = {load.name: load for load in kernel.loads}
    order = {name: k for k, name in enumerate(of)}
    reads: list[Reads] = []
    for part in parts:
        read = part.repeat.reads if part.repeat else {name: (name,) for name in _read(part)}
        inputs = [(column[0], name) for name, column in read.items() if column[0] in of]
        inputs.sort(key=lambda item: order[item[0]])
        part.loads = tuple(replace(of[actual], name=name) for actual, name in inputs)
        if part.repeat:
            for name, column in read.items():
                if column[0] in of:
                    vary(part.repeat, name, [of[each].index for each in column])
        reads.append(read)
    return reads


def _foreign(part: Part, read: Reads, home: Mapping[str, int], k: int) -> Reads:
    """What others have made of what a part reads: parts before it, and blocks before each block."""
    here = k + 1 if part.repeat else k
    return {name: column for name, column in read.items() if home.get(column[0], here) < here}


def _next(plain: Sequence[int], k: int) -> int:
    """The first part without a table from k on; the last one is always without."""
    return plain[bisect_left(plain, k)]


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


def _parts(kernel: Kernel) -> list[Part]:
    """With their statements."""
    if not kernel.repeats or not is_long(kernel) or kernel.solving:
        return [Part(sections=sections) for sections in _cut(kernel.sections, _count(kernel))]
    inputs = {load.name: load.argument for load in kernel.loads}
    parts: list[Part] = []
    plain: list[Section] = []
    for stage in stages(kernel.sections, inputs):
        if isinstance(stage, Stretch):
            parts += _plain(plain)
            plain = []
            section, repeat = repeated(stage)
            parts.append(Part(sections=(section,), repeat=repeat))
        else:
            plain.append(stage)
    return [*parts, *(_plain(plain) or [Part()])]


def _plain(sections: Sequence[Section]) -> list[Part]:
    total = sum(len(section.statements) for section in sections)
    return [Part(sections=some) for some in _cut(sections, -(-total // LONGEST))] if total else []


def _cut(sections: Sequence[Section], count: int) -> list[tuple[Section, ...]]:
    """Sections cut into pieces of nearly equal length."""
    total = sum(len(section.statements) for section in sections)
    pieces: list[list[Section]] = [[] for _ in range(count)]
    done = 0
    for section in sections:
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


def _ready(value: Expression, home: Mapping[str, int]) -> int:
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
    parts: Sequence[Part], foreign: Sequence[Reads], standing: Mapping[str, int], first: int
) -> int:
    """Give slots from `first` on to values that cross parts, or blocks, and are not `standing`
    anyway; a slot is free again in the part after its last use. Returns how many there are."""
    last = {
        name: k for k, read in enumerate(foreign) for column in read.values() for name in column
    }
    slots = dict(standing)
    free = _Free(first)
    moved = last.keys() - standing.keys()
    for k, part in enumerate(parts):
        blocks = part.repeat.makes if part.repeat else (tuple(part.makes),)
        columns = {names[0]: names for names in zip(*blocks) if not moved.isdisjoint(names)}
        for names in columns.values():
            slots.update(zip(names, free.taken(len(names))))
        fixed = [(name, slots[name]) for name in part.makes if name in standing]
        part.kept = [*fixed, *((name, slots[name]) for name in columns)]
        part.taken = [(name, slots[column[0]]) for name, column in foreign[k].items()]
        if part.repeat:
            for name, column in (*columns.items(), *foreign[k].items()):
                vary(part.repeat, name, [slots[each] for each in column])
            carry(part.repeat, columns, foreign, k)
        # freed after this part has got its own slots: a part may store a value before it loads
        # another
        read = (name for column in foreign[k].values() for name in column)
        made = (name for names in columns.values() for name in names)
        done = (name for name in dict.fromkeys((*read, *made)) if last.get(name, k) == k)
        free.give(slots[name] for name in done if name not in standing)
    return free.size


class _Free:
    """Slots that nothing stands in."""

    def __init__(self, size: int) -> None:
        self.size = size
        self._free: list[int] = []

    def taken(self, count: int) -> range:
        """So many side by side, the first ones that there are, else new ones."""
        run = 0
        for k, slot in enumerate(self._free):
            run = run + 1 if run and self._free[k - 1] == slot - 1 else 1
            if run == count:
                del self._free[k + 1 - count : k + 1]
                return range(slot + 1 - count, slot + 1)
        self.size += count
        return range(self.size - count, self.size)

    def give(self, slots: Iterable[int]) -> None:
        """Back, for others."""
        self._free = sorted([*self._free, *slots])
