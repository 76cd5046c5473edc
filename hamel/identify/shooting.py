"""Free parameters by multiple shooting: where the motion is not linear in them, it is simulated.

The motion is cut into segments, each with a start of its own. Parameters and starts together make
what is measured differ least from what is computed, with the end of each segment held to the start
of the next (Bock 1983): no segment is so long that a wrong start leads far away. Gauss and Newton's
steps with trust regions (scipy.optimize.least_squares). Derivatives are integrated with the motion
(`variation`); where forces jump they are differences of motions that run side by side in one call.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.formulations.records import Equations
from hamel.identify.limits import (
    CONTINUOUS,
    DIFFERENCE,
    DOUBTFUL,
    EVALUATIONS,
    FIRST_NOISE,
    LEAST_WEIGHT,
    LOOSE,
    MOVES,
    PART,
    PASSES,
    SMALLEST_STEP,
    TOLD,
    TOLERANCE,
)
from hamel.identify.measured import Array, Recorded
from hamel.identify.variation import Slopes, slopes

HOW: dict[str, Any] = {"rtol": TOLERANCE, "atol": TOLERANCE, "integrator": "dop853"}

MOVING = ("dynamics", "velocity", "outputs", "constraints")  # functions that a motion is told by


@dataclass(frozen=True)
class Shot:
    """Values and standard deviations of the free parameters; `noise`: what is left of each measured
    quantity, root mean square in its unit; `doubtful`: those of which much is left; `gap`: the
    largest between segments, in units of the spread of the state; `starts` (segments, nx)."""

    values: Array
    deviations: Array
    measured: tuple[str, ...]
    noise: Array
    doubtful: tuple[str, ...]
    gap: float
    starts: Array


@dataclass(frozen=True)
class _Problem:
    """What is unknown is θ = (free parameters, starts), each in units of its own scale."""

    equations: Equations
    module: ModuleType
    recorded: Recorded
    p: Array
    free: tuple[int, ...]
    at: Array  # (segments, rows): numbers of the rows of each, its end is the start of the next
    names: tuple[str, ...]
    scale_p: Array
    scale_x: Array
    along: ModuleType | None  # of a motion with its slopes
    slopes: Slopes

    def parts(self, theta: Array) -> tuple[Array, Array]:
        """Parameters (…, np) and starts (…, segments, nx) of θ (…, n)."""
        count = len(self.free)
        p = np.broadcast_to(self.p, (*theta.shape[:-1], len(self.p))).copy()
        p[..., list(self.free)] = theta[..., :count] * self.scale_p
        starts = theta[..., count:].reshape(*theta.shape[:-1], len(self.at), -1)
        return p, starts * self.scale_x

    def motions(self, p: Array, starts: Array, at: Array) -> Array:
        """x of motions from these starts, (motions, rows, nx). Raises AssumptionError where one
        stops on its way."""
        if hasattr(self.module, "project"):
            starts = self.module.project(self.recorded.t[at[:, 0]], starts, None, p)
        return self._simulated(self.module, starts, p, at)

    def motions_with_slopes(self, theta: Array) -> tuple[Array, Array]:
        """x of the segments and its slopes by (free p, own start) in their scales, (segments, rows,
        nx, n)."""
        assert self.along is not None  # who asks knows
        p, starts = self.parts(theta)
        t, u = self.recorded.t[self.at[:, 0]], self.recorded.u[self.at[:, 0]]
        begun = [self.slopes.at_start(*each, p) for each in zip(t, starts, u)]
        scale = np.concatenate([self.scale_p, self.scale_x])
        whole = np.array([np.concatenate([x, (D * scale).ravel()]) for x, D in begun])
        many = np.broadcast_to(p, (len(self.at), len(p)))
        rows = self._simulated(self.along, whole, many, self.at)
        x, D = np.split(rows, [len(self.scale_x)], axis=-1)
        return x, D.reshape(*x.shape, len(scale))

    def _simulated(self, module: ModuleType, starts: Array, p: Array, at: Array) -> Array:
        columns = zip(module.inputs, self.recorded.u.T)
        u = {name: module.Table(self.recorded.t, column, "linear") for name, column in columns}
        rows = module.simulate(self.recorded.t[at], starts, u or None, p, **HOW).x
        x = np.asarray(rows, float)
        if not np.isfinite(x).all():
            message = f"{self.equations.system.model.name}: a motion from a start between two "
            raise AssumptionError(f"{message}segments stops on its way", "more segments")
        return x

    def seen(self, x: Array, p: Array, at: Array) -> Array:
        """What is measured, (motions, rows, quantities)."""
        t, u = self.recorded.t[at], self.recorded.u[at]
        known = dict(zip(self.module.states, np.moveaxis(x, -1, 0)))
        for name in ("velocity", "outputs"):
            if not self.equations.has(name) or {*self.names} <= {*known}:
                continue
            labels = self.equations.function(name).result.labels
            values = getattr(self.module, name)(t, x, u, p[:, None, :])
            known = dict(zip(labels, np.moveaxis(values, -1, 0))) | known
        return np.stack([known[name] for name in self.names], axis=-1)

    def parts_seen(self, theta: Array) -> tuple[Array, Array]:
        """What each segment shows, (segments, rows, quantities), and where it ends, in scales."""
        p, starts = self.parts(theta)
        many = np.broadcast_to(p, (len(self.at), len(p)))
        x = self.motions(many, starts, self.at)
        return self.seen(x, many, self.at), x[:, -1] / self.scale_x


def shot(
    equations: Equations,
    module: ModuleType,
    recorded: Recorded,
    free: Sequence[str],
    segments: int,
    along: ModuleType | None,
) -> Shot:
    """The free parameters from a recorded motion; `along` is the module of `varied`, None where
    slopes are to be differences. Raises ModelError for names that are none and for
    a file that measures nothing, AssumptionError where the motion does not tell them."""
    problem = _problem(equations, module, recorded, free, segments, along)
    measured = np.column_stack([recorded.columns[name] for name in problem.names])
    noise = FIRST_NOISE * np.maximum(np.std(measured, axis=0), LEAST_WEIGHT)
    theta, jacobian = _first(problem), np.empty((0, 0))
    for tie in LOOSE:  # segments that need not meet find their way from far away
        theta, _ = _solved(problem, measured, noise, theta, tie)
    for _ in range(PASSES):  # the second time by the noise that there is
        theta, jacobian = _solved(problem, measured, noise, theta, CONTINUOUS)
        left = problem.parts_seen(theta)[0] - measured[problem.at]
        noise = np.maximum(np.sqrt(np.mean(left**2, axis=(0, 1))), LEAST_WEIGHT * noise)
    much = noise > DOUBTFUL * np.std(measured, axis=0)
    doubtful = [name for name, is_much in zip(problem.names, much) if is_much]
    return _told(problem, theta, jacobian, noise, tuple(doubtful))


def check_free(equations: Equations, free: Sequence[str]) -> None:
    """Raises ModelError for a name that is no parameter of the model, AssumptionError for one that
    nothing of its motion and outputs depends on."""
    known = equations.argument("p").labels
    for k, name in enumerate(free):
        if name not in known:
            near = did_you_mean(name, known) or f"it has {listed(known)}"
            raise ModelError(f"'{name}' is no parameter of {equations.system.model.name}; {near}")
        if name in free[:k]:
            raise ModelError(f"'{name}' is named twice", "each free parameter once")
    symbols = equations.argument("p").symbols
    used = [equations.function(x).result.value for x in MOVING if equations.has(x)]
    for name in free:
        parameter = symbols[known.index(name)]
        if not any(ca.depends_on(value, parameter) for value in used):
            model = equations.system.model.name
            raise AssumptionError(f"no formula of the motion of {model} uses '{name}'")


def quantities(equations: Equations, recorded: Recorded) -> tuple[str, ...]:
    """What is measured: states, velocities and outputs. Raises ModelError where nothing is."""
    labels = [*equations.argument("x").labels]
    for name in ("velocity", "outputs"):
        labels += equations.function(name).result.labels if equations.has(name) else ()
    names = tuple(dict.fromkeys(x for x in labels if x in recorded.columns))
    if not names:
        raise ModelError("the file measures nothing of the motion", f"columns of {listed(labels)}")
    return names


def _problem(
    equations: Equations,
    module: ModuleType,
    recorded: Recorded,
    free: Sequence[str],
    segments: int,
    along: ModuleType | None,
) -> _Problem:
    names = quantities(equations, recorded)
    rows = (len(recorded.t) - 1) // segments
    if rows < 2:
        raise ModelError(f"{segments} segments of {len(recorded.t)} rows", "fewer segments")
    at = rows * np.arange(segments)[:, None] + np.arange(rows + 1)
    p = np.array(equations.parameters, float)
    numbers = tuple(module.parameters.index(name) for name in free)
    scale_p = scales_of(equations, free)
    spread = np.std(recorded.x, axis=0)
    scale_x = np.where(spread > MOVES, spread, 1.0)
    by = slopes(equations, free, names)
    return _Problem(equations, module, recorded, p, numbers, at, names, scale_p, scale_x, along, by)


def scales_of(equations: Equations, free: Sequence[str]) -> Array:
    """What each free parameter is counted in: its value in the file, one where that is zero."""
    values = dict(zip(equations.argument("p").labels, equations.parameters))
    return np.array([abs(values[name]) or 1.0 for name in free])


def _first(problem: _Problem) -> Array:
    starts = problem.recorded.x[problem.at[:, 0]] / problem.scale_x
    return np.concatenate([problem.p[list(problem.free)] / problem.scale_p, starts.ravel()])


def _solved(
    problem: _Problem, y: Array, noise: Array, theta: Array, tie: float
) -> tuple[Array, Array]:
    """θ, and the Jacobian of all residuals there; `tie`: the standard deviations of noise that a
    gap of one spread of the state counts as."""
    measured = y[problem.at]
    count = (measured[:, :-1].size + measured[-1, -1].size) + theta[len(problem.free) :].size
    unknown = np.full(count - len(problem.scale_x), np.nan)

    def residuals(at: Array) -> Array:
        if np.array_equal(at, theta):
            seen, ends = problem.parts_seen(at)
        else:
            try:
                with warnings.catch_warnings(action="ignore"):
                    seen, ends = problem.parts_seen(at)
            except AssumptionError:
                return unknown  # the solver tries a shorter step
        starts = at[len(problem.free) :].reshape(len(problem.at), -1)
        off = ((seen - measured)[:, :-1] / noise).ravel()
        last = ((seen - measured)[-1, -1] / noise).ravel()
        return np.concatenate([off, last, tie * (starts[1:] - ends[:-1]).ravel()])

    def slopes(at: Array) -> Array:
        by = _differences if problem.along is None else _integrated
        return by(problem, noise, at, tie)

    derivatives: Any = slopes  # a function may stand there, too
    found = least_squares(residuals, theta, derivatives, max_nfev=EVALUATIONS, xtol=SMALLEST_STEP)
    return found.x, np.asarray(found.jac)


def _integrated(problem: _Problem, noise: Array, theta: Array, tie: float) -> Array:
    """By the slopes of each segment's motion. A segment knows its own start alone."""
    count = len(problem.free)
    p, _ = problem.parts(theta)
    x, D = problem.motions_with_slopes(theta)
    t, u = problem.recorded.t[problem.at], problem.recorded.u[problem.at]
    seen = problem.slopes.of_seen(t, x, u, p, D, problem.scale_p)
    dy = np.moveaxis(seen / noise[:, None], -1, 1)
    dx = np.moveaxis(D[:, -1] / problem.scale_x[:, None], -1, 1)
    return _assembled(dy, dx, count, tie)


