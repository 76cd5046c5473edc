"""Applied forces: potentials of springs and the generalised forces of everything else, conjugate to
the generalized velocities.

One file each, one line each in LAWS. The language half of a load is one file in derive/model/loads.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca

from derive.joints.rotations import sum_of
from derive.mechanics.loads.armature import ARMATURE, armatures
from derive.mechanics.loads.bushing import BUSHING
from derive.mechanics.loads.contact import CONTACT
from derive.mechanics.loads.damper import JOINT_DAMPER
from derive.mechanics.loads.exhaust import EXHAUST
from derive.mechanics.loads.expression import EXPRESSION
from derive.mechanics.loads.force import FORCE
from derive.mechanics.loads.friction import JOINT_FRICTION
from derive.mechanics.loads.records import Applied, Law, along, plus
from derive.mechanics.loads.spring import BALL_SPRING, JOINT_SPRING, POINT_SPRING
from derive.mechanics.loads.tension import TENSION
from derive.mechanics.loads.torque import TORQUE
from derive.mechanics.loads.wrench import WRENCH
from derive.mechanics.scene import Scene
from derive.mechanics.tree import Wrench, joint_forces
from derive.model.rows import row_names

__all__ = ["LAWS", "Applied", "Law", "along", "applied", "armatures"]

LAWS = (
    JOINT_SPRING,
    BALL_SPRING,
    JOINT_DAMPER,
    POINT_SPRING,
    FORCE,
    TORQUE,
    BUSHING,
    JOINT_FRICTION,
    ARMATURE,
    EXPRESSION,
    WRENCH,
    TENSION,
    CONTACT,
    EXHAUST,
)
LAW_OF = {law.record: law.applied for law in LAWS}


def applied(scene: Scene) -> tuple[Applied, ca.SX]:
    """The potential energy V (J) of springs, bushings and contacts, and the forces without
    potential conjugate to v (nv), summed over loads and inputs; apart from them the forces that
    use reactions of the ideal problem. Of springs no force is formed here: the assembly
    differentiates V."""
    energy, force = ca.SX(0), ca.SX.zeros(scene.symbols.v.numel())
    reacting = ca.SX.zeros(scene.symbols.v.numel())
    reactions = scene.symbols.reactions(row_names(scene.model))
    couples: dict[int, Wrench] = {}
    reacting_couples: dict[int, Wrench] = {}
    for load in scene.model.loads:
        one = LAW_OF[type(load)](scene, load)
        energy = energy + one.energy
        given = ca.vertcat(
            one.force, *[ca.SX(x) for n, f in one.couples.values() for x in (*n, *f)]
        )
        if reactions.numel() and ca.depends_on(given, reactions):
            reacting = plus(reacting, one.force)
            _add(reacting_couples, one.couples)
        else:
            force = plus(force, one.force)
            _add(couples, one.couples)
    force = plus(force, _carried(scene, couples))
    reacting = plus(reacting, _carried(scene, reacting_couples))
    for item in scene.model.inputs:
        if item.velocity:
            gear = scene.symbols.scalar(item.gear)
            driven = gear * scene.symbols.names[item.name]
            force = plus(force, along(scene, item.velocity, driven))
    return Applied(energy, scene.over_v(force)), scene.over_v(reacting)


def _add(total: dict[int, Wrench], couples: Mapping[int, Wrench]) -> None:
    for link, (moment, force) in couples.items():
        before = total.get(link)
        total[link] = (
            (sum_of(before[0], moment), sum_of(before[1], force)) if before else (moment, force)
        )


def _carried(scene: Scene, couples: Mapping[int, Wrench]) -> ca.SX:
    """Handed down from link to link; each joint takes what does work on it."""
    nv = scene.symbols.v.numel()
    if not couples:
        return ca.SX(nv, 1)
    none: Wrench = ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    every = [couples.get(i, none) for i in range(len(scene.links))]
    return ca.vertcat(*[ca.SX(x) for x in joint_forces(scene.links, every, nv)])
