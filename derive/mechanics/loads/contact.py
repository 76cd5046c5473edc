"""Penalty contact with friction.

The height g of the shape's lowest point C + a above the plane; depth δ = max(0, −g). Stored energy
½ k δ², damping k δ (max(0, 1 + d δ̇) − 1) along ∂ġ/∂v, friction along the slip of the two material
points that touch (K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440–445).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.geometry.frames import angular_velocity, ground_rotation, on_ground
from derive.mechanics.geometry.surfaces import surface_over
from derive.mechanics.loads.points import (
    Point,
    are_far,
    pair,
    point_at,
    point_of,
    shifted,
    velocity,
)
from derive.mechanics.loads.records import NONE, Applied, Law, all_of
from derive.mechanics.scene import IN_PLANE, NORMAL, Scene
from derive.mechanics.symbols import Symbols
from derive.model.load_records import Contact
from derive.model.mechanism.space import ORIGIN


@dataclass(frozen=True)
class Touch:
    """Height above the plane (m), its normal and the arm from the shape's centre to its lowest
    point, in ground axes. `slope`: how the height grows where the point at `foot`, an arm like the
    other, moves."""

    height: ca.SX
    normal: ca.SX
    arm: ca.SX
    slope: ca.SX
    foot: ca.SX


def contact(scene: Scene, load: Contact) -> Applied:
    """½ k δ², and the forces that dissipate."""
    bodies = (load.body, load.carrier)
    if are_far(scene, bodies):
        return _far(scene, load)
    near = scene if scene.frame else scene.among(bodies)
    s = scene.symbols
    touch = _touch(near, load)
    rate = near.rate(touch.height)
    pressure, factor = _pressure(s, load, touch, rate)
    damping = ca.SX(pressure * (factor - 1)) * ca.jacobian(rate, s.v).T
    slip = _slip(near, load, touch)
    rubbing = pressure * factor * _grip(near, load, touch, slip)
    return Applied(_energy(s, load, touch), damping + ca.jtimes(slip, s.v, rubbing, True))


def _far(scene: Scene, load: Contact) -> Applied:
    """The same from link to link: ∂height/∂v is the velocity of the foot along the slope, as the
    lowest point moves along the plane alone."""
    s = scene.symbols
    touch = _touch(scene, load)
    feet = _points(scene, load, touch.foot)
    rate = ca.dot(touch.slope, _apart(scene, feet))
    pressure, factor = _pressure(s, load, touch, rate)
    slip = _slip(scene, load, touch)
    rubbing = pressure * factor * _grip(scene, load, touch, slip)
    damping = pair(scene, feet, _entries(pressure * (factor - 1) * touch.slope))
    return Applied(
        ca.SX(0),
        ca.SX.zeros(s.v.numel()),
        all_of(damping, pair(scene, _points(scene, load, touch.arm), _entries(rubbing))),
        stored=_energy(s, load, touch),
        pulls=pair(scene, feet, _entries(pressure * touch.slope)),
    )


def _depth(touch: Touch) -> ca.SX:
    return ca.fmax(0, -touch.height)


def _energy(s: Symbols, load: Contact, touch: Touch) -> ca.SX:
    return ca.SX(0.5 * s.scalar(load.stiffness) * _depth(touch) * _depth(touch))


def _pressure(s: Symbols, load: Contact, touch: Touch, rate: ca.SX) -> tuple[ca.SX, ca.SX]:
    """k δ, and the factor that damping makes of it."""
    factor = ca.fmax(0, 1 - s.scalar(load.damping) * rate)
    return ca.SX(s.scalar(load.stiffness) * _depth(touch)), factor


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
    return Touch(ca.dot(normal, gap), normal, arm, normal, arm)


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
    growth = ca.mtimes(R, ca.substitute(ca.gradient(f / size, point), point, inside))
    return Touch(height - radius, normal, -radius * normal, growth, ca.SX.zeros(3))


def _slip(scene: Scene, load: Contact, touch: Touch) -> ca.SX:
    """Velocity of the body's material point at the contact against the carrier's, along the
    plane."""
    velocity = _against(scene, load, touch.arm)
    return velocity - ca.dot(touch.normal, velocity) * touch.normal


def _against(scene: Scene, load: Contact, arm: ca.SX) -> ca.SX:
    """Velocity of the body's material point at an arm from the shape's centre, against the
    carrier's there."""
    if are_far(scene, (load.body, load.carrier)):
        return _apart(scene, _points(scene, load, arm))
    centre = on_ground(scene, load.body, load.centre)
    base = on_ground(scene, load.carrier, ORIGIN)
    first, second = (_omega(scene, body) for body in (load.body, load.carrier))
    own = scene.rate(centre) + ca.cross(first, arm)
    return own - scene.rate(base) - ca.cross(second, centre + arm - base)


def _points(scene: Scene, load: Contact, arm: ca.SX) -> tuple[Point, Point]:
    """Of the carrier and of the body, at an arm from the shape's centre."""
    centre = point_of(scene, load.body, scene.symbols.vector(load.centre))
    touching = shifted(scene, centre, _entries(arm))
    if scene.places[load.carrier].link < 0:
        return Point(-1, NONE), touching
    there = on_ground(scene, load.body, load.centre) + arm
    return point_at(scene, load.carrier, _entries(there)), touching


def _apart(scene: Scene, points: tuple[Point, Point]) -> ca.SX:
    """Velocity of the second against the first."""
    first, second = (ca.vertcat(*velocity(scene, point)) for point in points)
    return ca.SX(second - first)


def _entries(column: ca.SX) -> Vector:
    return [column[k] for k in range(3)]


def _omega(scene: Scene, body: str) -> ca.SX:
    return ca.vertcat(*[ca.SX(x) for x in angular_velocity(scene, scene.places[body])])


CONTACT = Law(Contact, contact)
