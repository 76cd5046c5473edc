"""Penalty contact with friction.

The height g of the shape's lowest point C + a above the plane; depth δ = max(0, −g). Stored energy
½ k δ², damping k δ (max(0, 1 + d δ̇) − 1) along ∂ġ/∂v, friction along the slip of the two material
points that touch (K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440–445).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.evaluate import casadi_functions, value
from derive.mechanics.frames import angular_velocity, ground_rotation, on_ground
from derive.mechanics.loads.records import Applied, Law
from derive.mechanics.scene import IN_PLANE, Scene
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
    size = ca.sqrt(ca.dot(slip, slip) + s.scalar(load.smoothing) ** 2)
    rubbing = -s.scalar(load.friction) * k * depth * factor * slip / size
    return Applied(energy, damping + ca.jtimes(slip, s.v, rubbing, True))


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
    s, point = scene.symbols, ca.SX.sym("point", 3)
    names = s.names | dict(zip("xyz", ca.vertsplit(point)))
    f = ca.SX(value(load.surface, names, s.rates, casadi_functions()))
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
    centre = on_ground(scene, load.body, load.centre)
    contact_point = centre + touch.arm
    base = on_ground(scene, load.carrier, ORIGIN)
    first, second = (_omega(scene, body) for body in (load.body, load.carrier))
    velocity = scene.rate(centre) + ca.cross(first, touch.arm)
    velocity -= scene.rate(base) + ca.cross(second, contact_point - base)
    return velocity - ca.dot(touch.normal, velocity) * touch.normal


def _omega(scene: Scene, body: str) -> ca.SX:
    return ca.vertcat(*[ca.SX(x) for x in angular_velocity(scene, scene.places[body])])


CONTACT = Law(Contact, contact)
