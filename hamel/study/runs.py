"""Runs in the compiled loop of a module: whole simulations with the end time as their only output,
timed and judged."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np

from codegen.runtime.simulation import Status
from derive.formulations.projection import positions
from hamel.build.module import module_in
from hamel.charts import at_rows
from hamel.simulate.energies import total_energy
from hamel.simulate.motion import status_of
from hamel.study.limits import MOST_REPEATS, MOST_STEPS, POINTS
from hamel.study.modules import Start, start

TOO_LONG = "too long"


class Unfinished(Exception):
    """A run that did not come to its end: why, and the time that it reached where that is known."""

    def __init__(self, cause: str, reached: float | None) -> None:
        super().__init__(cause)
        self.cause, self.reached = cause, reached


class Watch:
    """Asked again and again on the way, and at the end: which time was reached, and whether the run
    used more than its share of processor time."""

    def __init__(self, limit: float) -> None:
        self.end = time.process_time() + limit
        self.reached = 0.0

    def __call__(self, reached: float) -> None:
        self.reached = reached
        if time.process_time() > self.end:
            raise Unfinished(TOO_LONG, reached)


def exact(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    run: Mapping[str, Any],
    limit: float,
) -> dict[str, Any]:
    """One tight run: the end (q, v), the sizes of all q and v on the way, and the largest energy
    exchanged."""
    begin, module = start(path, values), loaded(folder)
    times = np.linspace(0.0, span, POINTS)
    try:
        motion = _simulated(module, begin, times, run, span, limit)
    except Unfinished as end:
        return {"failed": end.cause}
    v = module.velocity(times, motion.x, begin.u, begin.p)
    q = motion.x[:, : begin.system.q.numel()]
    energy = module.energy(times, motion.x, begin.u, begin.p)
    return {
        "end": [*q[-1].tolist(), *v[-1].tolist()],
        "sizes": np.max(np.abs(np.hstack([q, v])), axis=0).tolist(),
        "exchanged": float(
            max(np.max(np.abs(energy[:, 0])), np.ptp(energy[:, 1]), np.max(np.abs(motion.work)))
        ),
        "steps": motion.steps,
        "violation": motion.position_violation,
    }


def row(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    run: Mapping[str, Any],
    limit: float,
    share: float,
) -> dict[str, Any]:
    """One run, repeated while that takes no more than `share` seconds."""
    begin, module, times = start(path, values), loaded(folder), np.array([span])
    try:
        ms, motion = timed(lambda: _simulated(module, begin, times, run, span, limit), share)
        record = _simulated(module, begin, times, run, span, limit, error=True)
    except Unfinished as end:
        return {"status": end.cause, "stopped": end.reached}
    estimate = record.error[-1, : begin.system.q.numel()]
    return judged(module, begin, span, ms, motion) | {"estimate": _finite(estimate)}


def _finite(values: np.ndarray) -> list[float] | None:
    return values.tolist() if np.isfinite(values).all() else None


@functools.lru_cache(maxsize=4)
def loaded(folder: str) -> ModuleType:
    """The module in a folder that is used for no other."""
    return module_in(folder)


def judged(module: ModuleType, begin: Start, span: float, ms: float, motion: Any) -> dict[str, Any]:
    """The row of a run that came to its end."""
    before = module.energy(0.0, _state(module, begin), begin.u, begin.p)
    after, v = (
        at_rows(module, name, motion, _speeds(module, begin), begin.u, begin.p)[-1]
        for name in ("energy", "velocity")
    )
    gain = total_energy(np.array([after]))[0] - total_energy(np.array([before]))[0]
    return {
        "status": "ok",
        "ms": ms,
        "end": [*motion.x[-1, : begin.system.q.numel()].tolist(), *v.tolist()],
        "phi": motion.position_violation,
        "velocity": motion.velocity_violation,
        "balance": float(gain - motion.work[-1]),
        "steps": motion.steps,
        "rejected": motion.rejected,
        "calls": motion.calls,
    }


def timed(call: Callable[[], Any], share: float) -> tuple[float, Any]:
    """Milliseconds of processor time, the least of as many calls as fit in `share` seconds; and
    what a call returned."""
    best, spent, motion = np.inf, 0.0, None
    for repeat in range(MOST_REPEATS):
        before = time.process_time()
        motion = call()
        took = time.process_time() - before
        best, spent = min(best, took), spent + took
        if repeat and spent + took > share:
            break
        if spent > 5 * share:
            break
    return 1e3 * best, motion


def _simulated(
    module: ModuleType,
    begin: Start,
    times: np.ndarray,
    run: Mapping[str, Any],
    span: float,
    limit: float,
    error: bool = False,
) -> Any:
    watch, rtol = Watch(limit), run.get("rtol") or 1e-6
    try:
        return module.simulate(
            (0.0, span),
            _state(module, begin),
            begin.u,
            begin.p,
            rtol=rtol,
            atol=rtol / 100,
            times=times,
            max_steps=MOST_STEPS,
            progress=watch,
            integrator=run["integrator"],
            enforcement=run["enforcement"],
            step_size=span / run["count"] if run.get("count") else None,
            events=False,
            error=error,
        )
    except FloatingPointError as refusal:
        raise _unfinished(module, refusal, watch) from None


def _unfinished(module: ModuleType, refusal: FloatingPointError, watch: Watch) -> Unfinished:
    """A motion has a status; a function that refused its arguments before has a message only."""
    if not hasattr(refusal, "partial"):
        return Unfinished(str(refusal), None)
    status = status_of(refusal)
    if status is Status.SINGULAR:  # which pivots can vanish the module itself knows
        return Unfinished(module._shared.FUNCTIONS["dynamics"][3], watch.reached)
    return Unfinished(status.cause, watch.reached)


def _state(module: ModuleType, begin: Start) -> np.ndarray:
    return module.state(0.0, begin.initial.whole, begin.u, begin.p)


def _speeds(module: ModuleType, begin: Start) -> slice:
    """Where w stands in x = (q, w, z)."""
    return slice(len(begin.initial.q), module.nx - len(begin.initial.z))


def track(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    run: Mapping[str, Any],
    limit: float,
) -> dict[str, Any]:
    """Violations and energy error over time; without them where it does not come to its end."""
    begin, module = start(path, values), loaded(folder)
    times = np.linspace(0.0, span, POINTS)
    try:
        motion = _simulated(module, begin, times, run, span, limit)
    except Unfinished as end:
        return {"failed": end.cause}
    closed, w = positions(begin.system), _speeds(module, begin)
    energy = total_energy(at_rows(module, "energy", motion, w, begin.u, begin.p))
    violations = np.abs(at_rows(module, "constraints", motion, w, begin.u, begin.p))
    return {
        "t": times.tolist(),
        "phi": np.max(violations[:, :closed], axis=1, initial=0.0).tolist(),
        "velocity": np.max(violations[:, closed:], axis=1, initial=0.0).tolist(),
        "balance": np.abs(energy - energy[0] - motion.work).tolist(),
    }
