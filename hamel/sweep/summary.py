"""What is known of many numbers without the numbers: mean, variance, quantiles, and the ends.

A summary has a size that does not grow with the count. Summaries of parts merge into that of the
whole; always in the same order, so that the bits of it do not depend on who was ready first.

Means and variances by B. P. Welford (1962) and T. F. Chan, G. H. Golub, R. J. LeVeque (1979).
Quantiles by logarithmic bins of 0.5 % as in DDSketch, C. Masson, J. E. Rim, H. K. Lee (2019): whole
numbers are added, so this part is exact in any order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from hamel.sweep.limits import ACCURACY, ENDS, LEAST

GAMMA = (1 + ACCURACY) / (1 - ACCURACY)
QUANTILES = (0.001, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999)


@dataclass(frozen=True)
class Summary:
    """Of the finite numbers of one column. `bins` counts by the number of the bin, which grows with
    the value; `lowest` and `highest` are (value, number of the motion)."""

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0  # Σ (x − mean)²
    lowest: tuple[tuple[float, int], ...] = ()
    highest: tuple[tuple[float, int], ...] = ()
    bins: Mapping[int, int] = field(default_factory=dict)

    @property
    def variance(self) -> float:
        """Of the population that this is a sample of."""
        return self.squares / (self.count - 1) if self.count > 1 else math.nan

    @property
    def deviation(self) -> float:
        """The square root of the variance."""
        return math.sqrt(self.variance) if self.count > 1 else math.nan

    def quantile(self, part: float) -> float:
        """What that part of the numbers does not exceed, to half a per cent of its magnitude."""
        return self.quantiles([part])[0]

    def quantiles(self, parts: Sequence[float]) -> list[float]:
        """Several of them."""
        if not self.count:
            return [math.nan] * len(parts)
        numbers = sorted(self.bins)
        reached = np.cumsum([self.bins[k] for k in numbers])
        places = np.searchsorted(reached, [part * self.count for part in parts])
        low, high = self.lowest[0][0], self.highest[0][0]
        middles = [middle(numbers[min(int(k), len(numbers) - 1)]) for k in places]
        return [min(max(x, low), high) for x in middles]

    def about(self) -> dict[str, Any]:
        """As JSON has it."""
        return {**asdict(self), "bins": sorted([k, n] for k, n in self.bins.items())}


def summary(values: np.ndarray, first: int) -> Summary:
    """Of a column whose first number is that of motion `first`."""
    at = np.flatnonzero(np.isfinite(values))
    x = values[at].astype(float)
    if not len(x):
        return Summary()
    mean = float(np.mean(x))
    order = np.argsort(x, kind="stable")
    pairs = [(float(x[k]), int(at[k]) + first) for k in (*order[:ENDS], *order[-ENDS:])]
    numbers, counts = np.unique(bin_numbers(x), return_counts=True)
    return Summary(
        len(x),
        mean,
        float(np.sum((x - mean) ** 2)),
        _ends(pairs, 1),
        _ends(pairs, -1),
        dict(zip(numbers.tolist(), counts.tolist())),
    )


def merged(a: Summary, b: Summary) -> Summary:
    """Of both."""
    count = a.count + b.count
    if not a.count or not b.count:
        return b if not a.count else a
    apart = b.mean - a.mean
    bins = dict(a.bins)
    for number, some in b.bins.items():
        bins[number] = bins.get(number, 0) + some
    return Summary(
        count,
        a.mean + apart * (b.count / count),
        a.squares + b.squares + apart * apart * (a.count * b.count / count),
        _ends((*a.lowest, *b.lowest), 1),
        _ends((*a.highest, *b.highest), -1),
        bins,
    )


def _ends(pairs: Sequence[tuple[float, int]], sign: int) -> tuple[tuple[float, int], ...]:
    return tuple(sorted({*pairs}, key=lambda pair: (sign * pair[0], pair[1]))[:ENDS])


def of_json(held: Mapping[str, Any]) -> Summary:
    """The summary that `about` wrote."""
    pairs = {
        name: tuple((float(x), int(k)) for x, k in held[name]) for name in ("lowest", "highest")
    }
    bins = {int(k): int(n) for k, n in held["bins"]}
    return Summary(
        int(held["count"]), float(held["mean"]), float(held["squares"]), **pairs, bins=bins
    )


def bin_numbers(x: np.ndarray) -> np.ndarray:
    """The bin of each value: 0 about zero, and one more for each factor of about 1.01."""
    size = np.maximum(np.abs(x), LEAST)
    steps = np.ceil(np.log(size / LEAST) / math.log(GAMMA)).astype(np.int64)
    return np.where(np.abs(x) <= LEAST, 0, np.sign(x).astype(np.int64) * steps)


def middle(number: int) -> float:
    """The value that a bin stands for: none in it is farther away than half a per cent."""
    if not number:
        return 0.0
    size = LEAST * GAMMA ** abs(number) * 2.0 / (1.0 + GAMMA)
    return math.copysign(size, number)
