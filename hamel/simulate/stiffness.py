"""Are explicit steps held down by stiffness? Looked at where a motion takes many of them."""

from __future__ import annotations

import warnings
from types import ModuleType

import numpy as np

from hamel.simulate.limits import HELD
from hamel.simulate.motion import Start, Unfinished

IMPLICIT = "radau"  # what takes over


class Stiff(Exception):
    """An explicit integrator is the wrong one; the message says why."""


def reason(module: ModuleType, start: Start, far: Unfinished) -> str:
    """Why the motion is stiff where it came to; nothing where it is not.

    Stiff: the eigenvalue of ∂ẋ/∂x of largest size has a negative real part, so what belongs to it
    has died out, and the mean step is as long as the stability of explicit methods allows.
    """
    rate = _fastest(module, start, far)
    mean = far.covered / max(1, far.partial.steps)
    if not (rate.real < 0 and mean * abs(rate) >= HELD):
        return ""
    held = f"steps of {mean:.2g} s were held down by stiffness"
    return f"{held}, the fastest rate is {abs(rate):.2g} 1/s"


def _fastest(module: ModuleType, start: Start, far: Unfinished) -> complex:
    """The eigenvalue of largest size at the last row that was reached; 0 where there is none."""
    reached = np.flatnonzero(np.isfinite(far.partial.x).all(axis=1))
    row = int(reached[-1]) if reached.size else 0
    x = far.partial.x[row] if reached.size else start.x
    u = start.u if far.partial.u is None else far.partial.u[row]
    J = _jacobian(module, float(far.partial.t[row]), x, u, _parameters(start, far, row))
    return complex(_largest(np.linalg.eigvals(J))) if np.isfinite(J).all() else 0j


def _parameters(start: Start, far: Unfinished, row: int) -> np.ndarray:
    """Those of the row, with the frame in force there, where the module has one."""
    return start.p if far.partial.p is None else far.partial.p[row]


def _largest(values: np.ndarray) -> complex:
    return values[np.argmax(np.abs(values))]


def _jacobian(
    module: ModuleType, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """By central differences, in the precision of the module."""
    rounding = float(np.finfo(module.defaults.dtype).eps)
    moves = np.diag(rounding ** (1 / 3) * np.maximum(1.0, np.abs(x)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # states without a value
        ahead, back = module.dynamics(t, x + moves, u, p), module.dynamics(t, x - moves, u, p)
    return ((ahead - back) / (2 * np.diag(moves))[:, np.newaxis]).T.astype(float)
