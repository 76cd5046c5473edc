"""ns of one call of `dynamics` from Python, with one state or with many: one_call.py FOLDER
STATES.npz CALL. The loop around the calls is taken off."""

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
        "out": np.empty((*arrays["x"].shape[:-1], module.nx)),
    }
    calls = CALLS if arrays["x"].ndim == 1 else 1
    timers = [timeit.Timer("pass"), timeit.Timer(call, globals=names)]
    rounds = np.array([[timer.timeit(calls) for timer in timers] for _ in range(ROUNDS)])
    empty, full = rounds.min(axis=0)
    return float(full - empty) / calls * 1e9


if __name__ == "__main__":
    print(least(*sys.argv[1:]))
