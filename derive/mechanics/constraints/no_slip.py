"""Knife edges and wheel pairs."""

from __future__ import annotations

from derive.mechanics.constraints.records import Tie
from derive.mechanics.records import Row, RowForm, TwistTerm
from derive.mechanics.recursions.tree import link_direction, link_point
from derive.mechanics.scene import NOTHING, Block, Scene
from derive.model.constraint_records import NoSlip


def no_slip(scene: Scene, constraint: NoSlip) -> Block:
    """d · (v + ω × r) = 0 in m/s: the point r of the body has no velocity along d, both fixed in
    the body. It is nonholonomic: there is no φ."""
    place = scene.places[constraint.body]
    point = link_point(place, scene.symbols.vector(constraint.point))
    direction = link_direction(place, scene.symbols.vector(constraint.direction))
    row = RowForm(constraint.name, (TwistTerm(place.link, direction, point, NOTHING),))
    return Block((Row(constraint.name, -1, "m/s"),), (), ((row,),))


NO_SLIP = Tie(NoSlip, no_slip)
