"""Blocks that are alike as a piece of code that is gone through for each of them: the table of
places, the constants, and where in arrays block i_ has what it reads and stores.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codegen import text
from codegen.passes.folding.split import Part
from codegen.passes.folding.tables import Column, Repeat

SHORT = 32_768  # places below it are written as short numbers


@dataclass(frozen=True)
class Again:
    """How often a piece is gone through, `rows` of the table of places, and its constants."""

    count: int
    width: int
    kind: str
    rows: tuple[str, ...]
    numbers: tuple[str, ...]
    begin: tuple[str, ...]  # lines before the first: what it takes of a block before
    end: tuple[str, ...]  # and at the end of each: what it hands on


def again(
    part: Part, repeat: Repeat, carried: Mapping[str, str], language: text.Language = text.C
) -> Again:
    """The repeat of a part. `carried`, what the block before has made by the local of this one that
    made it, stays in a local from block to block."""
    slots = dict(part.taken)
    places = [column.places for column in repeat.tables.values()]
    return Again(
        count=repeat.count,
        width=len(places),
        kind="short" if max(map(max, places), default=0) < SHORT else "int",
        rows=tuple(", ".join(map(str, row)) for row in zip(*places)),
        numbers=tuple(text.number(x, language) for x in repeat.numbers),
        begin=tuple(f"double {name} = work[{slots[name]}];" for name in carried),
        end=tuple(f"{name} = {maker};" for name, maker in carried.items()),
    )


def varying(part: Part) -> dict[str | int, str]:
    """Places in arrays that block i_ has elsewhere than the first, by local name or by number of a
    result; empty where the part is no blocks."""
    if part.repeat is None:
        return {}
    tables = {key: f"at_[{k}]" for k, key in enumerate(part.repeat.tables)}
    columns = part.repeat.columns.items()
    return tables | {key: _rule(column) for key, column in columns if key not in tables}


def _rule(column: Column) -> str:
    """Of a column whose places are equally far from each other."""
    step = column.step or 0
    times = "i_" if abs(step) == 1 else f"{abs(step)} * i_"
    return f"({column.places[0]} {'+' if step > 0 else '-'} {times})"
