"""Applied forces: potentials of springs and the generalised forces of everything else, conjugate to the base velocities."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.joints.records import Vector
from derive.joints.rotations import rotated
from derive.mechanics.constraints import Scene
from derive.mechanics.tree import ground_point, link_direction
from derive.model.records import Force, GeneralisedForce, JointDamper, JointSpring, Load, PointSpring, Torque


@dataclass(frozen=True)
class Applied:
    """`energy` is a potential; `force` (nv × 1) is conjugate to v and has no potential."""

    energy: ca.SX
    force: ca.SX


def applied(scene: Scene) -> Applied:
    """Sum over the loads and inputs of the model."""
    energy, force = ca.SX(0), ca.SX.zeros(scene.symbols.v.numel())
    for load in scene.model.loads:
        one = _load(scene, load)
        energy, force = energy + one.energy, force + one.force
    for item in scene.model.inputs:
        if item.velocity:
            force = force + along(scene, item.velocity, scene.symbols.names[item.name])
    return Applied(energy, scene.over_v(force))


def along(scene: Scene, velocity: str, force: ca.SX) -> ca.SX:
    """A force conjugate to one base velocity or, for a coordinate whose rate is none, to that rate: Nᵀ e f."""
    for j, v in enumerate(scene.model.velocities):
        if v.name == velocity or (v.rate_of and velocity == f"der({v.rate_of})"):
            return _unit(scene.symbols.v.numel(), j, force)
    name = velocity.removeprefix("der(").removesuffix(")")
    i = next(i for i, c in enumerate(scene.model.coordinates) if c.name == name)
    return ca.jacobian(scene.qdot[i], scene.symbols.v).T * force


def _unit(n: int, j: int, x: ca.SX) -> ca.SX:
    result = ca.SX.zeros(n)
    result[j] = x
    return result


def _load(scene: Scene, load: Load) -> Applied:
    match load:
        case JointSpring():
            return _joint_spring(scene, load)
        case JointDamper():
            return _joint_damper(scene, load)
        case PointSpring():
            return _point_spring(scene, load)
        case Force():
            return _force(scene, load)
        case Torque():
            return _torque(scene, load)
        case GeneralisedForce():
            force = ca.SX(scene.symbols.scalar(load.expression))
            return _only(scene, along(scene, load.velocity, force))


def _only(scene: Scene, force: ca.SX) -> Applied:
    return Applied(ca.SX(0), force)


def _joint_spring(scene: Scene, load: JointSpring) -> Applied:
    """½ k (q − rest)²."""
    s = scene.symbols
    stretch = s.names[load.coordinate] - s.scalar(load.rest)
    return Applied(ca.SX(0.5 * s.scalar(load.stiffness) * stretch * stretch), ca.SX.zeros(s.v.numel()))


def _joint_damper(scene: Scene, load: JointDamper) -> Applied:
    """−d times the rate."""
    rate = scene.symbols.rates.get(load.velocity.removeprefix("der(").removesuffix(")"))
    if rate is None:
        rate = scene.symbols.names[load.velocity]
    return _only(scene, along(scene, load.velocity, -scene.symbols.scalar(load.coefficient) * rate))


def _point_spring(scene: Scene, load: PointSpring) -> Applied:
    """½ k (d − length)² and, through d = |p₂ − p₁|, the damping force −damping ḋ ∂d/∂q."""
    s = scene.symbols
    ends = [_ground(scene, body, s.vector(point)) for body, point in zip(load.bodies, load.points)]
    gap = ca.vertcat(*[b - a for a, b in zip(*ends)])
    distance = ca.sqrt(ca.dot(gap, gap))
    stretch = distance - s.scalar(load.length)
    energy = 0.5 * s.scalar(load.stiffness) * stretch * stretch
    damping = s.scalar(load.damping)
    if not isinstance(damping, ca.SX) and damping == 0:
        return Applied(energy, ca.SX.zeros(s.v.numel()))
    rate = scene.rate(distance)
    return Applied(energy, -damping * rate * ca.jacobian(rate, s.v).T)


def _ground(scene: Scene, body: str, point: Vector) -> Vector:
    return ground_point(scene.places[body], point, scene.positions, scene.rotations)


def _force(scene: Scene, load: Force) -> Applied:
    """Jᵀ f with J v the velocity of the point."""
    s = scene.symbols
    point = ca.vertcat(*_ground(scene, load.body, s.vector(load.point)))
    force = ca.vertcat(*_in_ground(scene, load.body, load.frame, s.vector(load.components)))
    velocity = ca.jtimes(point, s.q, scene.qdot)
    return _only(scene, ca.jtimes(velocity, s.v, force, True))


def _in_ground(scene: Scene, body: str, frame: str, components: Vector) -> Vector:
    place = scene.places[body]
    if frame != "body" or place.link < 0:
        return components
    return rotated(scene.rotations[place.link], link_direction(place, components))


def _torque(scene: Scene, load: Torque) -> Applied:
    """Conjugate to the body's angular velocity: Σ columns of Jω, found from the links' own recursion."""
    s = scene.symbols
    place = scene.places[load.body]
    if place.link < 0:
        return _only(scene, ca.SX.zeros(s.v.numel()))
    torque = ca.vertcat(*_in_ground(scene, load.body, load.frame, s.vector(load.components)))
    omega = ca.vertcat(*rotated(scene.rotations[place.link], scene.omegas[place.link]))
    return _only(scene, ca.jtimes(omega, s.v, torque, True))
