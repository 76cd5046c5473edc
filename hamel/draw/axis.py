"""Axes: from numbers to positions between 0 and 1, with ticks a reader would choose."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

ROOM = 0.04  # of the length of an axis


@dataclass(frozen=True)
class Axis:
    """`low` and `high` bound the axis in its own scale (log10 of the values when `log`); `ticks`
    are (position, label)."""

    low: float
    high: float
    ticks: tuple[tuple[float, str], ...]
    log: bool = False

    def position(self, value: float) -> float:
        """Where `value` stands, 0 at the low end; what a logarithm cannot show stays at the
        bottom."""
        if self.log:
            value = max(math.log10(value), self.low) if value > 0 else self.low
        return (value - self.low) / (self.high - self.low)


def linear(values: Iterable[float], tight: bool = False) -> Axis:
    """An axis over the finite values; `tight` ends at the data (time), else at the ticks around
    it."""
    low, high = _range(values)
    step = _step(high - low)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    ticks = tuple((k * step, _label(k * step)) for k in range(first, last + 1))
    if not tight:
        low, high = first * step, last * step
    return Axis(low, high, _placed(ticks, low, high))


def logarithmic(values: Iterable[float], floor: float = 1e-18) -> Axis:
    """Whole decades around the positive values, at least two and never below `floor`."""
    exponents = [math.log10(max(v, floor)) for v in values if v > 0 and math.isfinite(v)] or [
        math.log10(floor)
    ]
    low, high = math.floor(min(exponents)), math.ceil(max(exponents))
    high = max(high, low + 2)
    every = max(1, (high - low) // 4)
    ticks = tuple((float(k), f"1e{k}") for k in range(low, high + 1, every))
    return Axis(low, high, _placed(ticks, low, high), log=True)


def decades(low: float, high: float) -> Axis:
    """A logarithmic axis that ends at two positive numbers, with ticks at powers of ten; where it
    has less than two of them, at 1, 2 and 5 times these."""
    ends = math.log10(low), math.log10(high)
    powers = range(math.floor(ends[0]), math.ceil(ends[1]) + 1)
    whole = [(float(k), f"1e{k}") for k in powers if ends[0] <= k <= ends[1]]
    parts = [m * 10.0**k for k in powers for m in (1, 2, 5)]
    ticks = whole if len(whole) > 1 else [(math.log10(x), _label(x)) for x in parts]
    return Axis(*ends, _placed(tuple(ticks), *ends), log=True)


def roomy(axis: Axis) -> Axis:
    """The axis with some room at both ends, so that what stands there is off the frame."""
    room = ROOM * (axis.high - axis.low)
    ticks = tuple(((at + ROOM) / (1 + 2 * ROOM), label) for at, label in axis.ticks)
    return replace(axis, low=axis.low - room, high=axis.high + room, ticks=ticks)


def _placed(
    ticks: tuple[tuple[float, str], ...], low: float, high: float
) -> tuple[tuple[float, str], ...]:
    span = high - low
    return tuple(
        ((at - low) / span, label) for at, label in ticks if -1e-9 <= (at - low) / span <= 1 + 1e-9
    )


def _range(values: Iterable[float]) -> tuple[float, float]:
    finite = [v for v in values if math.isfinite(v)] or [0.0]
    low, high = min(finite), max(finite)
    # A constant gets room around it; noise of rounding is shown as a constant.
    if high - low <= 1e-12 * max(abs(low), abs(high)) + 1e-300:
        margin = 0.5 * abs(low) or 1.0
        return low - margin, high + margin
    return low, high


def _step(span: float) -> float:
    """1, 2 or 5 times a power of ten, so that about five ticks fit."""
    power = 10.0 ** math.floor(math.log10(span / 5))
    return power * next(m for m in (1, 2, 5, 10) if m * power >= span / 5 * (1 - 1e-9))


def _label(value: float) -> str:
    return f"{value:.6g}".replace("-", "−") if abs(value) > 1e-300 else "0"
