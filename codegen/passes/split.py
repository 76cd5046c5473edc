"""split: a long function as parts over a workspace, because a compiler's time grows faster than the
length of a function.

What one part computes and another needs is kept in a slot of the workspace, which is given to other
values after its last use. Statements that come again and again with other operands are one part
with a table (passes/repeats.py).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

from codegen.passes.repeats import Leaf, Stretch, stages, with_leaves
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


@dataclass(frozen=True)
class Column:
    """A place that changes from block to block: first + step · i, or what a table says."""

    places: tuple[int, ...]

    @cached_property
    def step(self) -> int | None:
        """Between neighbours, where it is the same for all."""
        steps = {b - a for a, b in pairwise(self.places)}
        return steps.pop() if len(steps) == 1 else None


@dataclass
class Repeat:
    """So many blocks that are alike. Statements, loads, results and slots of the part are those of
    the first; `columns` says, by local name or by number of a result, where the others have
    theirs; `numbers` are what a column of constants points at."""

    count: int
    makes: tuple[tuple[str, ...], ...]  # the locals of each block, in the order of the statements
    columns: dict[str | int, Column] = field(default_factory=dict[str | int, Column])
    numbers: tuple[float, ...] = ()
    constants: tuple[str, ...] = ()  # locals that are of these
    reads: dict[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    # what the block before has made, by the local of this one that made it; and locals that nothing
    # else reads
    carried: dict[str, str] = field(default_factory=dict[str, str])
    passed: set[str] = field(default_factory=set[str])

    @property
    def tables(self) -> dict[str | int, Column]:
        """The columns that no rule gives."""
        return {key: column for key, column in self.columns.items() if column.step is None}


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
    copied = {i for copy in parts[-1].copies for i in range(copy.first, copy.first + copy.count)}
    home = {name: k for k, part in enumerate(parts) for name in part.makes}
    results = {i: value for i, value in enumerate(kernel.computed) if i not in copied}
    guards = list(kernel.guards)
    for k, part in enumerate(parts):
        if part.repeat:
            results = _own_results(part, part.repeat, results, home, k)
            guards = _own_guards(part, part.repeat, guards)
    plain = [k for k, part in enumerate(parts) if not part.repeat]
    for i, value in results.items():
        parts[_next(plain, _ready(value, home))].outputs.append((i, value))
    for guard in guards:
        parts[_next(plain, _ready(guard.value, home))].guards.append(guard)
    if kernel.loop:
        parts[-1].residual = kernel.loop.residual
    first = len(kernel.solving.values) if kernel.solving else 0
    of = {load.name: load for load in kernel.loads}
    order = {name: k for k, name in enumerate(of)}
    foreign: list[dict[str, tuple[str, ...]]] = []
    for k, part in enumerate(parts):
        read = part.repeat.reads if part.repeat else {name: (name,) for name in _read(part)}
        inputs = sorted(
            ((columns[0], name) for name, columns in read.items() if columns[0] in order),
            key=lambda item: order[item[0]],
        )
        part.loads = tuple(replace(of[actual], name=name) for actual, name in inputs)
        if part.repeat:
            for name, column in read.items():
                if column[0] in of:
                    _vary(part.repeat, name, [of[each].index for each in column])
        here = k + 1 if part.repeat else k  # a block reads what those before it have made
        made = ((n, column) for n, column in read.items() if home.get(column[0], here) < here)
        foreign.append(dict(made))
    return Parts(tuple(parts), _share_slots(parts, foreign, first))


def _next(plain: Sequence[int], k: int) -> int:
    """The first part without a table from k on; the last one is always without."""
    return plain[bisect_left(plain, k)]


def _own_results(
    part: Part, repeat: Repeat, results: dict[int, Expression], home: dict[str, int], k: int
) -> dict[int, Expression]:
    """Takes the results that every block has, at the same statement; the others are left."""
    of: dict[str, list[int]] = {}
    for i, value in results.items():
        if isinstance(value, str) and home.get(value) == k:
            of.setdefault(value, []).append(i)
    taken: set[int] = set()
    for names in zip(*repeat.makes):
        places = [of.get(name, []) for name in names]
        if places[0] and len({len(each) for each in places}) == 1:
            for column in zip(*places):
                part.outputs.append((column[0], names[0]))
                repeat.columns[column[0]] = Column(column)
                taken.update(column)
    return {i: value for i, value in results.items() if i not in taken}


def _own_guards(part: Part, repeat: Repeat, guards: list[Pivot]) -> list[Pivot]:
    """The same with guards."""
    of = {guard.value: guard for guard in guards if isinstance(guard.value, str)}
    taken: set[str] = set()
    for names in zip(*repeat.makes):
        if all(name in of for name in names) and len({of[name].tolerance for name in names}) == 1:
            ends = of[names[0]].name, of[names[-1]].name
            part.guards.append(replace(of[names[0]], name=" to ".join(ends)))
            taken.update(names)
    return [guard for guard in guards if guard.value not in taken]


def _vary(repeat: Repeat, key: str | int, places: Sequence[int]) -> None:
    if len(set(places)) > 1:
        repeat.columns[key] = Column(tuple(places))


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
            parts.append(_repeated(stage, inputs))
        else:
            plain.append(stage)
    return [*parts, *(_plain(plain) or [Part()])]


def _plain(sections: Sequence[Section]) -> list[Part]:
    total = sum(len(section.statements) for section in sections)
    return [Part(sections=some) for some in _cut(sections, -(-total // LONGEST))] if total else []


def _repeated(stretch: Stretch, inputs: Mapping[str, str]) -> Part:
    """The first block; what it reads is known by the local names of the first block."""
    first, leaves = stretch.blocks[0], stretch.leaves
    own = {s.name for s in first}
    repeat = Repeat(len(stretch.blocks), tuple(tuple(s.name for s in x) for x in stretch.blocks))
    columns = [tuple(map(_leaf_key, column)) for column in zip(*leaves)]
    known: dict[tuple[str, ...], Leaf] = {}
    numbers: dict[str, int] = {}
    for leaf, column in zip(leaves[0], columns):
        if column in known:
            continue
        if isinstance(leaf, str) and leaf not in own:
            leaf = leaf if leaf not in repeat.reads else f"{leaf}_{len(known)}_"
            repeat.reads[leaf] = column
        elif not isinstance(leaf, str) and len(set(column)) > 1:
            leaf = f"number{len(known)}_"
            repeat.constants = (*repeat.constants, leaf)
            _vary(repeat, leaf, [numbers.setdefault(x, len(numbers)) for x in column])
        known[column] = leaf
    repeat.numbers = tuple(map(float.fromhex, numbers))
    rest = iter([known[column] for column in columns])
    statements = tuple(Statement(s.name, with_leaves(s.value, rest)) for s in first)
    return Part(sections=(Section(stretch.title, statements),), repeat=repeat)


def _leaf_key(leaf: Leaf) -> str:
    """A name, or a number with its sign and all its digits."""
    return leaf if isinstance(leaf, str) else float(leaf).hex()


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
    parts: Sequence[Part], foreign: Sequence[Mapping[str, tuple[str, ...]]], first: int
) -> int:
    """Give slots from `first` on to values that cross parts, or blocks; a slot is free again in the
    part after its last use. Returns how many there are."""
    last = {
        name: k for k, read in enumerate(foreign) for column in read.values() for name in column
    }
    slots: dict[str, int] = {}
    free = _Free(first)
    for k, part in enumerate(parts):
        blocks = part.repeat.makes if part.repeat else (tuple(part.makes),)
        columns = {names[0]: names for names in zip(*blocks) if any(name in last for name in names)}
        for names in columns.values():
            slots.update(zip(names, free.taken(len(names))))
        part.kept = [(name, slots[name]) for name in columns]
        part.taken = [(name, slots[column[0]]) for name, column in foreign[k].items()]
        if part.repeat:
            for name, column in (*columns.items(), *foreign[k].items()):
                _vary(part.repeat, name, [slots[each] for each in column])
            _carry(part.repeat, columns, foreign, k)
        # freed after this part has got its own slots: a part may store a value before it loads
        # another
        read = (name for column in foreign[k].values() for name in column)
        made = (name for names in columns.values() for name in names)
        free.give(slots[name] for name in dict.fromkeys((*read, *made)) if last.get(name, k) == k)
    return free.size


def _carry(
    repeat: Repeat,
    columns: Mapping[str, tuple[str, ...]],
    foreign: Sequence[Mapping[str, tuple[str, ...]]],
    k: int,
) -> None:
    """What goes from block to block need not leave the registers."""
    makers = {names[:-1]: name for name, names in columns.items()}
    read = foreign[k].items()
    repeat.carried = {name: makers[names[1:]] for name, names in read if names[1:] in makers}
    others = {
        each
        for j, reads in enumerate(foreign)
        for name, names in reads.items()
        if j != k or name not in repeat.carried
        for each in names
    }
    repeat.passed = {
        maker for maker in repeat.carried.values() if others.isdisjoint(columns[maker])
    }


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
