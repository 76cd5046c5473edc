"""Rotations as products of turns, nothing multiplied out: what the tables of the joints are made
of.

Without CasADi, which takes as long to import as a model file to read: whoever only reads one does
not need it.
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Scalar
from derive.joints.records import Rotation, Turn

UNIT: dict[str, tuple[float, float, float]] = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
}


def euler_rotation(sequence: str, angles: Sequence[Scalar]) -> Rotation:
    """Intrinsic rotations about the letters of `sequence`, first letter first: R = R₁(θ₁) R₂(θ₂)
    R₃(θ₃), parent ← child. The same as extrinsic ones about fixed axes in reverse order."""
    return tuple(Turn(UNIT[letter], angle) for letter, angle in zip(sequence, angles))


def turn(axis: Sequence[Scalar], angle: Scalar) -> Rotation:
    """One turn; about −x, −y or −z it is written as the opposite turn about x, y or z, which merges
    and has no products."""
    unit = (float(axis[0]), float(axis[1]), float(axis[2]))
    opposite = (-unit[0] + 0.0, -unit[1] + 0.0, -unit[2] + 0.0)
    return (Turn(opposite, -angle),) if opposite in UNIT.values() else (Turn(unit, angle),)
