"""A chunk of motions in a worker: from the numbers of the motions to the columns that are kept."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Any

import numpy as np

from codegen.runtime.error import until_events
from codegen.runtime.simulation import Status
from derive.expressions.columns import columns_of
from derive.states.many import Starts
from hamel.simulate.energies import exchanged
from hamel.sweep import modes
from hamel.sweep.job import Job, Motions
from hamel.sweep.kept import Kept, evaluated
from hamel.sweep.limits import REASONS

Move = tuple[int, str, float, float]  # motion, name, what was given, what is used

NOT_ASSEMBLED, INADMISSIBLE = 100, 101
CAUSES = {
    int(
        Status.MORE
    ): "a million steps were not enough: forces that jump hold it, as dry friction by "
    "sign does where it sticks and tanh(v/eps) does not, or it is stiff, which `--integrator "
    "radau` is for",
    NOT_ASSEMBLED: "it cannot be assembled: no state near the initial values satisfies the "
    "constraints",
    INADMISSIBLE: "a mass or moment of inertia is negative, or a value is not finite",
    modes.NO_STEADY_MOTION: "no steady motion was found with these values",
    int(
        Status.SINGULAR_CHOICE
    ): "the choice of quasi-velocities is singular here, and a sweep stays "
    "in one: --choice names another; `hamel simulate` goes on in another by itself",
}


def is_good(status: np.ndarray) -> np.ndarray:
    """Which motions came to their end."""
    return (status == Status.OK) | (status == Status.EVENT)


def cause(status: int) -> str:
    """What a status of a motion means, in words."""
    return CAUSES.get(status) or Status(status).cause


@dataclass(frozen=True)
class Chunk:
    """Columns of motions first to first + len − 1: what varied, what is kept, and how each
    ended."""

    first: int
    varied: dict[str, np.ndarray]
    kept: dict[str, np.ndarray]
    status: np.ndarray
    moved: np.ndarray  # motions whose held values had to give way
    moves: tuple[Move, ...]  # the first of them
    seconds: float


def made(job: Job, module: Any, number: int) -> Chunk:
    """The chunk of that number; `module` is what `prepared` gave."""
    begin = time.perf_counter()
    first, last = job.span(number)
    varied = job.design.values(first, last)
    work = job.work
    if isinstance(work, Motions):
        columns, status, starts = _motions(job, work, module, varied, last - first)
        moved = starts.moved & ~np.isin(status, (NOT_ASSEMBLED, INADMISSIBLE))
        moves = _moves(starts, np.flatnonzero(moved)[:REASONS], first)
    else:
        parts, status = modes.columns(module, varied, last - first)
        status[~modes.has_masses(module, work.bodies, varied)] = INADMISSIBLE
        columns = {each.label: parts[each.text].copy() for each in job.kept}
        moved, moves = np.zeros(last - first, dtype=bool), ()
    good = is_good(status)
    for column in columns.values():
        column[~good] = np.nan
    return Chunk(first, varied, columns, status, moved, moves, time.perf_counter() - begin)


def _moves(starts: Starts, rows: np.ndarray, first: int) -> tuple[Move, ...]:
    """What gave way in these rows, in each the first that did."""
    moves = []
    for k in rows.tolist():
        name, (given, used) = next(
            (name, pair[:, k]) for name, pair in starts.moves.items() if np.isfinite(pair[1, k])
        )
        moves.append((first + k, name, float(given), float(used)))
    return tuple(moves)


# ---- motions


def _motions(
    job: Job, work: Motions, module: ModuleType, varied: dict[str, np.ndarray], count: int
) -> tuple[dict[str, np.ndarray], np.ndarray, Starts]:
    u = _filled(work.u, work.inputs, varied, count)
    p = _filled(work.p, work.parameters, varied, count)
    initial = {n: varied.get(n, np.array(work.held.get(n))) for n in work.starter.names}
    status = np.zeros(count, dtype=np.int16)
    with np.errstate(all="ignore"):
        least = columns_of(work.bodies)(p.T)[0].min(axis=(0, 1))
        starts = work.starter(initial, p)
        finite = np.isfinite(p).all(axis=1) & np.isfinite(u).all(axis=1)
    status[~starts.closed] = NOT_ASSEMBLED
    status[~finite | ~(least >= 0.0)] = INADMISSIBLE
    x = np.full((count, module.nx), np.nan)
    good = np.flatnonzero(status == 0)
    if len(good):
        qv = np.hstack([starts.q[good], starts.v[good], starts.z[good]])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            x[good] = module.state(work.times[0], qv, u[good], p[good])
    status[good[~np.isfinite(x[good]).all(axis=1)]] = Status.SINGULAR
    good = np.flatnonzero(status == 0)
    columns = {each.label: np.full(count, np.nan) for each in job.kept}
    if len(good):
        run = _run(work, module, x[good], u[good], p[good])
        status[good] = run.status
        for each in job.kept:
            columns[each.label][good] = run.column(each)
    return columns, status, starts


def _filled(
    usual: np.ndarray, names: tuple[str, ...], varied: dict[str, np.ndarray], count: int
) -> np.ndarray:
    rows = np.tile(usual, (count, 1))
    for k, name in enumerate(names):
        if name in varied:
            rows[:, k] = varied[name]
    return rows


@dataclass(frozen=True, eq=False)
class Run:
    """Motions in lanes, and every quantity of them by name."""

    work: Motions
    module: ModuleType
    found: Any  # what simulate() of the module gave
    t: np.ndarray  # (k, rows); from the end of a stopped motion on, that time
    x: np.ndarray  # (k, rows, nx); and that state
    u: np.ndarray
    p: np.ndarray
    known: dict[str, np.ndarray] = field(default_factory=dict)  # what was called already

    @property
    def status(self) -> np.ndarray:
        """How each ended."""
        return np.asarray(self.found.status)

    def column(self, each: Kept) -> np.ndarray:
        """What is kept, of every motion."""
        if each.how == "counted":
            return _COUNTED[each.text](self)
        if each.how in ("count", "first", "last"):
            return self._event(each)
        assert each.formula is not None
        rows = slice(None) if each.whole else self._place(each)
        names = self.work.parameters
        column = evaluated(each.formula, names, lambda name: self.values(name)[:, rows])
        values = np.broadcast_to(column, self.t[:, rows].shape)
        found = _OVER[each.how](self.t[:, rows], values)
        # a motion that ended before has nothing then
        return found if each.time is None else np.where(self.t[:, -1] < each.time, np.nan, found)

    def _place(self, each: Kept) -> slice:
        if each.time is None:
            return slice(len(self.work.times) - 1, None)
        place = int(np.searchsorted(self.work.times, each.time))
        return slice(place, place + 1)

    def values(self, name: str) -> np.ndarray:
        """A quantity by name, at every row of every motion."""
        work, shape = self.work, self.t.shape
        if name == "t":
            return self.t
        if name in work.states and name not in work.outputs:
            return self.x[:, :, work.states.index(name)]
        if name in work.inputs:
            return np.broadcast_to(self._inputs()[:, :, work.inputs.index(name)], shape)
        if name in work.parameters:
            return np.broadcast_to(self.p[:, None, work.parameters.index(name)], shape)
        if name == work.measures["work"]:
            return self.found.work
        function, labels = next(
            (function, labels) for function, labels in self._functions() if name in labels
        )
        return self._called(function)[:, :, labels.index(name)]

    def _functions(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        work = self.work
        rates = tuple(f"der({name})" for name in work.coordinates)
        return (
            ("outputs", work.outputs),
            ("energy", tuple(work.measures[name] for name in ("T", "V", "jacobi"))),
            ("velocity", work.velocities),
            ("dynamics", rates),
        )

    def _inputs(self) -> np.ndarray:
        fed = self.found.u
        return self.u[:, None, :] if fed is None else fed

    def _called(self, function: str) -> np.ndarray:
        if function in self.known:
            return self.known[function]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            call = getattr(self.module, function)
            result = call(self.t, self.x, self._inputs(), self.p[:, None, :])
        self.known[function] = np.asarray(result, dtype=float)
        return self.known[function]

    def _event(self, each: Kept) -> np.ndarray:
        events, k = self.found.events, len(self.x)
        mine = events.of(each.text)
        if each.how == "count":
            return np.bincount(mine.row, minlength=k).astype(float)
        times = np.full(k, np.nan)
        order = slice(None, None, -1) if each.how == "first" else slice(None)
        times[mine.row[order]] = mine.t[order]
        return times

    def balance(self) -> np.ndarray:
        """Energy that came from nowhere at the end, relative to the largest energy exchanged."""
        energy, work = self._called("energy"), self.found.work
        T, V = energy[:, :, 0], energy[:, :, 1]
        total = energy[:, :, 2] if energy.shape[2] > 2 else T + V
        off = np.max(np.abs(total - total[:, :1] - work), axis=1)
        return off / exchanged(T, V, work)


def _run(work: Motions, module: ModuleType, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> Run:
    by = work.stepping
    events: Any = None if module.event_names else False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # statuses say it, motion by motion
        motion = module.simulate(
            (work.times[0], work.times[-1]),
            x,
            _fed(work, module, u),
            p,
            times=work.times,
            rtol=by.rtol,
            atol=by.atol,
            integrator=by.integrator,
            enforcement=by.enforcement,
            step_size=by.step_size,
            max_steps=work.most_steps,
            events=events,
            error=work.error,
        )
    states, worked = (np.asarray(each, dtype=float) for each in (motion.x, motion.work))
    return Run(work, module, replace(motion, work=worked), _times(work, motion), states, u, p)


def _times(work: Motions, motion: Any) -> np.ndarray:
    """Of all rows; those behind the event that stopped a motion are of then, as its states are."""
    return np.array(np.broadcast_to(until_events(motion), (len(motion.x), len(work.times))))


def _fed(work: Motions, module: ModuleType, u: np.ndarray) -> Any:
    if not work.tables:
        return u
    numbers = {name: u[0, k] for k, name in enumerate(work.inputs) if name not in work.tables}
    return numbers | {name: module.Table(*table) for name, table in work.tables.items()}


def _error(run: Run) -> np.ndarray:
    """The largest estimate of any entry at the end."""
    return np.max(np.asarray(run.found.error)[:, -1], axis=1, initial=0.0)


_COUNTED: dict[str, Callable[[Run], np.ndarray]] = {
    "steps": lambda run: np.asarray(run.found.steps, dtype=float),
    "end": lambda run: run.t[:, -1],
    "violation": lambda run: np.asarray(run.found.position_violation, dtype=float),
    "balance": Run.balance,
    "error": _error,
}


def _mean(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Over time, by the trapezoidal rule."""
    span = t[:, -1] - t[:, 0]
    area = np.sum(0.5 * (values[:, 1:] + values[:, :-1]) * np.diff(t, axis=1), axis=1)
    return np.where(span > 0, area / np.where(span > 0, span, 1.0), values[:, 0])


_OVER: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "final": lambda t, values: values[:, -1],
    "at": lambda t, values: values[:, 0],
    "highest": lambda t, values: np.max(values, axis=1),
    "lowest": lambda t, values: np.min(values, axis=1),
    "mean": _mean,
    "rms": lambda t, values: np.sqrt(_mean(t, values * values)),
}
