"""Runs in the compiled loop of a module: whole simulations with the end time as their only output,
timed and judged."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from codegen.integrators import INTEGRATORS
from derive.formulations.functions import positions
from hamel.build.module import module_in
from hamel.charts import at_rows
from hamel.simulate.motion import balanced
from hamel.study.building import Start, start

MOST_STEPS = 10**9
POINTS = 240  # of a track
MOST_REPEATS = 15
TOO_LONG = "too long"
ADAPTIVE = {method.name for method in INTEGRATORS if method.adaptive}


class TooLong(Exception):
    """The run used more than its share of time."""


def exact(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    run: Mapping[str, Any],
    limit: float,
) -> Iterator[dict[str, Any]]:
    """One tight run: the end (q, v), the sizes of all q and v on the way, and the largest energy
    exchanged."""
    found, module = start(path, values), module_in(folder)
    times = np.linspace(0.0, span, POINTS)
    try:
        made = _simulated(module, found, times, run, span, limit)
    except (FloatingPointError, TooLong) as problem:
        yield {"failed": _cause(problem)[0]}
        return
    v = module.velocity(times, made.x, found.u, found.p)
    q = made.x[:, : found.system.q.numel()]
    energy = module.energy(times, made.x, found.u, found.p)
    yield {
        "end": [*q[-1].tolist(), *v[-1].tolist()],
        "sizes": np.max(np.abs(np.hstack([q, v])), axis=0).tolist(),
        "exchanged": float(
            max(np.max(np.abs(energy[:, 0])), np.ptp(energy[:, 1]), np.max(np.abs(made.work)))
        ),
        "steps": made.steps,
        "violation": made.position_violation,
    }


def rows(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    runs: Sequence[Mapping[str, Any]],
    limit: float,
    share: float,
) -> Iterator[dict[str, Any]]:
    """A message per run, in the order given. After a run that took too long, tighter ones of its
    family are not tried."""
    found, module = start(path, values), module_in(folder)
    hopeless: set[tuple[str, str]] = set()
    for run in runs:
        family = (run["enforcement"], run["integrator"])
        made = (
            {"status": TOO_LONG}
            if family in hopeless
            else _row(module, found, span, run, limit, share)
        )
        if made["status"] == TOO_LONG:
            hopeless.add(family)
        yield {"run": run["key"], "row": made}


def _row(
    module: ModuleType,
    found: Start,
    span: float,
    run: Mapping[str, Any],
    limit: float,
    share: float,
) -> dict[str, Any]:
    times = np.array([span])
    try:
        ms, made = timed(lambda: _simulated(module, found, times, run, span, limit), share)
    except (FloatingPointError, TooLong) as problem:
        status, reached = _cause(problem)
        return {"status": status, "stopped": reached}
    return judged(module, found, span, ms, made)


def judged(module: ModuleType, found: Start, span: float, ms: float, made: Any) -> dict[str, Any]:
    """The row of a run that came to its end."""
    before = module.energy(0.0, _state(module, found), found.u, found.p)
    after, v = (
        at_rows(module, name, made, found.system.q.numel(), found.u, found.p)[-1]
        for name in ("energy", "velocity")
    )
    gain = balanced(np.array([after]))[0] - balanced(np.array([before]))[0]
    return {
        "status": "ok",
        "ms": ms,
        "end": [*made.x[-1, : found.system.q.numel()].tolist(), *v.tolist()],
        "phi": made.position_violation,
        "velocity": made.velocity_violation,
        "balance": float(gain - made.work[-1]),
        "steps": made.steps,
        "rejected": made.rejected,
        "calls": made.calls,
    }


def timed(call: Callable[[], Any], share: float) -> tuple[float, Any]:
    """Milliseconds of processor time, the least of as many calls as fit in `share` seconds; and
    what a call returned."""
    best, spent, made = np.inf, 0.0, None
    for repeat in range(MOST_REPEATS):
        begin = time.process_time()
        made = call()
        took = time.process_time() - begin
        best, spent = min(best, took), spent + took
        if repeat and spent + took > share:
            break
        if spent > 5 * share:
            break
    return 1e3 * best, made


def _simulated(
    module: ModuleType,
    found: Start,
    times: np.ndarray,
    run: Mapping[str, Any],
    span: float,
    limit: float,
) -> Any:
    begin = time.process_time()

    def watch(reached: float) -> None:
        if time.process_time() - begin > limit:
            raise TooLong(reached)

    rtol = run.get("rtol") or 1e-6
    return module.simulate(
        (0.0, span),
        _state(module, found),
        found.u,
        found.p,
        rtol=rtol,
        atol=rtol / 100,
        times=times,
        max_steps=MOST_STEPS,
        progress=watch,
        integrator=run["integrator"],
        enforcement=run["enforcement"],
        step_size=span / run["count"] if run.get("count") else None,
    )


def _state(module: ModuleType, found: Start) -> np.ndarray:
    return module.state(0.0, np.concatenate([found.initial.q, found.initial.v]), found.u, found.p)


def _cause(problem: Exception) -> tuple[str, float | None]:
    """A status in a few words, and the time that was reached."""
    if isinstance(problem, TooLong):
        return TOO_LONG, float(problem.args[0])
    place, _, why = str(problem).partition(": ")
    reached = place.rpartition("t = ")[2]
    try:
        return why or place, float(reached)
    except ValueError:
        return str(problem), None


def tracks(
    path: str,
    values: Mapping[str, float | str],
    folder: str,
    span: float,
    runs: Sequence[Mapping[str, Any]],
    limit: float,
) -> Iterator[dict[str, Any]]:
    """Violations and energy error over time, a message per run; without them where it does not come
    to its end."""
    found, module = start(path, values), module_in(folder)
    times = np.linspace(0.0, span, POINTS)
    for run in runs:
        try:
            made = _simulated(module, found, times, run, span, limit)
        except (FloatingPointError, TooLong) as problem:
            yield {"track": run["key"], "failed": _cause(problem)[0]}
            continue
        closed, nq = positions(found.system), found.system.q.numel()
        energy = balanced(at_rows(module, "energy", made, nq, found.u, found.p))
        many = at_rows(module, "constraints", made, nq, found.u, found.p)
        yield {
            "track": run["key"],
            "t": times.tolist(),
            "phi": np.max(np.abs(many[:, :closed]), axis=1, initial=0.0).tolist(),
            "velocity": np.max(np.abs(many[:, closed:]), axis=1, initial=0.0).tolist(),
            "balance": np.abs(energy - energy[0] - made.work).tolist(),
        }
