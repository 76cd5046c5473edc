"""A module of several charts, looked at chart by chart: functions by their own names, rows by the
chart they were made in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from codegen.runtime.simulation import Simulation
    from derive.formulations.records import Equations
    from hamel.records import Switch


def in_chart(module: Any, name: str, chart: int) -> Callable[..., np.ndarray] | None:
    """The function of that name in a chart: its own where the charts differ, the one of all else;
    None where there is none."""
    return getattr(module, f"{name}_chart{chart}", None) or getattr(module, name, None)


def start(
    module: ModuleType, q: np.ndarray, v: np.ndarray, u: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, int]:
    """The state at t = 0 in a chart that is regular there, made from (q, v) itself; the first where
    it is good enough."""
    qv = np.concatenate([q, v])
    chart = int(module.chart(0.0, module.state(0.0, qv, u, p), u, p, active=0))
    state = in_chart(module, "state", chart)
    assert state is not None  # every chart has one
    return state(0.0, qv, u, p), chart


def pieces(
    module: ModuleType, found: Simulation, nq: int, u: np.ndarray, p: np.ndarray
) -> Iterator[tuple[int, np.ndarray, Simulation]]:
    """Each chart that has rows of what simulate() found: its number, the rows, and these with x in
    its own coordinates."""
    if found.chart is None:
        yield 0, np.arange(len(found.t)), found
        return
    for chart in sorted(set(found.chart.tolist()) - {-1}):
        rows = np.nonzero(found.chart == chart)[0]
        state = in_chart(module, "state", chart)
        assert state is not None  # every chart has one
        assert found.v is not None  # it comes with the charts
        x = state(found.t[rows], np.hstack([found.x[rows, :nq], found.v[rows]]), u, p)
        yield chart, rows, replace(found, t=found.t[rows], x=x, work=found.work[rows])


def at_rows(
    module: ModuleType, name: str, found: Simulation, nq: int, u: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """The function at every row, in the chart the row was made in; no column where the module has
    no such function."""
    if not hasattr(module, name):
        return np.zeros((len(found.t), 0))
    parts = [
        (rows, in_chart(module, name, chart), part)
        for chart, rows, part in pieces(module, found, nq, u, p)
    ]
    values = [(rows, call(part.t, part.x, u, p)) for rows, call, part in parts if call is not None]
    made = np.full((len(found.t), *(values[0][1].shape[1:] if values else (0,))), np.nan)
    for rows, value in values:
        made[rows] = value
    return made


def switches(equations: Equations, found: Simulation) -> tuple[Switch, ...]:
    """As far as the rows show them."""
    if found.chart is None:
        return ()
    from hamel.records import Switch

    names = [equations.choice, *(chart.choice for chart in equations.charts)]
    changed = np.nonzero(np.diff(found.chart))[0]
    return tuple(
        Switch(float(found.t[k]), names[found.chart[k]], names[found.chart[k + 1]]) for k in changed
    )
