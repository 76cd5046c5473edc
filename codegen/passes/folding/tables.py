"""tables: statements that come again and again as the first block of them, and where the others
have what it reads, makes and gives: by a rule, or by a table.

Which blocks are alike is found in passes/repeats.py; passes/split.py makes a part of each body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

from codegen.passes.folding.repeats import Leaf, Stretch, with_leaves
from codegen.program import Expression, Pivot, Section, Statement


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


def repeated(stretch: Stretch) -> tuple[Section, Repeat]:
    """The first block, and what differs in the others; what it reads is known by the local names of
    the first block."""
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
            vary(repeat, leaf, [numbers.setdefault(x, len(numbers)) for x in column])
        known[column] = leaf
    repeat.numbers = tuple(map(float.fromhex, numbers))
    rest = iter([known[column] for column in columns])
    statements = tuple(Statement(s.name, with_leaves(s.value, rest)) for s in first)
    return Section(stretch.title, statements), repeat


def _leaf_key(leaf: Leaf) -> str:
    """A name, or a number with its sign and all its digits."""
    return leaf if isinstance(leaf, str) else float(leaf).hex()


def vary(repeat: Repeat, key: str | int, places: Sequence[int]) -> None:
    """Add the places as a column, where they are not the same for all blocks."""
    if len(set(places)) > 1:
        repeat.columns[key] = Column(tuple(places))


def take_results(
    repeat: Repeat, results: Mapping[int, Expression]
) -> tuple[list[tuple[int, Expression]], dict[int, Expression]]:
    """The results that every block has, at the same statement, as those of the first block; and the
    others, which are left."""
    of: dict[str, list[int]] = {}
    for i, value in results.items():
        if isinstance(value, str):
            of.setdefault(value, []).append(i)
    own: list[tuple[int, Expression]] = []
    taken: set[int] = set()
    for names in zip(*repeat.makes):
        places = [of.get(name, []) for name in names]
        if places[0] and len({len(each) for each in places}) == 1:
            for column in zip(*places):
                own.append((column[0], names[0]))
                repeat.columns[column[0]] = Column(column)
                taken.update(column)
    return own, {i: value for i, value in results.items() if i not in taken}


def take_guards(repeat: Repeat, guards: Sequence[Pivot]) -> tuple[list[Pivot], list[Pivot]]:
    """The same with guards."""
    of = {guard.value: guard for guard in guards if isinstance(guard.value, str)}
    own: list[Pivot] = []
    taken: set[str] = set()
    for names in zip(*repeat.makes):
        if all(name in of for name in names) and len({of[name].tolerance for name in names}) == 1:
            ends = of[names[0]].name, of[names[-1]].name
            own.append(replace(of[names[0]], name=" to ".join(ends)))
            taken.update(names)
    return own, [guard for guard in guards if guard.value not in taken]


def carry(
    repeat: Repeat,
    columns: Mapping[str, tuple[str, ...]],
    foreign: Sequence[Mapping[str, tuple[str, ...]]],
    k: int,
) -> None:
    """What goes from block to block need not leave the registers. `columns` are the locals of all
    blocks that something reads, by those of the first; `foreign` what each part reads of others or
    of blocks before; k is the part of these blocks."""
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
