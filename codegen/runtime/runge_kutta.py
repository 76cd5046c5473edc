"""Explicit Runge–Kutta methods as tables: their stages, their error estimates and the continuous
output of a step, as in runtime_steps.h and runtime_dense.h.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Row = Sequence[float]
Slope = Callable[[Any, np.ndarray], np.ndarray]  # of t and y
Norm = Callable[[Any, np.ndarray, np.ndarray], float]  # of values beside two states


@dataclass(frozen=True)
class Dense:
    """Further stages of the continuous output, and the weights of its powers of θ."""

    c: Row
    a: Sequence[Row]
    powers: Sequence[Row]


@dataclass(frozen=True)
class Tableau:
    """kᵢ = f(t + cᵢ h, y + h Σ aᵢⱼ kⱼ), whose last stage is the step itself; `errors` are weights
    of the error estimate, `grow`, `damp` and `safety` those of the step control."""

    grow: float
    damp: float
    safety: float
    c: Row
    a: Sequence[Row]
    errors: Sequence[Row]
    dense: Dense | None = None


def combination(weights: Row, slopes: Sequence[np.ndarray]) -> Any:
    """Σ wⱼ kⱼ, without the terms that vanish."""
    return sum(weight * slope for weight, slope in zip(weights, slopes) if weight)


@dataclass(frozen=True)
class Step:
    """A step of length h from y at t: `stages` are its slopes, the first the one at y."""

    t: Any
    h: Any
    y: np.ndarray
    stages: list[np.ndarray]

    def arrival(self, tableau: Tableau, slope: Slope) -> np.ndarray:
        """The state at the end; its slope is the last of the stages then."""
        z = self.y
        for ci, row in zip(tableau.c[1:], tableau.a[1:]):
            z = self.y + self.h * combination(row, self.stages)
            self.stages.append(slope(self.t + ci * self.h, z))
        return z

    def error(self, tableau: Tableau, z: np.ndarray, norm: Norm) -> float:
        """Of the arrival at z, in units of the tolerance; 0 where the method estimates none."""
        sizes = [norm(self.h * combination(row, self.stages), self.y, z) for row in tableau.errors]
        error = sizes[0] if sizes else 0.0
        if len(sizes) == 2 and error:
            return error * error / np.hypot(error, 0.1 * sizes[1])
        return error

    def continuous(
        self, dense: Dense | None, slope: Slope, z: np.ndarray, last: np.ndarray
    ) -> Callable[[float], np.ndarray]:
        """The state as a function of θ from 0 to 1; it ends at z, whose slope is `last`. Without
        `dense` it is the cubic through both ends with their slopes."""
        y, h, k, own = self.y, self.h, self.stages, self.stages[0]
        if dense is None:
            rows = [y, h * own, 3 * (z - y) - h * (2 * own + last), 2 * (y - z) + h * (own + last)]
        else:
            for ci, row in zip(dense.c, dense.a):
                k.append(slope(self.t + ci * h, y + h * combination(row, k)))
            rows = [y, *(h * combination(row, k) for row in dense.powers)]
        off = z - sum(rows)  # what the enforcement moved the end by

        def state(theta: float) -> np.ndarray:
            polynomial = sum(row * theta**n for n, row in enumerate(rows))
            return polynomial + theta * theta * (3 - 2 * theta) * off

        return state
