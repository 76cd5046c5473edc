"""Statements that come again and again, written once with tables: what they compute is what the
statements one after the other compute, wherever values go.

Of codegen.passes.folding: repeats, tables, split.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace

import pytest

from codegen.passes.folding.repeats import FEWEST, Stretch, stages
from codegen.passes.folding.split import Part, split
from codegen.passes.folding.tables import Column
from codegen.program import (
    Argument,
    Expression,
    Kernel,
    Load,
    Pivot,
    Repeats,
    Section,
    Statement,
)

OPERATIONS = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "sin": lambda a: a * (1.0 - a * a / 6.0),
    "pow": lambda a, b: a**b,
}


def test_blocks_that_are_alike_are_found() -> None:
    chain = [Statement("a0", ("sin", "x0"))]
    for i in range(1, 40):
        chain += [
            Statement(f"b{i}", ("add", f"a{i - 1}", f"x{i}")),
            Statement(f"c{i}", ("mul", f"b{i}", 0.1 * i)),
            Statement(f"a{i}", ("sub", f"c{i}", f"b{i}")),
        ]
    inputs = {f"x{i}": "x" for i in range(40)}
    first, stretch = stages([Section("chain", tuple(chain))], inputs)
    assert isinstance(first, Section) and len(first.statements) == 1
    assert isinstance(stretch, Stretch)
    assert (len(stretch.blocks), len(stretch.blocks[0])) == (39, 3)
    assert stretch.leaves[4] == ("a4", "x5", "b5", 0.5, "c5", "b5")


def test_few_blocks_stay_as_they_are() -> None:
    few = tuple(Statement(f"a{i}", ("sin", f"x{i}")) for i in range(FEWEST - 1))
    inputs = {f"x{i}": "x" for i in range(FEWEST - 1)}
    assert stages([Section("few", few)], inputs) == [Section("few", few)]


def test_blocks_that_read_from_elsewhere_are_others() -> None:
    """An entry of x is at another place than one of p, and a number in a power is no operand."""
    names = [*(f"x{i}" for i in range(30)), *(f"p{i}" for i in range(30))]
    sines = tuple(Statement(f"a{i}", ("sin", name)) for i, name in enumerate(names))
    powers = tuple(
        Statement(f"b{i}", ("pow", name, 2.0 if i < 30 else 3.0)) for i, name in enumerate(names)
    )
    inputs = {name: name[0] for name in names}
    for statements in (sines, powers):
        found = stages([Section("both", statements)], inputs)
        assert [len(x.blocks) for x in found if isinstance(x, Stretch)] == [30, 30]


def test_a_column_knows_its_rule() -> None:
    assert Column((5, 8, 11)).step == 3
    assert Column((5, 4, 3)).step == -1
    assert Column((5, 8, 12)).step is None


@pytest.mark.parametrize("seed", range(12))
def test_parts_with_tables_compute_the_same(seed: int) -> None:
    kernel = _kernel(random.Random(seed))
    parts = split(replace(kernel, repeats=Repeats(0, 0)))
    repeated = [part for part in parts.parts if part.repeat]
    assert sum(part.repeat.count for part in repeated if part.repeat) > FEWEST
    x = [random.Random(k).uniform(-1.0, 1.0) for k in range(len(kernel.loads))]
    assert _run(parts.parts, parts.size, x, kernel) == _straight(kernel, x)


def test_a_wrong_place_in_a_table_shows() -> None:
    kernel = _kernel(random.Random(0))
    x = [random.Random(k).uniform(-1.0, 1.0) for k in range(len(kernel.loads))]
    parts = split(replace(kernel, repeats=Repeats(0, 0)))
    seen = []
    for repeat in [part.repeat for part in parts.parts if part.repeat]:
        for key, column in [*repeat.columns.items()]:
            swapped = (column.places[1], column.places[0], *column.places[2:])
            repeat.columns[key] = Column(swapped)
            seen.append(_run(parts.parts, parts.size, x, kernel) != _straight(kernel, x))
            repeat.columns[key] = column
    assert sum(seen) > 0.7 * len(seen)  # nobody reads what the others lead to


def test_what_goes_from_block_to_block_is_carried() -> None:
    kernel = _kernel(random.Random(3))
    parts = split(replace(kernel, repeats=Repeats(0, 0)))
    assert any(part.repeat.carried for part in parts.parts if part.repeat)


# ---- a long function of blocks, and what runs it


def _kernel(draw: random.Random) -> Kernel:
    """Blocks that read x, numbers, what they and others before them made, in several sections."""
    blocks, length = draw.randrange(120, 160), draw.randrange(3, 9)
    statements: list[Statement] = []
    sections: list[Section] = []
    outputs: list[Expression] = []
    guards: list[Pivot] = []
    number = iter(range(100_000))
    before: list[list[str]] = []
    for title in ("first", "second", "third"):
        pattern = [_step(draw, k, bool(before)) for k in range(length)]
        rows: list[list[str]] = []
        statements = [Statement(f"{title}{i}", ("mul", "x0", f"x{i}")) for i in range(1, 4)]
        last = [s.name for s in statements]
        for i in range(blocks):
            row: list[str] = []
            for operation, sources in pattern:
                operands = [_operand(s, i, row, rows, last, before) for s in sources]
                name = f"z{next(number)}"
                statements.append(Statement(name, (operation, *operands)))
                row.append(name)
            if draw.random() < 0.01:  # something else in between
                statements.append(Statement(f"z{next(number)}", ("sin", row[-1])))
            rows.append(row)
        outputs += [row[k] for k in range(0, length, 2) for row in rows]
        outputs += [draw.choice(draw.choice(rows)) for _ in range(5)]
        guards += [Pivot(row[0], row[0], 1e-9, 1e-9, 1.0) for row in rows]
        sections.append(Section(title, tuple(statements)))
        before = rows
    loads = tuple(Load(f"x{i}", "x", i) for i in range(200))
    names = tuple(load.name for load in loads)
    size = len(outputs)
    return Kernel(
        name="f", about="", result="out", shape=(size,), labels=(), units=(),
        x=Argument("x", names, names, ()), uses=("x",), loads=loads, sections=tuple(sections),
        outputs=tuple(outputs), guards=tuple(guards), loop=None, watched=(),
        results=tuple(range(size)), operations={},
    )  # fmt: skip


def _step(draw: random.Random, k: int, later: bool) -> tuple[str, tuple[tuple[str, int], ...]]:
    operation = draw.choice(["add", "sub", "mul", "sin"])
    kinds = ["x", "number", "carried", *(["own"] if k else []), *(["before"] if later else [])]
    many = 1 if operation == "sin" else 2
    sources = [(draw.choice(kinds), draw.randrange(k) if k else 0) for _ in range(many)]
    if sources[0][0] == "number":
        sources[0] = ("x", 0)
    return operation, tuple(sources)


def _operand(
    source: tuple[str, int],
    i: int,
    row: list[str],
    rows: list[list[str]],
    last: list[str],
    before: list[list[str]],
) -> Expression:
    kind, k = source
    if kind == "x":
        return f"x{i + k}"
    if kind == "number":
        return 0.25 + i / 128
    if kind == "own":
        return row[k]
    if kind == "before":
        return before[len(before) - 1 - i][k]
    return rows[-1][-1] if rows else last[k % 3]


def _value(value: Expression, known: dict[str, float]) -> float:
    if isinstance(value, str):
        return known[value]
    if isinstance(value, tuple):
        return OPERATIONS[value[0]](*(_value(x, known) for x in value[1:]))
    return value


def _straight(kernel: Kernel, x: list[float]) -> tuple[list[float], list[float]]:
    known = {load.name: x[load.index] for load in kernel.loads}
    for section in kernel.sections:
        for s in section.statements:
            known[s.name] = _value(s.value, known)
    results = [_value(value, known) for value in kernel.outputs]
    return results, sorted(_value(guard.value, known) for guard in kernel.guards)


def _run(
    parts: tuple[Part, ...], size: int, x: list[float], kernel: Kernel
) -> tuple[list[float], list[float]]:
    """As the text of the parts says: what is not written yet is no number."""
    work, out = [float("nan")] * size, [float("nan")] * kernel.size
    guards: list[float] = []
    for part in parts:
        for i in range(part.repeat.count if part.repeat else 1):
            known = dict(_read(part, i, x, work))
            for section in part.sections:
                for s in section.statements:
                    known[s.name] = _value(s.value, known)
            for place, value in part.outputs:
                out[_place(part, place, place, i)] = _value(value, known)
            for name, slot in part.kept:
                work[_place(part, name, slot, i)] = known[name]
            guards += [_value(guard.value, known) for guard in part.guards]
    return out, sorted(guards)


def _read(part: Part, i: int, x: list[float], work: list[float]) -> Iterator[tuple[str, float]]:
    yield from ((load.name, x[_place(part, load.name, load.index, i)]) for load in part.loads)
    yield from ((name, work[_place(part, name, slot, i)]) for name, slot in part.taken)
    for name in part.repeat.constants if part.repeat else ():
        assert part.repeat is not None
        yield name, part.repeat.numbers[_place(part, name, 0, i)]


def _place(part: Part, key: str | int, place: int, i: int) -> int:
    column = part.repeat.columns.get(key) if part.repeat else None
    return place if column is None else column.places[i]
