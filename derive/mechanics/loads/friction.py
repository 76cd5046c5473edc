"""Viscous and dry friction of joints."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.loads.records import Applied, Law, along, force_alone, rate_of
from derive.mechanics.scene import Scene
from derive.model.load_records import JointFriction


def joint_friction(scene: Scene, load: JointFriction) -> Applied:
    """−viscous v − coulomb tanh(v/smoothing): Coulomb friction made smooth. Below the smoothing
    velocity it creeps where dry friction would stick."""
    s, rate = scene.symbols, rate_of(scene, load.velocity)
    force = -s.scalar(load.viscous) * rate - s.scalar(load.coulomb) * ca.tanh(
        rate / s.scalar(load.smoothing)
    )
    return force_alone(scene, along(scene, load.velocity, ca.SX(force)))


JOINT_FRICTION = Law(JointFriction, joint_friction)
