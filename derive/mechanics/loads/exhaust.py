"""The thrust of matter that leaves a body."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import scaled
from derive.mechanics.loads.force import pushed
from derive.mechanics.loads.records import Applied, Law
from derive.mechanics.scene import Scene
from derive.model.load_records import Exhaust


def thrust(scene: Scene, load: Exhaust) -> Applied:
    """ṁ u at the point where the matter leaves: Meshchersky's equation, m v̇ = F + ṁ u, with u its
    velocity relative to the body and ṁ < 0. What is left of the body is at rest in it: the flow
    inside has no momentum of its own (no Coriolis force, no jet damping)."""
    s = scene.symbols
    rate = ca.jtimes(ca.SX(s.scalar(load.mass)), s.t, ca.SX(1))
    jet = scaled(rate, s.vector(load.velocity))
    return pushed(scene, load.body, s.vector(load.point), "body", jet)


EXHAUST = Law(Exhaust, thrust)
