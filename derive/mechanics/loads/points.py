"""Material points of bodies and forces on them, from link to link: how fast a point moves, and what
a force does to the link that it is part of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from derive.expressions.scalars import Vector
from derive.joints.rotations import cross, difference, is_zero, rotated, scaled, sum_of, transpose
from derive.mechanics.loads.records import NONE, Couples, all_of
from derive.mechanics.recursions.tree import link_point, nearest_carrier
from derive.mechanics.scene import Scene


@dataclass(frozen=True)
class Point:
    """`inside` is where it is in its link, −1 for the ground, in m and the link's axes."""

    link: int
    inside: Vector


def are_far(scene: Scene, bodies: Sequence[str]) -> bool:
    """Is the ground all that carries both, and one of them far from it?"""
    tips = [scene.places[body].link for body in bodies]
    carrier, _ = nearest_carrier(scene.links, *tips)
    return scene.frame is None and carrier < 0 and any(map(scene.is_deep, tips))


def point_of(scene: Scene, body: str, point: Vector) -> Point:
    """Of a body, by its coordinates in the body's frame."""
    place = scene.places[body]
    return Point(place.link, link_point(place, point))


def shifted(scene: Scene, point: Point, arm: Vector) -> Point:
    """The point of the same link at an arm, in ground axes, from another."""
    return Point(point.link, sum_of(point.inside, to_link(scene, point.link, arm)))


def point_at(scene: Scene, body: str, position: Vector) -> Point:
    """Of a body's link, by where it is in the ground."""
    link = scene.places[body].link
    if link < 0:
        return Point(link, position)
    return Point(link, to_link(scene, link, difference(position, scene.positions[link])))


def to_link(scene: Scene, link: int, vector: Vector) -> Vector:
    """From ground axes to the link's."""
    return vector if link < 0 else rotated(transpose(scene.rotations[link]), vector)


def position(scene: Scene, point: Point) -> Vector:
    """r + R x, in the ground."""
    if point.link < 0:
        return point.inside
    return sum_of(scene.positions[point.link], rotated(scene.rotations[point.link], point.inside))


def velocity(scene: Scene, point: Point) -> Vector:
    """R (v + ω × x), in ground axes."""
    if point.link < 0:
        return NONE
    omega, linear = scene.twist(point.link)
    return rotated(scene.rotations[point.link], sum_of(linear, cross(omega, point.inside)))


def turning(scene: Scene, link: int) -> Vector:
    """ω of a link, in ground axes."""
    return NONE if link < 0 else rotated(scene.rotations[link], scene.twist(link)[0])


def pair(scene: Scene, points: tuple[Point, Point], force: Vector) -> Couples:
    """A force, in ground axes, on the second point, and its opposite on the first."""
    opposite = scaled(-1.0, force)
    return all_of(*(_pushed(scene, *given) for given in zip(points, (opposite, force))))


def moments(scene: Scene, links: tuple[int, int], moment: Vector) -> Couples:
    """A moment, in ground axes, on the second link, and its opposite on the first."""
    opposite = scaled(-1.0, moment)
    return all_of(*(_turned(scene, *given) for given in zip(links, (opposite, moment))))


def _pushed(scene: Scene, point: Point, force: Vector) -> Couples:
    """(x × f, f) about the origin of the link; the ground does not care."""
    if point.link < 0 or all(map(is_zero, force)):
        return {}
    own = to_link(scene, point.link, force)
    return {point.link: (cross(point.inside, own), own)}


def _turned(scene: Scene, link: int, moment: Vector) -> Couples:
    if link < 0 or all(map(is_zero, moment)):
        return {}
    return {link: (to_link(scene, link, moment), NONE)}
