"""NumPy: the same statements over leading axes, for machines without a compiler."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from codegen import text
from codegen.program import Expression, Kernel, Program
from codegen.targets.records import Target


@dataclass(frozen=True)
class Body:
    """A kernel as lines of Python."""

    kernel: Kernel
    lines: tuple[str, ...]
    outputs: tuple[str, ...]
    guards: tuple[tuple[str, str, str], ...]  # value, tolerance, name
    residual: str


def files(program: Program) -> dict[str, str]:
    """_numpy.py, _library.py (the C library through ctypes) and what they share."""
    data = {"program": program, "prefix": program.name, "PREFIX": program.name.upper()}
    bodies = [_body(kernel) for kernel in program.kernels]
    erf = any(" _erf(" in f" {line}" or "(_erf(" in line for body in bodies for line in (*body.lines, *body.outputs))
    return {
        "_numpy.py": text.render("numpy.py.j2", bodies=bodies, erf=erf, **data),
        "_library.py": text.render("library.py.j2", **data),
        "_shared.py": text.render("shared.py.j2", **data),
    }


def _body(kernel: Kernel) -> Body:
    return Body(
        kernel=kernel,
        lines=tuple(_lines(kernel)),
        outputs=tuple(f"out[..., {i}] = {_value(value)}" for i, value in enumerate(kernel.outputs)),
        guards=tuple((_value(g.value), text.number(g.tolerance, text.NUMPY), text.printable(g.name)) for g in kernel.guards),
        residual=_value(kernel.loop.residual) if kernel.loop else "",
    )


def _value(value: Expression) -> str:
    return text.expression(value, text.NUMPY)


def _lines(kernel: Kernel) -> Iterator[str]:
    for load in kernel.loads:
        if load.argument != "t":
            yield f"{load.name} = {load.argument}[..., {load.index}]"
    for section in kernel.sections:
        yield ""
        yield f"# {text.printable(section.title)}"
        for statement in section.statements:
            yield f"{statement.name} = {_value(statement.value)}"


NUMPY = Target("numpy", "NumPy module and the ctypes binding", files)
