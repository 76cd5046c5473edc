"""Functions as lines of C: what they read, compute and store, for one state and for several side by
side, in parts where they are long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from codegen import text
from codegen.limits import MANY_RESULTS
from codegen.passes.folding.split import Copy, Part, names, split
from codegen.passes.lanes import (
    is_stepped,
)
from codegen.program import (
    Expression,
    Kernel,
    Program,
    Rolled,
    Section,
    Solving,
)
from codegen.targets.repeated import Again, again, varying
from codegen.targets.rolled import Text, c_text
from codegen.targets.turns import Step, by_fours, by_lanes, is_turn

FEW = 24  # values that are added up one by one to see that all are finite
FOUR = 4  # neighbouring results that are set to zero at once
MANY_ZEROS = 32  # one after the other, that are set to zero in a loop
# statements up to which the parts of a function for several states side by side are joined again: a
# compiler then keeps in registers what one part hands on to the next, and vectors are long
JOINED = 2_000
# vectors of up to EIGHT columns that are solved for side by side: a multiplication and addition
# takes as long as four of them, and any that is late is made up for by one more
ABREAST, EIGHT = (12, 11, 10, 9, 8, 7, 6, 5, 4), 8
APART = 16  # places; results further from each other are looked at in two calls


@dataclass(frozen=True)
class Piece:
    """A part of a kernel as lines of C."""

    lines: tuple[
        str, ...
    ]  # loads, values from the workspace, statements, results, values into the workspace
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    unused: tuple[str, ...]
    ready: tuple[int, ...] = ()  # four results from here on are known after it, and leave the lanes
    again: Again | None = None


@dataclass(frozen=True)
class Given:
    """How a long row of results leaves the lanes, four neighbours at a time: those from `fours` on
    are turned over, the others are the same for all states, zeros (first, length) or constants."""

    fours: tuple[int, ...]
    zeros: tuple[tuple[int, int], ...]
    constants: tuple[tuple[int, tuple[str, ...]], ...]


@dataclass(frozen=True)
class Columns:
    """Right-hand sides in a place of their own, `wide` numbers a row, so many vectors `abreast`:
    (place there, first, last) of each range of columns, and the ranges that are left."""

    abreast: int
    wide: int
    ranges: Sequence[tuple[int, int, int]]
    left: Sequence[tuple[int, int]]


@dataclass(frozen=True)
class Body:
    """A kernel as one piece, or as several over a workspace."""

    kernel: Kernel
    size: int
    pieces: tuple[Piece, ...]
    workspace: int
    stray: str  # zero when nothing is infinite or NaN
    residual: str
    turns: bool  # are there sines and cosines?
    zeros: bool = False  # are results set to zero by fours?
    constants: int = 0  # length of c, where it takes precomputed constants
    rolled: Text | None = None  # loops in the place of pieces
    # arrays that are looked at in loops: name, array, length
    finite: tuple[tuple[str, str, int], ...] = ()
    given: Given | None = None  # results that are looked at when they leave the lanes
    joined: bool = False  # are its pieces put together again?
    columns: Columns | None = None  # what is solved for after its pieces


@dataclass(frozen=True)
class Style:
    """How entry i of an array is written; at which statement of a section what step for sines and
    cosines stands."""

    entry: str
    language: text.Language
    turns: Callable[[str, Section, set[str]], dict[str, Step]]


def batch_body(program: Program, kernel: Kernel) -> Body:
    """For lanes constants are always precomputed where there are any."""
    rest, constants = rest_of(kernel)
    return replace(body_of(program, rest, SIDE_BY_SIDE), constants=constants)


def rest_of(kernel: Kernel) -> tuple[Kernel, int]:
    """What is left behind the constants that are precomputed, and how many these are."""
    if not kernel.hoisted:
        return kernel, 0
    return replace(kernel.hoisted.rest, name=kernel.name), kernel.hoisted.precompute.size


def _loops(program: Program, kernel: Kernel, of: Rolled, style: Style) -> Body:
    """Loops over links, with what the tables take of parameters before them."""
    lines = [
        f"const double {load.name} = {style.entry.format(load.argument, load.index)};"
        for load in kernel.loads
    ]
    lines += [
        f"const double {s.name} = {value_text(s.value, style)};"
        for section in kernel.sections
        for s in section.statements
    ]
    rolled = c_text(program.name, kernel, of, style is SIDE_BY_SIDE, lines)
    sizes = {argument.name: len(argument.names) for argument in program.arguments}
    return Body(
        kernel=kernel,
        size=kernel.size,
        pieces=(),
        workspace=of.workspace,
        stray=_stray(program, kernel, style),
        residual="",
        turns=any(of.angles) or rolled.turns,
        rolled=rolled,
        finite=(
            *((name, "t_" if name == "t" else name, sizes[name]) for name in kernel.uses),
            ("out", "out", kernel.size),
        ),
    )


def body_of(program: Program, kernel: Kernel, style: Style) -> Body:
    if kernel.rolled:
        return _loops(program, kernel, kernel.rolled, style)
    parts = split(kernel)
    given = _given(kernel) if style is SIDE_BY_SIDE else None
    if given:
        _leave_out(parts.parts, given)
    many = len(parts.parts) > 1 or kernel.size >= MANY_RESULTS
    lines = _near if many and style is ALONE else _far
    pieces = tuple(
        _piece(program, kernel, part, style, _far if part.repeat else lines) for part in parts.parts
    )
    if given:
        ready = _ready(parts.parts, given)
        pieces = tuple(replace(piece, ready=fours) for piece, fours in zip(pieces, ready))
    return Body(
        kernel=kernel,
        size=kernel.size,
        pieces=pieces,
        workspace=parts.size,
        stray=_stray(program, kernel, style),
        residual=value_text(kernel.loop.residual, style) if kernel.loop else "",
        turns=any(
            is_turn(s)
            for part in parts.parts
            for section in part.sections
            for s in section.statements
        ),
        zeros=any("_zeros(" in line for piece in pieces for line in piece.lines),
        given=given,
        columns=_columns(kernel.solving) if kernel.solving else None,
        finite=_looped(program, kernel) if style is SIDE_BY_SIDE else (),
        joined=sum(len(section.statements) for section in kernel.sections) <= JOINED,
    )


def _given(kernel: Kernel) -> Given | None:
    """Of functions that nothing but a batch calls."""
    if kernel.size < MANY_RESULTS or is_stepped(kernel) or kernel.loop or kernel.solving:
        return None
    last = kernel.size - FOUR
    places = [min(first, last) for first in range(0, kernel.size, FOUR)]
    blocks = {first: kernel.outputs[first : first + FOUR] for first in places}
    same = {first: block for first in places if (block := _numbers(blocks[first])) is not None}
    zeros = [first for first, block in same.items() if not any(block)]
    return Given(
        tuple(first for first in places if first not in same),
        tuple(_fours(zeros)),
        tuple((i, tuple(map(text.number, same[i]))) for i in same if i not in zeros),
    )


def _fours(places: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Stretches of four after four; the last four of a row may begin within those before."""
    whole = [first for first in places if first % FOUR == 0]
    yield from ((first, n - 1 + FOUR) for first, n in _stretches(whole, FOUR))
    yield from ((first, FOUR) for first in places if first % FOUR)


