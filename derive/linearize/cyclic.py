"""Cyclic coordinates: nothing but the rates of other cyclic coordinates depends on them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.formulations.records import Equations
from derive.linearize.limits import CYCLIC_SAMPLES, LEAST_SCALE, NOTHING
from derive.linearize.minimal import evaluator, position_rows
from derive.linearize.turning import rates_of_angles
from derive.states.sampling import states
from derive.states.scales import scales

Rows = tuple[np.ndarray, np.ndarray, np.ndarray]  # x, u and p of states


def cyclic_coordinates(equations: Equations, at: Rows | None = None) -> tuple[int, ...]:
    """Indices in q, the largest such set, from the derivatives of φ, q̇ and ẇ at random admissible
    states, and `at` further ones: where forces are in pieces others may not touch.

    Derivatives rather than formulas: in good quasi-velocities a wheel's angle cancels, though it
    may be written in f.
    """
    slopes = _slopes(equations, at)
    nq, fixed = (
        equations.system.q.numel(),
        equations.system.phi.numel() + len(equations.system.quaternions),
    )
    cyclic = set(range(nq))
    while True:
        rows = [
            i
            for i in range(slopes.shape[0])
            if not (fixed <= i < fixed + nq and i - fixed in cyclic)
        ]
        lost = {j for j in cyclic if np.any(slopes[rows, j])}
        if not lost:
            return tuple(sorted(cyclic))
        cyclic -= lost


def _slopes(equations: Equations, at: Rows | None) -> np.ndarray:
    """Which of (φ, q̇, ẇ) depend on which coordinate: flags."""
    system = equations.system
    _, x, *_ = (argument.symbols for argument in equations.arguments)
    f = equations.function("dynamics").result.value
    value = ca.vertcat(position_rows(system), f)
    rows = [sampled_rows(equations), *([at] if at else [])]
    places = [np.concatenate(parts) for parts in zip(*rows)]
    slopes = evaluator(equations, ca.jacobian(value, x))(*places)
    sizes = _in_own_units(equations, np.abs(slopes))
    scale = np.max(sizes, axis=2, keepdims=True, initial=0.0)
    return np.any(sizes[:, :, : system.q.numel()] > NOTHING * (LEAST_SCALE + scale), axis=0)


def sampled_rows(equations: Equations) -> Rows:
    """x, u and p of random admissible states, in rows."""
    system = equations.system
    B = ca.Function("B", [system.t, system.q, system.p], [ca.densify(_speed_rows(equations))])
    sampled = states(system, CYCLIC_SAMPLES, seed=1)
    w = [np.asarray(B(0.0, q, p)) @ v for q, v, p in zip(sampled.q, sampled.v, sampled.p)]
    own, z = np.split(sampled.p, [len(system.own_parameters)], axis=1)
    x = np.hstack([sampled.q, np.array(w).reshape(len(sampled.q), -1), z])
    return x, sampled.u, own


def _in_own_units(equations: Equations, slopes: np.ndarray) -> np.ndarray:
    """Slopes (N × rows × nx) of (φ, q̇, ẇ) in the model's own units. Rows of φ do not say theirs:
    where it is not SI, one of them is the largest slope."""
    own = scales(equations.system.model)
    if own.plain:
        return slopes
    one = own.all_of(equations.arguments[1].units)
    sizes = slopes * one
    first = slopes.shape[1] - len(one)
    positions = np.max(sizes[:, :first], axis=(0, 2), initial=0.0)
    rows = np.concatenate([np.where(positions > 0, positions, 1.0), one / own.time])
    return sizes / rows[:, np.newaxis]


def _speed_rows(equations: Equations) -> ca.SX:
    return equations.term("B")


def confirmed(
    equations: Equations, names: tuple[str, ...], result: tuple[int, ...]
) -> tuple[int, ...]:
    """Indices in q of coordinates that are said to be cyclic, where `result` are. Raises
    AssumptionError where a name is unknown or the equations depend on the coordinate."""
    known = [c.name for c in equations.system.model.coordinates]
    for name in names:
        if name not in known:
            raise AssumptionError(
                f"unknown coordinate '{name}'",
                did_you_mean(name, known) or f"known: {listed(known)}",
            )
        if known.index(name) not in result:
            cyclic = listed(known[i] for i in result) or "none"
            advice = rates_of_angles(equations, name)
            raise AssumptionError(
                f"'{name}' is not cyclic: the equations depend on it",
                f"cyclic coordinates: {cyclic}{advice and '; ' + advice}",
            )
    return tuple(known.index(name) for name in names)
