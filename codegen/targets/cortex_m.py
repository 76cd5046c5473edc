"""Cortex-M: the C as it is on bare metal, in float32: a start, a linker script, a program that runs
every function and counts instructions, and a computed-torque controller; a Makefile for QEMU."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from codegen import text
from codegen.passes.folding.split import split
from codegen.program import Kernel, Program
from codegen.targets.records import Target, plain_sources

FOLDER = "cortex-m"
RUNTIME = Path(__file__).parents[1] / "runtime" / "cortex_m"
CONTROL = "inverse_dynamics_u"
STACK = 4096  # bytes of the controller, which needs less than half of it
ROOM, BYTES = 16384, 4  # bytes of stack for all functions besides a workspace, and of one number


def files(program: Program) -> dict[str, str]:
    """cortex-m/: Makefile, check.c, control.c where the inputs follow from ẇ, states.h and what is
    the same for every model."""
    kernels = tested(program)
    data: dict[str, Any] = {
        "prefix": program.name,
        "PREFIX": program.name.upper(),
        "kernels": kernels,
        "sources": plain_sources(program),
        "controls": controls(program),
        "stack": STACK,
        "room": ROOM + BYTES * max(map(_workspace, kernels)),
        "nx": len(program.argument("x").names),
        "nu": len(program.argument("u").names),
        "np": len(program.argument("p").names),
        "nw": len(program.quasi_velocities),
        "first": program.coordinates,
        "start": program.nominal or (0.0,) * len(program.argument("x").names),
        "rows": {kernel.name: _row(program, kernel) for kernel in kernels},
    }
    named = {"Makefile": "makefile", "check.c": "check.c", "states.h": "states.h"}
    if controls(program):
        named["control.c"] = "control.c"
    own = {
        f"{FOLDER}/{file}": text.render(f"cortex_m.{template}.j2", program, **data)
        for file, template in named.items()
    }
    return {**own, **{f"{FOLDER}/{p.name}": p.read_text("utf-8") for p in sorted(_runtime())}}


def _runtime() -> list[Path]:
    return [path for path in RUNTIME.iterdir() if path.suffix in (".c", ".h", ".ld")]


def tested(program: Program) -> list[Kernel]:
    """What runs on the board: every function for one state."""
    return list(program.kernels)


def _workspace(kernel: Kernel) -> int:
    """Numbers that the function keeps on the stack besides its locals, a multiple of two."""
    of = kernel.rolled
    if of is None:
        numbers = split(kernel).size
    else:
        tables = sum(len(t.rows) * t.width for t in of.tables if t.computed)
        numbers = of.workspace + tables + len(of.factors)
    return numbers + numbers % 2


def controls(program: Program) -> bool:
    """Is there a controller: do the inputs follow from ẇ?"""
    return program.has(CONTROL) and program.simulates and not program.charts


def _row(program: Program, kernel: Kernel) -> list[float]:
    """Some arguments (t, x, u, p): the initial state, or numbers where another x is taken."""
    width = len(kernel.x.names)
    start = list(program.nominal) or [0.1] * width
    x = [*start, *[0.1] * width][:width]
    return [0.0, *x, *[0.0] * len(program.argument("u").names), *program.argument("p").defaults]


def refusal(program: Program) -> str:
    """The boards' floating point is of single precision."""
    if not program.real.words:
        return "a Cortex-M4F computes in float32: build with --real float32"
    if not program.kernels:
        return "it has no functions"
    return ""


CORTEX_M = Target(
    "cortex-m",
    "bare metal for Cortex-M4F and M7: Makefile, a main, a controller; float32",
    files,
    needs=(CONTROL,),
    refusal=refusal,
    readme="cortex_m.md.j2",
)
