"""Torques on bodies."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import rotated
from derive.mechanics.loads.records import (
    Applied,
    Law,
    components_in_ground,
    couples_alone,
    force_alone,
    in_link,
)
from derive.mechanics.scene import Scene
from derive.model.load_records import Torque


def torque(scene: Scene, load: Torque) -> Applied:
    """Jωᵀ n with Jω v the body's angular velocity in ground axes, n in N m: Σ columns of Jω, found
    from the links' own recursion; of far links (n, 0) is handed down from link to link."""
    s = scene.symbols
    place = scene.places[load.body]
    if place.link < 0:
        return force_alone(scene, ca.SX.zeros(s.v.numel()))
    if scene.is_deep(place.link):
        moment = in_link(scene, load.body, load.frame, s.vector(load.components))
        return couples_alone(scene, {place.link: (moment, [0.0, 0.0, 0.0])})
    applied = ca.vertcat(
        *components_in_ground(scene, load.body, load.frame, s.vector(load.components))
    )
    omega = ca.vertcat(*rotated(scene.rotations[place.link], scene.omegas[place.link]))
    return force_alone(scene, ca.jtimes(omega, s.v, applied, True))


TORQUE = Law(Torque, torque)
