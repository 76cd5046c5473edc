"""Applied forces in maximal coordinates z = (v, twist of each body), their potential energy and
their power."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from itertools import chain

import numpy as np

from derive.diagnostics import AssumptionError
from derive.expressions import tree
from derive.model.load_records import (
    Armature,
    BallSpring,
    Bushing,
    Contact,
    Exhaust,
    Force,
    GeneralisedForce,
    JointDamper,
    JointFriction,
    JointSpring,
    PointSpring,
    Tension,
    Torque,
    Wrench,
)
from derive.model.mechanism.named_frames import frame_named
from derive.model.records import GROUND, Body, Load, Model
from hamel.verify.reference.contact import pressing
from hamel.verify.reference.exhaust import lost, time_derivative
from hamel.verify.reference.jets import Jet, dot, joint_frame, product
from hamel.verify.reference.layout import Layout
from hamel.verify.reference.paths import pull
from hamel.verify.reference.rows import nonideal_force
from hamel.verify.reference.states import State, inertia_tensor, placed
from hamel.verify.reference.vectors import Array, cross, rotation_vector, skew, turn_slope


@dataclass(frozen=True)
class Applied:
    """Forces along z (nz): `weight` and `springs` follow from V (J), `other` do not; power = other
    · z (W). `summed` (J): the sizes of what V is a sum of, which may cancel."""

    weight: Array
    springs: Array
    other: Array
    V: float
    summed: float

    @property
    def total(self) -> Array:
        """All of them along z (nz), with a potential or without."""
        return self.weight + self.springs + self.other


@dataclass(frozen=True)
class _Part:
    """What one body or load contributes: by the field of Applied the entries of z that it acts on,
    and the forces there."""

    forces: dict[str, tuple[slice, Array]]
    V: float
    summed: float


def _only(V: float = 0.0, summed: float | None = None, **forces: tuple[slice, Array]) -> _Part:
    """The forces named, none besides."""
    return _Part(forces, V, abs(V) if summed is None else summed)


def _all(force: Array) -> tuple[slice, Array]:
    """The first entries of z, or all of them."""
    return slice(0, len(force)), force


@dataclass(frozen=True)
class Lagrange:
    """The analytic energies at one state: inertia (nv × nv) v̇ = force, energies T and V (J). The
    force is along z, or along v alone (nv).

    `power` is ∂(V − T)/∂t at held q and q̇; `odd` = T₁ + 2 T₀ (J) is what Jacobi's integral
    q̇·∂T/∂q̇ − T + V is less than T + V.
    """

    inertia: Array
    force: Array
    T: float
    V: float
    power: float
    odd: float


def applied(model: Model, place: Layout, state: State, nonideal: bool = True) -> Applied:
    """Gravity, loads, inputs and, unless left out, the constraints' own nonideal forces and the
    loads that use reactions, summed."""
    loads = (
        _load(load, model, place, state)
        for load in model.loads
        if nonideal or not uses_reactions(load)
    )
    driving = _drive(model, place, state, nonideal)
    return _summed(place, chain(_weights(model, place, state), loads, [driving]))


def weight(model: Model, place: Layout, state: State) -> Array:
    """Gravity alone, along z."""
    return _summed(place, _weights(model, place, state)).weight


def _weights(model: Model, place: Layout, state: State) -> Iterator[_Part]:
    gravity = np.zeros(3) if model.gravity is None else state.vector(model.gravity)
    still = _at_rest(model)
    for body in model.bodies:
        if body.name not in still:
            yield _weight(gravity, body, place, state)


def _summed(place: Layout, parts: Iterable[_Part]) -> Applied:
    """One after the other, each where it acts: time grows with their number alone."""
    total = {name: np.zeros(place.size) for name in ("weight", "springs", "other")}
    V = summed = 0.0
    for part in parts:
        for name, (where, force) in part.forces.items():
            total[name][where] += force
        V += part.V
        summed += part.summed
    return Applied(**total, V=V, summed=summed)


def names_in(record: object) -> Iterator[str]:
    """The names that the formulas of a record use, and those of what is in it."""
    if isinstance(record, tree.Expression):
        yield from (node.name for node in tree.walk(record) if isinstance(node, tree.Name))
    elif isinstance(record, tuple):
        for entry in record:
            yield from names_in(entry)
    elif is_dataclass(record):
        for field in fields(record):
            yield from names_in(getattr(record, field.name))


def uses_reactions(record: object) -> bool:
    """Whether a formula of a record, or of what is in it, names a reaction."""
    return any(name.startswith("reaction.") for name in names_in(record))


def _at_rest(model: Model) -> set[str]:
    """The ground and what is fixed to it: their weight does no work, V leaves out the constant."""
    result = {GROUND}
    for joint in model.joints:
        if joint.type == "fixed" and joint.parent in result:
            result.add(joint.child)
    return result


def _weight(gravity: Array, body: Body, place: Layout, state: State) -> _Part:
    """Force m g at the centre of mass; V = −m g · r."""
    frame, weight = state.frames[body.name], state.value(body.mass) * gravity
    arm = frame.point(state.vector(body.com))
    summed = float(np.abs(weight).sum() * (np.abs(frame.origin).sum() + np.abs(arm).sum()))
    force = place.twist(body.name), _wrench(arm, weight)
    return _only(-float(weight @ (frame.origin + arm)), summed, weight=force)


def _wrench(arm: Array, force: Array) -> Array:
    """(moment about the origin, force) of a force at `arm`."""
    return np.concatenate([cross(arm, force), force])


def _drive(model: Model, place: Layout, state: State, nonideal: bool) -> _Part:
    """Inputs on the velocity they are conjugate to, and nonideal constraint forces."""
    other = np.zeros(place.nv)
    if nonideal:
        other[:] = nonideal_force(model, state)
    for item, value in zip(model.inputs, state.u):
        if item.velocity:
            where, direction = _conjugate(model, state, item.velocity)
            other[where] += state.value(item.gear) * value * direction
    return _only(other=_all(other))


def _conjugate(model: Model, state: State, velocity: str) -> tuple[slice, Array]:
    """The entries of v, and g over them, with g · v the velocity that a force is conjugate to: a
    generalized velocity, or the rate der(q) of any coordinate."""
    j = model.conjugate_index(velocity)
    if j is not None:
        return slice(j, j + 1), np.ones(1)
    return state.entries(model.coordinate_index(velocity.removeprefix("der(").removesuffix(")")))


def _load(load: Load, model: Model, place: Layout, state: State) -> _Part:
    match load:
        case JointSpring() | BallSpring():
            return _sprung(load, model, state)
        case JointDamper() | JointFriction():
            return _resisted(load, model, state)
        case Armature():
            return _only()  # an inertia
        case Bushing():
            return _bushing(load, place, state)
        case GeneralisedForce():
            where, direction = _conjugate(model, state, load.velocity)
            return _only(other=(where, state.value(load.expression) * direction))
        case PointSpring():
            return _point_spring(load, place, state)
        case Force():
            arm = state.frames[load.body].point(state.vector(load.point))
            return _on_body(place, load.body, _wrench(arm, _components(load, model, state)))
        case Exhaust():
            frame = state.frames[load.body]
            rate = state.value(time_derivative(model, load.mass, state))
            jet = frame.rotation @ state.vector(load.velocity)
            arm = frame.point(state.vector(load.point))
            return _on_body(place, load.body, _wrench(arm, rate * jet))
        case Torque():
            return _on_body(
                place, load.body, np.concatenate([_components(load, model, state), np.zeros(3)])
            )
        case Contact() | Tension():
            return _touching(load, model, place, state)
        case Wrench():
            return _at_frame(load, model, place, state)
    raise AssumptionError(
        f"verify cannot derive the load '{load.name}' again: its reference does not know "
        f"{type(load).__name__}",
        "it takes a derivation of its own in hamel/verify/reference/loads.py",
    )


def _touching(load: Contact | Tension, model: Model, place: Layout, state: State) -> _Part:
    if isinstance(load, Tension):
        force = state.value(load.tension) * pull(load.path, model.plane, place, state)
        return _only(other=_all(force))
    press = pressing(load, model.plane, place, state)
    return _only(press.V, springs=_all(press.elastic), other=_all(press.dissipative))


def _at_frame(load: Wrench, model: Model, place: Layout, state: State) -> _Part:
    """A force at the frame's origin and a moment, on the frame's body."""
    frame = frame_named(model, load.frame)
    body = state.frames[frame.body]
    seat, turn = placed(state, frame.at)
    force, moment = state.vector(load.force), state.vector(load.moment)
    along = body.rotation @ turn if load.axes == "frame" else _axes(load.axes, model, state)
    force, moment = along @ force, along @ moment
    wrench = _wrench(body.point(seat), force)
    wrench[:3] += moment
    return _on_body(place, frame.body, wrench)


def _on_body(place: Layout, body: str, wrench: Array) -> _Part:
    return _only() if body == GROUND else _only(other=(place.twist(body), wrench))


def _components(load: Force | Torque, model: Model, state: State) -> Array:
    own = load.frame == "body"
    along = state.frames[load.body].rotation if own else _axes(load.frame, model, state)
    return along @ state.vector(load.components)


def _axes(name: str, model: Model, state: State) -> Array:
    """Axes of the ground, of a body, a joint or a frame, as columns in those of the ground."""
    frame = frame_named(model, name)
    _, turn = placed(state, frame.at)
    return turn if frame.body == GROUND else state.frames[frame.body].rotation @ turn


def _sprung(spring: JointSpring | BallSpring, model: Model, state: State) -> _Part:
    if isinstance(spring, BallSpring):
        return _ball_spring(spring, model, state)
    return _joint_spring(spring, model, state)


def _joint_spring(spring: JointSpring, model: Model, state: State) -> _Part:
    """V = ½ k (q − rest)², force −k (q − rest) along the coordinate, Nᵀ of it along v."""
    index = model.coordinate_index(spring.coordinate)
    stiffness, stretch = state.value(spring.stiffness), state.q[index] - state.value(spring.rest)
    where, row = state.entries(index)
    force = where, -stiffness * stretch * row
    return _only(0.5 * stiffness * stretch**2, springs=force)


def _ball_spring(spring: BallSpring, model: Model, state: State) -> _Part:
    """V = ½ Σ kᵢ φᵢ², φ the logarithm of the quaternion; the torque −J⁻ᵀ k φ about the joint's axes
    with the slope J⁻¹ = 1 + ½ φ̃ + (1/θ² − cot(θ/2)/(2 θ)) φ̃² of φ by turns about them."""
    h = np.array([state.q[model.coordinate_index(name)] for name in spring.coordinates])
    turn, stiffness = rotation_vector(h), state.vector(spring.stiffness)
    index = model.conjugate_index(spring.velocities[0])
    assert index is not None
    torque = -turn_slope(turn).T @ (stiffness * turn)
    V = 0.5 * float(turn @ (stiffness * turn))
    return _only(V, springs=(slice(index, index + 3), torque))


def _resisted(friction: JointDamper | JointFriction, model: Model, state: State) -> _Part:
    """−viscous r − coulomb tanh(r/smoothing) along the velocity r, or −d r of a damper."""
    where, direction = _conjugate(model, state, friction.velocity)
    rate = direction @ state.v[where]
    if isinstance(friction, JointDamper):
        drag = -state.value(friction.coefficient) * rate * direction
        return _only(other=(where, drag))
    viscous, coulomb, smoothing = state.vector(
        (friction.viscous, friction.coulomb, friction.smoothing)
    )
    drag = -(viscous * rate + coulomb * np.tanh(rate / smoothing)) * direction
    return _only(other=(where, drag))


def _bushing(bushing: Bushing, place: Layout, state: State) -> _Part:
    """V = ½ Σ k x² over the deflections x; forces −(k x + damping ẋ) ∂ẋ/∂z.

    Deflections: p₂ − p₁ and θ = ½ Σ aᵢ × bᵢ, along the axes aᵢ of the first joint frame.
    """
    frames = [
        joint_frame(place, state, body, at, np.eye(3))
        for body, at in zip(bushing.bodies, bushing.placements)
    ]
    (start, a), (end, b) = frames
    swung = [product(x, y).scaled(0.5) for x, y in zip(a, b)]
    shifts, turns = (
        [dot(x, end - start) for x in a],
        [dot(x, swung[0] + swung[1] + swung[2]) for x in a],
    )
    stiffness = state.vector((*bushing.stiffness, *bushing.torsion))
    damping = state.vector((*bushing.damping, *bushing.torsion_damping))
    return _elastic([*shifts, *turns], stiffness, damping)


def _elastic(deflections: list[Jet], stiffness: Array, damping: Array) -> _Part:
    """Springs and dampers over deflections x with ẋ = X z: V = ½ Σ k x², forces −(k x) X and
    −(damping ẋ) X."""
    over = np.array([x.over for x in deflections])
    value, rate = (np.array([getattr(x, name) for x in deflections]) for name in ("value", "rate"))
    springs, other = -(stiffness * value) @ over, -(damping * rate) @ over
    return _only(float(0.5 * stiffness @ value**2), springs=_all(springs), other=_all(other))


def _point_spring(spring: PointSpring, place: Layout, state: State) -> _Part:
    """Tension k (d − length) + damping ḋ along the line between the points; V = ½ k (d −
    length)²."""
    frames = [state.frames[body] for body in spring.bodies]
    arms = [frame.point(state.vector(point)) for frame, point in zip(frames, spring.points)]
    line = frames[1].origin + arms[1] - frames[0].origin - arms[0]
    distance = np.linalg.norm(line)
    unit = line / distance
    rate = unit @ (frames[1].speed(arms[1]) - frames[0].speed(arms[0]))
    stiffness, stretch = state.value(spring.stiffness), distance - state.value(spring.length)
    pull, drag = np.zeros(place.size), np.zeros(place.size)
    for body, sign, arm in zip(spring.bodies, (1.0, -1.0), arms):
        if body != GROUND:
            pull[place.twist(body)] += sign * stiffness * stretch * _wrench(arm, unit)
            drag[place.twist(body)] += (
                sign * state.value(spring.damping) * rate * _wrench(arm, unit)
            )
    return _only(float(0.5 * stiffness * stretch**2), springs=_all(pull), other=_all(drag))


def shrinking(model: Model, place: Layout, state: State) -> float:
    """∂(T + V)/∂t of bodies that lose mass, at held q and v (W)."""
    result = 0.0
    gravity = np.zeros(3) if model.gravity is None else state.vector(model.gravity)
    for load in model.loads:
        if isinstance(load, Exhaust):
            body, frame = lost(model, load.body, state), state.frames[load.body]
            twist = np.concatenate([frame.omega, frame.velocity])
            result += 0.5 * twist @ (body_inertia(body, state)[0] @ twist)
            result += _weight(gravity, body, place, state).V
    return float(result)


def body_inertia(body: Body, state: State) -> tuple[Array, Array]:
    """Newton–Euler of one body about its origin, ground axes: 6 × 6 inertia, and the
    velocity-dependent wrench 6.

    J α + m c × a and m (a + α × c), with ω × J ω and m ω × (ω × c).
    """
    frame, mass = state.frames[body.name], state.value(body.mass)
    c = frame.point(state.vector(body.com))
    about_com = frame.rotation @ inertia_tensor(state, body) @ frame.rotation.T
    about_origin = about_com + mass * ((c @ c) * np.eye(3) - np.outer(c, c))
    inertia = np.empty((6, 6))
    inertia[:3, :3], inertia[:3, 3:] = about_origin, mass * skew(c)
    inertia[3:, :3], inertia[3:, 3:] = -mass * skew(c), mass * np.eye(3)
    gyroscopic = np.concatenate(
        [
            cross(frame.omega, about_origin @ frame.omega),
            mass * cross(frame.omega, cross(frame.omega, c)),
        ]
    )
    return inertia, gyroscopic
