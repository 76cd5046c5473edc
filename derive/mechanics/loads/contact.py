"""Penalty contact with friction.

The height g of the shape's lowest point C + a above the plane; depth δ = max(0, −g). Stored energy
½ k δ², damping k δ (max(0, 1 + d δ̇) − 1) along ∂ġ/∂v, friction along the slip of the two material
points that touch (K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440–445).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.frames import angular_velocity, ground_rotation, on_ground
from derive.mechanics.loads.records import Applied, Law
from derive.mechanics.scene import IN_PLANE, NORMAL, Scene
from derive.mechanics.surfaces import surface_over
from derive.model.load_records import Contact
from derive.model.space import ORIGIN


@dataclass(frozen=True)
class Touch:
    """Height above the plane (m), its normal and the arm from the shape's centre to its lowest
    point, in ground axes."""

    height: ca.SX
    normal: ca.SX
    arm: ca.SX


def contact(scene: Scene, load: Contact) -> Applied:
    """½ k δ², and the forces that dissipate."""
    s = scene.symbols
    touch = _touch(scene, load)
    k, d = s.scalar(load.stiffness), s.scalar(load.damping)
    depth = ca.fmax(0, -touch.height)
    energy = ca.SX(0.5 * k * depth * depth)
    rate = scene.rate(touch.height)
    factor = ca.fmax(0, 1 - d * rate)
    damping = ca.SX(k * depth * (factor - 1)) * ca.jacobian(rate, s.v).T
    slip = _slip(scene, load, touch)
    rubbing = k * depth * factor * _grip(scene, load, touch, slip)
    return Applied(energy, damping + ca.jtimes(slip, s.v, rubbing, True))


def _grip(scene: Scene, load: Contact, touch: Touch, slip: ca.SX) -> ca.SX:
    """The force along the plane per pressure: against the slip, or as a tyre has it."""
    s = scene.symbols
    smoothing = s.scalar(load.smoothing)
    if not load.tyre:
        size = ca.sqrt(ca.dot(slip, slip) + smoothing**2)
        return -s.scalar(load.friction) * slip / size
    forward, sideways = _along(scene, load, touch)
    travel = ca.dot(forward, _against(scene, load, ca.SX.zeros(3)))
    speed = ca.sqrt(travel**2 + smoothing**2)
    slips = (ca.dot(forward, slip) / speed, ca.atan(ca.dot(sideways, slip) / speed))
    return -sum(
        (
            _curve(s.vector(law), x) * axis
            for law, x, axis in zip(load.tyre, slips, (forward, sideways))
        ),
        ca.SX.zeros(3),
    )


def _curve(law: Vector, x: ca.SX) -> Scalar:
    """B x, or D sin(C atan(B x − E (B x − atan(B x)))): the linear tyre, and Pacejka's."""
    if len(law) == 1:
        return law[0] * x
    B, C, D, E = law
    return D * ca.sin(C * ca.atan(B * x - E * (B * x - ca.atan(B * x))))


def _along(scene: Scene, load: Contact, touch: Touch) -> tuple[ca.SX, ca.SX]:
    """e × n/|…| and n × that; in a plane there is no sideways."""
    if scene.model.plane:
        forward = ca.cross(ca.vertcat(*NORMAL[scene.model.plane]), touch.normal)
        return forward, ca.SX.zeros(3)
    axis = ca.vertcat(*scene.symbols.vector(load.axis))
    forward = ca.cross(ca.mtimes(_rotation(scene, load.body), axis), touch.normal)
    forward = forward / ca.sqrt(ca.dot(forward, forward))
    return forward, ca.cross(touch.normal, forward)


def _touch(scene: Scene, load: Contact) -> Touch:
    s = scene.symbols
    centre = on_ground(scene, load.body, load.centre)
    R = _rotation(scene, load.carrier)
    if load.surface is not None:
        return _on_surface(scene, load, centre, R)
    normal = ca.mtimes(R, ca.vertcat(*s.vector(load.normal)))
    arm = _arm(scene, load, normal)
    gap = centre + arm - on_ground(scene, load.carrier, load.origin)
    return Touch(ca.dot(normal, gap), normal, arm)


def _rotation(scene: Scene, body: str) -> ca.SX:
    """Ground ← body."""
    rows = ground_rotation(scene, scene.places[body])
    return ca.vertcat(*[ca.horzcat(*row) for row in rows])


def _arm(scene: Scene, load: Contact, normal: ca.SX) -> ca.SX:
    """From the centre to the lowest point."""
    s = scene.symbols
    radius = s.scalar(load.radius)
    if load.shape == "point":
        return ca.SX.zeros(3)
    if load.shape == "sphere" or scene.model.plane:
        return -radius * normal
    axis = ca.mtimes(_rotation(scene, load.body), ca.vertcat(*s.vector(load.axis)))
    down = ca.dot(normal, axis) * axis - normal
    return radius * down / ca.sqrt(ca.dot(down, down))


def _on_surface(scene: Scene, load: Contact, centre: ca.SX, R: ca.SX) -> Touch:
    """f/|∇f| at the centre less the radius: the height to first order."""
    assert load.surface is not None
    s = scene.symbols
    f, point = surface_over(scene, load.surface, load.span)
    slope = ca.gradient(f, point)
    axes = IN_PLANE[scene.model.plane]
    size = ca.sqrt(sum(slope[i] * slope[i] for i in axes))
    inside = ca.mtimes(R.T, centre - on_ground(scene, load.carrier, ORIGIN))
    height, along = ca.substitute([f / size, slope / size], [point], [inside])
    normal, radius = ca.mtimes(R, along), s.scalar(load.radius)
    return Touch(height - radius, normal, -radius * normal)


def _slip(scene: Scene, load: Contact, touch: Touch) -> ca.SX:
    """Velocity of the body's material point at the contact against the carrier's, along the
    plane."""
    velocity = _against(scene, load, touch.arm)
    return velocity - ca.dot(touch.normal, velocity) * touch.normal


def _against(scene: Scene, load: Contact, arm: ca.SX) -> ca.SX:
    """Velocity of the body's material point at an arm from the shape's centre, against the
    carrier's there."""
    centre = on_ground(scene, load.body, load.centre)
    base = on_ground(scene, load.carrier, ORIGIN)
    first, second = (_omega(scene, body) for body in (load.body, load.carrier))
    own = scene.rate(centre) + ca.cross(first, arm)
    return own - scene.rate(base) - ca.cross(second, centre + arm - base)


def _omega(scene: Scene, body: str) -> ca.SX:
    return ca.vertcat(*[ca.SX(x) for x in angular_velocity(scene, scene.places[body])])


CONTACT = Law(Contact, contact)
