"""Loops over links as lines of C, one state or LANES of them, and of Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from codegen import text
from codegen.passes.lanes import sections_of
from codegen.program import Angle, Expression, Kernel, Rolled, Section, Visit
from codegen.targets.turns import by_lanes, is_turn


@dataclass(frozen=True)
class Block:
    """A visit as lines: `lines` read and compute, `after` store and hand on."""

    lines: tuple[str, ...]
    after: tuple[str, ...]


@dataclass(frozen=True)
class Loop:
    """A sweep: `start` are the first values handed on, `blocks` the visits by kind."""

    title: str
    rising: bool
    start: tuple[str, ...]
    blocks: tuple[Block, ...]

    @property
    def width(self) -> int:
        """How many values are handed on."""
        return len(self.start)


@dataclass(frozen=True)
class Index:
    """Whole numbers by link, as an expression of i; a table where they follow no rule."""

    name: str
    values: tuple[int, ...]

    @property
    def step(self) -> int | None:
        """From one link to the next, where it is always the same."""
        first, *others = self.values
        step = others[0] - first if others else 1
        regular = all(value == first + step * i for i, value in enumerate(self.values))
        return step if regular else None

    def text(self, prefix: str, link: str = "i") -> str:
        """The number of a link; a multiple of it and a constant need no table."""
        first, step = self.values[0], self.step
        if step is None:
            return f"{prefix}{self.name}[{link}]"
        if step == 0:
            return str(first)
        along = f"{step} * {link}" if step != 1 else link
        return f"{along} + {first}" if first else along


@dataclass(frozen=True)
class Tables:
    """Numbers as text, row by row; `computed`: (row, column, local) of what parameters make."""

    width: int
    rows: tuple[str, ...]
    computed: tuple[tuple[int, int, str], ...]


@dataclass(frozen=True)
class Text:
    """A rolled kernel in one language."""

    of: Rolled
    prologue: tuple[str, ...]
    tables: tuple[Tables, ...]
    indices: tuple[Index, ...]  # those that need a table
    row: str
    angles: tuple[Block | None, ...]
    loops: tuple[Loop, ...]
    clears: bool  # the result begins as zeros
    factors: tuple[str, ...]  # of parameters, the same at all links
    at: dict[str, str] = field(default_factory=dict[str, str])
    turns: bool = False  # are there sines and cosines in lanes, besides those of angles?

    @property
    def lines(self) -> Iterator[str]:
        """All that is computed, at any link."""
        blocks = [block for loop in self.loops for block in loop.blocks]
        for block in (*blocks, *(angle for angle in self.angles if angle)):
            yield from (*block.lines, *block.after)
        yield from (value for loop in self.loops for value in loop.start)
        yield from (value for table in self.tables for *_, value in table.computed)
        yield from (*self.prologue, *self.factors)

    @property
    def parametric(self) -> tuple[int, ...]:
        """The kinds whose tables parameters are in."""
        return tuple(k for k, table in enumerate(self.tables) if table.computed)


def indices(of: Rolled) -> dict[str, Index]:
    """By what they lead to."""
    named = {
        "kind": of.kinds,
        "row": of.rows,
        "of": of.of,
        "to": of.to,
        "start": of.starts,
        **of.indices,
    }
    return {name: Index(name, values) for name, values in named.items()}


def tables(of: Rolled, language: text.Language) -> tuple[Tables, ...]:
    """Numbers, and 0 where something is computed."""
    return tuple(
        Tables(
            table.width,
            tuple(", ".join(_entry(x, language) for x in row) for row in table.rows),
            tuple(
                (r, c, text.expression(x, language))
                for r, row in enumerate(table.rows)
                for c, x in enumerate(row)
                if not isinstance(x, float)
            ),
        )
        for table in of.tables
    )


def _entry(x: Expression, language: text.Language) -> str:
    return text.number(x, language) if isinstance(x, float) else "0.0"


def c_text(program: str, kernel: Kernel, of: Rolled, lanes: bool, prologue: Sequence[str]) -> Text:
    """In C. In lanes entry i of an array is LANES numbers side by side."""
    prefix = f"{program}_{kernel.name}_"
    at = {name: index.text(prefix) for name, index in indices(of).items()}
    at["ahead"] = indices(of)["start"].text(prefix, "(i + j)")
    language = text.LANES if lanes else text.C
    constants = tables(of, language)
    computed = {k for k, table in enumerate(constants) if table.computed}

    def entry(array: str, place: str) -> str:
        return f"{array}[({place}) * LANES + lane]" if lanes else f"{array}[{place}]"

    def source(kind: int, argument: str, index: int) -> str:
        """What a load reads."""
        if argument == "k":
            return entry("k", str(index)) if kind in computed else f"k[{index}]"
        places = {name: (name, str(index)) for name in "fre"}
        places |= {read.name: (read.argument, at[read.index]) for read in of.reads}
        return entry(*places[argument])

    def block(kind: int, visit: Visit) -> Block:
        lines = [
            f"const double {load.name} = {source(kind, load.argument, load.index)};"
            for load in visit.loads
            if load.argument != "t" and (lanes or load.argument != "e")
        ]
        if lanes and any(load.argument == "t" for load in visit.loads):
            lines.insert(0, "const double t = t_[lane];")
        for section in visit.sections:
            lines += _lane_lines(program, section) if lanes else _lines(section, language)
        return Block(tuple(lines), tuple(_after(of, visit, language, entry, at, lanes)))

    def angle(kind: int, angle: Angle) -> Block:
        value = text.expression(angle.value, language)
        return Block(block(kind, angle.of).lines, (value if lanes else f"return {value};",))

    return Text(
        of=of,
        prologue=tuple(prologue),
        tables=constants,
        indices=tuple(x for x in indices(of).values() if x.step is None),
        row=at["row"],
        angles=tuple(None if v is None else angle(k, v) for k, v in enumerate(of.angles)),
        loops=tuple(
            Loop(
                sweep.title,
                sweep.rising,
                tuple(text.expression(x, language) for x in sweep.start),
                tuple(block(k, visit) for k, visit in enumerate(sweep.visits)),
            )
            for sweep in of.sweeps
        ),
        clears=_clears(kernel.size, of),
        factors=tuple(text.expression(x, language) for x in of.factors),
        at=at,
        turns=lanes and any(is_turn(s) for part in sections_of(of) for s in part.statements),
    )


def _lines(section: Section, language: text.Language) -> Iterator[str]:
    for statement in section.statements:
        yield f"const double {statement.name} = {text.expression(statement.value, language)};"


def _lane_lines(program: str, section: Section) -> Iterator[str]:
    """With sines and cosines of an angle together."""
    taken = {statement.name for statement in section.statements}
    steps = by_lanes(program, section, taken, "bad[lane]")
    for statement in section.statements:
        if statement.name in steps:
            yield from steps[statement.name].lines
        elif not is_turn(statement):
            value = text.expression(statement.value, text.LANES)
            yield f"const double {statement.name} = {value};"


def _clears(size: int, of: Rolled) -> bool:
    """Whether there are entries that links add to, or that none has."""
    return bool(of.added) or len(of.covered) < size


def _after(
    of: Rolled,
    visit: Visit,
    language: text.Language,
    entry: Callable[[str, str], str],
    at: dict[str, str],
    lanes: bool,
) -> Iterator[str]:
    """What is kept and handed on; nothing is handed on before all of it is known."""
    for place, value in visit.kept:
        yield f"{entry('r', str(place))} = {text.expression(value, language)};"
    for name, value in visit.results:
        sign = "+=" if name in of.added else "="
        yield f"{entry('out', at[name])} {sign} {text.expression(value, language)};"
    for k, value in enumerate(visit.handed):
        yield f"const double h{k} = {text.expression(value, language)};"
    for k in range(len(visit.handed)):
        yield f"{entry('e', str(k)) if lanes else f'e{k}'} = h{k};"


def python_text(
    kernel: Kernel, of: Rolled, language: text.Language, prologue: tuple[str, ...]
) -> Text:
    """In Python over leading axes: a row is a list of arrays."""
    own = f"_{kernel.name}_"
    names = {name: name + "[{0}]" for name in "kfre"}
    names |= {x.name: f"{x.argument}[..., {own}{x.index}[i]]" for x in of.reads}

    def lines(visit: Visit) -> tuple[str, ...]:
        loads = [
            f"{load.name} = {names[load.argument].format(load.index)}"
            for load in visit.loads
            if load.argument != "t"
        ]
        statements = [
            f"{s.name} = {text.expression(s.value, language)}"
            for section in visit.sections
            for s in section.statements
        ]
        return (*loads, *statements)

    def angle(made: Angle) -> Block:
        return Block(lines(made.of), (f"return {text.expression(made.value, language)}",))

    def block(visit: Visit) -> Block:
        stores = [f"r[{place}] = {text.expression(x, language)}" for place, x in visit.kept]
        for name, value in visit.results:
            sign = "+=" if name in of.added else "="
            stores.append(f"out[..., {own}{name}[i]] {sign} {text.expression(value, language)}")
        handed = ", ".join(text.expression(x, language) for x in visit.handed)
        return Block((*lines(visit), *stores), (f"return [{handed}]",))

    return Text(
        of=of,
        prologue=prologue,
        tables=tables(of, language),
        indices=tuple(x for x in indices(of).values() if x.name != "start"),
        row="",
        angles=tuple(None if x is None else angle(x) for x in of.angles),
        loops=tuple(
            Loop(
                sweep.title,
                sweep.rising,
                tuple(text.expression(x, language) for x in sweep.start),
                tuple(map(block, sweep.visits)),
            )
            for sweep in of.sweeps
        ),
        clears=_clears(kernel.size, of),
        factors=tuple(text.expression(x, language) for x in of.factors),
    )
