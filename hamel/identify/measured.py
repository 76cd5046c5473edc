"""A measured motion: columns of a file become q, w, ẇ and u, filtered where rates are missing.

Zero-phase Butterworth filters take the noise out before anything is differentiated; the equations
are filtered by the same filter afterwards, so that it does not bias them (Gautier 1997; Swevers et
al. 2007).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.linalg import null_space
from scipy.signal import butter, sosfiltfilt

from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.formulations.evaluate import function_of, slots_of
from derive.formulations.records import Equations
from derive.states.closing import Kinematics, closed, nominal
from hamel.columns import file_columns
from hamel.identify.limits import (
    ABOVE,
    EVEN,
    LEAST,
    LOOKED,
    NYQUIST,
    ORDER,
    RISEN,
    SMOOTH,
    SPLINE_ENDS,
    TOLD,
    TOP,
)

Array = np.ndarray


@dataclass(frozen=True)
class Filter:
    """A low-pass filter at `cutoff` (Hz) of samples at `rate` (Hz)."""

    cutoff: float
    rate: float

    def __call__(self, x: Array) -> Array:
        sections = butter(ORDER, self.cutoff, fs=self.rate, output="sos")
        return sosfiltfilt(sections, x, axis=0)

    @property
    def every(self) -> int:
        """Of so many rows one is kept: what is left of the noise is then nearly white."""
        return max(1, int(self.rate / (2.5 * self.cutoff)))

    @property
    def correlation(self) -> Array:
        """Of white noise after the filter, between kept rows that are 0, 1, 2 … apart."""
        reach = 4 * self.ends
        impulse = np.zeros(2 * reach + 1)
        impulse[reach] = 1.0
        response = self(impulse)
        lags = np.correlate(response, response, "full")[2 * reach :: self.every]
        return lags[: reach // self.every + 1] / lags[0]

    @property
    def ends(self) -> int:
        """Rows at either end that the ends of filter and splines reach."""
        return int(2.0 * self.rate / self.cutoff) + SPLINE_ENDS


@dataclass(frozen=True)
class Measured:
    """Rows of a motion over the quasi-velocities; `filter` None where accelerations were there.
    `z` are first-order states at their initial values: those that act on forces are refused."""

    t: Array
    q: Array
    w: Array
    z: Array
    wdot: Array
    u: Array
    filter: Filter | None
    notes: tuple[str, ...]


def table(file: str | Path) -> dict[str, Array]:
    """The columns of a file. Raises ModelError where it has too few rows to fit anything to."""
    result = file_columns(file)
    rows = min(column.size for column in result.values())
    if rows < LEAST:
        shown = "one row" if rows == 1 else f"{rows} rows"
        raise ModelError(f"{file} has {shown}", f"{LEAST} or more")
    return result


def measured(equations: Equations, file: str | Path, cutoff: float | None) -> Measured:
    """The motion of a file. Raises ModelError for columns that are missing and no loop tells, times
    that do not rise evenly, and positions that the loops cannot be closed at; AssumptionError where
    nothing moves."""
    model, columns = equations.system.model, table(file)
    names = [x.name for x in model.coordinates]
    velocities = [x.name for x in model.velocities]
    rates = [f"der({name})" for name in velocities]
    t = _time(file, columns)
    _check(equations, file, columns)
    _check_moves(file, {n: columns[n] for n in names if n in columns})
    low = None if all(name in columns for name in rates) else _filter(t, columns, names, cutoff)
    smooth = low or (lambda x: x)
    q = _positions(equations, t, {n: smooth(columns[n]) for n in names if n in columns}, file)
    _check_told(equations, file, t, q, columns)
    given = {n: smooth(columns[n]) for n in velocities if n in columns}
    v = _velocities(equations, t, q, given)
    u = np.column_stack([columns[x.name] for x in model.inputs])
    z = _rows(_initial_states(equations), len(t))
    moving = _speeds(equations, t, q, np.hstack([v, z]), u)
    w = moving[:, : moving.shape[1] - z.shape[1]]
    if low is None:
        wdot = _speed_rates(equations, t, q, v, np.column_stack([columns[n] for n in rates]))
    else:
        wdot = make_interp_spline(t, w, k=5)(t, 1)
    known = {"t", *names, *velocities, *rates, *(x.name for x in model.inputs)}
    return Measured(t, q, w, z, wdot, u, low, _notes(columns, known, names, velocities, low))


@dataclass(frozen=True)
class Recorded:
    """Rows of a motion as they were measured: all columns of the file, inputs, and x, of which what
    was not measured is a guess."""

    t: Array
    columns: dict[str, Array]
    u: Array
    x: Array


def recorded(equations: Equations, file: str | Path, cutoff: float | None) -> Recorded:
    """The motion of a file that is to be simulated: inputs have to be there, and what else is
    measured may be any of the state, of velocities and of outputs. Raises ModelError."""
    system, columns = equations.system, table(file)
    model, t = system.model, _time(file, columns)
    _check_inputs(equations, file, columns)
    names = [x.name for x in model.coordinates]
    known = [name for name in names if name in columns]
    low = _filter(t, columns, names, cutoff) if known else None
    smooth = low or (lambda x: x)
    q = _positions(equations, t, {n: smooth(columns[n]) for n in known}, file)
    given = {x.name: columns[x.name] for x in model.velocities if x.name in columns}
    v = _velocities(equations, t, q, given)
    u = np.column_stack([np.empty((len(t), 0)), *(columns[x.name] for x in model.inputs)])
    initial = _initial_states(equations)
    z = [columns.get(x.name, np.full(len(t), a)) for x, a in zip(model.states, initial)]
    moving = _speeds(equations, t, q, np.column_stack([v, *z]), u)
    return Recorded(t, columns, u, np.column_stack([q, moving]))


def _time(file: str | Path, columns: dict[str, Array]) -> Array:
    if "t" not in columns:
        raise ModelError(f"{file} has no column 't'", "the times in seconds")
    steps = np.diff(columns["t"])
    if (steps <= 0.0).any() or np.ptp(steps) > 2.0 * EVEN * float(np.mean(steps)):
        raise ModelError(f"{file}: the times do not rise by even steps", "one sampling rate")
    return columns["t"]


def _check(equations: Equations, file: str | Path, columns: dict[str, Array]) -> None:
    model = equations.system.model
    if not model.inputs:
        raise ModelError(
            f"{model.name} has no inputs, so nothing says how large the forces were",
            "inputs: {torque: {joint: NAME}} for every force that was measured",
        )
    _check_inputs(equations, file, columns)
    wanted = {x.name for x in model.coordinates}
    if not wanted & {*columns}:
        raise ModelError(f"{file} has no column of a coordinate", listed(sorted(wanted)))


def _check_moves(file: str | Path, coordinates: dict[str, Array]) -> None:
    rows = len(next(iter(coordinates.values())))
    if not any(np.ptp(column) for column in coordinates.values()):
        still = f"{listed(list(coordinates))} stay as they are"
        raise AssumptionError(
            f"nothing moves in {file}: in all {rows} rows {still}",
            "a motion that moves every joint; --excite finds one",
        )


def _check_inputs(equations: Equations, file: str | Path, columns: dict[str, Array]) -> None:
    for item in equations.system.model.inputs:
        if item.name not in columns:
            near = did_you_mean(item.name, columns) or f"it has {listed(list(columns))}"
            raise ModelError(f"{file} has no column '{item.name}', an input; {near}")


def _filter(t: Array, columns: dict[str, Array], names: Sequence[str], own: float | None) -> Filter:
    rate = (len(t) - 1) / float(t[-1] - t[0])
    if own is not None and not 0.0 < own < rate / 2.0:
        raise ModelError(f"the cutoff is {own:g} Hz", f"less than half of {rate:g} Hz")
    if own is not None and 2 * Filter(own, rate).ends >= len(t):
        problem = f"the cutoff is {own:g} Hz, whose filter reaches over all {t[-1] - t[0]:.4g} s"
        least = 4.0 * rate / max(1, len(t) - 2 * SPLINE_ENDS)
        raise ModelError(problem, f"more than {least:.3g} Hz, or a longer motion")
    return Filter(
        own or _cutoff(np.column_stack([columns[n] for n in names if n in columns]), rate), rate
    )


def _cutoff(q: Array, rate: float) -> float:
    """Above where the coordinates rise from their noise.

    Second differences have no trend, and turn white noise of the coordinates into a spectrum of the
    known form (2 sin(π f / rate))⁴: divided by it the noise is flat, and as high everywhere as near
    half of the rate, where no motion is expected.
    """
    bends = np.diff(q, 2, axis=0)
    window = np.hanning(len(bends))[:, None]
    spectrum = np.fft.rfft((bends - bends.mean(axis=0)) * window, axis=0)[1:]
    f = np.fft.rfftfreq(len(bends), 1.0 / rate)[1:]
    power = np.abs(spectrum / (2.0 * np.sin(np.pi * f / rate))[:, None] ** 2) ** 2
    top = f > TOP * rate / 2.0
    noise = np.median(power[top], axis=0) / np.log(2.0)  # the mean of what has that median
    smooth = np.ones(SMOOTH) / SMOOTH
    means = np.array([np.convolve(column, smooth, mode="same") for column in power.T]).T
    risen = ((means > RISEN * noise) & ~top[:, None]).any(axis=1)
    highest = float(np.max(f[risen], initial=f[0]))
    return min(ABOVE * highest, NYQUIST * rate)


def _positions(equations: Equations, t: Array, given: dict[str, Array], file: str | Path) -> Array:
    """All coordinates; those that were not measured by closing the loops, row after row."""
    system = equations.system
    names = [x.name for x in system.model.coordinates]
    missing = np.array([name not in given for name in names])
    if not missing.any():
        return np.column_stack([given[name] for name in names])
    start, rows = nominal(system), np.zeros((len(t), len(names)))
    solver, p = Kinematics(system), np.array(system.parameters)
    for k, time in enumerate(t):
        start = np.where(missing, start, [given[n][k] if n in given else 0.0 for n in names])
        positions = closed(solver, float(time), start, p, missing)
        if positions is None:
            lost = [name for name in names if name not in given]
            raise ModelError(
                f"{file}: {listed(lost)} cannot be found at t = {time:g} s", "columns of them"
            )
        rows[k] = start = positions
    return rows


def _check_told(
    equations: Equations, file: str | Path, t: Array, q: Array, columns: dict[str, Array]
) -> None:
    """Raises ModelError for coordinates that neither the file nor the loops tell. At a dead centre
    loops tell less than elsewhere, so the best of some rows counts."""
    system = equations.system
    missing = [k for k, x in enumerate(system.model.coordinates) if x.name not in columns]
    if not missing:
        return
    solver, p = Kinematics(system), np.array(system.parameters)
    some = np.linspace(0, len(t) - 1, LOOKED).astype(int)
    slopes = [solver.positions(float(t[k]), q[k], p)[1][:, missing] for k in some]
    free = min((_left_alone(J) for J in slopes), key=lambda found: found.shape[1])
    lost = [system.model.coordinates[missing[k]].name for k in np.flatnonzero(free.any(axis=1))]
    told = len(lost) - free.shape[1]
    if lost:
        near = did_you_mean(lost[0], columns) or f"it has {listed(list(columns))}"
        names = " and ".join(f"'{name}'" for name in lost)
        which = f"coordinates of which the loops tell {told}" if told else "which no loop tells"
        raise ModelError(
            f"{file} has no column {names}, {which}; {near}",
            "columns of all coordinates but those that loops tell",
        )


def _left_alone(J: Array) -> Array:
    """Directions that J leaves alone, without rounding; J may be without rows."""
    found = null_space(np.vstack([J, np.zeros(J.shape[1])]), rcond=TOLD)
    return np.where(np.abs(found) > TOLD, found, 0.0)


def _velocities(equations: Equations, t: Array, q: Array, given: dict[str, Array]) -> Array:
    """Generalized velocities; those that are missing from the rates of the coordinates."""
    system = equations.system
    names = [x.name for x in system.model.velocities]
    if len(given) == len(names):
        return np.column_stack([given[name] for name in names])
    rates = make_interp_spline(t, q, k=5)(t, 1)
    N = Kinematics(system).values(system.N, t, q, _rows(system.parameters, len(t)))
    v = np.einsum("kij,kj->ki", np.linalg.pinv(N), rates)
    for j, name in enumerate(names):
        v[:, j] = given.get(name, v[:, j])
    return v


def _initial_states(equations: Equations) -> tuple[float, ...]:
    system = equations.system
    return system.parameters[len(system.own_parameters) :]


def _rows(values: Sequence[float], count: int) -> Array:
    return np.tile(np.array(values, dtype=float), (count, 1))


def at_rows(function: ca.Function, t: Array, x: Array, u: Array, p: Sequence[float]) -> Array:
    """A function of (t, x, u, p) at many rows: rows × r × c."""
    count, own = len(t), np.array(p, dtype=float)
    result = function.map(count)(t[None, :], x.T, u.T, np.tile(own[:, None], (1, count))).full()
    return result.reshape(result.shape[0], count, -1).transpose(1, 0, 2)


def parameters_of(equations: Equations) -> tuple[float, ...]:
    """The parameters of the file, with the usual frame of directions behind them."""
    return equations.parameters


def _speeds(equations: Equations, t: Array, q: Array, v: Array, u: Array) -> Array:
    """(w, z) of (v, z): w = B v."""
    function = function_of(equations, "state")
    values = at_rows(function, t, np.hstack([q, v]), u, parameters_of(equations))
    return values[:, q.shape[1] :, 0]


def _speed_rates(equations: Equations, t: Array, q: Array, v: Array, vdot: Array) -> Array:
    """ẇ = B v̇ + Ḃ v."""
    system = equations.system
    rate = ca.SX.sym("vdot", system.v.numel())
    Bv = ca.mtimes(equations.term("B"), system.v)
    moved = ca.jtimes(Bv, ca.vertcat(system.t, system.q), ca.vertcat(1, system.qdot))
    value = ca.densify(moved + ca.mtimes(equations.term("B"), rate))
    slots = slots_of(equations)
    x = ca.vertcat(system.q, system.v, rate)
    function = ca.Function("wdot", [slots[0], x, slots[2], slots[3]], [value])
    none = np.zeros((len(t), system.u.numel()))
    rows = at_rows(function, t, np.hstack([q, v, vdot]), none, parameters_of(equations))
    return rows[:, :, 0]


def _notes(
    columns: dict[str, Array],
    known: set[str],
    names: Sequence[str],
    velocities: Sequence[str],
    low: Filter | None,
) -> tuple[str, ...]:
    notes: list[str] = []
    if low is None:
        notes.append("accelerations are those of the file; nothing is filtered")
    else:
        notes.append(
            f"filtered forwards and backwards by a Butterworth filter of order {ORDER} at "
            f"{low.cutoff:.4g} Hz (sampled at {low.rate:.6g} Hz); one equation in {low.every} kept"
        )
    closed_ones = [name for name in names if name not in columns]
    if closed_ones:
        notes.append(f"found by closing the loops: {listed(closed_ones)}")
    if any(name not in columns for name in velocities):
        notes.append("velocities are derivatives of quintic splines through the coordinates")
    ignored = sorted({*columns} - known)
    if ignored:
        notes.append(f"columns that are not used: {listed(ignored)}")
    return tuple(notes)
