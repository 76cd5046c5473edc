"""Forces on points of bodies."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.loads.records import (
    Applied,
    Law,
    components_in_ground,
    force_alone,
    in_ground,
)
from derive.mechanics.scene import Scene
from derive.model.load_records import Force


def force(scene: Scene, load: Force) -> Applied:
    """Jᵀ f with J v the velocity of the point, f in ground axes (N): its power is f · J v."""
    s = scene.symbols
    point = ca.vertcat(*in_ground(scene, load.body, s.vector(load.point)))
    applied = ca.vertcat(
        *components_in_ground(scene, load.body, load.frame, s.vector(load.components))
    )
    velocity = ca.jtimes(point, s.q, scene.qdot)
    return force_alone(scene, ca.jtimes(velocity, s.v, applied, True))


FORCE = Law(Force, force)
