"""Springs at joints, in ball joints and between points."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import difference, dot, scaled, times
from derive.mechanics.geometry.paths import check_apart
from derive.mechanics.limits import AT_REST
from derive.mechanics.loads.points import are_far, pair, point_of, position, velocity
from derive.mechanics.loads.records import Applied, Law, in_ground
from derive.mechanics.scene import Scene
from derive.model.load_records import BallSpring, JointSpring, PointSpring


def joint_spring(scene: Scene, load: JointSpring) -> Applied:
    """V = ½ k (q − rest)², in J."""
    s = scene.symbols
    stretch = s.names[load.coordinate] - s.scalar(load.rest)
    return Applied(
        ca.SX(0.5 * s.scalar(load.stiffness) * stretch * stretch), ca.SX.zeros(s.v.numel())
    )


def ball_spring(scene: Scene, load: BallSpring) -> Applied:
    """V = ½ Σ kᵢ φᵢ², φ the rotation vector of a unit quaternion (w, x, y, z): its length is the
    angle 2 atan2(|(x, y, z)|, |w|). Of equal k that is all that counts."""
    s = scene.symbols
    w, x, y, z = (s.names[name] for name in load.coordinates)
    # the angle over the sine, which is what comes of this, has a value at rest, too
    sine = ca.sqrt(x * x + y * y + z * z + AT_REST)
    angle = 2 * ca.atan2(sine, ca.fabs(w))
    if len(set(load.stiffness)) == 1:
        squares = s.scalar(load.stiffness[0]) * angle * angle
    else:
        k = ca.vertcat(*s.vector(load.stiffness))
        squares = ca.dot(k, ca.vertcat(x, y, z) ** 2) * (angle / sine) ** 2
    return Applied(ca.SX(0.5 * squares), ca.SX.zeros(s.v.numel()))


def point_spring(scene: Scene, load: PointSpring) -> Applied:
    """V = ½ k (d − length)² and, through d = |p₂ − p₁|, the damping force −damping ḋ ∂d/∂q carried
    over to v. Singular where the two points meet; ModelError where they always do. What carries
    both points is no part of it."""
    if are_far(scene, load.bodies):
        return _far(scene, load)
    s, near = scene.symbols, scene.among(load.bodies)
    ends = [in_ground(near, body, s.vector(point)) for body, point in zip(load.bodies, load.points)]
    apart = difference(ends[1], ends[0])
    check_apart(scene, apart, load.name, load.span)
    gap = ca.vertcat(*apart)
    distance = ca.sqrt(ca.dot(gap, gap))
    stretch = distance - s.scalar(load.length)
    energy = 0.5 * s.scalar(load.stiffness) * stretch * stretch
    damping = s.scalar(load.damping)
    if not isinstance(damping, ca.SX) and damping == 0:
        return Applied(energy, ca.SX.zeros(s.v.numel()))
    rate = scene.rate(distance)
    return Applied(energy, -damping * rate * ca.jacobian(rate, s.v).T)


def _far(scene: Scene, load: PointSpring) -> Applied:
    """The same from link to link: −(k (d − length) + damping ḋ) along the line."""
    s = scene.symbols
    first, second = (
        point_of(scene, body, s.vector(x)) for body, x in zip(load.bodies, load.points)
    )
    apart = difference(*(position(scene, x) for x in (second, first)))
    check_apart(scene, apart, load.name, load.span)
    distance = ca.sqrt(dot(apart, apart))
    along = [x / distance for x in apart]
    stretch = distance - s.scalar(load.length)
    pull = times(s.scalar(load.stiffness), stretch)
    moving = difference(velocity(scene, second), velocity(scene, first))
    drag = times(s.scalar(load.damping), dot(along, moving))
    return Applied(
        ca.SX(0),
        ca.SX.zeros(s.v.numel()),
        pair(scene, (second, first), scaled(drag, along)),
        stored=ca.SX(0.5 * pull * stretch),
        pulls=pair(scene, (second, first), scaled(pull, along)),
    )


BALL_SPRING = Law(BallSpring, ball_spring)
JOINT_SPRING = Law(JointSpring, joint_spring)
POINT_SPRING = Law(PointSpring, point_spring)
