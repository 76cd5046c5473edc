"""Massless rods."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.joints.rotations import rotated, times, transpose
from derive.mechanics.constraints.records import Tie
from derive.mechanics.geometry.frames import on_ground
from derive.mechanics.records import Rod, RowForm, TwistTerm
from derive.mechanics.recursions.tree import link_point
from derive.mechanics.rows import block_of_positions
from derive.mechanics.scene import NOTHING, Block, Scene
from derive.model.constraint_records import Distance


def distance(scene: Scene, constraint: Distance) -> Block:
    """φ = |p₂ − p₁| − length, in m. The distance and not its square: φ is a length then, but
    singular where the ends meet, which a rod of positive length excludes."""
    seen = scene.between(constraint.bodies)
    ends = [
        on_ground(seen, body, point) for body, point in zip(constraint.bodies, constraint.points)
    ]
    gap = ends[1] - ends[0]
    length = ca.SX(scene.symbols.scalar(constraint.length))
    size = ca.sqrt(ca.dot(gap, gap))
    block = block_of_positions(scene, [constraint.name], [size - length], "m/s")
    if ca.depends_on(length, scene.symbols.t):
        return block
    return replace(block, ways=(*block.ways, (_by_twists(scene, constraint, gap, size),)))


def _by_twists(scene: Scene, constraint: Distance, gap: ca.SX, size: ca.SX) -> RowForm:
    """e · (v₂ + ω₂ × r₂) − e · (v₁ + ω₁ × r₁) = 0 along the rod e. Of a long mechanism such a row
    speaks of two links, and not of all velocities on the way to them."""
    along: Vector = [*ca.vertsplit(gap / size)]
    terms: list[TwistTerm] = []
    ends: list[tuple[float, Matrix]] = []
    for sign, body, point in zip((-1.0, 1.0), constraint.bodies, constraint.points):
        place = scene.places[body]
        if place.link < 0:
            continue
        R = scene.rotations[place.link]
        direction = [times(sign, x) for x in rotated(transpose(R), along)]
        here = link_point(place, scene.symbols.vector(point))
        terms.append(TwistTerm(place.link, direction, here, NOTHING, "ground"))
        ends.append((sign, R))
    return RowForm(constraint.name, tuple(terms), rod=Rod(size, along, tuple(ends)))


DISTANCE = Tie(Distance, distance)
