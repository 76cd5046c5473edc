"""Points that stay on surfaces."""

from __future__ import annotations

import casadi as ca

from derive.expressions.tree import ZERO
from derive.joints.rotations import (
    rotated,
    transpose,
)
from derive.mechanics.constraints.records import Tie
from derive.mechanics.geometry.frames import (
    ground_rotation,
    on_ground,
)
from derive.mechanics.geometry.surfaces import surface_over
from derive.mechanics.rows import block_of_positions
from derive.mechanics.scene import Block, Scene
from derive.model.constraint_records import OnSurface


def on_surface(scene: Scene, constraint: OnSurface) -> Block:
    """φ = surface(x, y, z) at the point, in the frame of the body that carries the surface. The
    unit of φ is that of the formula; its slope must not vanish on the surface, or the row does."""
    carrier = scene.places[constraint.frame_body]
    gap = on_ground(scene, constraint.body, constraint.point) - on_ground(
        scene, constraint.frame_body, (ZERO, ZERO, ZERO)
    )
    inside = rotated(transpose(ground_rotation(scene, carrier)), [gap[k] for k in range(3)])
    surface, at = surface_over(scene, constraint.surface, constraint.span)
    phi = ca.substitute(surface, at, ca.vertcat(*inside))
    return block_of_positions(scene, [constraint.name], [phi], "")


POINT_ON_SURFACE = Tie(OnSurface, on_surface)