def _differences(problem: _Problem, noise: Array, theta: Array, tie: float) -> Array:
    """By one start and one parameter more at a time: all of them side by side. A segment knows its
    own start alone."""
    count, (segments, rows), nx = len(problem.free), problem.at.shape, len(problem.scale_x)
    p, starts = problem.parts(theta)
    many = 1 + count + nx  # as it is, each parameter, each entry of the start
    all_p = np.tile(p, (segments, many, 1))
    all_x = np.repeat(starts[:, None, :], many, axis=1)
    for k, number in enumerate(problem.free):
        all_p[:, 1 + k, number] += DIFFERENCE * problem.scale_p[k]
    for j in range(nx):
        all_x[:, 1 + count + j, j] += DIFFERENCE * problem.scale_x[j]
    at = np.repeat(problem.at, many, axis=0)
    given = all_p.reshape(segments * many, -1)
    x = problem.motions(given, all_x.reshape(segments * many, -1), at)
    seen = problem.seen(x, given, at).reshape(segments, many, rows, -1)
    ends = x[:, -1].reshape(segments, many, -1) / problem.scale_x
    dy = (seen[:, 1:] - seen[:, :1]) / DIFFERENCE / noise
    dx = (ends[:, 1:] - ends[:, :1]) / DIFFERENCE
    return _assembled(dy, dx, count, tie)


