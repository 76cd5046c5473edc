"""Measures: the numbers of the mechanics that formulas can speak of, such as the x of the position
of a point, each a name with a meaning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from derive.expressions.dimensions import Inferred
from derive.expressions.units import LENGTH, NUMBER, TIME, quotient_of
from derive.model.records import GROUND, Measure, Vector3

SPEED = quotient_of(LENGTH, TIME)
PER_TIME = quotient_of(NUMBER, TIME)
SPEEDING = "speeding"  # of the rate of a coordinate, or of a generalized velocity
# what a measure is, its rate, and its dimension
POSITIONS: Mapping[str, str] = {
    "position": "velocity",
    "orientation": "turning",
    "angle": "angular_velocity",
    "length": "lengthening",
}
VELOCITIES: Mapping[str, str] = {
    "velocity": "acceleration",
    "turning": "second_turning",
    "angular_velocity": "angular_acceleration",
    "lengthening": "second_lengthening",
}
ACCELERATIONS = frozenset({*VELOCITIES.values(), SPEEDING})
DIMENSIONS: Mapping[str, Inferred] = {
    "position": LENGTH,
    "velocity": SPEED,
    "orientation": NUMBER,
    "turning": PER_TIME,
    "angle": NUMBER,
    "angular_velocity": PER_TIME,
    "length": LENGTH,
    "lengthening": SPEED,
    "acceleration": quotient_of(SPEED, TIME),
    "second_turning": quotient_of(PER_TIME, TIME),
    "angular_acceleration": quotient_of(PER_TIME, TIME),
    "second_lengthening": quotient_of(SPEED, TIME),
}


@dataclass(frozen=True)
class Spot:
    """A point of a body or frame, in its own axes."""

    frame: str
    point: Vector3


class Measures:
    """The measures that the formulas of a file use, by name; `frames`: whatever has a place;
    `paths`: whatever has a length."""

    def __init__(self) -> None:
        self.frames: tuple[str, ...] = (GROUND,)
        self.paths: tuple[str, ...] = ()
        self.found: dict[str, Measure] = {}

    def named(self, measure: Measure) -> str:
        """The name of a measure, which is a new one unless it is there already."""
        stem = measure.name
        for count in range(1, len(self.found) + 2):
            name = stem if count == 1 else f"{stem}#{count}"
            other = self.found.get(name)
            if other is None:
                self.found[name] = Measure(name, *_meaning(measure))
                return name
            if _meaning(other) == _meaning(measure):
                return name
        raise AssertionError("unreachable")

    def of(self, accelerations: bool) -> tuple[Measure, ...]:
        """Those that are accelerations, or the others."""
        found = self.found.values()
        return tuple(x for x in found if (x.quantity in ACCELERATIONS) == accelerations)


def _meaning(
    measure: Measure,
) -> tuple[str, str, Vector3, str, tuple[int, ...]]:
    return (
        measure.quantity,
        measure.frame,
        measure.point,
        measure.relative,
        measure.component,
    )
