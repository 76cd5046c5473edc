"""Rotors as the joints feel them: inertias, no forces."""

from __future__ import annotations

import casadi as ca

from derive.mechanics.loads.records import Applied, Law, force_alone
from derive.mechanics.scene import Scene
from derive.model.load_records import Armature


def nothing(scene: Scene, load: Armature) -> Applied:
    """No force: the inertia is in `armatures`."""
    return force_alone(scene, ca.SX(scene.symbols.v.numel(), 1))


def armatures(scene: Scene) -> ca.SX:
    """Rotor inertias on the diagonal of M (nv × nv): the rotor turns with the joint's generalized
    velocity. Its gyroscopic moment on the carrier is left out: only ½ J v² counts, and J v̇ where v
    is no rate, for the rotor has an angle of its own then."""
    result = ca.SX(scene.symbols.v.numel(), scene.symbols.v.numel())
    for load in scene.model.loads:
        if isinstance(load, Armature):
            j = scene.model.velocity_index(load.velocity)
            result[j, j] += scene.symbols.scalar(load.inertia)
    return result


ARMATURE = Law(Armature, nothing)
