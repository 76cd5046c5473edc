"""Forces on points of bodies."""

from __future__ import annotations

import casadi as ca

from derive.expressions.scalars import Vector
from derive.joints.rotations import cross
from derive.mechanics.loads.records import (
    Applied,
    Law,
    components_in_ground,
    couples_alone,
    force_alone,
    in_ground,
    in_link,
)
from derive.mechanics.recursions.tree import link_point
from derive.mechanics.scene import Scene
from derive.model.load_records import Force


def force(scene: Scene, load: Force) -> Applied:
    """A force (N) with these components."""
    s = scene.symbols
    return pushed(scene, load.body, s.vector(load.point), load.frame, s.vector(load.components))


def pushed(scene: Scene, body: str, point: Vector, frame: str, components: Vector) -> Applied:
    """Jᵀ f with J v the velocity of the point, f in ground axes: its power is f · J v. Of far links
    (r × f, f) is handed down from link to link instead."""
    s = scene.symbols
    place = scene.places[body]
    if scene.is_deep(place.link):
        given = in_link(scene, body, frame, components)
        return couples_alone(scene, {place.link: (cross(link_point(place, point), given), given)})
    on_ground = ca.vertcat(*in_ground(scene, body, point))
    applied = ca.vertcat(*components_in_ground(scene, body, frame, components))
    velocity = ca.jtimes(on_ground, s.q, scene.qdot)
    return force_alone(scene, ca.jtimes(velocity, s.v, applied, True))


FORCE = Law(Force, force)
