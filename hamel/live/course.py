"""Roughly where a motion goes: the size of its picture, and how far floors and rails reach, are
read from it before anything is compiled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from hamel.draw.mechanism.records import Vector
from hamel.live.limits import LOOKED, SPAN, STEPS


def course(equations: Equations, x: Vector, p: Vector) -> tuple[Vector, Vector]:
    """Times (s) and a row of coordinates for each, from x without inputs, by equal Runge–Kutta
    steps of fourth order; it ends where there are no more numbers."""
    dynamics = function_of(equations, "dynamics")
    u = np.zeros(equations.system.u.numel())
    h = SPAN / STEPS

    def rate(t: float, x: Vector) -> Vector:
        return np.asarray(dynamics(t, x, u, p)).ravel()

    rows, nq = [np.asarray(x, dtype=float)], equations.system.q.numel()
    for k in range(STEPS):
        state = _step(rate, k * h, rows[-1], h)
        if not np.all(np.abs(state) < 1 / np.finfo(float).eps):
            break
        rows.append(state)
    some = rows[:: STEPS // LOOKED]
    some = some if len(some) > 1 else [rows[0], rows[0]]
    t = np.linspace(0.0, h * (STEPS // LOOKED) * (len(some) - 1), len(some))
    return t, np.array(some)[:, :nq]


def _step(rate: Callable[[float, Vector], Vector], t: float, x: Vector, h: float) -> Vector:
    a = rate(t, x)
    b = rate(t + h / 2, x + h / 2 * a)
    c = rate(t + h / 2, x + h / 2 * b)
    d = rate(t + h, x + h * c)
    return x + h / 6 * (a + 2 * b + 2 * c + d)
