"""What a call from Python costs: the extension module of the same program, one state at a time and
ten thousand at once."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

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
    call = f"f(0.0, x{', u' if of.states.u.shape[1] else ''}{'' if fresh else ', out=out'})"
    least = _least(of, call, of.x[0], of.states.u[0])
    return least, _c(of, batch=False, rows=len(of.x)).ns


def many_at_once(of: Subject) -> tuple[float, float]:
    """ns of a state in one call with MANY of them, and in the C loop over as many: the least of
    several copies of its binary, and here of several processes."""
    x, u = (np.resize(part, (MANY, part.shape[1])) for part in (of.x, of.states.u))
    least = _least(of, "f(0.0, x, u, out=out)", x, u) / MANY
    return least, _c(of, batch=True, rows=MANY).ns


def _least(of: Subject, call: str, x: np.ndarray, u: np.ndarray) -> float:
    """ns of a call, the least of PROCESSES."""
    folder = _folder(of)
    states = folder / "states.npz"
    np.savez(states, x=x, u=u)
    command = [sys.executable, str(HERE / "one_call.py"), str(folder), str(states), call]
    return min(float(run(command)) for _ in range(PROCESSES))


def _folder(of: Subject) -> Path:
    folder = Path(BUILD / "ours" / f"{of.name}-module").resolve()
    published(program(of.equations, ["dynamics"]), folder)
    return folder


def _c(of: Subject, batch: bool, rows: int) -> Time:
    return times([contender(of, batch=batch)], rows=rows, passing=2e6 if batch else 150e3)[0]
