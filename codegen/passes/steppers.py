"""steppers: the loops of the runtime that are offered like functions of the program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from codegen.program import KINDS, Argument, Kernel, Program, Stepper
from derive.formulations.records import Request

SENSITIVE = "step_sensitivity"


def with_steppers(program: Program, asked: Sequence[Request]) -> Program:
    """The program with what was asked for, in every chart."""
    if not program.simulates:
        return program
    numbers = range(max(1, len(program.charts)))
    steppers = [_stepper(program, request, number) for request in asked for number in numbers]
    return replace(program, steppers=tuple(steppers))


def _stepper(program: Program, request: Request, chart: int) -> Stepper:
    x = program.argument("x")
    suffix = program.charts[chart].suffix if program.charts else ""
    about = request.about + (f"; chart {chart}" if chart else "")
    columns = len(x.names) + len(program.argument("u").names)
    shape = (len(x.names), columns) if request.name == SENSITIVE else (len(x.names),)
    called = _called(program, request.needs, suffix)
    kernel = _kernel(request.name + suffix, about, shape, _longer(x, ("h",), ("s",)), called)
    size = kernel.size + len(x.names) + 1
    taken = _longer(x, ("h", "method", "substeps"), ("s", "", ""))
    about = f"{request.name} by any method, with the estimate of its error and a status"
    row = _kernel(f"{request.name}_row{suffix}", about, (size,), taken, called)
    return Stepper(replace(kernel, labels=x.labels), row, chart)


def _called(program: Program, needs: Sequence[str], suffix: str) -> list[Kernel]:
    kernels = [program.in_chart(name, suffix) for name in needs]
    return [kernel for kernel in kernels if kernel is not None]


def _longer(x: Argument, labels: tuple[str, ...], units: tuple[str, ...]) -> Argument:
    """The x slot with more behind it."""
    return replace(
        x,
        labels=(*x.labels, *labels),
        names=(*x.names, *labels),
        units=(*x.units, *units),
    )


def _kernel(
    name: str, about: str, shape: tuple[int, ...], x: Argument, called: Sequence[Kernel]
) -> Kernel:
    """Its guards are those of `dynamics`, wherever it is evaluated."""
    used = {"t", "x"}.union(*(kernel.uses for kernel in called))
    size = shape[0] * (shape[1] if len(shape) > 1 else 1)
    return Kernel(
        name=name,
        about=about,
        result="S" if len(shape) > 1 else "x",
        shape=shape,
        labels=(),
        units=(),
        x=x,
        uses=tuple(letter for letter in "txup" if letter in used),
        loads=(),
        sections=(),
        outputs=(0.0,) * size,
        guards=called[0].guards,
        loop=None,
        watched=(),
        results=(),
        operations=dict.fromkeys((*KINDS, "total"), 0),
    )
