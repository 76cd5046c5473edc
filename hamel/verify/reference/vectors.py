"""Vectors, cross-product matrices and rotations as NumPy arrays."""

from __future__ import annotations

import math

import numpy as np

Array = np.ndarray
SMALL_TURN = 1e-4  # rad: below it the last factor of `turn_slope` has few digits, and needs none
UNIT = {
    "x": np.array([1.0, 0.0, 0.0]),
    "y": np.array([0.0, 1.0, 0.0]),
    "z": np.array([0.0, 0.0, 1.0]),
}


def skew(a: Array) -> Array:
    """[a]× with [a]× b = a × b."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Array, b: Array) -> Array:
    """a × b (np.cross costs fifty times as much on three numbers)."""
    (a1, a2, a3), (b1, b2, b3) = (
        a.tolist(),
        b.tolist(),
    )  # Python's own numbers are three times as fast as NumPy's
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def turn(axis: Array, angle: float) -> Array:
    """Rodrigues: R = 1 + sin θ [e]× + (1 − cos θ) [e]×²."""
    e = skew(axis)
    return np.eye(3) + np.sin(angle) * e + (1.0 - np.cos(angle)) * (e @ e)


def quaternion_rotation(h: Array) -> Array:
    """Rotation of the quaternion (w, x, y, z) divided by its length: R = 1 + 2 w [x]× + 2 [x]×²."""
    w, x = (h / np.linalg.norm(h))[0], skew((h / np.linalg.norm(h))[1:])
    return np.eye(3) + 2.0 * w * x + 2.0 * (x @ x)


def quaternion_product(h: Array) -> Array:
    """½ h ⊗ (0, ω) as a 4 × 3 matrix times ω."""
    w, x = h[0], h[1:]
    return 0.5 * np.vstack([-x, w * np.eye(3) + skew(x)])


def rotation_vector(h: Array) -> Array:
    """What the quaternion (w, x, y, z) turns by, the shorter way round: from the sine of half the
    angle, or from the cosine where that is the smaller one."""
    h = h / np.linalg.norm(h)
    cosine, sine = abs(h[0]), float(np.linalg.norm(h[1:]))
    half = math.asin(min(sine, 1.0)) if sine < cosine else math.acos(min(cosine, 1.0))
    towards = math.copysign(2.0, h[0]) * h[1:]
    return towards * (half / sine) if sine > 0.0 else towards


def turn_slope(turn: Array) -> Array:
    """Of a rotation vector by a small turn about the body's axes; 1/12 is the limit of the last
    factor at no turn."""
    across, angle = skew(turn), float(np.linalg.norm(turn))
    small = angle < SMALL_TURN
    last = 1.0 / 12.0 if small else 1.0 / angle**2 - 0.5 / (angle * math.tan(0.5 * angle))
    return np.eye(3) + 0.5 * across + last * (across @ across)


def turned_quaternion(h: Array, turn: Array) -> Array:
    """h ⊗ (cos |ω|/2, sin(|ω|/2) ω/|ω|) for a turn by the rotation vector ω along the body's
    axes."""
    half = np.linalg.norm(turn) / 2.0
    return np.cos(half) * h + np.sinc(half / np.pi) * (quaternion_product(h) @ turn)