def _numbers(values: Sequence[Expression]) -> Sequence[float] | None:
    """The values, where all of them are numbers."""
    found = [value for value in values if not isinstance(value, (str, tuple))]
    return found if len(found) == len(values) else None


def _leave_out(parts: Sequence[Part], given: Given) -> None:
    """What is the same for all states is not written in lanes."""
    turned = {first + k for first in given.fours for k in range(FOUR)}
    for part in parts:
        part.outputs = [(i, value) for i, value in part.outputs if i in turned]


def _ready(parts: Sequence[Part], given: Given) -> list[tuple[int, ...]]:
    """Which four results are known after each part and were not before."""
    home = {i: k for k, part in enumerate(parts) for i in part.places}
    last = {first: max(home[first + k] for k in range(FOUR)) for first in given.fours}
    return [tuple(i for i in given.fours if last[i] == k) for k in range(len(parts))]


def _piece(
    program: Program, kernel: Kernel, part: Part, style: Style, lines: Callable[..., Iterator[str]]
) -> Piece:
    uses = {load.argument for load in part.loads}
    if part.taken or part.kept or any(i >= kernel.size for i, _ in part.outputs):
        uses.add("work")
    written = [i for i, value in part.outputs if i < kernel.size and is_written(kernel, value)]
    uses |= {"out" if _in_side(kernel, i) is None else "side" for i in written}
    uses |= {name for copy in part.copies for name in ("out", copy.argument)}
    if part.residual is not None:
        uses.add("residual")
    given = (*"txupc", "work", "out", *(["residual"] if kernel.loop else []))
    given = (*given, *(["side"] if kernel.solving else []))
    return Piece(
        lines=tuple(lines(program, kernel, part, style)),
        guards=tuple(
            (value_text(g.value, style), text.number(g.tolerance), text.comment(g.name))
            for g in part.guards
        ),
        unused=tuple(name for name in given if name not in uses),
        again=again(part, part.repeat, _carried(part, style)) if part.repeat else None,
    )


