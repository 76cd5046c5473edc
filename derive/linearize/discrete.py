"""Discrete time: δx(t + h) = Φ δx + Γ δu by the sensitivities of implicit steps, along any motion,
u held over the step.

Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 1996, IV.5 and IV.8
(Radau IIA of order 5).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError
from derive.linearize.limits import (
    DECAYED,
    DISCRETE_AGREES,
    DISCRETE_FEWEST,
    DISCRETE_MOST,
    NEWTON,
    SETTLED,
)
from derive.linearize.records import Linear

Array = np.ndarray

_ROOT = np.sqrt(6.0)
NODES = np.array([(4 - _ROOT) / 10, (4 + _ROOT) / 10, 1.0])
WEIGHTS = np.array(
    [
        [(88 - 7 * _ROOT) / 360, (296 - 169 * _ROOT) / 1800, (-2 + 3 * _ROOT) / 225],
        [(296 + 169 * _ROOT) / 1800, (88 + 7 * _ROOT) / 360, (-2 - 3 * _ROOT) / 225],
        [(16 - _ROOT) / 36, (16 + _ROOT) / 36, 1 / 9],
    ]
)


@dataclass(frozen=True)
class _Flow:
    """x at the end of an interval, and its derivatives by x at the start and by u."""

    x: Array
    by_x: Array
    by_u: Array


class Discrete:
    """Φ (n × n) and Γ (n × nu) in the minimal states of a linear form; the graph is made once.

    The state moves by equal steps of the Radau IIA method with the nonlinear equations, and the
    steps are differentiated exactly: near a steady motion Φ is e^{A h}, along others it is what a
    controller that samples needs. There are twice as many steps until that changes nothing, so that
    stiff dampers and fast oscillations are no special case.
    """

    def __init__(self, form: Linear) -> None:
        self.form = form
        t, x, u, p = (argument.symbols for argument in form.equations.arguments)
        f = form.equations.function("dynamics").result.value
        slopes = [f, ca.jacobian(f, x), ca.jacobian(f, u)]
        self.slopes = ca.Function("slopes", [t, x, u, p], [ca.densify(part) for part in slopes])
        self.T = ca.Function("T", [t, x, u, p], [ca.densify(form.T)])

    def __call__(self, t: float, x: Array, u: Array, p: Array, h: float) -> tuple[Array, Array]:
        """(Φ, Γ) over the step of length h (s) from (t, x) with inputs u held: δx_i(t + h) = Φ δx_i
        + Γ δu, Φ = [∂x⁺/∂x]_i T. Raises AssumptionError where h is too long for them to be had."""
        rows, T = list(self.form.independent), self.T(t, x, u, p).full()
        before, steps = self._flow(t, x, u, p, h, DISCRETE_FEWEST), DISCRETE_FEWEST
        while steps < DISCRETE_MOST:
            steps *= 2
            found = self._flow(t, x, u, p, h, steps)
            Phi, Gamma = found.by_x[rows] @ T, found.by_u[rows]
            if _agree(Phi, before.by_x[rows] @ T, DECAYED) and _agree(Gamma, before.by_u[rows]):
                return Phi, Gamma
            before = found
        raise AssumptionError(
            f"the equations in discrete time do not settle in {steps} steps of {h / steps:.3g} s",
            "a shorter step: the motion is too fast for it, or runs into a singular position",
        )

    def _flow(self, t: float, x: Array, u: Array, p: Array, h: float, steps: int) -> _Flow:
        """Of so many steps, one behind the other."""
        flow = _Flow(np.asarray(x, dtype=float), np.eye(len(x)), np.zeros((len(x), len(u))))
        for k in range(steps):
            one = self._step(t + k * h / steps, flow.x, u, p, h / steps)
            flow = _Flow(one.x, one.by_x @ flow.by_x, one.by_x @ flow.by_u + one.by_u)
        return flow

    def _step(self, t: float, x: Array, u: Array, p: Array, h: float) -> _Flow:
        """The last stage of Z_i = x + h Σ a_ij f(Z_j), by Newton's method; its slopes solve the
        same matrix."""
        n, stages = len(x), np.tile(x, (3, 1))
        for _ in range(NEWTON):
            rates, by_x, _ = self._at_stages(t, stages, u, p, h)
            missing = x + h * WEIGHTS @ rates - stages
            change = _solved(_newton_matrix(by_x, h), missing.ravel()).reshape(3, n)
            stages = stages + change
            if not np.any(np.abs(change) > SETTLED * (1.0 + np.abs(stages))):
                break
        _, by_x, by_u = self._at_stages(t, stages, u, p, h)
        by_start = np.tile(np.eye(n), (3, 1))
        by_input = h * np.concatenate(list(np.tensordot(WEIGHTS, by_u, 1)))
        slopes = _solved(_newton_matrix(by_x, h), np.hstack([by_start, by_input]))[-n:]
        return _Flow(stages[-1], slopes[:, :n], slopes[:, n:])

    def _at_stages(
        self, t: float, stages: Array, u: Array, p: Array, h: float
    ) -> tuple[Array, Array, Array]:
        """ẋ, ∂ẋ/∂x and ∂ẋ/∂u at all stages."""
        found = [self.slopes(t + c * h, z, u, p) for c, z in zip(NODES, stages)]
        rates, by_x, by_u = (np.array([part.full() for part in parts]) for parts in zip(*found))
        return rates[:, :, 0], by_x, by_u


def _newton_matrix(by_x: Array, h: float) -> Array:
    """1 − h a_ij ∂f/∂x(Z_j), block by block."""
    blocks = [[a * F for a, F in zip(row, by_x)] for row in WEIGHTS]
    return np.eye(3 * len(by_x[0])) - h * np.block(blocks)


def _solved(matrix: Array, sides: Array) -> Array:
    """Not numbers where the matrix is singular, or none: fewer and longer steps are at fault."""
    try:
        return np.linalg.solve(matrix, sides)
    except np.linalg.LinAlgError:
        return np.full(sides.shape, np.nan)


def _agree(now: Array, before: Array, least: float = 0.0) -> bool:
    """Relative to the largest entry of the row or of the column, as entries have units of both;
    what has decayed below `least` counts as that large."""
    sizes = np.abs(now)
    rows, columns = sizes.max(axis=1, initial=0.0), sizes.max(axis=0, initial=0.0)
    scale = np.maximum(np.minimum.outer(rows, columns), least)
    return bool(np.all(np.abs(now - before) <= DISCRETE_AGREES * scale))
