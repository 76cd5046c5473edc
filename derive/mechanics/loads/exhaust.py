"""The thrust of matter that leaves a body."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.loads.force import force
from derive.mechanics.loads.records import Applied, Law
from derive.mechanics.scene import Scene
from derive.model.load_records import Exhaust, Force


def thrust(scene: Scene, load: Exhaust) -> Applied:
    """ṁ u at the point where the matter leaves: Meshchersky's equation, m v̇ = F + ṁ u, with u its
    velocity relative to the body and ṁ < 0. What is left of the body is at rest in it: the flow
    inside has no momentum of its own (no Coriolis force, no jet damping)."""
    rate = ca.jtimes(ca.SX(scene.symbols.scalar(load.mass)), scene.symbols.t, ca.SX(1))
    jet = Force(load.name, load.body, load.point, load.velocity, "body", load.span)
    return Applied(ca.SX(0), rate * force(scene, jet).force)


EXHAUST = Law(Exhaust, thrust)
