"""What each joint does, as numbers: the reference's own table, written from the definitions and not
from derive.joints.

In the parent's joint frame the child's joint frame sits at `translation`, turned by `rotation`; its
relative twist (ω, v of its origin), in the child's joint frame, is H v with the rate H v̇ + bias;
q̇ = N v and q̈ = N v̇ + drift.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from derive.diagnostics import AssumptionError
from hamel.verify.reference.vectors import (
    UNIT,
    Array,
    cross,
    quaternion_product,
    quaternion_rotation,
    turn,
)


@dataclass(frozen=True)
class Motion:
    """One joint at one state: rotation 3 × 3, translation 3, H 6 × k, N nq × k, drift nq (= Ṅ v),
    bias 6 (= Ḣ v)."""

    rotation: Array
    translation: Array
    H: Array
    N: Array
    drift: Array
    bias: Array = field(default_factory=lambda: np.zeros(6))


def revolute(q: Array, v: Array, axis: Array) -> Motion:
    """A turn by q about the axis, which is the same in both joint frames: ω = axis q̇."""
    H = np.concatenate([axis, np.zeros(3)])[:, None]
    return Motion(turn(axis, q[0]), np.zeros(3), H, np.eye(1), np.zeros(1))


def prismatic(q: Array, v: Array, axis: Array) -> Motion:
    """A shift by q along the axis: velocity axis q̇, no turn."""
    H = np.concatenate([np.zeros(3), axis])[:, None]
    return Motion(np.eye(3), q[0] * axis, H, np.eye(1), np.zeros(1))


def screw(pitch: float) -> Callable[[Array, Array, Array], Motion]:
    """Turn about the axis with an advance of `pitch` metres a turn."""

    def motion(q: Array, v: Array, axis: Array) -> Motion:
        advance = pitch / (2.0 * np.pi) * axis
        return Motion(
            turn(axis, q[0]),
            q[0] * advance,
            np.concatenate([axis, advance])[:, None],
            np.eye(1),
            np.zeros(1),
        )

    return motion


def cylindrical(q: Array, v: Array, axis: Array) -> Motion:
    """Turn about the axis, then slide along it."""
    H = np.zeros((6, 2))
    H[:3, 0] = H[3:, 1] = axis
    return Motion(turn(axis, q[0]), q[1] * axis, H, np.eye(2), np.zeros(2))


def universal(axis2: Array) -> Callable[[Array, Array, Array], Motion]:
    """R = R₁ R₂ about `axis` of the parent and `axis2` of the child: ω = R₂ᵀ e₁ q̇₁ + e₂ q̇₂, so Ḣ
    v = −q̇₂ e₂ × R₂ᵀ e₁ q̇₁."""

    def motion(q: Array, v: Array, axis: Array) -> Motion:
        second = turn(axis2, q[1])
        seen = second.T @ axis
        H = np.zeros((6, 2))
        H[:3, 0], H[:3, 1] = seen, axis2
        bias = np.concatenate([-v[1] * v[0] * cross(axis2, seen), np.zeros(3)])
        return Motion(turn(axis, q[0]) @ second, np.zeros(3), H, np.eye(2), np.zeros(2), bias)

    return motion


def ball(orientation: str) -> Callable[[Array, Array, Array], Motion]:
    """The angular velocity in the child's frame, orientation by quaternion or Euler angles."""

    def motion(q: Array, v: Array, axis: Array) -> Motion:
        R, spin, drift = _orientation(orientation, q, v)
        return Motion(R, np.zeros(3), np.vstack([np.eye(3), np.zeros((3, 3))]), spin, drift)

    return motion


def fixed(q: Array, v: Array, axis: Array) -> Motion:
    """No motion: q and v are empty, H has no columns."""
    return Motion(np.eye(3), np.zeros(3), np.zeros((6, 0)), np.zeros((0, 0)), np.zeros(0))


