"""Springs at joints, in ball joints and between points."""

from __future__ import annotations

import casadi as ca

from derive.joints.rotations import difference
from derive.mechanics.limits import AT_REST
from derive.mechanics.loads.records import Applied, Law, in_ground
from derive.mechanics.paths import check_apart
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


BALL_SPRING = Law(BallSpring, ball_spring)
JOINT_SPRING = Law(JointSpring, joint_spring)
POINT_SPRING = Law(PointSpring, point_spring)
