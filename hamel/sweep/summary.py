"""What is known of many numbers without the numbers: mean, variance, quantiles, and the ends.

A summary has a size that does not grow with the count. Summaries of parts merge into that of the
whole; always in the same order, so that the bits of it do not depend on who was ready first.

Means and variances by B. P. Welford (1962) and T. F. Chan, G. H. Golub, R. J. LeVeque (1979).

Quantiles by bins: the binary digits of a number without the last `level` of them, so that there are
equally many bins in every power of two, as in DDSketch by C. Masson, J. E. Rim, H. K. Lee (2019).
The level is the least that leaves at most BINS of them with a number inside, but not so high that a
middle would be farther off than half a per cent. So numbers that lie closely are told apart, too. A
part never has a higher level than the whole, and dropping digits takes bins to bins: what is known
of quantiles does not depend on the order.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hamel.sweep.limits import BINS, COARSEST, ENDS, FINEST, FLUSH, LEAST, SAME

QUANTILES = (0.001, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999)


@dataclass(frozen=True, eq=False)
class Bins:
    """How many numbers are in each bin: `places` grow with the number, (k,) integers."""

    level: int
    places: np.ndarray
    counts: np.ndarray

    def middles(self) -> np.ndarray:
        """The number in the middle of each bin, which stands for those in it."""
        sizes = (np.abs(self.places) << self.level) + ((1 << self.level) >> 1)
        return np.where(self.places == 0, 0.0, np.sign(self.places) * sizes.view(np.float64))


def binned(x: np.ndarray) -> Bins:
    """Of finite numbers; what is below LEAST counts as zero."""
    sizes = np.where(np.abs(x) < LEAST, 0.0, np.abs(x)).view(np.int64) >> FINEST
    return _fitted(FINEST, np.where(x < 0, -sizes, sizes), np.ones(len(x), np.int64))


def together(parts: Sequence[Bins]) -> Bins:
    """Of all parts, in any order."""
    level = max(part.level for part in parts)
    places = [_dropped(part.places, level - part.level) for part in parts]
    counts = np.concatenate([part.counts for part in parts])
    return _fitted(level, np.concatenate(places), counts)


def _dropped(places: np.ndarray, digits: int) -> np.ndarray:
    """Without so many binary digits, of negative numbers, too."""
    return np.sign(places) * (np.abs(places) >> digits)


def _fitted(level: int, places: np.ndarray, counts: np.ndarray) -> Bins:
    """Each place once, at the least level that leaves few enough."""
    order = np.argsort(places, kind="stable")
    places, counts = places[order], counts[order]
    digits = bisect_left(
        range(COARSEST - level), True, key=lambda k: len(_first(_dropped(places, k))) <= BINS
    )
    places = _dropped(places, digits)
    first = _first(places)
    summed = np.add.reduceat(counts, first) if len(first) else counts
    return Bins(level + digits, places[first], summed)


def _first(places: np.ndarray) -> np.ndarray:
    """Where each place is for the first time, of places in their order."""
    return np.flatnonzero(np.diff(places, prepend=places[:1] - 1))


NONE = Bins(FINEST, np.zeros(0, np.int64), np.zeros(0, np.int64))


@dataclass(frozen=True)
class Summary:
    """Of the finite numbers of one column. `lowest` and `highest` are (value, number of the
    motion)."""

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0  # Σ (x − mean)²
    lowest: tuple[tuple[float, int], ...] = ()
    highest: tuple[tuple[float, int], ...] = ()
    bins: Bins = NONE

    @property
    def variance(self) -> float:
        """Of the population that this is a sample of."""
        return self.squares / (self.count - 1) if self.count > 1 else math.nan

    @property
    def deviation(self) -> float:
        """The square root of the variance."""
        return math.sqrt(self.variance) if self.count > 1 else math.nan

    def quantile(self, part: float) -> float:
        """What that part of the numbers does not exceed, to the width of a bin."""
        return self.quantiles([part])[0]

    def quantiles(self, parts: Sequence[float]) -> list[float]:
        """Several of them."""
        if not self.count:
            return [math.nan] * len(parts)
        reached = np.cumsum(self.bins.counts)
        places = np.searchsorted(reached, [part * self.count for part in parts])
        middles = self.bins.middles()[np.minimum(places, len(reached) - 1)]
        return np.clip(middles, self.lowest[0][0], self.highest[0][0]).tolist()

    def histogram(self, bars: int) -> tuple[list[float], list[int]]:
        """`bars` + 1 edges of equal distance from the lowest to the highest, and the counts between
        them; none where the values differ by rounding alone."""
        if self.count < 2:
            return [], []
        low, high = self.lowest[0][0], self.highest[0][0]
        if not high - low > SAME * max(abs(low), abs(high)):
            return [], []
        values = np.clip(self.bins.middles(), low, high)
        counts, edges = np.histogram(values, bars, (low, high), weights=self.bins.counts)
        return edges.tolist(), counts.astype(np.int64).tolist()

    def about(self) -> dict[str, Any]:
        """As JSON has it; the places by their distances, which are small."""
        places = np.diff(self.bins.places, prepend=0).tolist()
        bins = {"level": self.bins.level, "places": places, "counts": self.bins.counts.tolist()}
        return {**vars(self), "bins": bins}


def summary(values: np.ndarray, first: int) -> Summary:
    """Of a column whose first number is that of motion `first`."""
    at = np.flatnonzero(np.isfinite(values))
    x = values[at].astype(float)
    if not len(x):
        return Summary()
    mean = float(np.mean(x))
    order = np.argsort(x, kind="stable")
    pairs = [(float(x[k]), int(at[k]) + first) for k in (*order[:ENDS], *order[-ENDS:])]
    squares = float(np.sum((x - mean) ** 2))
    return Summary(len(x), mean, squares, _ends(pairs, 1), _ends(pairs, -1), binned(x))


class Growing:
    """The summary of a whole, to which those of its parts are added in their order."""

    def __init__(self) -> None:
        self._known = Summary()  # but for the bins, some of which wait to be put together
        self._bins: list[Bins] = []
        self._waiting = 0

    def add(self, part: Summary) -> None:
        """One more."""
        self._known = _merged(self._known, part)
        self._bins.append(part.bins)
        self._waiting += len(part.bins.places)
        if self._waiting > FLUSH:
            self._bins, self._waiting = [together(self._bins)], 0

    def summary(self) -> Summary:
        """Of all so far."""
        return replace(self._known, bins=together(self._bins)) if self._bins else self._known


def _merged(a: Summary, b: Summary) -> Summary:
    """Of both, but for the bins."""
    if not a.count or not b.count:
        return a if a.count else b
    count, apart = a.count + b.count, b.mean - a.mean
    return Summary(
        count,
        a.mean + apart * (b.count / count),
        a.squares + b.squares + apart * apart * (a.count * b.count / count),
        _ends((*a.lowest, *b.lowest), 1),
        _ends((*a.highest, *b.highest), -1),
    )


def _ends(pairs: Sequence[tuple[float, int]], sign: int) -> tuple[tuple[float, int], ...]:
    return tuple(sorted({*pairs}, key=lambda pair: (sign * pair[0], pair[1]))[:ENDS])


def of_json(held: Mapping[str, Any]) -> Summary:
    """The summary that `about` wrote."""
    lowest, highest = (
        tuple((float(x), int(k)) for x, k in held[name]) for name in ("lowest", "highest")
    )
    bins = held["bins"]
    places = np.cumsum(np.array(bins["places"], dtype=np.int64))
    return Summary(
        int(held["count"]),
        float(held["mean"]),
        float(held["squares"]),
        lowest,
        highest,
        Bins(int(bins["level"]), places, np.array(bins["counts"], dtype=np.int64)),
    )
