"""Tables: points joined by a cubic spline, y(x), as data and as a formula of x.

C1: the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984), which keep what rises
rising; at the ends those of the first and last chord. C2: the natural spline. Outside the points
the straight line of the end goes on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
SMOOTH = ("C1", "C2")


@dataclass(frozen=True)
class Table:
    """Strictly increasing `x` and as many `y`, in SI units `units` of the two; `smooth` C1 or
    C2."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    units: tuple[str, str]
    smooth: str


def slopes(table: Table) -> Vector:
    """dy/dx at the points."""
    x, y = np.array(table.x), np.array(table.y)
    if len(x) == 2:
        return np.full(2, (y[1] - y[0]) / (x[1] - x[0]))
    return _natural(x, y) if table.smooth == "C2" else _monotone(x, y)


def _natural(x: Vector, y: Vector) -> Vector:
    """From the equality of second derivatives inside, zero at both ends."""
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    n = len(x)
    matrix, right = np.zeros((n, n)), np.zeros(n)
    matrix[0, :2], right[0] = (2.0, 1.0), 3.0 * d[0]
    matrix[-1, -2:], right[-1] = (1.0, 2.0), 3.0 * d[-1]
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1]
        right[i] = 3.0 * (h[i] * d[i - 1] + h[i - 1] * d[i])
    return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)


def _monotone(x: Vector, y: Vector) -> Vector:
    """Weighted harmonic means of the slopes beside, zero where these have opposite signs."""
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    result = np.empty(len(x))
    result[0], result[-1] = d[0], d[-1]
    for i in range(1, len(x) - 1):
        first, second = 2.0 * h[i] + h[i - 1], h[i] + 2.0 * h[i - 1]
        alike = d[i - 1] * d[i] > 0.0
        mean = (first + second) / (first / d[i - 1] + second / d[i]) if alike else 0.0
        result[i] = mean
    return result


def spline(
    table: Table, least: Callable[[Any, Any], Any], most: Callable[[Any, Any], Any]
) -> Callable[[Any], Any]:
    """y(x) = y₀ + Σ pᵢ(sᵢ), where sᵢ is how far x has come in the i-th interval, 0 to its length,
    and pᵢ the cubic of the interval less its beginning: straight-line code without a search."""
    x, y, m = table.x, table.y, [float(slope) for slope in slopes(table)]

    def at(value: Any) -> Any:
        """The value of the table."""
        result = y[0] + m[0] * least(value - x[0], 0.0) + m[-1] * most(value - x[-1], 0.0)
        for i in range(len(x) - 1):
            h = x[i + 1] - x[i]
            d = (y[i + 1] - y[i]) / h
            second = (3.0 * d - 2.0 * m[i] - m[i + 1]) / h
            third = (m[i] + m[i + 1] - 2.0 * d) / h**2
            s = most(least(value, x[i + 1]) - x[i], 0.0)
            result = result + s * (m[i] + s * (second + s * third))
        return result

    return at
