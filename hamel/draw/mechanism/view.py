"""How space is laid on the paper: a plane as it is, space by a parallel projection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hamel.draw.mechanism.records import Point, Vector
from hamel.draw.mechanism.vectors import cross

AXES = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
ELEVATION = np.radians(20.0)
AZIMUTHS = (-62.0, -35.0, 30.0, 60.0)  # degrees; the first unless another shows much more
MUCH = 1.25
UPRIGHT = 1e-9


@dataclass(frozen=True)
class View:
    """Unit vectors to the right, up, and towards the reader; pixels per metre."""

    right: Vector
    up: Vector
    toward: Vector
    scale: float = 1.0
    flat: bool = True  # a plane, drawn as it is

    def paper(self, at: Vector) -> Point:
        """A point of the ground, in pixels to the right and downwards."""
        return (
            float(self.scale * (at @ self.right)),
            float(-self.scale * (at @ self.up)),
        )

    def depth(self, at: Vector) -> float:
        """How near to the reader, in pixels."""
        return float(self.scale * (at @ self.toward))

    @property
    def pixel(self) -> float:
        """The length (m) of a pixel."""
        return 1.0 / self.scale


def planar(plane: str) -> View:
    """The plane's first axis to the right and its second up."""
    first, second = AXES[plane]
    right, up = np.eye(3)[first], np.eye(3)[second]
    return View(right, up, cross(right, up))


def axonometric(up: Vector, points: Sequence[Vector]) -> View:
    """From above, at the azimuth that shows the points well."""
    views = [_turned(up, azimuth) for azimuth in AZIMUTHS]
    spreads = [_spread(view, points) for view in views]
    best = int(np.argmax(spreads))
    return views[best] if spreads[best] > MUCH * spreads[0] else views[0]


def _turned(up: Vector, azimuth: float) -> View:
    """A camera at an azimuth (degrees) from the first horizontal axis of the ground."""
    along = np.eye(3)[0] - up[0] * up
    if np.linalg.norm(along) < 0.5:
        along = np.eye(3)[1] - up[1] * up
    along = along / np.linalg.norm(along)
    aside = cross(up, along)
    angle = np.radians(azimuth)
    level = np.cos(angle) * along + np.sin(angle) * aside
    toward = np.cos(ELEVATION) * level + np.sin(ELEVATION) * up
    right = cross(up, toward)
    right = right / np.linalg.norm(right)
    return View(right, cross(toward, right), toward, flat=False)


def _spread(view: View, points: Sequence[Vector]) -> float:
    """How far the points spread across the direction in which they spread most."""
    if len(points) < 3:
        return 1.0
    laid = np.array([view.paper(point) for point in points])
    return float(np.linalg.svd(laid - laid.mean(axis=0), compute_uv=False)[1]) + UPRIGHT
