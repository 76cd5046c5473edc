"""Comparison of arrays over many states, component by component, each against its own typical
size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hamel.verify.limits import FLOOR, ROUNDING, SMALL
from hamel.verify.reference.vectors import Array


def sizes(values: Array, floor: float = FLOOR, small: float = SMALL) -> Array:
    """For states × k values: what size an error in each is to be compared with, max(|value|, its
    median, the floors)."""
    typical = np.median(np.abs(values), axis=0)
    least = max(small, floor * float(np.max(typical, initial=0.0)))
    return np.maximum(np.abs(values), np.maximum(typical, least))


def worst(errors: Array | Sequence[Any]) -> float:
    """The largest entry; infinite where one is not a number, zero where there is none."""
    errors = np.abs(np.asarray(errors, dtype=float))
    if not errors.size:
        return 0.0
    return float("inf") if np.isnan(errors).any() else float(errors.max())


@dataclass(frozen=True)
class Sums:
    """Per state, or per state and component, the size of what the result is a sum of, in its units,
    and the tolerance that the result is held to: where the sum cancels, what rounding leaves of it
    is no error."""

    tolerance: float
    sizes: Sequence[float] | Array

    @property
    def floors(self) -> Array:
        """What an error is at least compared with, so that ROUNDING of the sizes is tolerated."""
        return ROUNDING / self.tolerance * np.asarray(self.sizes, dtype=float)


def deviation(
    got: Sequence[Array],
    wanted: Sequence[Array],
    relax: Sequence[float] | Array | None = None,
    small: float = SMALL,
    unit: Array | float = 1.0,
    sums: Sums | None = None,
) -> float:
    """Worst relative error over the states, each state's error divided by `relax` (a condition
    number).

    `unit`: one of each component, so that different quantities can be compared with each other's
    sizes.
    """
    left, right = (np.array([np.ravel(x) for x in side], dtype=float) for side in (got, wanted))
    if left.shape != right.shape:
        return float("inf")
    left, right = left / np.ravel(unit), right / np.ravel(unit)
    weights = np.ones(len(left)) if relax is None else np.asarray(relax, dtype=float)
    size = sizes(right, small=small)
    if sums is not None:
        floors = sums.floors
        size = np.maximum(size, floors if floors.ndim > 1 else floors[:, None])
    with np.errstate(invalid="ignore"):
        return worst((left - right) / size / weights[:, None])


def slope(function: Callable[[float], Array | float], step: float) -> tuple[Array, Array]:
    """Derivative at 0 by five points, (8 (f₁ − f₋₁) − (f₂ − f₋₂)) / 12 h with h = step/2, and how
    much it differs from h = step.

    The difference is sixteen times the truncation error of the derivative, or its roundoff,
    whichever is larger.
    """
    f = {k: np.asarray(function(k * step / 2.0), dtype=float) for k in (-4, -2, -1, 1, 2, 4)}
    wide, narrow = (_five_points(f[-2 * k], f[-k], f[k], f[2 * k], k * step / 2.0) for k in (2, 1))
    return narrow, np.abs(narrow - wide)


def _five_points(a: Array, b: Array, c: Array, d: Array, h: float) -> Array:
    return (8.0 * (c - b) - (d - a)) / (12.0 * h)
