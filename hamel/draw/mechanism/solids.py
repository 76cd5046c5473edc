"""Circles, boxes and cylinders as spots of a body."""

from __future__ import annotations

import math

import numpy as np

from hamel.draw.mechanism.records import Shape, Vector, spot
from hamel.draw.mechanism.vectors import across, cross

AROUND = 36  # corners of a circle
CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
# corners of a box by number: four below, four above, each counter-clockwise seen from above
FACES = ((3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def ring(at: Vector, first: Vector, second: Vector, radius: float) -> list[Vector]:
    """A circle in the plane of two unit vectors."""
    angles = 2 * math.pi * np.arange(AROUND) / AROUND
    return [at + radius * (math.cos(a) * first + math.sin(a) * second) for a in angles]


def box(index: int, at: Vector, axes: Vector, halves: Vector, style: str) -> Shape:
    """A box about a point of a body; `axes` are columns, `halves` half its sides."""
    spots = []
    for level in (-1, 1):
        for a, b in CORNERS:
            spots.append(spot(index, at + axes @ (halves * np.array([a, b, level]))))
    return Shape("solid", style, tuple(spots), faces=FACES)


def cylinder(index: int, at: Vector, axis: Vector, half: float, radius: float, style: str) -> Shape:
    """A cylinder about a unit axis: its outline and its two ends."""
    first = across(axis)
    second = cross(axis, first)
    below = ring(at - half * axis, first, second, radius)
    above = ring(at + half * axis, first, second, radius)
    spots = tuple(spot(index, x) for x in (*below, *above))
    ends = (tuple(range(AROUND - 1, -1, -1)), tuple(range(AROUND, 2 * AROUND)))
    return Shape("solid", style, spots, faces=ends, smooth=True)