def planar(q: Array, v: Array, axis: Array) -> Motion:
    """Body-frame velocities along e1, e2 = axis × e1 of the turned frame: q̇ = turn(θ) v, so Ṅ v =
    θ̇ k × (turn v)."""
    e1 = UNIT["y"] if np.array_equal(axis, UNIT["x"]) else UNIT["x"]
    plane = np.array([e1, cross(axis, e1)])
    c, s = np.cos(q[2]), np.sin(q[2])
    N = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rate = N @ v
    H = np.zeros((6, 3))
    H[3:, :2], H[:3, 2] = plane.T, axis
    return Motion(turn(axis, q[2]), q[:2] @ plane, H, N, v[2] * np.array([-rate[1], rate[0], 0.0]))


def point(q: Array, v: Array, axis: Array) -> Motion:
    """Shifts along e1 and e2 = axis × e1, no turn: what a planar joint does while it keeps its
    angle at zero."""
    still = planar(np.append(q, 0.0), np.append(v, 0.0), axis)
    return Motion(np.eye(3), still.translation, still.H[:, :2], np.eye(2), np.zeros(2))


def free(orientation: str) -> Callable[[Array, Array, Array], Motion]:
    """Six degrees of freedom, linear then angular velocity in the body frame, orientation by
    quaternion or Euler angles."""

    def motion(q: Array, v: Array, axis: Array) -> Motion:
        R, spin, spin_drift = _orientation(orientation, q[3:], v[3:])
        N = np.zeros((len(q), 6))
        N[:3, :3], N[3:, 3:] = R, spin
        H = np.zeros((6, 6))
        H[3:, :3] = H[:3, 3:] = np.eye(3)
        return Motion(R, q[:3], H, N, np.concatenate([R @ cross(v[3:], v[:3]), spin_drift]))

    return motion


def _orientation(orientation: str, angles: Array, omega: Array) -> tuple[Array, Array, Array]:
    """Rotation, the matrix from ω to the orientation's rates, and its rate times ω."""
    if orientation == "quaternion":
        spin = quaternion_product(angles)
        return quaternion_rotation(angles), spin, quaternion_product(spin @ omega) @ omega
    return _euler(orientation or "zyx", angles, omega)


def _euler(sequence: str, angles: Array, omega: Array) -> tuple[Array, Array, Array]:
    """R = R₁ R₂ R₃; ω = E θ̇ with columns e₁, e₂, e₃ seen from the body, hence θ̈ = E⁻¹ (ω̇ − Ė
    θ̇)."""
    e1, e2, e3 = (UNIT[letter] for letter in sequence)
    R1, R2, R3 = (turn(UNIT[letter], angle) for letter, angle in zip(sequence, angles))
    E = np.column_stack([(R2 @ R3).T @ e1, R3.T @ e2, e3])
    inverse = np.linalg.inv(E)
    rate = inverse @ omega
    later = (
        rate[1] * E[:, 1] + rate[2] * e3
    )  # angular velocity of the body relative to the frame before the second turn
    E_rate = np.column_stack([-cross(later, E[:, 0]), -cross(rate[2] * e3, E[:, 1]), np.zeros(3)])
    return R1 @ R2 @ R3, inverse, -inverse @ (E_rate @ rate)


_TABLE = {
    "revolute": revolute, "prismatic": prismatic, "planar": planar, "fixed": fixed,
    "point": point, "cylindrical": cylindrical,
}  # fmt: skip


def joint_motion(
    kind: str, orientation: str = "", pitch: float = 0.0, axis2: Array | None = None
) -> Callable[[Array, Array, Array], Motion]:
    """The function (q, v, axis) → Motion of a joint type; NotImplementedError for one the reference
    does not know."""
    if kind == "free":
        return free(orientation)
    if kind == "ball":
        return ball(orientation or "quaternion")
    if kind == "screw":
        return screw(pitch)
    if kind == "universal" and axis2 is not None:
        return universal(axis2)
    if kind not in _TABLE:
        raise AssumptionError(
            f"verify cannot derive joints of type {kind} again: its reference does not know them",
            "they take a derivation of their own in hamel/verify/reference/joints.py",
        )
    return _TABLE[kind]
