"""What a joint type is: a short table of names and functions.

The child joint frame sits at `translation` with `rotation` in the parent joint frame; its relative
twist (ω, v at the joint frame's origin), written in the child joint frame, is motion(q, axis) v.
Functions take and return lists of SX scalars or floats, so that structural zeros stay zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from derive.expressions.scalars import Matrix, Scalar, Vector

# Rows of a closure: an axis that stays parallel, and the third that keeps the frames from turning.
PARALLEL = ("turn1", "turn2")
LOCKED = (*PARALLEL, "turn3")


def meeting(plane: str) -> tuple[str, ...]:
    """Rows of two points that coincide, along the ground's axes: two in a plane, three in space."""
    return tuple(plane or "xyz")


@dataclass(frozen=True)
class Turn:
    """A factor of a rotation: the turn by `angle` about a constant unit axis."""

    axis: tuple[float, float, float]
    angle: Scalar


@dataclass(frozen=True)
class Still:
    """A factor of a rotation: a matrix that is no single turn (a constant placement, a quaternion's
    matrix)."""

    matrix: Matrix


Rotation = tuple[Turn | Still, ...]  # product from left to right


@dataclass(frozen=True)
class Slot:
    """One coordinate or generalized velocity: suffix in names such as `base.vx` and its SI unit
    ("rad", "m", "rad/s", "m/s")."""

    suffix: str
    unit: str


@dataclass(frozen=True)
class JointType:
    """`motion` is a list of 6-vectors (angular first), one per velocity; `rates` is q̇ = N(q) v.

    Velocities with suffix "" are the rate of the coordinate in the same place (generalized velocity
    `der(q)`). `needs_axis` says whether a model must, in space, give an axis. `parts` names the
    simpler joints of a chain with massless bodies between; the functions are then not used.
    `unit_from`: index of the first of four coordinates that are a unit quaternion (w, x, y, z), −1
    where there is none. `planar`: it may stand in a planar model. `closing(plane)` names the rows
    by which a joint of this type closes a loop, in the order of derive.mechanics.closures, in a
    plane ("xy", "xz", "yz") or in space (""); None where it closes none. `lock`(q) is what `rates`
    divides by; None where it divides by nothing that can vanish. `turned`(v, p) is what momenta p
    conjugate to v change by because the velocities' axes turn along, ṗ + turned = force (−ad*_v p,
    Euler–Poincaré); None where velocities are rates of coordinates.
    """

    name: str
    about: str
    coordinates: tuple[Slot, ...]
    velocities: tuple[Slot, ...]
    needs_axis: bool
    rotation: Callable[
        [Sequence[Scalar], Sequence[Scalar]], Rotation
    ]  # (q, axis) → parent joint frame ← child joint frame
    translation: Callable[[Sequence[Scalar], Sequence[Scalar]], Vector]
    motion: Callable[[Sequence[Scalar], Sequence[Scalar]], list[Vector]]
    rates: Callable[
        [Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]], Vector
    ]  # (q, v, axis) → q̇
    parts: tuple[str, ...] = ()
    unit_from: int = -1
    planar: bool = False
    closing: Callable[[str], tuple[str, ...]] | None = None
    lock: Callable[[Sequence[Scalar]], Scalar] | None = None
    turned: Callable[[Sequence[Scalar], Sequence[Scalar]], Vector] | None = None
