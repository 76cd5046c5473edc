"""Rotations as lists of scalars, exact zeros and ones kept as floats so that nothing is ever multiplied by them."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.joints.records import Matrix, Scalar, Vector

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def axis_rotation(axis: Sequence[Scalar], angle: Scalar) -> Matrix:
    """Rodrigues: R = cos θ 1 + sin θ [e]× + (1 − cos θ) e eᵀ for a unit axis e."""
    s, c = ca.sin(angle), ca.cos(angle)
    x, y, z = axis
    cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return [
        [(c if i == j else 0.0) + cross[i][j] * s + _versine(axis[i] * axis[j], c) for j in range(3)] for i in range(3)
    ]


def _versine(weight: Scalar, c: Scalar) -> Scalar:
    if _is(weight, 0.0):
        return 0.0
    return weight * (1.0 - c)


def _is(value: Scalar, number: float) -> bool:
    if isinstance(value, float | int):
        return value == number
    return value.is_constant() and float(value) == number


def euler_rotation(sequence: str, angles: Sequence[Scalar]) -> Matrix:
    """Intrinsic rotations about the letters of `sequence`, first letter first: R = R₁(θ₁) R₂(θ₂) R₃(θ₃)."""
    result = IDENTITY
    for letter, angle in zip(sequence, angles):
        result = product(result, principal_rotation(letter, angle))
    return result


def principal_rotation(letter: str, angle: Scalar) -> Matrix:
    """Rotation about x, y or z, written out so that 1 − cos never appears."""
    s, c = ca.sin(angle), ca.cos(angle)
    return {
        "x": [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        "y": [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        "z": [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    }[letter]


def product(a: Matrix, b: Matrix) -> Matrix:
    return [[dot(row, [b[k][j] for k in range(3)]) for j in range(3)] for row in a]


def transpose(a: Matrix) -> Matrix:
    return [list(column) for column in zip(*a)]


def rotated(a: Matrix, x: Sequence[Scalar]) -> Vector:
    return [dot(row, x) for row in a]


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Σ aᵢ bᵢ, leaving out products with an exact zero."""
    total: Scalar = 0.0
    for x, y in zip(a, b):
        if not (_is(x, 0.0) or _is(y, 0.0)):
            total = total + x * y
    return total


def cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    return [dot([a[1], a[2]], [b[2], -b[1]]), dot([a[2], a[0]], [b[0], -b[2]]), dot([a[0], a[1]], [b[1], -b[0]])]


def sum_of(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    return [x + y for x, y in zip(a, b)]
