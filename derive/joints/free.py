"""Free joint: six degrees of freedom; generalized velocities = linear and angular velocity in the
child's frame.

Position first, then orientation as Euler angles of any sequence (intrinsic) or as a unit quaternion
(FLOATING). Inverse of ω = Σ axisᵢ θ̇ᵢ in closed form: for a sequence i, j, k about different axes N
is regular away from θ₂ = ±90°, for i, j, i away from θ₂ = 0.
"""

from collections.abc import Sequence
from dataclasses import replace

from derive.expressions.scalars import Scalar, Vector
from derive.joints.ball import QUATERNION, quaternion_matrix, quaternion_rates, quaternion_rotation
from derive.joints.records import JointType, Rotation, Slot
from derive.joints.rotations import cross, dot, matrix, principal_rotation, rotated, transpose
from derive.joints.turns import UNIT, euler_rotation


def _angle_rates(sequence: str, angles: Sequence[Scalar], omega: Sequence[Scalar]) -> Vector:
    """θ̇ from ω: θ̇₁ and θ̇₂ along the dual axes, taken in the frame before the last turn where
    they are single components."""
    # components of ω in the frame before the last turn
    before = rotated(principal_rotation(sequence[2], angles[2]), omega)
    first = rotated(transpose(principal_rotation(sequence[1], angles[1])), UNIT[sequence[0]])
    second, third = UNIT[sequence[1]], UNIT[sequence[2]]
    across = cross(
        second, third
    )  # first = a across + b third, and a vanishes at the singular attitude
    theta1 = dot(across, before) / dot(across, first)
    return [theta1, dot(second, before), dot(third, before) - dot(third, first) * theta1]


def _motion(q: Sequence[Scalar], axis: Sequence[Scalar]) -> list[Vector]:
    linear: list[Vector] = [[0.0, 0.0, 0.0, *UNIT[s]] for s in "xyz"]
    angular: list[Vector] = [[*UNIT[s], 0.0, 0.0, 0.0] for s in "xyz"]
    return linear + angular


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
        return [*rotated(matrix(rotation(q, axis)), v[:3]), *_angle_rates(sequence, q[3:], v[3:])]

    return JointType(
        name="free",
        about="six degrees of freedom; generalized velocities in the body's frame",
        coordinates=tuple(Slot(s, "m") for s in "xyz")
        + tuple(Slot(f"angle{i}", "rad") for i in (1, 2, 3)),
        velocities=tuple(Slot(f"v{s}", "m/s") for s in "xyz")
        + tuple(Slot(f"w{s}", "rad/s") for s in "xyz"),
        needs_axis=False,
        rotation=rotation,
        translation=lambda q, axis: list(q[:3]),
        motion=_motion,
        rates=rates,
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
)