def _carried(part: Part, style: Style) -> Mapping[str, str]:
    """What stays in a local from block to block, by the local of a block that reads it."""
    return part.repeat.carried if part.repeat and style is ALONE else {}


def value_text(value: Expression, style: Style) -> str:
    return text.expression(value, style.language)


def _far(program: Program, kernel: Kernel, part: Part, style: Style) -> Iterator[str]:
    """Loads first, stores last."""
    yield from load_lines(part, style).values()
    for step in steps_of(program, part, style):
        yield from step.lines
    yield ""
    places = varying(part)
    yield from (
        output_line(kernel, i, style, places.get(i, ""))
        for i, value in part.outputs
        if is_written(kernel, value)
    )
    passed = part.repeat.passed if part.repeat and style is ALONE else ()
    yield from (
        _store_line(name, places.get(name, slot), style)
        for name, slot in part.kept
        if name not in passed
    )
    yield from copied_lines(kernel, part.copies, style)


def _near(program: Program, kernel: Kernel, part: Part, style: Style) -> Iterator[str]:
    """Loads at their first use, stores as soon as there is something to store, for the parts of a
    long function.

    gcc looks through all lines between a load and its only use for what could change the value
    (combine.cc): with all loads at the top its time is quadratic in the length of a part.
    """
    loads, stores = load_lines(part, style), _stores(kernel, part, style)
    for number, step in enumerate(steps_of(program, part, style)):
        for name in step.reads:
            if name in loads:
                yield from (loads.pop(name), *stores.pop(name, ()))
        yield from (
            step.lines if number else step.lines[1:]
        )  # the first heading without an empty line above
        for name in step.makes:
            yield from stores.pop(name, ())
    yield ""
    for name, line in loads.items():  # what results and guards alone need
        yield from (line, *stores.pop(name, ()))
    for lines in stores.values():
        yield from lines
    constants = [(i, value) for i, value in part.outputs if not isinstance(value, str)]
    yield from _constant(program, kernel, constants, style)
    yield from copied_lines(kernel, part.copies, style)


def _constant(
    program: Program, kernel: Kernel, outputs: Sequence[tuple[int, Expression]], style: Style
) -> Iterator[str]:
    """Results that are no locals; zeros by fours."""
    zeros = [i for i, value in outputs if value == 0.0 and not kernel.solving]
    cleared = set[int]()
    for first, n in _stretches(zeros, 1):
        whole = n // FOUR * FOUR
        yield from _cleared(program, first, whole)
        cleared.update(range(first, first + whole))
    for i, value in outputs:
        if i not in cleared and is_written(kernel, value):
            yield output_line(kernel, i, style)


