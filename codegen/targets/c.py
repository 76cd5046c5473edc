"""C99: a header and one source file, straight-line code, no allocation, nothing but libm behind it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from codegen import text
from codegen.passes.split import Part, split
from codegen.program import Expression, Kernel, Program, Statement
from codegen.targets.records import Target


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
    checked: tuple[tuple[str, int], ...]  # arguments and sizes that are searched for values that are not finite
    residual: str


def files(program: Program) -> dict[str, str]:
    """NAME.h, NAME.c, and a NAME_FUNCTION.c for every long function, so that several are compiled at a time."""
    data = {"program": program, "prefix": program.name, "PREFIX": program.name.upper()}
    bodies = [_body(program, kernel) for kernel in program.kernels]
    short = [body for body in bodies if len(body.pieces) == 1]
    long = {
        f"{program.name}_{body.kernel.name}.c": text.render("long.c.j2", bodies=[body], **data)
        for body in bodies
        if len(body.pieces) > 1
    }
    return {
        f"{program.name}.h": text.render("header.h.j2", bodies=bodies, **data),
        f"{program.name}.c": text.render("source.c.j2", bodies=short, **data),
        **long,
    }


def _body(program: Program, kernel: Kernel) -> Body:
    sizes = {argument.name: len(argument.names) for argument in program.arguments} | {"x": len(kernel.x.names)}
    parts = split(kernel)
    return Body(
        kernel=kernel,
        size=len(kernel.outputs),
        pieces=tuple(_piece(kernel, part) for part in parts.parts),
        workspace=parts.size,
        checked=tuple((name, sizes[name]) for name in "xup" if name in kernel.uses),
        residual=_value(kernel.loop.residual) if kernel.loop else "",
    )


def _piece(kernel: Kernel, part: Part) -> Piece:
    uses = {load.argument for load in part.loads} | ({"work"} if part.taken or part.kept else set())
    uses |= ({"out"} if part.outputs else set()) | (set() if part.residual is None else {"residual"})
    names = (*"txup", "work", "out", *(["residual"] if kernel.loop else []))
    return Piece(
        lines=tuple(_lines(part)),
        outputs=tuple(_output(kernel, i) for i, _ in part.outputs),
        kept=tuple(f"work[{slot}] = {name};" for name, slot in part.kept),
        guards=tuple((_value(g.value), text.number(g.tolerance), text.comment(g.name)) for g in part.guards),
        unused=tuple(name for name in names if name not in uses),
    )


def _value(value: Expression) -> str:
    return text.expression(value, text.C)


def _lines(part: Part) -> Iterator[str]:
    for load in part.loads:
        if load.argument != "t":
            yield f"const double {load.name} = {load.argument}[{load.index}];"
    for name, slot in part.taken:
        yield f"const double {name} = work[{slot}];"
    for section in part.sections:
        yield ""
        yield f"/* {text.comment(section.title)} */"
        yield from (_statement(statement) for statement in section.statements)


def _statement(statement: Statement) -> str:
    return f"const double {statement.name} = {_value(statement.value)};"


def _output(kernel: Kernel, i: int) -> str:
    label = kernel.labels[i] if i < len(kernel.labels) else ""
    unit = kernel.units[i] if i < len(kernel.units) else ""
    note = text.comment(", ".join(part for part in (label, unit) if part))
    return f"out[{i}] = {_value(kernel.outputs[i])};" + (f" /* {note} */" if note else "")


C = Target("c", "C99 source and header", files)
