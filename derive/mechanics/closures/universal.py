"""Crosses that close a loop."""

from __future__ import annotations

import casadi as ca

from derive.expressions.scalars import Vector
from derive.joints.rotations import (
    matrix,
    rotated,
)
from derive.mechanics.closures.parts import meeting
from derive.mechanics.closures.records import Closing
from derive.mechanics.geometry.frames import (
    ground_rotation,
)
from derive.mechanics.links import placement
from derive.mechanics.rows import block_of_positions
from derive.mechanics.scene import Block, Scene
from derive.model.records import (
    Closure,
    Placement,
)


def universal(scene: Scene, closure: Closure) -> list[Block]:
    """The cross: the points meet, and the axis fixed in the first body stays at right angles to the
    one fixed in the second, φ = e₁ · e₂. 4 rows."""
    s = scene.symbols
    axes = (closure.axis, closure.axis2 or closure.axis)
    ground = [
        _in_ground(scene, body, at, s.vector(e))
        for body, at, e in zip(closure.bodies, closure.placements, axes)
    ]
    cross_angle = block_of_positions(scene, [f"{closure.name}.cross"], [ca.dot(*ground)], "rad/s")
    return [meeting(scene, closure), cross_angle]


def _in_ground(scene: Scene, body: str, at: Placement, direction: Vector) -> ca.SX:
    place = scene.places[body]
    inside = rotated(matrix(placement(scene.symbols, at)[0]), direction)
    return ca.vertcat(*rotated(ground_rotation(scene, place), inside))


UNIVERSAL = Closing("universal", universal)
