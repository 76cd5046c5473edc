"""The values that random numbers of a distribution do not exceed with given probabilities."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hamel.optional import library


def _normal(u: np.ndarray, mean: float, deviation: float, *ends: float) -> np.ndarray:
    special = library("scipy.special", "a normal distribution")
    if not ends:
        return mean + deviation * special.ndtri(np.clip(u, 2.0**-60, 1.0 - 2.0**-53))
    # probabilities near one have no digits left: those of the mirrored ends are small
    low, high = ((end - mean) / deviation for end in ends)
    mirrored = low + high > 0
    z = -_cut(special, 1.0 - u, -high, -low) if mirrored else _cut(special, u, low, high)
    first, last = ends
    return np.clip(mean + deviation * z, first, last)


def _cut(special: Any, u: np.ndarray, low: float, high: float) -> np.ndarray:
    """Quantiles of the standard normal distribution between two ends, through logarithms: the
    probability of what is beyond 38 deviations is no number."""
    with np.errstate(divide="ignore"):  # of u = 0 and 1, which are the ends
        below, above = np.log1p(-u), np.log(u)
    p = np.logaddexp(below + special.log_ndtr(low), above + special.log_ndtr(high))
    return np.clip(special.ndtri_exp(p), low, high)


def _uniform(u: np.ndarray, low: float, high: float) -> np.ndarray:
    return low + (high - low) * u


def _loguniform(u: np.ndarray, low: float, high: float) -> np.ndarray:
    return np.exp(np.log(low) + (np.log(high) - np.log(low)) * u)


def _triangular(u: np.ndarray, low: float, mode: float, high: float) -> np.ndarray:
    split = (mode - low) / (high - low)
    left = low + np.sqrt(u * (high - low) * (mode - low))
    return np.where(u < split, left, high - np.sqrt((1 - u) * (high - low) * (high - mode)))


QUANTILES: dict[str, Callable[..., np.ndarray]] = {
    "normal": _normal,
    "uniform": _uniform,
    "loguniform": _loguniform,
    "triangular": _triangular,
}