def _cleared(program: Program, first: int, count: int) -> Iterator[str]:
    """So many zeros, a multiple of four; many in a loop, which is less to compile."""
    clear = f"{program.name}_zeros(out + {{}});"
    if count < MANY_ZEROS:
        yield from (clear.format(first + k) for k in range(0, count, FOUR))
    else:
        yield f"for (int i = 0; i < {count}; i += {FOUR})"
        yield "    " + clear.format(f"{first} + i" if first else "i")


def _stretches(places: Sequence[int], apart: int) -> list[tuple[int, int]]:
    """Sorted places as stretches, first and length, of which neighbours are further than `apart`
    from each other."""
    ends = [k for k in range(1, len(places)) if places[k] - places[k - 1] > apart]
    bounds = [0, *ends, len(places)] if places else [0]
    return [(places[a], places[b - 1] + 1 - places[a]) for a, b in pairwise(bounds)]


def copied_lines(kernel: Kernel, copies: Sequence[Copy], style: Style) -> Iterator[str]:
    for copy in copies:
        ends = (_note(kernel, copy.first), _note(kernel, copy.first + copy.count - 1))
        about = text.comment(" to ".join(ends))
        target, source = (
            style.entry.format(name, f"({first} + i)" if first else "i")
            for name, first in (("out", copy.first), (copy.argument, copy.index))
        )
        yield f"for (int i = 0; i < {copy.count}; i++) /* {about} */"
        yield f"    {target} = {source};"


def is_written(kernel: Kernel, value: Expression) -> bool:
    """Whether an output is to be written: where something is solved for, all begin as zeros."""
    return not (kernel.solving and value == 0.0)


def load_lines(part: Part, style: Style) -> dict[str, str]:
    """What arguments and the workspace hold, as lines by local name; t is an argument by itself."""
    entries = {
        load.name: (load.argument, load.index) for load in part.loads if load.argument != "t"
    }
    carried = _carried(part, style)
    entries |= {name: ("work", slot) for name, slot in part.taken if name not in carried}
    places = varying(part)
    lines = {
        name: f"const double {name} = {style.entry.format(array, places.get(name, place))};"
        for name, (array, place) in entries.items()
    }
    for name in part.repeat.constants if part.repeat else ():
        lines[name] = f"const double {name} = numbers_[{places[name]}];"
    return lines


def _stores(kernel: Kernel, part: Part, style: Style) -> dict[str, list[str]]:
    """The lines that store a local: into the workspace, as a result; not of repeats."""
    lines = {name: [_store_line(name, slot, style)] for name, slot in part.kept}
    for i, value in part.outputs:
        if isinstance(value, str):
            line = output_line(kernel, i, style)
            lines.setdefault(value, []).append(line)
    return lines


def _store_line(name: str, place: str | int, style: Style) -> str:
    return f"{style.entry.format('work', place)} = {name};"


def steps_of(program: Program, part: Part, style: Style) -> Iterator[Step]:
    taken = {statement.name for section in part.sections for statement in section.statements}
    taken |= {load.name for load in part.loads} | {name for name, _ in part.taken}
    for section in part.sections:
        yield Step(("", f"/* {text.comment(section.title)} */"), (), ())
        turns = style.turns(program.name, section, taken)
        for statement in section.statements:
            if not is_turn(statement):
                line = f"const double {statement.name} = {value_text(statement.value, style)};"
                yield Step([line], list(names(statement.value)), [statement.name])
            elif statement.name in turns:
                yield turns.pop(statement.name)


ALONE = Style("{0}[{1}]", text.C, by_fours)
SIDE_BY_SIDE = Style("{0}[{1} * LANES + lane]", text.LANES, by_lanes)


def output_line(kernel: Kernel, i: int, style: Style, where: str = "") -> str:
    """`where` it stands, if that is not i itself."""
    if i >= kernel.size:  # what solving takes stands first in the workspace
        place = style.entry.format("work", i - kernel.size)
        return f"{place} = {value_text(kernel.computed[i], style)};"
    note = text.comment(_note(kernel, i))
    beside = _in_side(kernel, i)
    place = style.entry.format(*(("out", where or i) if beside is None else ("side", beside)))
    return f"{place} = {value_text(kernel.outputs[i], style)};" + (f" /* {note} */" if note else "")


