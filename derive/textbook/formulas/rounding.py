"""What rounding left: sin(180 deg) is 1.2e-16 where the model means zero."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, cast

from derive.model.records import Model

NOISE = 1e-14  # of numbers of order one
SMALLEST = 2e-5  # of a file's numbers: the product of three of them is above NOISE
TURNS = 16  # right angles whose sines and cosines are known to be left


def _right_angles() -> frozenset[float]:
    """|sin| and |cos| of multiples of 90 degrees, where rounding alone makes them differ from
    zero."""
    counts = range(1, TURNS + 1)
    angles = [x for k in counts for x in (k * (math.pi / 2), 90 * k * (math.pi / 180))]
    values = [abs(f(x)) for x in angles for f in (math.sin, math.cos)]
    return frozenset(x for x in values if x < NOISE)


RIGHT_ANGLES = _right_angles()


def leftovers(model: Model) -> Callable[[float], bool]:
    """Whether a number is left of rounding: one of a right angle, or a tiny one where the numbers
    of the file are too large for that."""

    @cache
    def large() -> bool:
        return min(_numbers(model), default=1.0) > SMALLEST

    def left(x: float) -> bool:
        return 0 < abs(x) < NOISE and (abs(x) in RIGHT_ANGLES or large())

    return left


def _numbers(record: Any) -> Iterator[float]:
    """Magnitudes of the numbers in a record, and in the records that it holds."""
    if isinstance(record, float) and record:
        yield abs(record)
    elif isinstance(record, tuple):
        for entry in cast(tuple[Any, ...], record):
            yield from _numbers(entry)
    elif is_dataclass(record):
        for field in fields(record):
            yield from _numbers(getattr(record, field.name))
