"""tuning: which choice and which formulation are fastest on this machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING

from derive.diagnostics import AssumptionError
from hamel.pipeline import Clock, Constants, Fixed, mechanics_of, program_of

if TYPE_CHECKING:
    from codegen.program import Program
    from derive.formulations.records import Equations
    from derive.mechanics.records import System

FEW = 1.5  # candidates with more than so many times the fewest operations are not compiled


def fastest(
    path: str | PathLike[str],
    choice: str | None,
    constants: Constants,
    fix: Fixed,
    real: str,
    clock: Clock,
) -> tuple[Equations, dict[str, float]]:
    """The equations whose `dynamics` is fastest here, and the nanoseconds per state of all that
    were compiled.

    Every formulation that fits is tried, with every choice of the file where `choice` names none.
    """
    from codegen.tune import timings
    from derive.robots import load
    from hamel.fixing import fixed

    with clock("model"):
        model, constants = fixed(load(path), constants, fix)
    with clock("mechanics"):
        mechanics = mechanics_of(model, constants)
    with clock("tune"):
        found = dict(
            _candidates(
                mechanics, [choice] if choice else [c.name for c in model.choices] or [None]
            )
        )
        programs = {
            name: program_of(equations, ("dynamics",), real=real)
            for name, equations in found.items()
        }
        fewest = min(map(_operations, programs.values()))
        worth = {
            name: program
            for name, program in programs.items()
            if _operations(program) <= FEW * fewest
        }
        taken = timings(worth)
    best = min(taken, key=lambda name: taken[name])
    return found[best], {name: round(ns, 1) for name, ns in taken.items()}


def _candidates(
    mechanics: System, choices: Sequence[str | None]
) -> Iterator[tuple[str, Equations]]:
    """Raises the last refusal where nothing can be built."""
    from derive.formulations import equations, misfits
    from derive.linearize.minimal import with_linearization

    fitting = [name for name, misfit in misfits(mechanics).items() if not misfit]
    refusal = None
    seen = 0
    for choice in choices:
        for formulation in fitting:
            try:
                found = with_linearization(equations(mechanics, choice, formulation))
            except AssumptionError as error:
                refusal = error
                continue
            seen += 1
            yield f"{formulation}, {found.choice}", found
    if not seen and refusal is not None:
        raise refusal


def _operations(program: Program) -> int:
    return program.kernel("dynamics").operations["total"]


def tuned(program: Program, known: dict[str, float], clock: Clock) -> Program:
    """The program with the fastest flags; `known` goes to the manifest with their times."""
    from codegen.tune import with_fastest_flags

    with clock("tune"):
        alone = replace(
            program,
            kernels=(program.kernel("dynamics"),),
            charts=(),
            integrators=("dop853",),
            enforcements=("none",),
        )
        chosen = with_fastest_flags(alone, known)
    return replace(program, flags=chosen.flags, timings=chosen.timings)
