"""What a drawing is made of: shapes that bodies carry, marks on the paper, and labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Point = tuple[float, float]
GROUND = -1  # the index of the ground among the bodies


@dataclass(frozen=True)
class Pose:
    """Of a body in the ground: x_ground = rotation x_body + position (m)."""

    rotation: Vector
    position: Vector

    def point(self, at: Any) -> Vector:
        """A point of the body, in ground axes."""
        return self.rotation @ np.asarray(at, dtype=float) + self.position

    def inside(self, at: Any) -> Vector:
        """A point of the ground, in the axes of the body."""
        return self.rotation.T @ (np.asarray(at, dtype=float) - self.position)


@dataclass(frozen=True)
class Spot:
    """A point that a body carries, in its own frame (m)."""

    body: int
    at: tuple[float, float, float]


def spot(body: int, at: Sequence[float] | Vector) -> Spot:
    """A point of a body, in its frame."""
    x, y, z = (float(entry) for entry in at)
    return Spot(body, (x, y, z))


@dataclass(frozen=True)
class Shape:
    """Part of the mechanism, in the frames of the bodies that carry it.

    `kind`: "line" through the spots, "solid" (their hull, with the `faces` that look at the
    reader), "dot" and "mass" (a disc, whole or quartered, of so many pixels), "spring" and "damper"
    between two spots; `size` in pixels is a radius, or how far a spring stands beside its line.
    """

    kind: str
    style: str
    spots: tuple[Spot, ...]
    closed: bool = False
    faces: tuple[tuple[int, ...], ...] = ()
    size: float = 0.0
    smooth: bool = False  # a solid whose hull is its outline


@dataclass(frozen=True)
class Mark:
    """A line or an area on the paper, in pixels downwards; a disc where there is a radius."""

    style: str
    points: tuple[Point, ...]
    closed: bool = False
    radius: float = 0.0

    def moved(self, x: float, y: float) -> Mark:
        """The same elsewhere."""
        return replace(self, points=tuple((a + x, b + y) for a, b in self.points))


@dataclass(frozen=True)
class Label:
    """A name in LaTeX, the point it belongs to, and where it may stand: directions in degrees
    (counter-clockwise from the right), best first; `away` are pixels to the nearest edge."""

    latex: str
    style: str
    at: Point
    directions: tuple[float, ...] = ()
    away: float = 7.0


@dataclass(frozen=True)
class Box:
    """A rectangle on the paper: left, top, right, bottom in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    def overlaps(self, other: Box) -> bool:
        """Whether the insides meet."""
        beside = self.right <= other.left or other.right <= self.left
        above = self.bottom <= other.top or other.bottom <= self.top
        return not (beside or above)

    def grown(self, by: float) -> Box:
        """With a margin all around."""
        return Box(self.left - by, self.top - by, self.right + by, self.bottom + by)


@dataclass(frozen=True)
class Lettering:
    """A label in its place: the box of its letters; `leader` leads to what it names where that is
    not beside it."""

    label: Label
    box: Box
    leader: tuple[Point, ...] = ()
