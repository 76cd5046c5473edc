"""C99: a header and one source file, straight-line code, no allocation, nothing but libm behind it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from codegen import text
from codegen.program import Expression, Kernel, Program, Statement
from codegen.targets.records import Target


@dataclass(frozen=True)
class Body:
    """A kernel as lines of C."""

    kernel: Kernel
    size: int
    lines: tuple[str, ...]  # loads and statements
    outputs: tuple[str, ...]
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    unused: tuple[str, ...]
    checked: tuple[tuple[str, int], ...]  # arguments and sizes that are searched for values that are not finite
    residual: str


def files(program: Program) -> dict[str, str]:
    """NAME.h and NAME.c."""
    data = {
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "bodies": [_body(program, kernel) for kernel in program.kernels],
    }
    return {f"{program.name}.h": text.render("header.h.j2", **data), f"{program.name}.c": text.render("source.c.j2", **data)}


def _body(program: Program, kernel: Kernel) -> Body:
    sizes = {argument.name: len(argument.names) for argument in program.arguments} | {"x": len(kernel.x.names)}
    return Body(
        kernel=kernel,
        size=len(kernel.outputs),
        lines=tuple(_lines(kernel)),
        outputs=tuple(_output(kernel, i) for i in range(len(kernel.outputs))),
        guards=tuple((_value(g.value), text.number(g.tolerance), text.comment(g.name)) for g in kernel.guards),
        unused=tuple(name for name in "txup" if name not in kernel.uses),
        checked=tuple((name, sizes[name]) for name in "xup" if name in kernel.uses),
        residual=_value(kernel.loop.residual) if kernel.loop else "",
    )


def _value(value: Expression) -> str:
    return text.expression(value, text.C)


def _lines(kernel: Kernel) -> Iterator[str]:
    for load in kernel.loads:
        if load.argument != "t":
            yield f"const double {load.name} = {load.argument}[{load.index}];"
    for section in kernel.sections:
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
