"""Paths: straight pieces from pulley to pulley, arcs round them, and the pulleys.

They touch where derive.mechanics.geometry.paths has them touch. In space the way round a cylinder
is straight where the cylinder is unrolled.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from derive.mechanics.scene import IN_PLANE
from derive.model.records import Path, Waypoint
from hamel.draw.mechanism.records import Shape, Spot, Vector, spot
from hamel.draw.mechanism.scene import Scene, paths
from hamel.draw.mechanism.solids import ring
from hamel.draw.mechanism.vectors import across, cross

STEP = math.radians(12.0)  # of an arc


@dataclass(frozen=True)
class _Circle:
    """A pulley in the plane: its radius has the sign of the side on which its centre lies, left
    being positive; of a point it is zero."""

    body: int
    centre: Vector  # in the ground
    rho: float


def rope_shapes(scene: Scene) -> list[Shape]:
    """Of every path once."""
    shapes: list[Shape] = []
    for path in paths(scene.model):
        circles = [_circle(scene, way) for way in path.points]
        shapes += [_pulley(scene, way) for way, x in zip(path.points, circles) if x.rho]
        shapes += (
            _in_plane(scene, circles) if scene.model.plane else _in_space(scene, path, circles)
        )
    return shapes


def _circle(scene: Scene, way: Waypoint) -> _Circle:
    body = scene.index(way.body)
    centre = scene.pose(body).point(scene.numbers.vector(way.point))
    return _Circle(body, centre, way.side * scene.numbers.scalar(way.radius))


def _pulley(scene: Scene, way: Waypoint) -> Shape:
    axis = scene.numbers.vector(way.axis)
    length = float(np.linalg.norm(axis))
    axis = axis / length if length else scene.view.toward
    first = across(axis)
    rim = ring(
        scene.numbers.vector(way.point),
        first,
        cross(axis, first),
        abs(scene.numbers.scalar(way.radius)),
    )
    body = scene.index(way.body)
    return Shape("line", "pulley", tuple(spot(body, x) for x in rim), closed=True)


def _straight(scene: Scene, circles: Sequence[_Circle]) -> list[Shape]:
    """From middle to middle."""
    return [
        _line(_carried(scene, a, a.centre), _carried(scene, b, b.centre))
        for a, b in pairwise(circles)
    ]


def _in_space(scene: Scene, path: Path, circles: Sequence[_Circle]) -> list[Shape]:
    """Point to point, with at most one cylinder between two points."""
    shapes: list[Shape] = []
    for k, (first, second) in enumerate(pairwise(circles)):
        if first.rho:
            shapes += _round(scene, path.points[k], circles[k - 1 : k + 2])
        elif not second.rho:
            shapes += _straight(scene, (first, second))
    return shapes


def _round(scene: Scene, way: Waypoint, three: Sequence[_Circle]) -> list[Shape]:
    """A cylinder between two points: in its own axes, the third along it."""
    axis = scene.pose(three[1].body).rotation @ scene.numbers.vector(way.axis)
    axis = axis / float(np.linalg.norm(axis))
    first = across(axis)
    axes = np.column_stack([first, cross(axis, first), axis])
    inside = [replace(x, centre=axes.T @ (x.centre - three[1].centre)) for x in three]
    ways = [_direction(a, b, (0, 1)) for a, b in pairwise(inside)]
    if not all(np.isfinite(x).all() for x in ways):  # an end is within the cylinder
        return _straight(scene, three)
    arc = [_touched(inside[1], x, (0, 1)) for x in _turned(ways[0], ways[1], three[1].rho)]
    points = np.array([inside[0].centre, *arc, inside[2].centre])
    gone = np.cumsum([0.0, *np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)])
    points[:, 2] = points[0, 2] + (points[-1, 2] - points[0, 2]) * gone / gone[-1]
    there = [three[1].centre + axes @ x for x in points]
    ends = (_carried(scene, three[0], there[0]), _carried(scene, three[2], there[-1]))
    return [_line(ends[0], *(_carried(scene, three[1], x) for x in there[1:-1]), ends[1])]


def _line(*spots: Spot) -> Shape:
    return Shape("line", "rope", spots)


def _carried(scene: Scene, circle: _Circle, at: Vector) -> Spot:
    """A point of the ground that the body of a pulley carries."""
    return spot(circle.body, scene.pose(circle.body).inside(at))


def _in_plane(scene: Scene, circles: Sequence[_Circle]) -> list[Shape]:
    axes = IN_PLANE[scene.model.plane]
    ways = [_direction(a, b, axes) for a, b in pairwise(circles)]
    if not all(np.isfinite(way).all() for way in ways):  # an end is within its pulley
        return _straight(scene, circles)
    shapes = [
        _line(
            _carried(scene, a, _touched(a, way, axes)), _carried(scene, b, _touched(b, way, axes))
        )
        for (a, b), way in zip(pairwise(circles), ways)
    ]
    for circle, (before, after) in zip(circles[1:-1], pairwise(ways)):
        if circle.rho:
            arc = [_touched(circle, way, axes) for way in _turned(before, after, circle.rho)]
            shapes.append(_line(*(_carried(scene, circle, at) for at in arc)))
    return shapes


def _direction(a: _Circle, b: _Circle, axes: tuple[int, ...]) -> Vector:
    """Of the line that touches both: u = (t c − δ e × c)/(c · c); not finite where there is
    none."""
    c = (b.centre - a.centre)[list(axes)]
    square, delta = float(c @ c), b.rho - a.rho
    if square <= delta * delta:
        return np.full(2, np.nan)
    return (math.sqrt(square - delta * delta) * c - delta * np.array([-c[1], c[0]])) / square


def _touched(circle: _Circle, way: Vector, axes: tuple[int, ...]) -> Vector:
    """Where a line of that direction touches: the centre is on its left for a positive radius."""
    at = circle.centre.copy()
    at[list(axes)] -= circle.rho * np.array([-way[1], way[0]])
    return at


def _turned(before: Vector, after: Vector, rho: float) -> Iterator[Vector]:
    """Directions from one to the next, turning left for a positive radius."""
    start = math.atan2(before[1], before[0])
    sense = math.copysign(1.0, rho)
    turn = (sense * (math.atan2(after[1], after[0]) - start)) % math.tau
    parts = max(1, math.ceil(turn / STEP))
    for k in range(parts + 1):
        angle = start + sense * turn * k / parts
        yield np.array([math.cos(angle), math.sin(angle)])
