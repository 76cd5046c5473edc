"""C99: a header and source files, straight-line code, no allocation, nothing but libm behind it.

NAME.c has every function for one state, NAME_batch.c the same for several states side by side, in loops that compilers turn
into vector instructions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from codegen import text
from codegen.passes.lanes import is_batched
from codegen.passes.schedule import TURNS
from codegen.passes.split import Part, split
from codegen.program import Expression, Kernel, Program, Section, Statement
from codegen.targets.records import Target

FEW = 24  # values that are added up one by one to see that all are finite
FEATURES = ("avx", "avx2", "fma", "bmi", "bmi2", "avx512f", "avx512dq", "avx512bw", "avx512vl")


@dataclass(frozen=True)
class Piece:
    """A part of a kernel as lines of C."""

    lines: tuple[str, ...]  # loads, values from the workspace, statements
    outputs: tuple[str, ...]
    kept: tuple[str, ...]  # values into the workspace
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    unused: tuple[str, ...]


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
    constants: int = 0  # length of c, where it takes precomputed constants


@dataclass(frozen=True)
class _Style:
    """How entry i of an array is written; at which statement of a section what lines for sines and cosines stand."""

    entry: str
    turns: Callable[[str, Section, set[str]], dict[str, list[str]]]


def files(program: Program) -> dict[str, str]:
    """NAME.h, NAME.c, NAME_batch.c, and a NAME_FUNCTION.c for every long function, so that several are compiled at a time."""
    widths = {argument.name: len(argument.names) for argument in program.arguments}
    data: dict[str, object] = {"program": program, "prefix": program.name, "PREFIX": program.name.upper(), "widths": widths}
    bodies = [_body(program, kernel, _ONE) for kernel in program.kernels]
    hoisted = [(kernel, kernel.hoisted) for kernel in program.kernels if kernel.hoisted]
    data["hoisted"] = [(k, _body(program, h.precompute, _ONE), _body(program, h.rest, _ONE)) for k, h in hoisted]
    batches = [_batch(program, kernel) for kernel in program.kernels if is_batched(kernel)]
    short = [body for body in bodies if len(body.pieces) == 1]
    long = {
        f"{program.name}_{body.kernel.name}.c": text.render("long.c.j2", bodies=[body], **data)
        for body in bodies
        if len(body.pieces) > 1
    }
    return {
        f"{program.name}.h": text.render("header.h.j2", bodies=bodies, batches=batches, **data),
        f"{program.name}.c": text.render("source.c.j2", bodies=short, features=FEATURES, **data),
        f"{program.name}_cpu.c": text.render("cpu.c.j2", features=FEATURES, **data),
        **({f"{program.name}_inline.h": text.render("inline.h.j2", bodies=bodies, **data)} if program.inline else {}),
        **({f"{program.name}_batch.c": text.render("batch.c.j2", bodies=batches, **data)} if batches else {}),
        **long,
    }


def _batch(program: Program, kernel: Kernel) -> Body:
    """For lanes constants are always precomputed where there are any."""
    if not kernel.hoisted:
        return _body(program, kernel, _MANY)
    rest = replace(kernel.hoisted.rest, name=kernel.name)
    return replace(_body(program, rest, _MANY), constants=len(kernel.hoisted.precompute.outputs))


def _body(program: Program, kernel: Kernel, style: _Style) -> Body:
    parts = split(kernel)
    return Body(
        kernel=kernel,
        size=len(kernel.outputs),
        pieces=tuple(_piece(program, kernel, part, style) for part in parts.parts),
        workspace=parts.size,
        stray=_stray(program, kernel, style),
        residual=_value(kernel.loop.residual) if kernel.loop else "",
        turns=any(_is_turn(s) for part in parts.parts for section in part.sections for s in section.statements),
    )


def _piece(program: Program, kernel: Kernel, part: Part, style: _Style) -> Piece:
    uses = {load.argument for load in part.loads} | ({"work"} if part.taken or part.kept else set())
    uses |= ({"out"} if part.outputs else set()) | (set() if part.residual is None else {"residual"})
    names = (*"txupc", "work", "out", *(["residual"] if kernel.loop else []))
    return Piece(
        lines=tuple(_lines(program, part, style)),
        outputs=tuple(_output(kernel, i, style) for i, _ in part.outputs),
        kept=tuple(f"{style.entry.format('work', slot)} = {name};" for name, slot in part.kept),
        guards=tuple((_value(g.value), text.number(g.tolerance), text.comment(g.name)) for g in part.guards),
        unused=tuple(name for name in names if name not in uses),
    )


def _value(value: Expression) -> str:
    return text.expression(value, text.C)


def _lines(program: Program, part: Part, style: _Style) -> Iterator[str]:
    for load in part.loads:
        if load.argument != "t":
            yield f"const double {load.name} = {style.entry.format(load.argument, load.index)};"
    for name, slot in part.taken:
        yield f"const double {name} = {style.entry.format('work', slot)};"
    taken = {statement.name for section in part.sections for statement in section.statements}
    for section in part.sections:
        yield ""
        yield f"/* {text.comment(section.title)} */"
        turns = style.turns(program.name, section, taken)
        for statement in section.statements:
            if _is_turn(statement):
                yield from turns.pop(statement.name, ())
            else:
                yield f"const double {statement.name} = {_value(statement.value)};"


def _is_turn(statement: Statement) -> bool:
    """A sine or a cosine."""
    return isinstance(statement.value, tuple) and statement.value[0] in ("sin", "cos")


def _angles(section: Section) -> dict[Expression, dict[str, str]]:
    """Which locals are the sine and the cosine of an angle."""
    found: dict[Expression, dict[str, str]] = {}
    for statement in section.statements:
        if isinstance(statement.value, tuple) and _is_turn(statement):
            found.setdefault(statement.value[1], {})[statement.value[0]] = statement.name
    return found


def _by_lanes(prefix: str, section: Section, taken: set[str]) -> dict[str, list[str]]:
    """At the first of a sine and cosine the lines for both."""
    lines = {}
    for angle, found in _angles(section).items():
        first = next(iter(found.values()))
        sin, cos = (found.get(name) or _fresh(f"{first}_{name}", taken) for name in ("sin", "cos"))
        call = f"bad += {prefix}_sincos({_value(angle)}, &{sin}, &{cos});"
        lines[first] = [f"double {sin}, {cos};", call]
    return lines


def _by_fours(prefix: str, section: Section, taken: set[str]) -> dict[str, list[str]]:
    """At the last sine or cosine the lines for all, four angles at a time; where one needs another, one by one."""
    angles = list(_angles(section).items())
    groups = [angles[i : i + 4] for i in range(0, len(angles), 4)] if section.title == TURNS else [[item] for item in angles]
    lines = {}
    for group in groups:
        last = [s.name for s in section.statements if any(s.name in found.values() for _, found in group)]
        sines, cosines = _fresh("sines", taken), _fresh("cosines", taken)
        values = [*(_value(angle) for angle, _ in group), "0.0", "0.0", "0.0"][:4]
        made = [f"double {sines}[4], {cosines}[4];", f"{prefix}_turns({', '.join(values)}, {sines}, {cosines});"]
        for k, (_, found) in enumerate(group):
            made += [f"const double {local} = {sines if name == 'sin' else cosines}[{k}];" for name, local in found.items()]
        lines[last[-1] if section.title == TURNS else last[0]] = made
    return lines


def _fresh(wanted: str, taken: set[str]) -> str:
    """The name, with lines under it until nothing else is called so."""
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted


_ONE = _Style("{0}[{1}]", _by_fours)
_MANY = _Style("{0}[{1} * LANES + lane]", _by_lanes)


def _output(kernel: Kernel, i: int, style: _Style) -> str:
    label = kernel.labels[i] if i < len(kernel.labels) else ""
    unit = kernel.units[i] if i < len(kernel.units) else ""
    note = text.comment(", ".join(part for part in (label, unit) if part))
    return f"{style.entry.format('out', i)} = {_value(kernel.outputs[i])};" + (f" /* {note} */" if note else "")


def _stray(program: Program, kernel: Kernel, style: _Style) -> str:
    """0 * value is 0 for finite values and NaN for the others; many values are gone through in loops."""
    watched = ["t" if name == "t" else style.entry.format(name, i) for name, i in kernel.watched]
    results = [style.entry.format("out", i) for i in kernel.results]
    if len(watched) + len(results) <= FEW or style is _MANY:
        return _added([f"0.0 * {value}" for value in (*watched, *results)])
    sizes = {argument.name: len(argument.names) for argument in program.arguments} | {"x": len(kernel.x.names)}
    slots = dict.fromkeys(name for name, _ in kernel.watched)
    calls = ["0.0 * t" if name == "t" else f"{program.name}_stray({name}, {sizes[name]})" for name in slots]
    return " + ".join([*calls, f"{program.name}_stray(out, {len(kernel.outputs)})"])


def _added(terms: Sequence[str]) -> str:
    """A sum in three independent chains, so that no addition waits long for the one before."""
    chains = [" + ".join(terms[k::3]) for k in range(min(3, len(terms)))]
    return " + ".join(chain if len(chains) == 1 else f"({chain})" for chain in chains) or "0.0"


C = Target("c", "C99 source and header", files)