def _assembled(dy: Array, dx: Array, count: int, tie: float) -> Array:
    """Slopes of all residuals from those of each segment by the `count` parameters and by its own
    start: dy (segments, count + nx, rows, quantities) of what is seen, dx (segments, count + nx,
    nx) of its end."""
    (segments, _, rows, measured), nx = dy.shape, dx.shape[-1]
    columns = count + segments * nx
    own = np.zeros((segments, rows, measured, columns))
    gaps = np.zeros((segments, nx, columns))
    for s in range(segments):
        first = count + s * nx
        own[s, ..., :count] = np.moveaxis(dy[s, :count], 0, -1)
        own[s, ..., first : first + nx] = np.moveaxis(dy[s, count:], 0, -1)
        gaps[s, :, :count] = -dx[s, :count].T
        gaps[s, :, first : first + nx] = -dx[s, count:].T
        if s + 1 < segments:
            gaps[s, :, first + nx : first + 2 * nx] = np.eye(nx)
    off = own[:, :-1].reshape(-1, columns)
    last = own[-1, -1].reshape(-1, columns)
    return np.vstack([off, last, tie * gaps[:-1].reshape(-1, columns)])


def _told(
    problem: _Problem, theta: Array, jacobian: Array, noise: Array, doubtful: tuple[str, ...]
) -> Shot:
    """With the deviations that independent noise of every row leaves."""
    count, p = len(problem.free), problem.parts(theta)[0]
    sizes = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / np.where(sizes > 0.0, sizes, 1.0)
    _, singular, directions = np.linalg.svd(scaled, full_matrices=False)
    weak = np.flatnonzero(singular < TOLD * singular[0])
    for k in range(count):
        if sizes[k] == 0.0 or np.abs(directions[weak, k]).max(initial=0.0) > PART:
            name = problem.module.parameters[problem.free[k]]
            raise AssumptionError(f"the motion does not tell '{name}'", "another motion, or fewer")
    inverse = directions.T / np.where(singular > TOLD * singular[0], singular, np.inf)
    deviations = np.linalg.norm(inverse, axis=1)[:count] / sizes[:count] * problem.scale_p
    _, ends = problem.parts_seen(theta)
    starts = theta[count:].reshape(len(problem.at), -1)
    gap = float(np.abs(starts[1:] - ends[:-1]).max(initial=0.0))
    values = p[list(problem.free)]
    starts = starts * problem.scale_x
    return Shot(values, deviations, problem.names, noise, doubtful, gap, starts)
