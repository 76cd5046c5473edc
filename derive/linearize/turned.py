"""Why a motion is not steady that looks so: quasi-velocities along axes that turn with a coordinate
change as it does, though nothing else depends on it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.formulations.records import Equations
from derive.linearize.cyclic import sampled_rows
from derive.linearize.limits import CANCELLED, NOTHING, RANK
from derive.linearize.minimal import evaluator, position_rows
from derive.states.scales import scales


@dataclass(frozen=True)
class Turned:
    """A coordinate that goes on changing, the quasi-velocities along axes that turn with it, and
    rates of coordinates that can be constant in their place."""

    coordinate: str
    speeds: tuple[str, ...]
    instead: tuple[str, ...]


def turned(equations: Equations, cyclic: Collection[int], y: np.ndarray) -> Turned | None:
    """Of the first coordinate, but the cyclic ones, that changes at y = (x, u, p) and is cyclic
    where velocities are the rates of the coordinates; None where there is none.

    At constant q̇ a change of coordinate j takes the quasi-velocities along, ∂w/∂q_j = −G⁺ ∂q̇/∂q_j
    with q̇ = G w. The coordinate is cyclic if φ, q̈ and ż stay what they are.
    """
    system, labels = equations.system, equations.arguments[1].labels
    if system.quaternions or not equations.w:
        return None
    nq = system.q.numel()
    slopes, G = _slopes(equations), _along(equations)
    changes: np.ndarray = -np.linalg.pinv(G) @ slopes[:, :nq, :nq]
    for j in np.flatnonzero(_moving(equations, y) & _stay(equations, slopes, changes)):
        largest = np.max(np.abs(changes[:, :, j]), axis=0)
        speeds = [equations.w[k] for k in np.flatnonzero(largest > NOTHING)]
        instead = _independent(equations, y)
        if j not in cyclic and speeds and instead:
            return Turned(labels[j], tuple(speeds), instead)
    return None


def _rates(equations: Equations) -> tuple[ca.SX, ca.SX, ca.SX]:
    """x, q̇ and the rates of x."""
    f = equations.function("dynamics").result.value
    return equations.arguments[1].symbols, f[: equations.system.q.numel(), 0], f


def _slopes(equations: Equations) -> np.ndarray:
    """Of (q̇, φ, q̈, ż) in x, at random admissible states: (N, rows, nx)."""
    x, rates, f = _rates(equations)
    accelerations = ca.jtimes(rates, x, f)
    zdot = f[equations.speeds.stop :, 0]
    value = ca.vertcat(rates, position_rows(equations.system), accelerations, zdot)
    return evaluator(equations, ca.jacobian(value, x))(*sampled_rows(equations))


def _along(equations: Equations) -> np.ndarray:
    """G of q̇ = G w at the same states: (N, nq, nw)."""
    x, rates, _ = _rates(equations)
    return evaluator(equations, ca.jacobian(rates, x[equations.speeds]))(*sampled_rows(equations))


def _stay(equations: Equations, slopes: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Of which coordinates nothing depends at constant q̇, but for rounding: flags."""
    nq, one = equations.system.q.numel(), scales(equations.system.model)
    sizes = one.all_of(equations.arguments[1].units)
    along = slopes[:, :, equations.speeds]
    left = slopes[:, :, :nq] + along @ changes
    terms = np.abs(slopes[:, :, :nq]) + np.abs(along) @ np.abs(changes)
    # of a row that is zero in some states, as without contact, rounding is judged by the others
    largest = np.max(np.abs(slopes) * sizes, axis=(0, 2), initial=0.0)
    least = NOTHING * largest + CANCELLED * np.max(largest, initial=0.0)
    return np.all(np.abs(left) <= NOTHING * terms + least[:, np.newaxis] / sizes[:nq], axis=(0, 1))


def _moving(equations: Equations, y: np.ndarray) -> np.ndarray:
    """Which coordinates change at y."""
    _, rates, _ = _rates(equations)
    own, (x, u, p) = scales(equations.system.model), _parts(equations, y)
    sizes = own.all_of(equations.arguments[1].units)[: rates.numel()] / own.time
    values = evaluator(equations, rates)(x, u, p)[0, :, 0]
    return np.abs(values) > NOTHING * sizes


def _parts(equations: Equations, y: np.ndarray) -> list[np.ndarray]:
    """x, u and p as rows."""
    sizes = [argument.symbols.numel() for argument in equations.arguments[1:3]]
    return [part[np.newaxis] for part in np.split(y, np.cumsum(sizes))]


def _independent(equations: Equations, y: np.ndarray) -> tuple[str, ...]:
    """Rates of coordinates, as many as quasi-velocities are, that determine these at y, the largest
    rows of G first; none where they do not."""
    x, rates, _ = _rates(equations)
    function = evaluator(equations, ca.jacobian(rates, x[equations.speeds]))
    left, chosen = function(*_parts(equations, y))[0], list[int]()
    least = RANK * np.max(np.abs(left), initial=0.0)
    for _ in equations.w:
        lengths = np.linalg.norm(left, axis=1)
        k = int(np.argmax(lengths))
        if not lengths[k] > least:
            return ()
        chosen.append(k)
        along = left[k] / lengths[k]
        left = left - np.outer(left @ along, along)
    return tuple(f"der({equations.arguments[1].labels[k]})" for k in sorted(chosen))
