"""Forces on points of bodies."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import cross
from derive.mechanics.loads.records import (
    Applied,
    Law,
    components_in_ground,
    couple_alone,
    force_alone,
    in_ground,
    in_link,
)
from derive.mechanics.scene import Scene
from derive.mechanics.tree import link_point
from derive.model.load_records import Force


def force(scene: Scene, load: Force) -> Applied:
    """Jᵀ f with J v the velocity of the point, f in ground axes (N): its power is f · J v. Of far
    links (r × f, f) is handed down from link to link instead."""
    s = scene.symbols
    place = scene.places[load.body]
    if scene.is_deep(place.link):
        given = in_link(scene, load.body, load.frame, s.vector(load.components))
        arm = link_point(place, s.vector(load.point))
        return couple_alone(scene, place.link, (cross(arm, given), given))
    point = ca.vertcat(*in_ground(scene, load.body, s.vector(load.point)))
    applied = ca.vertcat(
        *components_in_ground(scene, load.body, load.frame, s.vector(load.components))
    )
    velocity = ca.jtimes(point, s.q, scene.qdot)
    return force_alone(scene, ca.jtimes(velocity, s.v, applied, True))


FORCE = Law(Force, force)