def _in_side(kernel: Kernel, i: int) -> int | None:
    """Where an entry of a right-hand side stands while it is solved for."""
    of = kernel.solving
    if of is None or i < of.first * of.size:
        return None
    row, column = divmod(i - of.first * of.size, of.size)
    columns = _columns(of)
    for place, begin, end in columns.ranges:
        if begin <= column < end:
            return row * columns.wide + place + column - begin
    return None


def _columns(of: Solving) -> Columns:
    """In whole groups, as many abreast as leave the fewest places empty."""
    lengths = [end - begin for begin, end in of.ranges]
    edges = [0, *(edge for pair in of.ranges for edge in pair), of.size]
    groups = {k: -(-sum(lengths) // (k * EIGHT)) for k in ABREAST}
    abreast = min(ABREAST, key=lambda k: k * groups[k])
    return Columns(
        abreast,
        abreast * groups[abreast] * EIGHT,
        [(sum(lengths[:k]), *of.ranges[k]) for k in range(len(lengths))],
        [(a, b) for a, b in zip(edges[::2], edges[1::2]) if a < b],
    )


def _note(kernel: Kernel, i: int) -> str:
    """What an entry of the result is, with its unit."""
    label = kernel.labels[i] if i < len(kernel.labels) else ""
    unit = kernel.units[i] if i < len(kernel.units) else ""
    return ", ".join(part for part in (label, unit) if part)


def _stray(program: Program, kernel: Kernel, style: Style) -> str:
    """0 * value is 0 for finite values and NaN for the others; many values are gone through in
    loops. What is solved for is looked at there. In lanes t is read where it is looked at, as the
    last part of a long function need not have it."""
    t = "t_[lane]" if style is SIDE_BY_SIDE else "t"
    if kernel.solving:
        sizes = {a.name: len(a.names) for a in program.arguments} | {"x": len(kernel.x.names)}
        given = [f"{program.name}_stray({a}, {sizes[a]})" for a in kernel.uses if a != "t"]
        return _added([*given, f"0.0 * {t}", "solved"])
    watched = [t if name == "t" else style.entry.format(name, i) for name, i in kernel.watched]
    looked_at = () if style is SIDE_BY_SIDE and _given(kernel) else kernel.results
    results = [style.entry.format("out", i) for i in looked_at]
    if style is SIDE_BY_SIDE and kernel.repeats:
        return "0.0"  # looked at in loops
    if len(watched) + len(results) <= FEW or style is SIDE_BY_SIDE:
        return _added([f"0.0 * {value}" for value in (*watched, *results)])
    sizes = {argument.name: len(argument.names) for argument in program.arguments} | {
        "x": len(kernel.x.names)
    }
    slots = dict.fromkeys(name for name, _ in kernel.watched)
    calls = [
        "0.0 * t" if name == "t" else f"{program.name}_stray({name}, {sizes[name]})"
        for name in slots
    ]
    calls += [
        f"{program.name}_stray({f'out + {first}' if first else 'out'}, {count})"
        for first, count in _stretches(kernel.results, APART)
    ]
    return " + ".join(calls) or "0.0"


def _looped(program: Program, kernel: Kernel) -> tuple[tuple[str, str, int], ...]:
    """What is looked at in loops over lanes, where there are too many for one expression."""
    if not kernel.repeats:
        return ()
    sizes = {a.name: len(a.names) for a in program.arguments} | {"x": len(kernel.x.names)}
    watched = dict.fromkeys(name for name, _ in kernel.watched)
    arguments = ((name, name, sizes[name]) for name in watched)
    results = () if _given(kernel) else _stretches(kernel.results, APART)
    return (*arguments, *(("out", f"out + {first} * LANES", count) for first, count in results))


def _added(terms: Sequence[str]) -> str:
    """A sum in three independent chains, so that no addition waits long for the one before."""
    chains = [" + ".join(terms[k::3]) for k in range(min(3, len(terms)))]
    return " + ".join(chain if len(chains) == 1 else f"({chain})" for chain in chains) or "0.0"
