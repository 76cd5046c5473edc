"""ns of one call of `dynamics` from Python: one_call.py FOLDER STATES.npz CALL. The loop around the
calls is taken off."""

from __future__ import annotations

import sys
import timeit
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from codegen import loader

CALLS, ROUNDS = 500, 300


def least(folder: str, states: str, call: str) -> float:
    module, arrays = loader.load(folder), np.load(states)
    names = {
        "f": module.dynamics,
        "x": arrays["x"].copy(),
        "u": arrays["u"].copy(),
        "out": np.empty(module.nx),
    }
    timers = [timeit.Timer("pass"), timeit.Timer(call, globals=names)]
    rounds = np.array([[timer.timeit(CALLS) for timer in timers] for _ in range(ROUNDS)])
    empty, full = rounds.min(axis=0)
    return float(full - empty) / CALLS * 1e9


if __name__ == "__main__":
    print(least(*sys.argv[1:]))
