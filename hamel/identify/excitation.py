"""Motions that tell parameters apart: finite Fourier series of every joint, within its limits,
with a regressor that is well conditioned (Swevers et al. 1997).

    q = middle + Σ (aₖ sin kωt − bₖ cos kωt) / kω
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from derive.diagnostics import AssumptionError, ModelError
from derive.expressions.evaluate import number
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.model.records import Model
from hamel.identify.base import Base
from hamel.identify.limits import PEAKS, POINTS, ROOM, STEPS, TRIES
from hamel.identify.measured import at_rows, parameters_of

Array = np.ndarray
WIDE = {"rad": 1.5, "m": 0.25}  # to either side of the file's start, where a joint has no limits


@dataclass(frozen=True)
class Series:
    """Coefficients a, b (joints × harmonics) and the middle of each joint; `omega` in rad/s."""

    omega: float
    middle: Array
    a: Array
    b: Array

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """q, q̇ and q̈ at the times (rows)."""
        k = self.omega * np.arange(1, self.a.shape[1] + 1)
        sine, cosine = np.sin(np.outer(t, k)), np.cos(np.outer(t, k))
        q = self.middle + sine @ (self.a / k).T - cosine @ (self.b / k).T
        rate = cosine @ self.a.T + sine @ self.b.T
        return q, rate, cosine @ (self.b * k).T - sine @ (self.a * k).T


@dataclass(frozen=True)
class Bounds:
    """Of each coordinate, and of all speeds (infinite where none is given)."""

    low: Array
    high: Array
    speed: float


def undriven(equations: Equations) -> tuple[str, ...]:
    """Coordinates that no input moves, where inputs move others: a motion of these takes the forces
    of somebody else."""
    system = equations.system
    through = ca.vertcat(system.u, system.z)  # what inputs change moves, too
    moves = ca.sparsify(ca.jacobian(system.Q, through))
    still = [not moves[i, :].nnz() for i in range(system.v.numel())]
    if all(still) or not system.u.numel():
        return ()
    return tuple(v.rate_of for v, alone in zip(system.model.velocities, still) if alone)


def excitation(
    equations: Equations, base: Base, start: Array, period: float, harmonics: int, speed: float
) -> tuple[Series, float]:
    """A series and the condition of its regressor, columns scaled to one. Raises AssumptionError
    for loops and for joints whose velocities are no rates."""
    system = equations.system
    model = system.model
    if system.rows or any(not v.rate_of for v in model.velocities):
        raise AssumptionError(
            f"{model.name}: series are for trees whose velocities are rates of coordinates",
            "a motion of the independent coordinates by hand",
        )
    if not model.velocities:
        raise ModelError(f"{model.name} does not move")
    bounds = limits(model, start, speed)
    t = np.linspace(0.0, period, POINTS * harmonics, endpoint=False)
    function = function_of(equations, equations.request("regressor").function)
    shape = (2, len(model.velocities), harmonics)

    def judged(x: Array) -> float:
        series = within(np.reshape(x, shape), 2.0 * np.pi / period, bounds)
        q, v, vdot = series.motion(t)
        none = np.zeros((len(t), system.u.numel()))
        Y = at_rows(function, t, np.hstack([q, v, vdot]), none, parameters_of(equations))
        A = (Y @ base.basis).reshape(-1, len(base.leading))
        size = np.linalg.norm(A, axis=0)
        return float(np.log10(np.linalg.cond(A / np.where(size > 0.0, size, 1.0))))

    rng = np.random.default_rng(0)
    drawn = [rng.normal(size=np.prod(shape)) for _ in range(TRIES)]
    best = min(drawn, key=judged)
    optimum = minimize(judged, best, method="L-BFGS-B", options={"maxiter": STEPS})
    chosen = optimum.x if optimum.fun < judged(best) else best
    series = within(np.reshape(chosen, shape), 2.0 * np.pi / period, bounds)
    return series, 10.0 ** judged(chosen)


def limits(model: Model, start: Array, speed: float) -> Bounds:
    """Those of the joints; where one has none, so far to either side of the start."""
    names = {x.name: x.value for x in model.parameters} | {"t": 0.0}
    low = np.array([q - WIDE.get(c.unit, 1.0) for q, c in zip(start, model.coordinates)])
    high = np.array([q + WIDE.get(c.unit, 1.0) for q, c in zip(start, model.coordinates)])
    for joint in model.joints:
        if joint.limits is not None:
            k = model.coordinate_index(joint.coordinates[0])
            low[k], high[k] = (number(x, names) for x in joint.limits)
    return Bounds(low, high, speed)


def within(coefficients: Array, omega: float, bounds: Bounds) -> Series:
    """The series, moved and made smaller until it keeps the limits.

    Between N points even a series of n harmonics is no more than 1 / cos(nπ/N) times the largest
    value at them (Ehlich & Zeller 1964): a bound that holds at all times.
    """
    a, b = coefficients
    none = np.zeros(len(a))
    t = np.linspace(0.0, 2.0 * np.pi / omega, PEAKS * a.shape[1], endpoint=False)
    q, rate, _ = Series(omega, none, a, b).motion(t)
    width = np.maximum(np.ptp(q, axis=0), 1e-300)
    fastest = np.maximum(np.abs(rate).max(axis=0), 1e-300) / np.cos(np.pi / PEAKS)
    scale = np.minimum(ROOM * (bounds.high - bounds.low) / width, bounds.speed / fastest)
    middle = 0.5 * (bounds.high + bounds.low) - scale * 0.5 * (q.max(axis=0) + q.min(axis=0))
    return Series(omega, middle, a * scale[:, None], b * scale[:, None])


def columns(names: Sequence[str], series: Series, t: Array) -> dict[str, Array]:
    """t, coordinates, velocities and accelerations by the names that `identify` reads."""
    q, v, vdot = series.motion(t)
    result = {"t": t}
    for prefix, suffix, values in (("", "", q), ("der(", ")", v), ("der(der(", "))", vdot)):
        result |= {f"{prefix}{name}{suffix}": values[:, k] for k, name in enumerate(names)}
    return result
