"""make loops: closed loops and rolling against Exudyn, by where points of all bodies are after a
while.

    python benchmarks/loops.py [MODEL …]

Exudyn integrates bodies in maximal coordinates (Euler parameters, generalised alpha, second order)
with its own joints; two step sizes are extrapolated. Loads other than gravity are left out on both
sides. What it has no joint for is said.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from derive.formulations import equations
from derive.model import Model, load
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import temporary_module
from hamel.simulate.motion import Start, Stepping, integrated
from hamel.verify.reference.engines import exudyn
from hamel.verify.reference.outcome import Reference, reference, state_of

MODELS = Path(__file__).resolve().parent.parent / "models"
NAMES = (
    "four_bar",
    "slider_crank",
    "double_pendulum",
    "planar_3r",
    "rolling_disk",
    "gear_train",
    "spatial_four_bar",
    "extremes/bricard",
)
TIME, STEPS = 0.3, 3_000
ARM = 0.1  # m, to the points of each body that are compared
TOLERANCE = 1e-8  # of positions, relative to the largest


def main() -> None:
    failed = False
    for name in sys.argv[1:] or NAMES:
        found = compared(replace(load(MODELS / f"{name}.yaml"), loads=()))
        failed |= isinstance(found, float) and not found <= TOLERANCE
        print(f"{name:20} {found if isinstance(found, str) else f'{found:.1e}'}", flush=True)
    sys.exit(1 if failed else 0)


def compared(model: Model) -> float | str:
    """The largest difference of the points relative to the largest coordinate, or why there is
    none."""
    ref = reference(model)
    mechanics = system(model)
    start = initial_state(mechanics)
    missing = exudyn.missing(model)
    if missing:
        return f"not compared: Exudyn has no counterpart of {missing}"
    ours = _ours(mechanics, ref, start)
    first = state_of(ref, 0.0, start.q, start.v)
    theirs = exudyn.ends(model, first, TIME, STEPS, ARM)
    return (
        "Exudyn gives up"
        if theirs is None
        else float(np.max(np.abs(ours - theirs)) / np.max(np.abs(ours)))
    )


def _ours(mechanics: Any, ref: Reference, start: Any) -> np.ndarray:
    derived = equations(mechanics)
    u, p = np.zeros(mechanics.u.numel()), np.array(mechanics.parameters)
    with temporary_module(derived) as module:
        x = module.state(0.0, np.concatenate([start.q, start.v]), u, p)
        by = Stepping("dop853", None, None, 1e-12, 1e-14)
        end = integrated(module, derived, Start(np.array([0.0, TIME]), x, u, p), by)
        q = np.array([values[-1] for values in end.q.values()])
        v = np.array([values[-1] for values in end.v.values()])
    there = state_of(ref, TIME, q, v)
    return exudyn.points(ref.model, there, ARM)


if __name__ == "__main__":
    main()
