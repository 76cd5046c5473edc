"""Euler angles of any intrinsic sequence as coordinates: their rates from ω.

The inverse of ω = Σ axisᵢ θ̇ᵢ in closed form: for a sequence i, j, k about different axes it is
regular away from θ₂ = ±90°, for i, j, i away from θ₂ = 0.
"""

from collections.abc import Sequence

from derive.expressions.scalars import Scalar, Vector
from derive.joints.records import Slot
from derive.joints.rotations import cross, dot, principal_rotation, rotated, transpose
from derive.joints.turns import UNIT

ANGLES = tuple(Slot(f"angle{i}", "rad") for i in (1, 2, 3))


def angle_rates(sequence: str, angles: Sequence[Scalar], omega: Sequence[Scalar]) -> Vector:
    """θ̇ from ω: θ̇₁ and θ̇₂ along the dual axes, taken in the frame before the last turn where
    they are single components."""
    # components of ω in the frame before the last turn
    before = rotated(principal_rotation(sequence[2], angles[2]), omega)
    first, second, third, across = _axes(sequence, angles)
    theta1 = dot(across, before) / dot(across, first)
    return [theta1, dot(second, before), dot(third, before) - dot(third, first) * theta1]


def distance_from_lock(sequence: str, angles: Sequence[Scalar]) -> Scalar:
    """What the rates are divided by: ± cos θ₂ of three different axes, ± sin θ₂ of i, j, i."""
    first, _, _, across = _axes(sequence, angles)
    return dot(across, first)


def _axes(sequence: str, angles: Sequence[Scalar]) -> tuple[Vector, Vector, Vector, Vector]:
    """The three axes in the frame before the last turn, and the one across the last two: first =
    a across + b third, and a vanishes in gimbal lock."""
    first = rotated(transpose(principal_rotation(sequence[1], angles[1])), UNIT[sequence[0]])
    second: Vector = [*UNIT[sequence[1]]]
    third: Vector = [*UNIT[sequence[2]]]
    return first, second, third, cross(second, third)
