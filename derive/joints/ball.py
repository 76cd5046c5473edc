"""Ball joint: any rotation about a point, as a unit quaternion (w, x, y, z) or by Euler angles;
generalized velocity = ω in the child's frame.

q̇ = ½ q ∘ (0, ω). The rotation matrix divides by |q|², so that it is orthogonal for every
quaternion but zero; the norm is a matter for `normalise` and `project`, never for the equations of
motion.
"""

from collections.abc import Sequence
from dataclasses import replace

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.euler import ANGLES, angle_rates, distance_from_lock
from derive.joints.records import JointType, Rotation, Slot, Still, meeting
from derive.joints.rotations import cross, dot
from derive.joints.turns import euler_rotation

UNIT_VECTORS = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
QUATERNION = tuple(Slot(s, "1") for s in ("qw", "qx", "qy", "qz"))
SPIN = tuple(Slot(s, "rad/s") for s in ("wx", "wy", "wz"))


def quaternion_matrix(q: Sequence[Scalar]) -> Matrix:
    """R = 1 + (2/|q|²) (w [e]× + [e]× [e]×), e the vector part: parent ← child, 3 × 3.

    The division keeps R orthogonal where integration lets |q| drift, so that a norm that is
    slightly off stretches nothing.
    """
    w, x, y, z = q
    s = 2.0 / dot(q, q)
    sx, sy, sz = s * x, s * y, s * z
    wx, wy, wz, xx, xy, xz, yy, yz, zz = (
        w * sx,
        w * sy,
        w * sz,
        x * sx,
        x * sy,
        x * sz,
        y * sy,
        y * sz,
        z * sz,
    )
    return [
        [1.0 - (yy + zz), xy - wz, xz + wy],
        [xy + wz, 1.0 - (xx + zz), yz - wx],
        [xz - wy, yz + wx, 1.0 - (xx + yy)],
    ]


def quaternion_rotation(q: Sequence[Scalar]) -> Rotation:
    """The rotation of a ball joint: one factor without an axis, parent ← child, 3 × 3, orthogonal
    for every q but zero."""
    return (Still(quaternion_matrix(q)),)


def quaternion_rates(q: Sequence[Scalar], omega: Sequence[Scalar]) -> Vector:
    """q̇ = ½ q ∘ (0, ω), ω in the child's frame. |q| is constant under it, as q · q̇ = 0."""
    w, x, y, z = q
    a, b, c = (0.5 * e for e in omega)
    return [
        -(x * a + y * b + z * c),
        w * a + y * c - z * b,
        w * b + z * a - x * c,
        w * c + x * b - y * a,
    ]


BALL = JointType(
    name="ball",
    about="any rotation about a point, as a unit quaternion (w, x, y, z)",
    coordinates=QUATERNION,
    velocities=SPIN,
    needs_axis=False,
    rotation=lambda q, axis: quaternion_rotation(q),
    translation=lambda q, axis: [0.0, 0.0, 0.0],
    motion=lambda q, axis: [[*e, 0.0, 0.0, 0.0] for e in UNIT_VECTORS],
    rates=lambda q, v, axis: quaternion_rates(q, v),
    unit_from=0,
    closing=meeting,
    turned=cross,
)


def ball_joint(sequence: str) -> JointType:
    """The ball joint with Euler angles (θ₁, θ₂, θ₃) of the given intrinsic sequence, such as "zxz",
    as coordinates; v = ω in the child's frame as with a quaternion, so that Euler's equations are
    the same. It closes no loop by itself: a closure has no coordinates."""

    def rotation(q: Sequence[Scalar], axis: Sequence[Scalar]) -> Rotation:
        """Parent ← child: R₁(θ₁) R₂(θ₂) R₃(θ₃)."""
        return euler_rotation(sequence, q)

    def rates(q: Sequence[Scalar], v: Sequence[Scalar], axis: Sequence[Scalar]) -> Vector:
        """θ̇ from ω; singular where the middle angle makes the other two axes parallel."""
        return angle_rates(sequence, q, v)

    def lock(q: Sequence[Scalar]) -> Scalar:
        return distance_from_lock(sequence, q)

    return replace(
        BALL,
        about="any rotation about a point, by Euler angles",
        coordinates=ANGLES,
        rotation=rotation,
        rates=rates,
        unit_from=-1,
        lock=lock,
    )
