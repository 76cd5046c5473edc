"""Force laws by formula."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.loads.records import Applied, Law, along, force_alone
from derive.mechanics.scene import Scene
from derive.model.load_records import GeneralisedForce


def law(scene: Scene, load: GeneralisedForce) -> Applied:
    """The formula, conjugate to one generalized velocity."""
    force = ca.SX(scene.symbols.scalar(load.expression))
    return force_alone(scene, along(scene, load.velocity, force))


EXPRESSION = Law(GeneralisedForce, law)
