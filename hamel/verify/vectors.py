"""Vectors, cross-product matrices and rotations as NumPy arrays."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
UNIT = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}


def skew(a: Array) -> Array:
    """[a]× with [a]× b = a × b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def cross(a: Array, b: Array) -> Array:
    """a × b (np.cross costs fifty times as much on three numbers)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


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
