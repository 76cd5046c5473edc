"""Planes and directions: how two components become three, and which way a planar model turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

from derive.expressions.tree import ZERO, Expression, Number
from derive.model.algebra import Rows, constant, rows
from derive.model.limits import RIGHT_TURN, ZERO_ENTRY
from derive.model.records import Vector3

_LETTERS = "xyz"
_NORMALS = {
    "xy": (0.0, 0.0, 1.0),
    "xz": (0.0, -1.0, 0.0),
    "yz": (1.0, 0.0, 0.0),
    "": (0.0, 0.0, 1.0),
}
ORIGIN: Vector3 = (ZERO, ZERO, ZERO)
Rotation = Rows


@dataclass(frozen=True)
class Space:
    """`plane` is "xy", "xz", "yz", or "" in space."""

    plane: str

    @property
    def letters(self) -> str:
        """The axes that components are given along: the two letters of the plane, or x, y, z."""
        return self.plane or _LETTERS

    @property
    def size(self) -> int:
        """Components of a point."""
        return len(self.letters)

    @property
    def normal(self) -> Vector3:
        """The axis of a planar model, so that angles grow from its first to its second axis; z in
        space."""
        return constant_vector(_NORMALS[self.plane])

    @property
    def normal_index(self) -> int:
        """Which of x, y, z is the normal of the plane: the axis that a planar model turns about."""
        return next(i for i, component in enumerate(_NORMALS[self.plane]) if component)

    def embedded(self, components: list[Expression]) -> Vector3:
        """Components on the axes of the plane as a vector in space."""
        entries: list[Expression] = [ZERO, ZERO, ZERO]
        for letter, component in zip(self.letters, components):
            entries[_LETTERS.index(letter)] = component
        return (entries[0], entries[1], entries[2])

    def along(self, letter: str) -> Vector3:
        """The unit vector of an axis, `x` or `-x`."""
        sign = -1.0 if letter.startswith("-") else 1.0
        entries = [sign if letter.endswith(axis) else 0.0 for axis in _LETTERS]
        return constant_vector((entries[0], entries[1], entries[2]))


def constant_vector(components: tuple[float, float, float]) -> Vector3:
    """Three numbers as formulas without a unit."""
    a, b, c = (constant(component) for component in components)
    return (a, b, c)


def normalised(components: tuple[float, float, float]) -> Vector3 | None:
    """The unit vector along numbers, exact along the axes; None for the zero vector."""
    length = math.hypot(*components)
    if length == 0.0:
        return None
    a, b, c = (component / length for component in components)
    return snapped_row(constant_vector((a, b, c)))


def turned_about(axis: tuple[float, float, float], angle: float) -> Rotation:
    """Rotation matrix (Rodrigues)."""
    s, c = _sine_cosine(angle)
    x, y, z = axis
    skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    return snapped(
        rows(
            [
                [
                    constant(c * (i == j) + s * skew[i][j] + (1.0 - c) * axis[i] * axis[j])
                    for j in range(3)
                ]
                for i in range(3)
            ]
        )
    )


def snapped(rotation: Rotation) -> Rotation:
    """Entries within 1e-12 of zero are zero, and a row that has one other entry has ±1: structure
    survives rounding."""
    return rows([list(snapped_row(row)) for row in rotation])


def snapped_row(row: Vector3) -> Vector3:
    """A row of a rotation with entries nearer to zero than ZERO_ENTRY taken for zero, and a row of
    one entry for a unit vector. cos 90° is 6e-17 in floats; only exact zeros vanish from the
    equations.
    """
    entries = [ZERO if isinstance(x, Number) and abs(x.value) < ZERO_ENTRY else x for x in row]
    if sum(x != ZERO for x in entries) == 1:
        entries = [
            constant(math.copysign(1.0, x.value)) if isinstance(x, Number) and x != ZERO else x
            for x in entries
        ]
    a, b, c = entries
    return (a, b, c)


def _sine_cosine(angle: float) -> tuple[float, float]:
    """Exact at multiples of a right angle, so that structural zeros stay zeros."""
    quarter = angle / (math.pi / 2.0)
    if abs(quarter - round(quarter)) < RIGHT_TURN * max(1.0, abs(quarter)):
        return ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))[round(quarter) % 4]
    return math.sin(angle), math.cos(angle)
