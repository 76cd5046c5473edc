"""What a call from Python costs: the extension module of the same program, one state at a time and ten thousand at once."""

from __future__ import annotations

import timeit
from pathlib import Path

import numpy as np

from codegen import build, loader
from codegen.passes import program
from peers.contest import BUILD, Time, times
from peers.ours import Subject, contender

MANY = 10_000
ALLOWED = 60.0  # ns of a call above the C
WITHIN = 1.1  # of the C loop


def one_at_a_time(of: Subject) -> tuple[float, float]:
    """ns of a call with `out` given, in a loop of Python's own, and of the C."""
    module = _module(of)
    names = {"f": module.dynamics, "x": of.x[0].copy(), "u": of.states.u[0].copy(), "out": np.empty(module.nx)}
    call = "f(0.0, x, u, out=out)" if of.states.u.shape[1] else "f(0.0, x, out=out)"
    least = min(timeit.repeat(call, globals=names, number=500, repeat=400)) / 500
    return least * 1e9, _c(of, batch=False, rows=len(of.x)).ns


def many_at_once(of: Subject) -> tuple[float, float]:
    """ns of a state in one call with MANY of them, and in the C loop over as many."""
    module = _module(of)
    x, u = (np.ascontiguousarray(np.resize(part, (MANY, part.shape[1]))) for part in (of.x, of.states.u))
    names = {"f": module.dynamics, "x": x, "u": u, "out": np.empty((MANY, module.nx))}
    least = min(timeit.repeat("f(0.0, x, u, out=out)", globals=names, number=1, repeat=300)) / MANY
    return least * 1e9, _c(of, batch=True, rows=MANY).ns


def _module(of: Subject) -> object:
    folder = Path(BUILD / "ours" / f"{of.name}-module").resolve()
    build.build(program(of.equations, ["dynamics"]), folder)
    return loader.load(folder)


def _c(of: Subject, batch: bool, rows: int) -> Time:
    return times([contender(of, batch=batch)], rows=rows, passing=2e6 if batch else 150e3)[0]
