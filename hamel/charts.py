"""A motion over several choices of quasi-velocities: where one comes near a singular position, another takes over.

Every choice is a chart of the same motion, regular where its pivots are away from zero. At a row of the output the state is
carried from chart a to chart b exactly, x_b = (q, B_b v) with v = S_a w_a + R_a c; nothing is projected or fitted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from types import ModuleType
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from hamel.motion import MOST_STEPS, Motion, Stepping, judged
from hamel.records import Switch

if TYPE_CHECKING:
    from derive.formulations.records import Equations

LOW = 0.03  # of the largest pivot seen when the equations were made: below this a chart is left …
BETTER = 2.0  # … for one that is so much better, so that no two charts take turns
WINDOWS = 50  # the rows are computed in so many portions: at most one portion is computed in vain per change
ROUNDING = 1e9  # of a guard's tolerance: the largest pivot seen


@dataclass(frozen=True)
class Chart:
    """A choice, compiled; `margin`: (t, x, u, p) → the smallest pivot relative to the largest seen."""

    equations: Equations
    module: ModuleType
    margin: ca.Function


@dataclass(frozen=True)
class _Portion:
    """Rows of one chart."""

    chart: Chart
    found: Any  # what simulate() returned, or the part of it before it stopped
    last: int  # the last row that is used
    why: str  # it stopped, or empty


def chart(equations: Equations, module: ModuleType) -> Chart:
    """The chart of a choice."""
    guards = next(function.guards for function in equations.functions if function.name == "dynamics")
    sizes = [ca.fabs(guard.value) / (guard.tolerance * ROUNDING) for guard in guards]
    least = ca.mmin(ca.vertcat(*sizes)) if sizes else ca.SX(1)
    return Chart(equations, module, ca.Function("margin", [a.symbols for a in equations.arguments], [least]))


def followed(
    charts: Sequence[Chart],
    times: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    u: np.ndarray,
    p: np.ndarray,
    by: Stepping,
    progress: Callable[[float], None] | None,
) -> Motion:
    """The motion from (q, v), beginning in the first chart. Raises AssumptionError where none of them is regular."""
    start, here, row = time.perf_counter(), charts[0], 0
    portions: list[_Portion] = []
    switches: list[Switch] = []
    window = max(1, len(times) // WINDOWS)
    while row < len(times) - 1:
        x = here.module.state(times[row], np.concatenate([q, v]), u, p)
        portion = _portion(here, times[row : row + window + 1], x, u, p, by)
        if portion.last:
            portions.append(portion)
            row += portion.last
            q, v = _state(portion, u, p)
        if portion.why or portion.last < len(portion.found.t) - 1:
            better = _best(charts, here, times[row], q, v, u, p)
            if better is here and not portion.last:
                raise AssumptionError(f"no choice of quasi-velocities goes on at t = {times[row]:.6g} s: {portion.why}")
            if better is not here:
                switches.append(Switch(float(times[row]), here.equations.choice, better.equations.choice))
            here = better
        if progress is not None:
            progress(float(times[row] - times[0]))
    return _joined(charts[0], portions, u, p, tuple(switches), time.perf_counter() - start)


def _portion(here: Chart, times: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray, by: Stepping) -> _Portion:
    """Integrate over `times`; use the rows as long as the chart is good, or not much worse than at the first of them."""
    why = ""
    try:
        found = here.module.simulate(times, x, u, p, max_steps=MOST_STEPS, **asdict(by))
    except FloatingPointError as error:
        found, why = error.partial, str(error)  # type: ignore[attr-defined]
    margins = np.where(np.isfinite(found.x).all(axis=1), _margins(here, found.t, found.x, u, p), np.nan)
    bad = np.nonzero(~(margins >= min(LOW, 0.5 * margins[0])))[0]
    last = int(bad[0]) - 1 if len(bad) else len(found.t) - 1
    return _Portion(here, found, max(0, last), why)


def _margins(here: Chart, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    many = [np.broadcast_to(values, (len(t), values.size)).T for values in (u, p)]
    return np.asarray(here.margin(t[np.newaxis, :], x.T, *many)).ravel()


def _state(portion: _Portion, u: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) at the last row that is used."""
    t, x = portion.found.t[portion.last], portion.found.x[portion.last]
    nq = portion.chart.equations.system.q.numel()
    return x[:nq], portion.chart.module.velocity(t, x, u, p)


def _best(charts: Sequence[Chart], here: Chart, t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray, p: np.ndarray) -> Chart:
    """The chart with the largest margin, if it is so much better than the one we are in."""

    def margin(one: Chart) -> float:
        x = one.module.state(t, np.concatenate([q, v]), u, p)
        return float(_margins(one, np.array([t]), x[np.newaxis, :], u, p)[0])

    sizes = [margin(one) for one in charts]
    best = int(np.nanargmax(sizes))
    return charts[best] if sizes[best] > BETTER * margin(here) else here


def _joined(
    first: Chart, portions: Sequence[_Portion], u: np.ndarray, p: np.ndarray, switches: tuple[Switch, ...], seconds: float
) -> Motion:
    """One motion, in the quasi-velocities of the first chart: w = B v holds wherever it is."""
    pieces, done = [], 0.0
    for number, portion in enumerate(portions):
        rows = slice(1 if number else 0, portion.last + 1)
        found = portion.found
        part = replace(found, t=found.t[rows], x=found.x[rows], work=found.work[rows] + done)
        done += float(found.work[portion.last])
        pieces.append(judged(portion.chart.module, portion.chart.equations, part, u, p, 0.0))
    whole = {field.name: _column([getattr(piece, field.name) for piece in pieces]) for field in fields(Motion)}
    found = Motion(**{**whole, "seconds": seconds, "switches": switches})
    state = np.column_stack([*found.q.values(), *found.v.values()])
    x = first.module.state(found.t, state, u, p)
    names = pieces[0].w if portions[0].chart is first else first.equations.w
    return replace(found, w=dict(zip(names, x[:, len(found.q) :].T)))


def _column(values: list[Any]) -> Any:
    """Arrays end to end, counts summed, the largest violation."""
    if isinstance(values[0], np.ndarray):
        return np.concatenate(values)
    if isinstance(values[0], dict):
        shared = [name for name in values[0] if all(name in other for other in values)]
        return {name: _column([other[name] for other in values]) for name in shared}
    if isinstance(values[0], int):
        return sum(values)
    return max(values) if isinstance(values[0], float) else values[0]
