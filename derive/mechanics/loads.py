"""Applied forces: potentials of springs and the generalised forces of everything else, conjugate to
the generalized velocities."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.joints.records import Vector
from derive.joints.rotations import rotated
from derive.mechanics.constraints import Scene, joint_frame
from derive.mechanics.tree import ground_point, link_direction
from derive.model.records import (
    Armature,
    Bushing,
    Force,
    GeneralisedForce,
    JointDamper,
    JointFriction,
    JointSpring,
    Load,
    PointSpring,
    Torque,
)


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
            gear = scene.symbols.scalar(item.gear)
            force = force + along(scene, item.velocity, gear * scene.symbols.names[item.name])
    return Applied(energy, scene.over_v(force))


def along(scene: Scene, velocity: str, force: ca.SX) -> ca.SX:
    """A force conjugate to one generalized velocity or, for a coordinate whose rate is none, to
    that rate: Nᵀ e f."""
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
        case Bushing():
            return _bushing(scene, load)
        case JointFriction():
            return _joint_friction(scene, load)
        case Armature():
            return Applied(
                ca.SX(0), ca.SX.zeros(scene.symbols.v.numel())
            )  # an inertia, see `armatures`
        case GeneralisedForce():
            force = ca.SX(scene.symbols.scalar(load.expression))
            return _only(scene, along(scene, load.velocity, force))


def _only(scene: Scene, force: ca.SX) -> Applied:
    return Applied(ca.SX(0), force)


def _joint_spring(scene: Scene, load: JointSpring) -> Applied:
    """½ k (q − rest)²."""
    s = scene.symbols
    stretch = s.names[load.coordinate] - s.scalar(load.rest)
    return Applied(
        ca.SX(0.5 * s.scalar(load.stiffness) * stretch * stretch), ca.SX.zeros(s.v.numel())
    )


def _joint_damper(scene: Scene, load: JointDamper) -> Applied:
    """−d times the rate."""
    return _only(
        scene,
        along(
            scene,
            load.velocity,
            -scene.symbols.scalar(load.coefficient) * _rate(scene, load.velocity),
        ),
    )


def _rate(scene: Scene, velocity: str) -> ca.SX:
    """A generalized velocity, or the rate of a coordinate, by name."""
    rate = scene.symbols.rates.get(velocity.removeprefix("der(").removesuffix(")"))
    return scene.symbols.names[velocity] if rate is None else rate


def _joint_friction(scene: Scene, load: JointFriction) -> Applied:
    """−viscous v − coulomb tanh(v/smoothing): Coulomb friction made smooth."""
    s, rate = scene.symbols, _rate(scene, load.velocity)
    force = -s.scalar(load.viscous) * rate - s.scalar(load.coulomb) * ca.tanh(
        rate / s.scalar(load.smoothing)
    )
    return _only(scene, along(scene, load.velocity, ca.SX(force)))


def _bushing(scene: Scene, load: Bushing) -> Applied:
    """A soft weld: ½ Σ kᵢ dᵢ² + ½ Σ κᵢ θᵢ² and the dampings, in the first body's joint frame.

    d is the second origin's displacement, θ = ½ Σ aᵢ × bᵢ of the two frames' axes: the rotation
    vector while it is small.
    """
    s = scene.symbols
    frames = [joint_frame(scene, body, at, ()) for body, at in zip(load.bodies, load.placements)]
    (start, a), (end, b) = frames
    turn = 0.5 * sum((ca.cross(x, y) for x, y in zip(a, b)), ca.SX.zeros(3))
    parts = [(ca.vertcat(*[ca.dot(e, end - start) for e in a]), load.stiffness, load.damping)]
    parts.append((ca.vertcat(*[ca.dot(e, turn) for e in a]), load.torsion, load.torsion_damping))
    energy, force = ca.SX(0), ca.SX.zeros(s.v.numel())
    for deflection, stiffness, damping in parts:
        energy += 0.5 * ca.dot(ca.vertcat(*s.vector(stiffness)), deflection * deflection)
        rate = scene.rate(deflection)
        force -= ca.jtimes(rate, s.v, ca.vertcat(*s.vector(damping)) * rate, True)
    return Applied(energy, force)


def armatures(scene: Scene) -> ca.SX:
    """Rotor inertias on the diagonal of M: the rotor turns with the joint's generalized
    velocity."""
    result = ca.SX(scene.symbols.v.numel(), scene.symbols.v.numel())
    names = [v.name for v in scene.model.velocities]
    for load in scene.model.loads:
        if isinstance(load, Armature):
            j = names.index(load.velocity)
            result[j, j] += scene.symbols.scalar(load.inertia)
    return result


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
    """Conjugate to the body's angular velocity: Σ columns of Jω, found from the links' own
    recursion."""
    s = scene.symbols
    place = scene.places[load.body]
    if place.link < 0:
        return _only(scene, ca.SX.zeros(s.v.numel()))
    torque = ca.vertcat(*_in_ground(scene, load.body, load.frame, s.vector(load.components)))
    omega = ca.vertcat(*rotated(scene.rotations[place.link], scene.omegas[place.link]))
    return _only(scene, ca.jtimes(omega, s.v, torque, True))
