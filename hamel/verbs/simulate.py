"""simulate: integrate the compiled module from the consistent initial state and say how far the motion can be trusted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.mechanics.initial import Initial, initial_state
from hamel import motion
from hamel.importing import load
from hamel.pipeline import mechanics_of, temporary_module
from hamel.records import Simulated
from hamel.settings import settings

if TYPE_CHECKING:
    from rich.console import Console

    from derive.formulations.records import Equations

ROWS = 500  # of the output when no step is given
MOST_ROWS = 10_000_000


def run(
    path: str | Path,
    choice: str | None,
    time: float,
    step: float | None,
    rtol: float,
    atol: float | None,
    values: Mapping[str, float | str],
    out: str | Path | None,
    plot: str | Path | None,
    progress: Callable[[float], None] | None,
) -> Simulated:
    times = _times(time, step)
    files = motion.writers(out, plot)
    tolerances = _tolerances(rtol, atol)
    mechanics = mechanics_of(load(path))
    given = settings(mechanics.model, values)
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    initial = initial_state(mechanics, given.initial, p)
    chosen = equations(mechanics, choice)
    with temporary_module(chosen) as module:
        x = module.state(0.0, np.concatenate([initial.q, initial.v]), u, p)
        found = motion.integrated(module, chosen, times, x, u, p, tolerances, progress)
    for write in files:
        write(found)
    return _record(chosen, initial, found, out, plot)


def _times(time: float, step: float | None) -> np.ndarray:
    """0, step, 2 step … and the last time itself."""
    _positive("time", time)
    step = time / ROWS if step is None else step
    _positive("step", step)
    if time / step > MOST_ROWS:
        raise ModelError(f"a step of {step:g} s makes more than {MOST_ROWS} rows in {time:g} s")
    count = math.floor(time / step * (1 + 1e-12))
    inner = np.arange(count + 1) * step
    return np.append(inner[inner < time * (1 - 1e-12)], time)


def _tolerances(rtol: float, atol: float | None) -> tuple[float, float]:
    _positive("rtol", rtol)
    atol = rtol / 100 if atol is None else atol
    _positive("atol", atol)
    return max(rtol, 1e-15), atol


def _positive(name: str, value: float) -> None:
    if not (value > 0 and math.isfinite(value)):
        raise ModelError(f"{name} is {value}, which is not a positive number")


def _record(
    chosen: Equations, initial: Initial, found: motion.Motion, out: str | Path | None, plot: str | Path | None
) -> Simulated:
    return Simulated(
        model=chosen.system.model.name,
        choice=chosen.choice,
        time=float(found.t[-1]),
        steps=found.steps,
        rejected=found.rejected,
        calls=found.calls,
        seconds=found.seconds,
        position_violation=found.position_violation,
        velocity_violation=found.velocity_violation,
        energy_balance=found.energy_balance,
        crossings=found.crossings,
        moved={name: {"given": wanted, "used": used} for name, wanted, used in initial.moved},
        final={name: float(values[-1]) for name, values in found.columns().items()},
        file=Path(out) if out else None,
        plot=Path(plot) if plot else None,
        motion=found.columns(),
    )


def show(record: Simulated, console: Console) -> None:
    from hamel.show import number

    for name, by in record.moved.items():
        console.print(f"initial {name} = {by['given']:.6g} contradicts the constraints, {by['used']:.6g} is used")
    steps = f"{record.steps} steps, {record.rejected} rejected, {record.seconds:.2g} s of computing"
    console.print(f"{record.model}, choice {record.choice}: {record.time:g} s in {steps}")
    console.print(f"  largest |φ|         {number(record.position_violation)}")
    console.print(f"  largest |A v − c|   {number(record.velocity_violation)}")
    console.print(f"  energy balance      {number(record.energy_balance)} of the largest energy exchanged")
    if record.crossings:
        first, more = record.crossings[0], len(record.crossings) - 1
        also = f" and {more} more times" if more else ""
        console.print(f"  SINGULAR: {first.pivot} vanished between {first.after:g} s and {first.before:g} s{also};")
        console.print("  the motion beyond is not to be trusted; another choice may be regular there, see `hamel choices`")
    for place in (record.file, record.plot):
        if place:
            console.print(f"  wrote {place}")
