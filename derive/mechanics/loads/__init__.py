"""Applied forces: potentials of springs and the generalised forces of everything else, conjugate to
the generalized velocities.

One file each, one line each in LAWS. The language half of a load is one file in derive/model/loads.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.one_sided import gradient
from derive.joints.rotations import dot
from derive.joints.rotations import plus as plus_of
from derive.mechanics.loads.armature import ARMATURE, armatures
from derive.mechanics.loads.bushing import BUSHING
from derive.mechanics.loads.contact import CONTACT
from derive.mechanics.loads.damper import JOINT_DAMPER
from derive.mechanics.loads.exhaust import EXHAUST
from derive.mechanics.loads.expression import EXPRESSION
from derive.mechanics.loads.force import FORCE
from derive.mechanics.loads.friction import JOINT_FRICTION
from derive.mechanics.loads.records import NONE, Applied, Couples, Law, all_of, along, plus
from derive.mechanics.loads.spring import BALL_SPRING, JOINT_SPRING, POINT_SPRING
from derive.mechanics.loads.tension import TENSION
from derive.mechanics.loads.torque import TORQUE
from derive.mechanics.loads.wrench import WRENCH
from derive.mechanics.records import Pushed
from derive.mechanics.recursions.tree import Wrench, joint_forces
from derive.mechanics.scene import Scene
from derive.model.rows import row_names

__all__ = ["LAWS", "Applied", "Law", "Loads", "along", "applied", "armatures", "by_links"]

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


@dataclass(frozen=True)
class Loads:
    """Of all loads and inputs together: the potential energy `stored` (J); of it `sloped`, of which
    no force is formed here, as the assembly differentiates it; `force` (nv), everything else,
    conjugate to v; and the `power` (W) of what has no potential."""

    stored: ca.SX
    sloped: ca.SX
    force: ca.SX
    power: ca.SX


@dataclass
class _Sum:
    """What the loads contribute, so far. Couples are added up at the end."""

    stored: ca.SX
    sloped: ca.SX
    force: ca.SX
    reacting: ca.SX
    lost: list[Couples]
    pulls: list[Couples]
    reacting_couples: list[Couples]


def _sum(scene: Scene) -> _Sum:
    """Of all loads and inputs."""
    nv = scene.symbols.v.numel()
    total = _Sum(ca.SX(0), ca.SX(0), ca.SX.zeros(nv), ca.SX.zeros(nv), [], [], [])
    reactions = scene.symbols.reactions(row_names(scene.model))
    for load in scene.model.loads:
        one = LAW_OF[type(load)](scene, load)
        total.stored, total.sloped = total.stored + one.stored, total.sloped + one.energy
        if reactions.numel() and ca.depends_on(one.every_force, reactions):
            total.reacting = plus(total.reacting, one.force)
            total.reacting_couples.append(one.couples)
        else:
            total.force = plus(total.force, one.force)
            total.lost.append(one.couples)
        total.pulls.append(one.pulls)
    for item in scene.model.inputs:
        if item.velocity:
            gear = scene.symbols.scalar(item.gear)
            driven = gear * scene.symbols.names[item.name]
            total.force = plus(total.force, along(scene, item.velocity, driven))
    return total


def applied(scene: Scene) -> tuple[Loads, ca.SX]:
    """The loads, and apart from them the forces, conjugate to v (nv), that use reactions of the
    ideal problem."""
    total = _sum(scene)
    couples = all_of(*total.lost)
    power = ca.dot(total.force, scene.symbols.v) + _power(scene, couples)
    force = plus(total.force, _carried(scene, all_of(couples, *total.pulls)))
    reacting = plus(total.reacting, _carried(scene, all_of(*total.reacting_couples)))
    return (
        Loads(
            total.stored + total.sloped,
            total.sloped,
            scene.over_v(force),
            scene.over_v(power),
        ),
        scene.over_v(reacting),
    )


def by_links(scene: Scene) -> Pushed:
    """The loads of a scene with symbols for the links' poses. Raises AssumptionError where what
    acts on a link depends on more than that, or a joint's force on where a link is."""
    total, s = _sum(scene), scene.symbols
    if total.reacting_couples:
        raise AssumptionError("a force depends on reactions")
    N = ca.jacobian(scene.qdot, s.v)
    force = scene.over_v(total.force - ca.mtimes(N.T, gradient(total.sloped, s.q)))
    if ca.depends_on(ca.vertcat(force, total.sloped), ca.vertcat(*scene.cut)):
        raise AssumptionError("a force at a joint depends on where a body is")
    couples = all_of(*total.lost, *total.pulls)
    given = {x.element_hash() for x in ca.vertsplit(ca.vertcat(s.t, s.u, s.p))}
    for link, (moment, pushed) in couples.items():
        own = {x.element_hash() for x in ca.vertsplit(scene.cut[link])}
        every = ca.vertcat(*[ca.SX(x) for x in (*moment, *pushed)])
        if not {x.element_hash() for x in ca.symvar(every)} <= own | given:
            name = scene.links[link].name
            raise AssumptionError(f"what acts on {name} depends on other bodies or on coordinates")
    return Pushed(force, couples, scene.cut)


def _power(scene: Scene, couples: Couples) -> ca.SX:
    """Σ n · ω + f · v."""
    twists = [(scene.numbers[link], couple) for link, couple in couples.items()]
    given = [plus_of(dot(n, omega), dot(f, v)) for (omega, v), (n, f) in twists]
    return sum((ca.SX(x) for x in given), ca.SX(0))


def _carried(scene: Scene, couples: Couples) -> ca.SX:
    """Handed down from link to link; each joint takes what does work on it."""
    nv = scene.symbols.v.numel()
    if not couples:
        return ca.SX(nv, 1)
    none: Wrench = (NONE, NONE)
    every = [couples.get(i, none) for i in range(len(scene.links))]
    return ca.vertcat(*[ca.SX(x) for x in joint_forces(scene.links, every, nv)])
