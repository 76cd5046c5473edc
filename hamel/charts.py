"""A module of several charts, looked at chart by chart: functions by their own names, rows by the
chart they were made in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np

from codegen.runtime.simulation import Simulation
from derive.choices.orthonormal import LENGTH
from derive.formulations.records import Equations, Function
from derive.states.initial import Initial
from hamel.records import Switch


def in_chart(module: Any, name: str, chart: int) -> Callable[..., np.ndarray] | None:
    """The function of that name in a chart: its own where the charts differ, the one of all else;
    None where there is none."""
    return getattr(module, f"{name}_chart{chart}", None) or getattr(module, name, None)


LEFT = 0.5  # of a direction of a frame at the start: with less the frame is based there


def start(
    module: ModuleType, initial: Initial, u: np.ndarray, p: np.ndarray, t: float = 0.0
) -> tuple[np.ndarray, int, np.ndarray]:
    """The state at t in a chart that is regular there, made from (q, v, z) itself; the first
    where it is good enough. And the parameters, with a frame that is good there behind them."""
    q = initial.q
    at = np.concatenate([q, np.zeros(module.nx - len(q))])  # of which only q counts
    if hasattr(module, "rebase") and module.frame(t, at, u, p) < LEFT:
        p = module.rebase(t, at, u, p)
    several = hasattr(module, "charts")
    chart = int(module.chart(t, at, u, p, active=0)) if several else 0
    state = in_chart(module, "state", chart)
    assert state is not None  # every chart has one
    return state(t, initial.whole, u, p), chart, p


def parameters(found: Any, p: np.ndarray) -> np.ndarray:
    """The parameters of each row, with the frame in force there where the module has one; else
    those of all."""
    return p if found.p is None else found.p.astype(float)


def inputs(found: Any, u: np.ndarray) -> np.ndarray:
    """The inputs of each row where they change; else those of all."""
    return u if found.u is None else found.u.astype(float)


def pieces(
    module: ModuleType, simulation: Simulation, w: slice, u: np.ndarray, p: np.ndarray
) -> Iterator[tuple[int, np.ndarray, Simulation]]:
    """Each chart that has rows of what simulate() found: its number, the rows, and these with x in
    its own coordinates; `w` is where quasi-velocities stand in it."""
    if simulation.chart is None:
        yield 0, np.arange(len(simulation.t)), simulation
        return
    for chart in sorted(set(simulation.chart.tolist()) - {-1}):
        rows = np.nonzero(simulation.chart == chart)[0]
        state = in_chart(module, "state", chart)
        assert state is not None  # every chart has one
        assert simulation.v is not None  # it comes with the charts
        here = p[rows] if p.ndim > 1 else p
        fed = None if simulation.u is None else simulation.u[rows]
        now = u if fed is None else fed
        old, v = simulation.x[rows], simulation.v[rows]
        moving = np.hstack([old[:, : w.start], v, old[:, w.stop :]])
        x = state(simulation.t[rows], moving, now, here)
        framed = here if simulation.p is not None else None
        t, work = simulation.t[rows], simulation.work[rows]
        yield chart, rows, replace(simulation, t=t, x=x, work=work, p=framed, u=fed)


def at_rows(
    module: ModuleType, name: str, simulation: Simulation, w: slice, u: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """The function at every row, in the chart the row was made in; no column where the module has
    no such function."""
    if not hasattr(module, name):
        return np.zeros((len(simulation.t), 0))
    parts = [
        (rows, in_chart(module, name, chart), part)
        for chart, rows, part in pieces(module, simulation, w, u, p)
    ]
    values = [
        (rows, call(part.t, part.x, inputs(part, u), parameters(part, p)))
        for rows, call, part in parts
        if call is not None
    ]
    result = np.full((len(simulation.t), *(values[0][1].shape[1:] if values else (0,))), np.nan)
    for rows, value in values:
        result[rows] = value
    return result


def choices(equations: Equations, found: Any) -> tuple[str, ...]:
    """The choice that each row was made in; one that is measured along a frame that was based anew
    with a number, as far as the rows show it."""
    names = [equations.choice, *(chart.choice for chart in equations.charts)]
    charts = np.zeros(len(found.t), dtype=int) if found.chart is None else found.chart
    framed = [any(map(_measured, one.functions)) for one in (equations, *equations.charts)]
    base, rows = 1, []
    for k, chart in enumerate(charts.tolist()):
        if k and found.p is not None and (found.p[k] != found.p[k - 1]).any():
            base += 1
        rows.append(names[chart] + (f" (base {base})" if framed[chart] and base > 1 else ""))
    return tuple(rows)


def _measured(function: Function) -> bool:
    """Whether a function is guarded by what is left of the directions of a frame."""
    return any(guard.name.startswith(LENGTH) for guard in function.guards)


def switches(equations: Equations, rows: Sequence[str], t: np.ndarray) -> tuple[Switch, ...]:
    """Where one choice took over from another, as far as the rows show it; the start in another
    choice than the first is one."""
    if not rows:
        return ()
    before = [equations.choice, *rows[:-1]]
    return tuple(
        Switch(float(t[max(k - 1, 0)]), float(t[k]), left, entered)
        for k, (left, entered) in enumerate(zip(before, rows))
        if left != entered
    )
