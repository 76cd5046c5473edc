"""Vectors of space as NumPy columns of three."""

from __future__ import annotations

import numpy as np

from hamel.draw.mechanism.records import Vector


def cross(a: Vector, b: Vector) -> Vector:
    """a × b."""
    return np.asarray(np.cross(a, b), dtype=float)


def across(axis: Vector) -> Vector:
    """A unit vector at right angles to a unit axis, from the coordinate axis that is least along
    it."""
    side = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return side / float(np.linalg.norm(side))
