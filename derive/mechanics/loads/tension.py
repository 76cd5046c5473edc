"""Pulls along paths."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.geometry.paths import path_length
from derive.mechanics.loads.records import Applied, Law, force_alone
from derive.mechanics.scene import Scene
from derive.model.load_records import Tension


def tension(scene: Scene, load: Tension) -> Applied:
    """−T ∂l̇/∂v with the length l of the path: its power is −T l̇."""
    rate = scene.rate(ca.SX(path_length(scene, load.path)))
    pull = ca.SX(scene.symbols.scalar(load.tension))
    return force_alone(scene, -pull * ca.jacobian(rate, scene.symbols.v).T)


TENSION = Law(Tension, tension)
