"""C99: a header and source files, straight-line code, no allocation, nothing but libm behind it.

NAME.c has every function for one state, NAME_batch.c the same for several states side by side, in
loops that compilers turn into vector instructions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from codegen import text
from codegen.passes.angles import Turn, spelled, turns
from codegen.passes.lanes import (
    CONSTRAINTS,
    DYNAMICS,
    GUARDS,
    POWER,
    SHORTER,
    STEPPED,
    has_looked,
    has_pairs,
    has_rates,
    has_slope,
    is_batched,
    most_lanes,
    side_by_side,
)
from codegen.passes.schedule import TURNS
from codegen.passes.split import Copy, Part, names, split
from codegen.program import (
    BASE,
    PREVIOUS,
    Expression,
    Kernel,
    Program,
    Rolled,
    Section,
    Solving,
    Statement,
)
from codegen.targets.records import Target
from codegen.targets.rolled import Text, c_text

FEW = 24  # values that are added up one by one to see that all are finite
# results from which on each is stored as soon as it is known, as the parts of a long function do:
# registers do not hold them to the end
MANY = 200
FOUR = 4  # neighbouring results that are set to zero at once
# statements up to which the parts of a function for several states side by side are joined again: a
# compiler then keeps in registers what one part hands on to the next, and vectors are long
JOINED = 2_000
# vectors of up to EIGHT columns that are solved for side by side: a multiplication and addition
# takes as long as four of them, and any that is late is made up for by one more
ABREAST, EIGHT = (12, 11, 10, 9, 8, 7, 6, 5, 4), 8
APART = 16  # places; results further from each other are looked at in two calls
_CALL = re.compile(r"_sincos\((.*), &\w+, &\w+\);$")  # of a sine with its cosine in lanes
FEATURES = ("avx", "avx2", "fma", "bmi", "bmi2", "avx512f", "avx512dq", "avx512bw", "avx512vl")


@dataclass(frozen=True)
class Piece:
    """A part of a kernel as lines of C."""

    lines: tuple[
        str, ...
    ]  # loads, values from the workspace, statements, results, values into the workspace
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    unused: tuple[str, ...]
    ready: tuple[int, ...] = ()  # four results from here on are known after it, and leave the lanes


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
    finite: tuple[tuple[str, str, int], ...] = ()  # arrays that are looked at: name, array, length
    given: Given | None = None  # results that are looked at when they leave the lanes
    joined: bool = False  # are its pieces put together again?
    columns: Columns | None = None  # what is solved for after its pieces


@dataclass(frozen=True)
class Moved:
    """What steps of motions side by side call: kernels at once, each into a result of its own."""

    name: str
    parts: tuple[tuple[Body, str], ...]  # and the names of the results
    guarded: bool  # may a pivot be near zero?
    twice: bool = False  # also for two groups of lanes at a time


@dataclass(frozen=True)
class _Step:
    """Lines that belong together, the locals that they read and those that they make."""

    lines: Sequence[str]
    reads: Sequence[str]
    makes: Sequence[str]


@dataclass(frozen=True)
class _Style:
    """How entry i of an array is written; at which statement of a section what step for sines and
    cosines stands."""

    entry: str
    language: text.Language
    turns: Callable[[str, Section, set[str]], dict[str, _Step]]


def files(program: Program) -> dict[str, str]:
    """NAME.h, NAME.c, NAME_batch.c, and a NAME_FUNCTION.c for every long function, so that several
    are compiled at a time."""
    widths = {argument.name: len(argument.names) for argument in program.arguments}
    data: dict[str, Any] = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "widths": widths,
    }
    bodies = [_body(program, kernel, _ONE) for kernel in program.kernels]
    hoisted = [(kernel, kernel.hoisted) for kernel in program.kernels if kernel.hoisted]
    data["hoisted"] = [
        (k, _body(program, h.precompute, _ONE), _body(program, h.rest, _ONE)) for k, h in hoisted
    ]
    batches = [_batch(program, kernel) for kernel in program.kernels if is_batched(kernel)]
    stepped = [
        _beside(program, kernel) for kernel in side_by_side(program) if not is_batched(kernel)
    ]
    short = [body for body in bodies if len(body.pieces) == 1 and not _is_apart(body)]
    data |= {"previous": PREVIOUS, "base": BASE}
    long = {
        f"{program.name}_{body.kernel.name}.c": text.render("long.c.j2", bodies=[body], **data)
        for body in bodies
        if _is_apart(body)
    }
    long |= {
        f"{program.name}_{body.kernel.name}.c": text.render("loops.c.j2", bodies=[body], **data)
        for body in bodies
        if body.rolled
    }
    return {
        f"{program.name}.h": text.render("header.h.j2", bodies=bodies, batches=batches, **data),
        f"{program.name}.c": text.render("source.c.j2", bodies=short, features=FEATURES, **data),
        f"{program.name}_cpu.c": text.render("cpu.c.j2", features=FEATURES, **data),
        **(
            {f"{program.name}_inline.h": text.render("inline.h.j2", bodies=bodies, **data)}
            if program.inline
            else {}
        ),
        **(
            {
                f"{program.name}_batch.c": text.render(
                    "batch.c.j2",
                    bodies=batches,
                    stepped=stepped,
                    moved=_moved(program),
                    looked=_looked(program),
                    plain=_plain(program),
                    compared=_compared([*batches, *stepped]),
                    **data,
                ),
                f"{program.name}_lanes.h": text.render(
                    "lanes.h.j2",
                    room=most_lanes(program),
                    bodies=batches,
                    stepped=stepped,
                    moved=_moved(program),
                    looked=_looked(program),
                    **data,
                ),
            }
            if batches
            else {}
        ),
        **long,
    }


def _is_apart(body: Body) -> bool:
    """Whether it has a file of its own, which is compiled as long functions are."""
    return len(body.pieces) > 1 or (len(body.pieces) == 1 and body.size >= MANY)


def _compared(bodies: Sequence[Body]) -> set[str]:
    """Which of the comparisons of text.LANES occur."""
    lines = [line for body in bodies for piece in body.pieces for line in piece.lines]
    written = " ".join([*lines, *(body.residual for body in bodies)])
    return {name for name in ("LARGER", "SMALLER") if f"{name}(" in written}


def _moved(program: Program) -> list[Moved]:
    """What steps of motions call instead of dynamics, and of dynamics and power."""
    if not has_rates(program):
        return []
    rates = (_moving(program, DYNAMICS), "out")
    found = [_at_once("rates", (rates,), has_pairs(program))]
    if has_slope(program):
        slope = (rates, (_moving(program, POWER, DYNAMICS), "power"))
        found.append(_at_once("slope", slope, has_pairs(program)))
    return found


def _at_once(name: str, parts: tuple[tuple[Body, str], ...], twice: bool) -> Moved:
    guarded = any(piece.guards for body, _ in parts for piece in body.pieces)
    return Moved(name, parts, guarded, twice)


def _beside(program: Program, kernel: Kernel) -> Body:
    """What a step calls besides."""
    return (
        _moving(program, kernel.name, checked=True)
        if kernel.name in SHORTER and not kernel.rolled
        else _body(program, kernel, _MANY)
    )


def _looked(program: Program) -> Moved | None:
    """Constraints and guards at once, where there are both."""
    if not has_looked(program):
        return None
    first = _moving(program, CONSTRAINTS, checked=True)
    second = _moving(program, GUARDS, CONSTRAINTS, checked=True)
    return Moved("looked", ((first, "out"), (second, "seen")), guarded=True)


def _moving(program: Program, name: str, before: str = "", checked: bool = False) -> Body:
    """With shorter sines and cosines, those of sums from those of their parts. How large angles are
    is looked at where it is `checked`; in dynamics that is done once for a step. Behind another
    kernel what that has is made as it was there."""
    kernel, constants = _taken(program, name)
    (part,) = split(kernel).parts
    loads, angles = part.loads, ()
    if before:
        (other,) = split(_taken(program, before)[0]).parts
        loads = tuple(
            dict.fromkeys((*loads, *(load for load in other.loads if load.argument == "x")))
        )
        angles = tuple(_spelled_angles(other))
    given = {load.name for load in loads}
    steps = list(_moving_steps(program, part, given, angles, checked))
    body = _body(program, kernel, _MANY)
    lines = _lines(kernel, replace(part, loads=loads), steps)
    pieces = (replace(body.pieces[0], lines=tuple(lines)),)
    return replace(body, pieces=pieces, constants=constants)


def _spelled_angles(part: Part) -> list[Expression]:
    values = {s.name: s.value for section in part.sections for s in section.statements}
    angles = (angle for section in part.sections for angle in _angles(section))
    return [spelled(angle, values) for angle in angles]


def _plain(program: Program) -> list[Body]:
    """What is looked at once for a step: angles that are not too large, and what has to be
    finite."""
    names = (DYNAMICS, POWER) if has_slope(program) else (DYNAMICS,) if has_rates(program) else ()
    return [_looking(program, name) for name in names]


def _looking(program: Program, name: str) -> Body:
    """The angles of a kernel, and what they need."""
    kernel, constants = _taken(program, name)
    (part,) = split(kernel).parts
    body = _body(program, kernel, _MANY)
    steps: list[_Step] = []
    for step in _steps(program, part, _MANY):
        call = _CALL.search(step.lines[-1])
        if call:
            steps.append(_Step([_in_reach(program, call[1])], step.reads, ()))
        steps.append(step)
    kept = [step for step in _live(steps, set()) if step.reads or step.makes]
    reads = {name for step in kept for name in step.reads}
    loads = [line for name, line in _loads(part, _MANY).items() if name in reads]
    if "t" in {*reads, *(name for name, _ in kernel.watched)}:
        loads.insert(0, "const double t = t_[lane];")
    lines = (*loads, *(line for step in kept for line in step.lines))
    pieces = (replace(body.pieces[0], lines=lines, guards=()),)
    return replace(body, pieces=pieces, constants=constants)


def _taken(program: Program, name: str) -> tuple[Kernel, int]:
    """As the loops over lanes take it: the constants of dynamics are precomputed."""
    kernel = program.kernel(name)
    return _rest(kernel) if name == DYNAMICS else (kernel, 0)


def _live(steps: Sequence[_Step], wanted: set[str]) -> list[_Step]:
    """Without those whose locals nobody reads."""
    kept: list[_Step] = []
    for step in reversed(steps):
        if not step.makes or wanted & set(step.makes):
            kept.insert(0, step)
            wanted |= set(step.reads)
    return kept


def _lines(kernel: Kernel, part: Part, steps: Sequence[_Step]) -> Iterator[str]:
    """As _far, without what is not read."""
    results = [value for _, value in part.outputs if _stands(kernel, value)]
    values = [*results, *(guard.value for guard in part.guards)]
    values += [part.residual] if part.residual is not None else []
    kept = _live(steps, {name for value in values for name in names(value)})
    reads = {name for step in kept for name in step.reads} | {n for v in values for n in names(v)}
    yield from (line for name, line in _loads(part, _MANY).items() if name in reads)
    for step in kept:
        yield from step.lines
    yield ""
    yield from (_output(kernel, i, _MANY) for i, value in part.outputs if _stands(kernel, value))
    yield from _copied(kernel, part.copies, _MANY)


def _moving_steps(
    program: Program,
    part: Part,
    given: set[str],
    before: Sequence[Expression],
    checked: bool,
) -> Iterator[_Step]:
    """As _steps; sums of angles stand behind their parts, all of them at the first of them."""
    statements = [s for section in part.sections for s in section.statements]
    taken = {s.name for s in statements}
    values = {s.name: s.value for s in statements}
    for section in part.sections:
        yield _Step(("", f"/* {text.comment(section.title)} */"), (), ())
        own = _angles(section)
        sums = turns(list(own), values, given, before) if own else []
        more = [turn.angle for turn in sums if turn.angle not in own]
        pairs = own | {angle: {"sin": _fresh("sine", taken)} for angle in more}
        places = {angle: _pair(pair, taken) for angle, pair in pairs.items()}
        together = [s for turn in sums for s in _turned(program, turn, places, values, checked)]
        steps = {
            next(iter(own[angle].values())): [_short(program, angle, places[angle], checked)]
            for angle in own
            if angle not in [turn.angle for turn in sums]
        }
        firsts = [next(iter(pair.values())) for pair in own.values()]
        late = [name for name in firsts if name not in steps]
        steps |= dict.fromkeys(late[:1], together)
        for statement in section.statements:
            if _is_turn(statement):
                yield from steps.get(statement.name, ())
                continue
            line = f"const double {statement.name} = {_value(statement.value, _MANY)};"
            yield _Step([line], list(names(statement.value)), [statement.name])


def _turned(
    program: Program,
    turn: Turn,
    places: Mapping[Expression, tuple[str, str]],
    values: Mapping[str, Expression],
    checked: bool,
) -> Iterator[_Step]:
    """The sine and the cosine of a sum of angles."""
    sin, cos = places[turn.angle]
    if not turn.of:
        yield _short(program, spelled(turn.angle, values), places[turn.angle], checked)
        return
    (sin_a, cos_a), (sin_b, cos_b) = (places[angle] for angle in turn.of)
    plus, minus = ("+", "-") if turn.sign > 0 else ("-", "+")
    reads = (sin_a, cos_a, sin_b, cos_b)
    yield _Step([f"const double {sin} = {sin_a} * {cos_b} {plus} {cos_a} * {sin_b};"], reads, [sin])
    yield _Step(
        [f"const double {cos} = {cos_a} * {cos_b} {minus} {sin_a} * {sin_b};"], reads, [cos]
    )


def _short(program: Program, angle: Expression, place: tuple[str, str], checked: bool) -> _Step:
    sin, cos = place
    value = _value(angle, _MANY)
    lines = [
        f"double {sin}, {cos};",
        f"{program.name}_sincos_short({value}, &{sin}, &{cos});",
        *([_in_reach(program, value)] if checked else []),
    ]
    return _Step(lines, list(names(angle)), place)


def _in_reach(program: Program, value: str) -> str:
    return f"bad += fabs({value}) <= {program.real.reach} ? 0.0 : 1.0;"


def _pair(pair: dict[str, str], taken: set[str]) -> tuple[str, str]:
    """Names of the sine and the cosine of an angle."""
    first = next(iter(pair.values()))
    sin, cos = (pair.get(name) or _fresh(f"{first}_{name}", taken) for name in ("sin", "cos"))
    return sin, cos


def _batch(program: Program, kernel: Kernel) -> Body:
    """For lanes constants are always precomputed where there are any."""
    rest, constants = _rest(kernel)
    return replace(_body(program, rest, _MANY), constants=constants)


def _rest(kernel: Kernel) -> tuple[Kernel, int]:
    """What is left behind the constants that are precomputed, and how many these are."""
    if not kernel.hoisted:
        return kernel, 0
    return replace(kernel.hoisted.rest, name=kernel.name), kernel.hoisted.precompute.size


def _loops(program: Program, kernel: Kernel, of: Rolled, style: _Style) -> Body:
    """Loops over links, with what the tables take of parameters before them."""
    lines = [
        f"const double {load.name} = {style.entry.format(load.argument, load.index)};"
        for load in kernel.loads
    ]
    lines += [
        f"const double {s.name} = {_value(s.value, style)};"
        for section in kernel.sections
        for s in section.statements
    ]
    own = f"{program.name}_{kernel.name}_"
    sizes = {argument.name: len(argument.names) for argument in program.arguments}
    return Body(
        kernel=kernel,
        size=kernel.size,
        pieces=(),
        workspace=of.workspace,
        stray=_stray(program, kernel, style),
        residual="",
        turns=any(of.angles),
        rolled=c_text(kernel, of, own, style is _MANY, lines),
        finite=(
            *((name, "t_" if name == "t" else name, sizes[name]) for name in kernel.uses),
            ("out", "out", kernel.size),
        ),
    )


def _body(program: Program, kernel: Kernel, style: _Style) -> Body:
    if kernel.rolled:
        return _loops(program, kernel, kernel.rolled, style)
    parts = split(kernel)
    given = _given(kernel) if style is _MANY else None
    if given:
        _leave_out(parts.parts, given)
    many = len(parts.parts) > 1 or kernel.size >= MANY
    lines = _near if many and style is _ONE else _far
    pieces = tuple(_piece(program, kernel, part, style, lines) for part in parts.parts)
    if given:
        ready = _ready(parts.parts, given)
        pieces = tuple(replace(piece, ready=fours) for piece, fours in zip(pieces, ready))
    return Body(
        kernel=kernel,
        size=kernel.size,
        pieces=pieces,
        workspace=parts.size,
        stray=_stray(program, kernel, style),
        residual=_value(kernel.loop.residual, style) if kernel.loop else "",
        turns=any(
            _is_turn(s)
            for part in parts.parts
            for section in part.sections
            for s in section.statements
        ),
        zeros=any("_zeros(" in line for piece in pieces for line in piece.lines),
        given=given,
        columns=_columns(kernel.solving) if kernel.solving else None,
        joined=sum(len(section.statements) for section in kernel.sections) <= JOINED,
    )


def _given(kernel: Kernel) -> Given | None:
    """Of functions that nothing but a batch calls."""
    if kernel.size < MANY or kernel.name in (DYNAMICS, *STEPPED) or kernel.loop or kernel.solving:
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
    home = {i: k for k, part in enumerate(parts) for i, _ in part.outputs}
    last = {first: max(home[first + k] for k in range(FOUR)) for first in given.fours}
    return [tuple(i for i in given.fours if last[i] == k) for k in range(len(parts))]


def _piece(
    program: Program, kernel: Kernel, part: Part, style: _Style, lines: Callable[..., Iterator[str]]
) -> Piece:
    uses = {load.argument for load in part.loads}
    if part.taken or part.kept or any(i >= kernel.size for i, _ in part.outputs):
        uses.add("work")
    written = [i for i, value in part.outputs if i < kernel.size and _stands(kernel, value)]
    uses |= {"out" if _in_side(kernel, i) is None else "side" for i in written}
    uses |= {name for copy in part.copies for name in ("out", copy.argument)}
    if part.residual is not None:
        uses.add("residual")
    given = (*"txupc", "work", "out", *(["residual"] if kernel.loop else []))
    given = (*given, *(["side"] if kernel.solving else []))
    return Piece(
        lines=tuple(lines(program, kernel, part, style)),
        guards=tuple(
            (_value(g.value, style), text.number(g.tolerance), text.comment(g.name))
            for g in part.guards
        ),
        unused=tuple(name for name in given if name not in uses),
    )


def _value(value: Expression, style: _Style) -> str:
    return text.expression(value, style.language)


def _far(program: Program, kernel: Kernel, part: Part, style: _Style) -> Iterator[str]:
    """Loads first, stores last."""
    yield from _loads(part, style).values()
    for step in _steps(program, part, style):
        yield from step.lines
    yield ""
    yield from (_output(kernel, i, style) for i, value in part.outputs if _stands(kernel, value))
    yield from (_store_line(name, slot, style) for name, slot in part.kept)
    yield from _copied(kernel, part.copies, style)


def _near(program: Program, kernel: Kernel, part: Part, style: _Style) -> Iterator[str]:
    """Loads at their first use, stores as soon as there is something to store, for the parts of a
    long function.

    gcc looks through all lines between a load and its only use for what could change the value
    (combine.cc): with all loads at the top its time is quadratic in the length of a part.
    """
    loads, stores = _loads(part, style), _stores(kernel, part, style)
    for number, step in enumerate(_steps(program, part, style)):
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
    yield from _copied(kernel, part.copies, style)


def _constant(
    program: Program, kernel: Kernel, outputs: Sequence[tuple[int, Expression]], style: _Style
) -> Iterator[str]:
    """Results that are no locals; zeros by fours."""
    zeros = [i for i, value in outputs if value == 0.0 and not kernel.solving]
    stretches = _stretches(zeros, 1)
    fours = [first + k for first, n in stretches for k in range(0, n - FOUR + 1, FOUR)]
    yield from (f"{program.name}_zeros(out + {first});" for first in fours)
    cleared = {first + k for first in fours for k in range(FOUR)}
    for i, value in outputs:
        if i not in cleared and _stands(kernel, value):
            yield _output(kernel, i, style)


def _stretches(places: Sequence[int], apart: int) -> list[tuple[int, int]]:
    """Sorted places as stretches, first and length, of which neighbours are further than `apart`
    from each other."""
    ends = [k for k in range(1, len(places)) if places[k] - places[k - 1] > apart]
    bounds = [0, *ends, len(places)] if places else [0]
    return [(places[a], places[b - 1] + 1 - places[a]) for a, b in pairwise(bounds)]


def _copied(kernel: Kernel, copies: Sequence[Copy], style: _Style) -> Iterator[str]:
    for copy in copies:
        ends = (_note(kernel, copy.first), _note(kernel, copy.first + copy.count - 1))
        about = text.comment(" to ".join(ends))
        target, source = (
            style.entry.format(name, f"({first} + i)" if first else "i")
            for name, first in (("out", copy.first), (copy.argument, copy.index))
        )
        yield f"for (int i = 0; i < {copy.count}; i++) /* {about} */"
        yield f"    {target} = {source};"


def _stands(kernel: Kernel, value: Expression) -> bool:
    """Whether an output is to be written: where something is solved for, all begin as zeros."""
    return not (kernel.solving and value == 0.0)


def _loads(part: Part, style: _Style) -> dict[str, str]:
    """What arguments and the workspace hold, as lines by local name; t is an argument by itself."""
    entries = {
        load.name: (load.argument, load.index) for load in part.loads if load.argument != "t"
    }
    entries |= {name: ("work", slot) for name, slot in part.taken}
    return {
        name: f"const double {name} = {style.entry.format(*entry)};"
        for name, entry in entries.items()
    }


def _stores(kernel: Kernel, part: Part, style: _Style) -> dict[str, list[str]]:
    """The lines that store a local: into the workspace, as a result."""
    lines = {name: [_store_line(name, slot, style)] for name, slot in part.kept}
    for i, value in part.outputs:
        if isinstance(value, str):
            lines.setdefault(value, []).append(_output(kernel, i, style))
    return lines


def _store_line(name: str, slot: int, style: _Style) -> str:
    return f"{style.entry.format('work', slot)} = {name};"


def _steps(program: Program, part: Part, style: _Style) -> Iterator[_Step]:
    taken = {statement.name for section in part.sections for statement in section.statements}
    for section in part.sections:
        yield _Step(("", f"/* {text.comment(section.title)} */"), (), ())
        turns = style.turns(program.name, section, taken)
        for statement in section.statements:
            if not _is_turn(statement):
                line = f"const double {statement.name} = {_value(statement.value, style)};"
                yield _Step([line], list(names(statement.value)), [statement.name])
            elif statement.name in turns:
                yield turns.pop(statement.name)


def _is_turn(statement: Statement) -> bool:
    """A sine or a cosine."""
    return isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")


def _angles(section: Section) -> dict[Expression, dict[str, str]]:
    """Which locals are the sine and the cosine of an angle."""
    pairs: dict[Expression, dict[str, str]] = {}
    for statement in section.statements:
        if isinstance(statement.value, tuple) and _is_turn(statement):
            pairs.setdefault(statement.value[1], {})[statement.value[0]] = statement.name
    return pairs


def _by_lanes(prefix: str, section: Section, taken: set[str]) -> dict[str, _Step]:
    """At the first of a sine and cosine the a step for both."""
    steps: dict[str, _Step] = {}
    for angle, pairs in _angles(section).items():
        first = next(iter(pairs.values()))
        sin, cos = (pairs.get(name) or _fresh(f"{first}_{name}", taken) for name in ("sin", "cos"))
        call = f"bad += {prefix}_sincos({text.expression(angle, text.C)}, &{sin}, &{cos});"
        steps[first] = _Step([f"double {sin}, {cos};", call], list(names(angle)), [sin, cos])
    return steps


def _by_fours(prefix: str, section: Section, taken: set[str]) -> dict[str, _Step]:
    """At the last sine or cosine the a step for all, four angles at a time; where one needs
    another, one by one."""
    angles = list(_angles(section).items())
    groups = (
        [angles[i : i + 4] for i in range(0, len(angles), 4)]
        if section.title == TURNS
        else [[item] for item in angles]
    )
    steps: dict[str, _Step] = {}
    for group in groups:
        last = [
            s.name
            for s in section.statements
            if any(s.name in pairs.values() for _, pairs in group)
        ]
        sines, cosines = _fresh("sines", taken), _fresh("cosines", taken)
        values = [*(text.expression(angle, text.C) for angle, _ in group), "0.0", "0.0", "0.0"][:4]
        calls = [
            f"double {sines}[4], {cosines}[4];",
            f"{prefix}_turns({', '.join(values)}, {sines}, {cosines});",
        ]
        for k, (_, pairs) in enumerate(group):
            calls += [
                f"const double {local} = {sines if name == 'sin' else cosines}[{k}];"
                for name, local in pairs.items()
            ]
        reads = [name for angle, _ in group for name in names(angle)]
        step = _Step(calls, reads, [local for _, pairs in group for local in pairs.values()])
        steps[last[-1] if section.title == TURNS else last[0]] = step
    return steps


def _fresh(wanted: str, taken: set[str]) -> str:
    """The name, with lines under it until nothing else is called so."""
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted


_ONE = _Style("{0}[{1}]", text.C, _by_fours)
_MANY = _Style("{0}[{1} * LANES + lane]", text.LANES, _by_lanes)


def _output(kernel: Kernel, i: int, style: _Style) -> str:
    if i >= kernel.size:  # what solving takes stands first in the workspace
        place = style.entry.format("work", i - kernel.size)
        return f"{place} = {_value(kernel.computed[i], style)};"
    note = text.comment(_note(kernel, i))
    beside = _in_side(kernel, i)
    place = style.entry.format(*(("out", i) if beside is None else ("side", beside)))
    return f"{place} = {_value(kernel.outputs[i], style)};" + (f" /* {note} */" if note else "")


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


def _stray(program: Program, kernel: Kernel, style: _Style) -> str:
    """0 * value is 0 for finite values and NaN for the others; many values are gone through in
    loops. What is solved for is looked at there."""
    if kernel.solving:
        sizes = {a.name: len(a.names) for a in program.arguments} | {"x": len(kernel.x.names)}
        given = [f"{program.name}_stray({a}, {sizes[a]})" for a in kernel.uses if a != "t"]
        return _added([*given, "0.0 * t", "solved"])
    watched = ["t" if name == "t" else style.entry.format(name, i) for name, i in kernel.watched]
    looked_at = () if style is _MANY and _given(kernel) else kernel.results
    results = [style.entry.format("out", i) for i in looked_at]
    if len(watched) + len(results) <= FEW or style is _MANY:
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


def _added(terms: Sequence[str]) -> str:
    """A sum in three independent chains, so that no addition waits long for the one before."""
    chains = [" + ".join(terms[k::3]) for k in range(min(3, len(terms)))]
    return " + ".join(chain if len(chains) == 1 else f"({chain})" for chain in chains) or "0.0"


C = Target("c", "C99 source and header", files)
