"""Contact forces a second time: pressure and friction as forces on both bodies at the point of
contact, as numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from derive.model.load_records import Contact
from derive.model.records import GROUND
from hamel.verify.reference.closures import NORMAL
from hamel.verify.reference.layout import Layout, point_velocity
from hamel.verify.reference.states import State
from hamel.verify.reference.surfaces import surface_at
from hamel.verify.reference.vectors import Array, cross


@dataclass(frozen=True)
class Pressing:
    """Along z (nz): what follows from V = ½ k δ² (J), and what dissipates."""

    elastic: Array
    dissipative: Array
    V: float


@dataclass(frozen=True)
class Touch:
    """Height, the contact point from the ground's origin, the direction in which the height grows
    (its slope at the point `at`) and the normal."""

    height: float
    point: Array
    slope: Array
    at: Array
    normal: Array


def turning(load: Contact, plane: str, state: State) -> tuple[float, float]:
    """What changes its sign where the force of a contact goes on to another piece: the height, and
    1 − d times its rate, at which damping has taken all of the pressure."""
    touch = _touch(load, plane, state)
    climbing = touch.slope @ _relative(load, state, touch.at)
    return touch.height, float(1.0 - state.value(load.damping) * climbing)


def pressing(load: Contact, plane: str, place: Layout, state: State) -> Pressing:
    """k δ along the slope of the height; k δ (max(0, 1 + d δ̇) − 1) there as well; −μ N v/√(v² +
    ε²) along the slip."""
    touch = _touch(load, plane, state)
    depth = max(0.0, -touch.height)
    k, d, mu, smoothing = state.vector(
        (load.stiffness, load.damping, load.friction, load.smoothing)
    )
    climbing = touch.slope @ _relative(load, state, touch.at)
    factor = max(0.0, 1.0 - d * climbing)
    slip = _relative(load, state, touch.point)
    slip = slip - touch.normal * (touch.normal @ slip)
    grip = -mu * slip / np.hypot(np.linalg.norm(slip), smoothing)
    if load.tyre:
        grip = _tyre(load, plane, state, touch, slip)
    rubbing = k * depth * factor * grip
    push = _pair(load, place, state, touch.at, touch.slope)
    rub = _pair(load, place, state, touch.point, rubbing)
    return Pressing(
        k * depth * push, k * depth * (factor - 1.0) * push + rub, float(0.5 * k * depth**2)
    )


def _tyre(load: Contact, plane: str, state: State, touch: Touch, slip: Array) -> Array:
    """Against the slip forward over |v|, and against the slip angle sideways; v is the wheel
    centre's own speed forward."""
    frame = state.frames[load.body]
    centre = frame.origin + frame.point(state.vector(load.centre))
    e = NORMAL[plane] if plane else frame.rotation @ state.vector(load.axis)
    forward = cross(e, touch.normal)
    forward = forward / np.linalg.norm(forward)
    speed = np.hypot(forward @ _relative(load, state, centre), state.value(load.smoothing))
    sideways = cross(touch.normal, forward)
    slips = ((forward @ slip) / speed, np.arctan((sideways @ slip) / speed))
    forces = [_magic(state.vector(law), float(x)) for law, x in zip(load.tyre, slips)]
    return -forces[0] * forward - (0.0 if plane else forces[1]) * sideways


def _magic(law: Array, x: float) -> float:
    """Pacejka's y(x), or its slope times x."""
    if len(law) == 1:
        return float(law[0] * x)
    stiffness, shape, peak, curvature = law
    bent = (1.0 - curvature) * stiffness * x + curvature * np.arctan(stiffness * x)
    return float(peak * np.sin(shape * np.arctan(bent)))


def _pair(load: Contact, place: Layout, state: State, point: Array, force: Array) -> Array:
    """A force on the body at a point, and its opposite on the carrier."""
    result = np.zeros(place.size)
    for body, sign in ((load.body, 1.0), (load.carrier, -1.0)):
        if body != GROUND:
            arm = point - state.frames[body].origin
            result[place.twist(body)] += sign * point_velocity(arm).T @ force
    return result


def _relative(load: Contact, state: State, point: Array) -> Array:
    """Velocity of the body's material point against the carrier's."""
    first, second = state.frames[load.body], state.frames[load.carrier]
    return first.speed(point - first.origin) - second.speed(point - second.origin)


def _touch(load: Contact, plane: str, state: State) -> Touch:
    body, carrier = state.frames[load.body], state.frames[load.carrier]
    centre = body.origin + body.point(state.vector(load.centre))
    radius = state.value(load.radius)
    if load.surface is not None:
        return _on_surface(load, state, centre, radius)
    n = carrier.rotation @ state.vector(load.normal)
    point = centre
    if load.shape == "sphere" or (plane and load.shape == "disk"):
        point = centre - radius * n
    elif load.shape == "disk":
        e = body.rotation @ state.vector(load.axis)
        lowest = n - (n @ e) * e
        point = centre - radius * lowest / np.linalg.norm(lowest)
    height = n @ (point - carrier.origin - carrier.point(state.vector(load.origin)))
    return Touch(float(height), point, n, point, n)


def _on_surface(load: Contact, state: State, centre: Array, radius: float) -> Touch:
    """The slope of f/|∇f| is ∇f/|∇f| − f (∇∇f) ∇f/|∇f|³."""
    assert load.surface is not None
    carrier = state.frames[load.carrier]
    inside = carrier.rotation.T @ (centre - carrier.origin)
    f, gradient, hessian = surface_at(load.surface, state)(inside)
    size = np.linalg.norm(gradient)
    normal = carrier.rotation @ (gradient / size)
    slope = carrier.rotation @ (gradient / size - f * (hessian @ gradient) / size**3)
    return Touch(float(f / size - radius), centre - radius * normal, slope, centre, normal)
