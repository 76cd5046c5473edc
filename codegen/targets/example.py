"""example.c (example_program.c of a model called example): a program that calls the
generated C, to copy from."""

from __future__ import annotations

from typing import Any

from codegen import compiler, text
from codegen.program import Program
from codegen.targets.records import Target, is_apart


def files(program: Program) -> dict[str, str]:
    """The state derivative at one state, or the first function where there is none."""
    names = [kernel.name for kernel in program.kernels]
    if not names:
        return {}
    shown = program.kernel("dynamics" if "dynamics" in names else names[0])
    consistent = shown.x.labels == program.argument("x").labels and bool(program.nominal)
    states = program.nominal if consistent else _some(len(shown.x.names))
    charts = [f"{program.name}_charts"] if program.charts else []
    names_of_rows = [f"{program.name}_nullspace"] if "constraint_rows" in names else []
    sources = [
        program.name,
        *charts,
        *names_of_rows,
        *(f"{program.name}_{kernel.name}" for kernel in program.kernels if is_apart(kernel)),
    ]
    data: dict[str, Any] = {
        "file": compiler.example(program.name),
        "sources": sources,
        "program": program,
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "kernel": shown,
        "states": states,
        "place": "the model's initial state" if consistent else "a state of arbitrary numbers",
    }
    return {data["file"]: text.render("example.c.j2", **data)}


def _some(count: int) -> tuple[float, ...]:
    """Numbers where the model gives none."""
    return tuple(0.1 * (i + 1) for i in range(count))


EXAMPLE = Target("example", "a C program that uses the module", files)
