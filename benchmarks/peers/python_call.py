"""What a call from Python costs: the extension module of the same program, one state at a time and
ten thousand at once."""

from __future__ import annotations

import sys
import timeit
from pathlib import Path

import numpy as np

from codegen import loader
from codegen.passes import program
from hamel.build.module import published
from peers.contest import BUILD, HERE, Time, run, times
from peers.ours import Subject, contender

MANY = 10_000
PROCESSES = 8
ALLOWED = 60.0  # ns of a call above the C
WITHIN = 1.1  # of the C loop


def one_at_a_time(of: Subject, fresh: bool = False) -> tuple[float, float]:
    """ns of a call, and of the C; the result into `out`, or a fresh one.

    The least of PROCESSES: what an interpreter takes for one and the same call differs by 40 ns
    from process to process.
    """
    folder = _folder(of)
    np.savez(folder / "states.npz", x=of.x[0], u=of.states.u[0])
    call = f"f(0.0, x{', u' if of.states.u.shape[1] else ''}{'' if fresh else ', out=out'})"
    command = [
        sys.executable,
        str(HERE / "one_call.py"),
        str(folder),
        str(folder / "states.npz"),
        call,
    ]
    return min(float(run(command)) for _ in range(PROCESSES)), _c(
        of, batch=False, rows=len(of.x)
    ).ns


def many_at_once(of: Subject) -> tuple[float, float]:
    """ns of a state in one call with MANY of them, and in the C loop over as many."""
    module = loader.load(_folder(of))
    x, u = (
        np.ascontiguousarray(np.resize(part, (MANY, part.shape[1]))) for part in (of.x, of.states.u)
    )
    names = {"f": module.dynamics, "x": x, "u": u, "out": np.empty((MANY, module.nx))}
    least = min(timeit.repeat("f(0.0, x, u, out=out)", globals=names, number=1, repeat=300)) / MANY
    return least * 1e9, _c(of, batch=True, rows=MANY).ns


def _folder(of: Subject) -> Path:
    folder = Path(BUILD / "ours" / f"{of.name}-module").resolve()
    published(program(of.equations, ["dynamics"]), folder)
    return folder


def _c(of: Subject, batch: bool, rows: int) -> Time:
    return times([contender(of, batch=batch)], rows=rows, passing=2e6 if batch else 150e3)[0]
