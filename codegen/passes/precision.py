"""precision: a program in the numbers of another precision. What would lose its digits there is
refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codegen.passes.lanes import values_of
from codegen.program import Expression, Kernel, Pivot, Program, Rolled, Stepper
from codegen.reals import FLOAT64, Real, real_of
from derive.diagnostics import AssumptionError


def in_precision(program: Program, name: str) -> Program:
    """The program with `real` of that name, its guards and iterations held to what that precision
    can tell.

    Raises AssumptionError where a number of the program cannot be written with all digits.
    """
    real = real_of(name)
    if real == FLOAT64:
        return program
    result = replace(
        program,
        real=real,
        kernels=tuple(_kernel(kernel, real) for kernel in program.kernels),
        steppers=tuple(
            Stepper(_kernel(stepper.kernel, real), _kernel(stepper.row, real), stepper.chart)
            for stepper in program.steppers
        ),
    )
    for where, value in _numbers(result):
        if not real.holds(value):
            raise AssumptionError(
                f"{where} has the number {value:.6g}, which {real.name} cannot hold with all"
                " digits",
                "float64 can; or choose units in which the numbers of the model are nearer to one",
            )
    return result


def _kernel(kernel: Kernel, real: Real) -> Kernel:
    """Guards keep the same share of the digits, residuals as many units of rounding."""
    return replace(
        kernel,
        guards=tuple(_guard(guard, real) for guard in kernel.guards),
        loop=kernel.loop
        and replace(kernel.loop, tolerance=_short(real.rounding(kernel.loop.tolerance))),
        hoisted=kernel.hoisted and replace(kernel.hoisted, rest=_kernel(kernel.hoisted.rest, real)),
    )


def _guard(guard: Pivot, real: Real) -> Pivot:
    wider = real.wider(guard.part)
    return replace(
        guard, tolerance=_short(guard.tolerance * wider), limit=_short(guard.limit * wider)
    )


def _short(value: float) -> float:
    return float(f"{value:.3g}")


def _numbers(program: Program) -> Iterator[tuple[str, float]]:
    """Every number that is written into the code, and where."""
    p = program.argument("p")
    yield from ((f"parameter {label}", value) for label, value in zip(p.labels, p.defaults))
    hoisted = [kernel.hoisted for kernel in program.kernels if kernel.hoisted]
    for kernel in (*program.kernels, *(k for h in hoisted for k in (h.precompute, h.rest))):
        values = [s.value for section in kernel.sections for s in section.statements]
        values += [*kernel.outputs, *(x for g in kernel.guards for x in (g.value, g.tolerance))]
        values += [kernel.loop.residual] if kernel.loop else []
        values += _of_links(kernel.rolled) if kernel.rolled else []
        for value in values:
            yield from ((kernel.name, number) for number in _constants(value))


def _of_links(of: Rolled) -> list[Expression]:
    """What stands in tables and in the bodies of loops."""
    tables = [x for table in of.tables for row in table.rows for x in row]
    starts = [x for sweep in of.sweeps for x in sweep.start]
    return [*tables, *starts, *values_of(of)]


def _constants(value: Expression) -> Iterator[float]:
    if isinstance(value, float):
        yield value
    elif isinstance(value, tuple):
        for operand in value[1:]:
            yield from _constants(operand)
