"""Massless rods."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.constraints.records import Tie
from derive.mechanics.frames import (
    on_ground,
)
from derive.mechanics.rows import block_of_positions
from derive.mechanics.scene import Block, Scene
from derive.model.constraint_records import Distance


def distance(scene: Scene, constraint: Distance) -> Block:
    """φ = |p₂ − p₁| − length, in m. The distance and not its square: φ is a length then, but
    singular where the ends meet, which a rod of positive length excludes."""
    seen = scene.between(constraint.bodies)
    ends = [
        on_ground(seen, body, point) for body, point in zip(constraint.bodies, constraint.points)
    ]
    gap = ends[1] - ends[0]
    length = scene.symbols.scalar(constraint.length)
    return block_of_positions(scene, [constraint.name], [ca.sqrt(ca.dot(gap, gap)) - length], "m/s")


DISTANCE = Tie(Distance, distance)
