"""Frames placed on bodies, in the ground."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.expressions.scalars import Matrix, Vector
from derive.joints.records import Rotation, Still
from derive.joints.rotations import (
    is_zero,
    matrix,
    merged,
    product,
    rotated,
)
from derive.mechanics.links import placement
from derive.mechanics.records import Place
from derive.mechanics.recursions.tree import ground_point, nearest_carrier, relative_rotation
from derive.mechanics.scene import IN_PLANE, NORMAL, NOTHING, Scene
from derive.model.records import (
    Closure,
    Placement,
    Vector3,
)


@dataclass(frozen=True)
class Frames:
    """The joint frames of a closure in the ground: origins, and axes as columns; the axis is the
    third where there is one."""

    origins: tuple[ca.SX, ca.SX]
    axes: tuple[tuple[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX, ca.SX]]


def closure_frames(scene: Scene, closure: Closure) -> Frames:
    """The joint frame of a closure as each of its two bodies carries it: points and triads, in
    ground axes.

    The triad's third vector is along the axis of the joint. Both frames agree where the loop is
    closed.
    """
    turned = triad(scene.symbols.vector(closure.axis), scene.model.plane)
    frames = [
        joint_frame(scene, body, at, turned) for body, at in zip(closure.bodies, closure.placements)
    ]
    return Frames((frames[0][0], frames[1][0]), (frames[0][1], frames[1][1]))


def triad(axis: Vector, plane: str) -> Rotation:
    """A frame whose third axis is the given one; in the plane its first axis lies in the plane
    too."""
    unit = np.array([float(x) for x in axis])
    normal = np.array(NORMAL[plane])
    if not unit.any():
        unit = normal
    across = np.cross(normal, unit)
    if not plane or not across.any():
        # any direction across will do; the axis that is least along the unit is the safest to cross
        # with
        across = np.cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))])
    x = across / np.linalg.norm(across)
    return (Still(np.column_stack([x, np.cross(unit, x), unit]).tolist()),)


def joint_frame(
    scene: Scene, body: str, at: Placement, turned: Rotation
) -> tuple[ca.SX, tuple[ca.SX, ca.SX, ca.SX]]:
    """Origin (m) and axes, in the ground, of a frame placed on a body and turned there."""
    place = scene.places[body]
    on_body, origin = placement(scene.symbols, at)
    R = product(ground_rotation(scene, place), matrix(merged(on_body, turned)))
    point = ca.vertcat(*ground_point(place, origin, scene.positions, scene.rotations))
    return point, _columns(R)


def axes_of(scene: Scene, body: str) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The axes of a body's frame, in the ground."""
    return _columns(ground_rotation(scene, scene.places[body]))


def _columns(R: Matrix) -> tuple[ca.SX, ca.SX, ca.SX]:
    x, y, z = [ca.vertcat(*[row[k] for row in R]) for k in range(3)]
    return x, y, z


def ground_rotation(scene: Scene, place: Place) -> Matrix:
    """Ground ← body, 3 × 3. A body is merged into a link where it is fixed to it, so two rotations
    are chained."""
    own = matrix(place.rotation)
    return own if place.link < 0 else product(scene.rotations[place.link], own)


def angular_velocity(scene: Scene, place: Place) -> Vector:
    """ω of the body in ground axes, rad/s; links carry theirs in their own axes."""
    if place.link < 0:
        return NOTHING
    return rotated(scene.rotations[place.link], scene.twist(place.link)[0])


def on_ground(scene: Scene, body: str, point: Vector3) -> ca.SX:
    """Where a point of a body is, 3 × 1 in m in ground axes; `point` is in the body's frame."""
    inside = scene.symbols.vector(point)
    return ca.vertcat(*ground_point(scene.places[body], inside, scene.positions, scene.rotations))


def axes_in_plane(scene: Scene, link: int) -> list[int]:
    """The axes of a link's frame, or of the ground's (−1), that span the plane of the model; all in
    space. They have other numbers than the ground's where a slide is the third axis of its link."""
    turned = matrix(relative_rotation(scene.links, link, -1))
    across = [k for k in range(3) if k not in IN_PLANE[scene.model.plane]]
    return [i for i in range(3) if all(is_zero(turned[i][k]) for k in across)]


def carrier_in_plane(scene: Scene, *tips: int) -> int:
    """The link nearest to these that carries them, if its axes are those of the plane; else the
    ground."""
    carrier, _ = nearest_carrier(scene.links, *tips)
    return carrier if axes_in_plane(scene, carrier) == [*IN_PLANE[scene.model.plane]] else -1
