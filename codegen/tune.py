"""tune: what is fastest here. Candidates are compiled and their `dynamics` timed, in loops of C, at
one state after another."""

from __future__ import annotations

import ctypes
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from codegen import compiler
from codegen.build import build
from codegen.program import Program
from derive.diagnostics import ToolchainError

ROWS = 256
ROUNDS = 60  # the least of so many counts: what else the machine does only adds
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


def timings(programs: Mapping[str, Program]) -> dict[str, float]:
    """Nanoseconds of `dynamics` per state for every program that the compiler takes. Raises
    ToolchainError without a compiler."""
    if compiler.find_compiler() is None:
        raise ToolchainError("there is nothing to tune without a C compiler", hint=compiler.INSTALL)
    with tempfile.TemporaryDirectory(prefix="hamel-", ignore_cleanup_errors=True) as folder:
        loops = {}
        for number, (name, program) in enumerate(programs.items()):
            try:
                loops[name] = _loop(program, build(program, Path(folder) / str(number)).folder)
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
    arrays = (np.zeros(1), x, u, defaults, np.zeros((ROWS, len(kernel.outputs))))
    return Loop(rows, function, tuple(array.astype(program.real.name) for array in arrays))


def with_fastest_flags(program: Program, known: Mapping[str, float]) -> Program:
    """The program with the compiler's flags that make it fastest, and all that was timed, also
    `known`, for the manifest."""
    tried = {_label(flags): replace(program, flags=flags) for flags in FLAGS}
    found = timings(tried)
    best = min(found, key=lambda name: found[name])
    return replace(
        program,
        flags=tried[best].flags,
        timings=(*known.items(), *((name, round(ns, 1)) for name, ns in found.items())),
    )


def _label(flags: Sequence[str]) -> str:
    return f"flags {' '.join(flags)}" if flags else "flags as usual"
