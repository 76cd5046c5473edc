"""Free joint: six degrees of freedom; generalized velocities = linear and angular velocity in the
child's frame.

Position first, then orientation as Euler angles of any sequence (intrinsic) or as a unit quaternion
(FLOATING).
"""

from collections.abc import Sequence
from dataclasses import replace

from derive.expressions.scalars import Scalar, Vector
from derive.joints.ball import QUATERNION, quaternion_matrix, quaternion_rates, quaternion_rotation
from derive.joints.euler import ANGLES, angle_rates, distance_from_lock
from derive.joints.records import JointType, Rotation, Slot
from derive.joints.rotations import cross, matrix, rotated, sum_of
from derive.joints.turns import UNIT, euler_rotation


def _motion(q: Sequence[Scalar], axis: Sequence[Scalar]) -> list[Vector]:
    linear: list[Vector] = [[0.0, 0.0, 0.0, *UNIT[s]] for s in "xyz"]
    angular: list[Vector] = [[*UNIT[s], 0.0, 0.0, 0.0] for s in "xyz"]
    return linear + angular


def _turned(v: Sequence[Scalar], p: Sequence[Scalar]) -> Vector:
    """ω × P and ω × Π + v × P (Kirchhoff's equations)."""
    return [*cross(v[3:], p[:3]), *sum_of(cross(v[3:], p[3:]), cross(v[:3], p[:3]))]


def free_joint(sequence: str) -> JointType:
    """The free joint with Euler angles of the given intrinsic sequence, such as "zxy".

    q = (x, y, z, θ₁, θ₂, θ₃): position in the parent's axes, angles about axes that turn along. v =
    (v, ω) in the child's frame, so that M is constant for a single body.
    """

    def rotation(q: Sequence[Scalar], axis: Sequence[Scalar]) -> Rotation:
        """Parent ← child from the three Euler angles q[3:], turned one after the other about axes
        that turn along. `axis` is not used: every joint has this signature."""
        return euler_rotation(sequence, q[3:])

    def rates(q: Sequence[Scalar], v: Sequence[Scalar], axis: Sequence[Scalar]) -> Vector:
        """q̇ = (R v, E(θ)⁻¹ ω): the linear velocity of the child's frame goes to the parent's axes,
        and ω becomes rates of the angles.

        E is singular where the middle angle makes first and last axis parallel (gimbal lock): a
        pivot of the joint and not of the mechanics.
        """
        return [*rotated(matrix(rotation(q, axis)), v[:3]), *angle_rates(sequence, q[3:], v[3:])]

    return JointType(
        name="free",
        about="six degrees of freedom; generalized velocities in the body's frame",
        coordinates=(*(Slot(s, "m") for s in "xyz"), *ANGLES),
        velocities=tuple(Slot(f"v{s}", "m/s") for s in "xyz")
        + tuple(Slot(f"w{s}", "rad/s") for s in "xyz"),
        needs_axis=False,
        rotation=rotation,
        translation=lambda q, axis: list(q[:3]),
        motion=_motion,
        rates=rates,
        lock=lambda q: distance_from_lock(sequence, q[3:]),
        turned=_turned,
    )


def _floating_rotation(q: Sequence[Scalar], axis: Sequence[Scalar]) -> Rotation:
    return quaternion_rotation(q[3:])


def _floating_rates(q: Sequence[Scalar], v: Sequence[Scalar], axis: Sequence[Scalar]) -> Vector:
    return [*rotated(quaternion_matrix(q[3:]), v[:3]), *quaternion_rates(q[3:], v[3:])]


FREE = free_joint("zyx")

FLOATING = replace(
    FREE,
    about="six degrees of freedom with a unit quaternion (w, x, y, z); generalized velocities "
    "in the body's frame",
    coordinates=(*FREE.coordinates[:3], *QUATERNION),
    rotation=_floating_rotation,
    rates=_floating_rates,
    unit_from=3,
    lock=None,
)
