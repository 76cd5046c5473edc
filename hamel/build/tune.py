"""tune: which choice, which formulation and which flags are fastest on this machine.

Candidates are compiled and their `dynamics` timed, in loops of C, at one state after another.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from codegen import compiler
from codegen.program import Program
from derive.diagnostics import AssumptionError, ToolchainError
from derive.formulations import equations, misfits
from derive.formulations.records import Equations
from derive.linearize.minimal import with_linearization
from derive.mechanics.records import System
from hamel.build.clock import Clock
from hamel.build.limits import FASTER, FEW, ROUNDS, ROWS
from hamel.build.module import published
from hamel.build.options import BuildOptions
from hamel.build.scratch import workspace
from hamel.build.stages import mechanics_of, model_of, program_of

FLAGS: tuple[tuple[str, ...], ...] = (
    (),
    ("-O3",),
    ("-fno-schedule-insns",),
    ("-O3", "-fno-schedule-insns"),
    ("-fno-tree-vectorize",),
)


@dataclass(frozen=True)
class Loop:
    """The functions of a compiled module that go through many states, and arguments for them."""

    rows: ctypes._CFuncPtr
    function: ctypes.c_void_p
    arrays: tuple[np.ndarray, ...]  # t, x, u, p, out, in the precision of the code

    def nanoseconds(self) -> float:
        """Per state, of one run."""
        t, x, u, p, out = self.arrays
        given = [
            (a.ctypes.data if a.size else None, stride)
            for a, stride in ((t, 0), (x, x.shape[1]), (u, u.shape[1]), (p, 0))
        ]
        start = time.perf_counter_ns()
        self.rows(
            self.function,
            out.shape[1],
            ROWS,
            *(part for pair in given for part in pair),
            out.ctypes.data,
            None,
        )
        return (time.perf_counter_ns() - start) / ROWS


def fastest(
    path: str | PathLike[str], options: BuildOptions, clock: Clock
) -> tuple[Equations, dict[str, float]]:
    """The equations whose `dynamics` is fastest here, the usual ones where no others are clearly
    faster, and the nanoseconds per state of all that were compiled.

    Every formulation that fits is tried, with every choice of the file where `options` name none.
    """
    with clock("model", "file → Model"):
        model, constants = model_of(path, options.constants, options.fix)
    with clock("mechanics", "Model → System"):
        mechanics = mechanics_of(model, constants)
    with clock("tune", "System → the fastest Equations"):
        names = [choice.name for choice in model.choices] or [None]
        formed = dict(_candidates(mechanics, [options.choice] if options.choice else names))
        programs = {
            name: program_of(candidate, ("dynamics",), real=options.real)
            for name, candidate in formed.items()
        }
        fewest = min(map(_operations, programs.values()))
        worth = {name: p for name, p in programs.items() if _operations(p) <= FEW * fewest}
        taken = timings(worth)
    return formed[_best(taken)], {name: round(ns, 1) for name, ns in taken.items()}


def _best(taken: Mapping[str, float]) -> str:
    """The fastest; the first where that is hardly slower."""
    usual = next(iter(taken))
    best = min(taken, key=lambda name: taken[name])
    return best if taken[best] < FASTER * taken[usual] else usual


def _candidates(
    mechanics: System, choices: Sequence[str | None]
) -> Iterator[tuple[str, Equations]]:
    """Raises the last refusal where nothing can be built."""
    fitting = [name for name, misfit in misfits(mechanics).items() if not misfit]
    refusal = None
    seen = 0
    for choice in choices:
        for formulation in fitting:
            try:
                result = with_linearization(equations(mechanics, choice, formulation, moving=True))
            except AssumptionError as error:
                refusal = error
                continue
            seen += 1
            yield f"{formulation}, {result.choice}", result
    if not seen and refusal is not None:
        raise refusal


def _operations(program: Program) -> int:
    return program.kernel("dynamics").operations["total"]


def timings(programs: Mapping[str, Program]) -> dict[str, float]:
    """Nanoseconds of `dynamics` per state for every program that the compiler takes. Raises
    ToolchainError without a compiler."""
    if compiler.find_compiler() is None:
        raise ToolchainError("there is nothing to tune without a C compiler", hint=compiler.INSTALL)
    with workspace() as folder:
        loops = {}
        for number, (name, program) in enumerate(programs.items()):
            try:
                loops[name] = _loop(program, published(program, folder / str(number)).folder)
            except ToolchainError:
                if program.flags:
                    continue  # a compiler that does not know these flags
                raise
        least = dict.fromkeys(loops, float("inf"))
        for _ in range(ROUNDS):  # in turns, for a machine is not equally fast all the time
            least = {name: min(least[name], loop.nanoseconds()) for name, loop in loops.items()}
    return least


def _loop(program: Program, folder: Path) -> Loop:
    library = ctypes.CDLL(str(folder / f"lib{program.name}{compiler.SUFFIX}"))
    rows = getattr(library, f"{program.name}_rows")
    pointer, count = ctypes.c_void_p, ctypes.c_ssize_t
    rows.argtypes = [pointer, count, count, *([pointer, count] * 4), pointer, pointer]
    function = ctypes.cast(getattr(library, f"{program.name}_dynamics"), pointer)
    kernel, random = program.kernel("dynamics"), np.random.default_rng(1)
    x, u = (
        random.uniform(-1, 1, (ROWS, n))
        for n in (len(kernel.x.names), len(program.argument("u").names))
    )
    defaults = np.array(program.argument("p").defaults, dtype=float)
    arrays = (np.zeros(1), x, u, defaults, np.zeros((ROWS, kernel.size)))
    return Loop(rows, function, tuple(array.astype(program.real.name) for array in arrays))


def with_fastest_flags(program: Program, known: Mapping[str, float]) -> Program:
    """The program with the compiler's flags that make its `dynamics` fastest, and all that was
    timed, also `known`, for the manifest."""
    alone = replace(
        program,
        kernels=(program.kernel("dynamics"),),
        charts=(),
        events=(),
        integrators=("dop853",),
        enforcements=("none",),
    )
    flags = {_label(each): each for each in FLAGS}
    taken = timings({label: replace(alone, flags=each) for label, each in flags.items()})
    best = _best(taken)
    times = {label: round(ns, 1) for label, ns in taken.items()}
    return replace(program, flags=flags[best], timings=(*known.items(), *times.items()))


def _label(flags: Sequence[str]) -> str:
    return f"flags {' '.join(flags)}" if flags else "flags as usual"
