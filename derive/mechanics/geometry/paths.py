"""The length of a path through points and round pulleys.

In the plane of the pulleys a point is a circle of radius zero. With ρ = ±r, positive where the
centre lies to the left, the line that touches two circles has the direction u and the length t:

    c = c₂ − c₁,   δ = ρ₂ − ρ₁,   t = √(c·c − δ²),   u = (t c − δ e × c)/(c·c)

and the path turns at each circle by the angle from one direction to the next. In space the way
round a cylinder is straight where the cylinder is unrolled, so that the length is that of the way
across the axis and the advance along it, √(l² + h²). The rope stays on its pulleys.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import casadi as ca

from derive.diagnostics import ModelError
from derive.expressions.scalars import Scalar, Vector
from derive.expressions.tree import ZERO
from derive.joints.rotations import difference, dot, is_zero, matrix, product, rotated, transpose
from derive.mechanics.geometry.frames import carrier_in_plane, ground_rotation, on_ground, triad
from derive.mechanics.scene import IN_PLANE, Scene
from derive.model.records import Path, Span, Waypoint


@dataclass(frozen=True)
class Circle:
    """Centre in a plane, radius with its sign, and whole turns round it."""

    centre: Vector
    rho: Scalar
    side: int
    turns: int


@dataclass(frozen=True)
class Straight:
    """Between two circles: direction and length."""

    direction: Vector
    length: Scalar


def path_length(scene: Scene, path: Path) -> Scalar:
    """In m, over (t, q). ModelError where two of its points in a row always meet. What carries all
    points that a part of it goes by is no part of its length."""
    for first, second in pairwise(path.points):
        if not _is_round(first) and not _is_round(second):
            check_apart(scene, _apart(scene, first, second), path.name, path.span)
    if not scene.model.plane or not any(map(_is_round, path.points)):
        return _spatial(scene, path)
    tips = [scene.places[x.body].link for x in path.points]
    near = scene.near(*tips) if carrier_in_plane(scene, *tips) >= 0 else scene
    axes = IN_PLANE[scene.model.plane]
    centres = [[_ground(near, x)[k] for k in axes] for x in path.points]
    return _planar([_circle(near, x, centre) for x, centre in zip(path.points, centres)])


def _apart(scene: Scene, first: Waypoint, second: Waypoint) -> Vector:
    """p₂ − p₁ in the axes of what carries both."""
    near = scene.among([first.body, second.body])
    return difference(_ground(near, second), _ground(near, first))


def check_apart(scene: Scene, gap: Vector, name: str, span: Span) -> None:
    """ModelError for two points that are one at every position: between them is no direction."""
    if all(is_zero(x) for x in gap):
        raise ModelError(
            scene.model.diagnostic(
                span,
                f"{name}: two of its points are one and the same at every position, so that no "
                "line from one to the other has a direction",
                "points that can be apart: say where they are in their bodies",
            )
        )


def _ground(scene: Scene, x: Waypoint) -> Vector:
    point = on_ground(scene, x.body, x.point)
    return [point[k] for k in range(3)]


def _circle(scene: Scene, x: Waypoint, centre: Vector) -> Circle:
    return Circle(centre, dot([x.side], [scene.symbols.scalar(x.radius)]), x.side, x.turns)


def _planar(circles: list[Circle]) -> Scalar:
    """Straight parts and arcs, added up."""
    lines = [_straight(first, second) for first, second in pairwise(circles)]
    total: Scalar = 0.0
    for line in lines:
        total = total + line.length
    for circle, before, after in zip(circles[1:-1], lines, lines[1:]):
        if isinstance(circle.rho, ca.SX) or circle.rho:
            total = total + circle.side * circle.rho * _turn(circle, before, after)
    return total


def _straight(first: Circle, second: Circle) -> Straight:
    c = difference(second.centre, first.centre)
    square = dot(c, c)
    delta = second.rho - first.rho
    if isinstance(delta, float) and delta == 0.0:
        length = ca.sqrt(square)
        return Straight([x / length for x in c], length)
    length = ca.sqrt(square - delta * delta)
    across = [-c[1], c[0]]
    return Straight([(length * x - delta * y) / square for x, y in zip(c, across)], length)


def _turn(circle: Circle, before: Straight, after: Straight) -> Scalar:
    """The angle of contact, counted in the sense of the pulley: from −90° to 270°, so that it does
    not jump by a turn where the rope just touches."""
    a, b = before.direction, after.direction
    sine = circle.side * (a[0] * b[1] - a[1] * b[0])
    cosine = dot(a, b)
    return pi / 2 + ca.atan2(-cosine, sine) + 2 * pi * circle.turns


def _spatial(scene: Scene, path: Path) -> Scalar:
    """Point to point, with at most one cylinder between two points."""
    total: Scalar = 0.0
    points = path.points
    for k, (first, second) in enumerate(pairwise(points)):
        if _is_round(first):
            total = total + _round(scene, points[k - 1], first, second)
        elif not _is_round(second):
            gap = _apart(scene, first, second)
            total = total + ca.sqrt(dot(gap, gap))
    return total


def _is_round(x: Waypoint) -> bool:
    return x.radius != ZERO


def _round(scene: Scene, before: Waypoint, x: Waypoint, after: Waypoint) -> Scalar:
    """In the frame of the cylinder: two of its axes across, the third along."""
    scene = scene.among([before.body, x.body, after.body])
    turned = triad(scene.symbols.vector(x.axis), "")
    place = scene.places[x.body]
    axes = transpose(product(ground_rotation(scene, place), matrix(turned)))
    centre = _ground(scene, x)
    ends = [rotated(axes, difference(_ground(scene, end), centre)) for end in (before, after)]
    circles = [Circle(end[:2], 0.0, 1, 0) for end in ends]
    across = _planar([circles[0], _circle(scene, x, [0.0, 0.0]), circles[1]])
    advance = ends[1][2] - ends[0][2]
    return ca.sqrt(across * across + advance * advance)
