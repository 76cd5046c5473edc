"""Rotations as lists of scalars, exact zeros and ones kept as floats so that nothing is ever
multiplied by them."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation, Still, Turn
from derive.joints.turns import UNIT

IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


def axis_rotation(axis: Sequence[Scalar], angle: Scalar) -> Matrix:
    """Rodrigues: R = cos θ 1 + sin θ [e]× + (1 − cos θ) e eᵀ for a unit axis e, θ in rad. About x,
    y or z it is the principal rotation, with exact zeros."""
    for letter, unit in UNIT.items():
        if tuple(axis) == unit:
            return principal_rotation(letter, angle)
    s, c = ca.sin(angle), ca.cos(angle)
    x, y, z = axis
    cross = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return [
        [
            (c if i == j else 0.0) + cross[i][j] * s + _versine(axis[i] * axis[j], c)
            for j in range(3)
        ]
        for i in range(3)
    ]


def _versine(weight: Scalar, c: Scalar) -> Scalar:
    if is_zero(weight):
        return 0.0
    return weight * (1.0 - c)


def is_zero(value: Scalar) -> bool:
    """Exactly zero, as a float or as a CasADi constant. A formula that cancels to zero is none:
    nothing is simplified to find out."""
    return value.is_constant() and float(value) == 0 if isinstance(value, ca.SX) else value == 0


def is_one(value: Scalar) -> bool:
    """Exactly one, likewise."""
    return value.is_constant() and float(value) == 1 if isinstance(value, ca.SX) else value == 1


def inverse(rotation: Rotation) -> Rotation:
    """Rᵀ as factors: each factor turned back, in reverse order. A turn stays a turn, so no matrix
    is written out."""
    return tuple(
        Turn(f.axis, -f.angle) if isinstance(f, Turn) else Still(transpose(f.matrix))
        for f in reversed(rotation)
    )


def merged(*rotations: Rotation) -> Rotation:
    """The product, with neighbouring turns about one axis made one: along parallel axes angles add,
    no matrix is multiplied."""
    result: list[Turn | Still] = []
    for factor in (f for rotation in rotations for f in rotation):
        last = result[-1] if result else None
        if isinstance(factor, Turn) and isinstance(last, Turn) and factor.axis == last.axis:
            result[-1] = Turn(last.axis, last.angle + factor.angle)
        else:
            result.append(factor)
    return tuple(result)


def matrix(rotation: Rotation) -> Matrix:
    """The factors multiplied out, 3 × 3, parent ← child; the identity where there are none."""
    result = IDENTITY
    for factor in rotation:
        turned = (
            axis_rotation(factor.axis, factor.angle) if isinstance(factor, Turn) else factor.matrix
        )
        result = turned if result is IDENTITY else product(result, turned)
    return result


def principal_rotation(letter: str, angle: Scalar) -> Matrix:
    """Rotation about x, y or z, written out so that 1 − cos never appears."""
    s, c = ca.sin(angle), ca.cos(angle)
    turns: dict[str, Matrix] = {
        "x": [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        "y": [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        "z": [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    }
    return turns[letter]


def product(a: Matrix, b: Matrix) -> Matrix:
    """A B of 3 × 3 matrices. Terms with an exact zero are dropped on the way and do not reach the
    graph."""
    return [[dot(row, [b[k][j] for k in range(3)]) for j in range(3)] for row in a]


def transpose(a: Matrix) -> Matrix:
    """Aᵀ; of a rotation it is the inverse."""
    return [list(column) for column in zip(*a)]


def rotated(a: Matrix, x: Sequence[Scalar]) -> Vector:
    """A x: the components of x in the axes that A leads to."""
    return [dot(row, x) for row in a]


def plus(x: Scalar, y: Scalar) -> Scalar:
    """x + y. CasADi's own operators try every type it knows before SX: eight times as long."""
    return ca.SX.binary(ca.OP_ADD, x, y) if isinstance(x, ca.SX) or isinstance(y, ca.SX) else x + y


def minus(x: Scalar, y: Scalar) -> Scalar:
    """x − y, likewise."""
    return ca.SX.binary(ca.OP_SUB, x, y) if isinstance(x, ca.SX) or isinstance(y, ca.SX) else x - y


def times(x: Scalar, y: Scalar) -> Scalar:
    """x · y, likewise."""
    return ca.SX.binary(ca.OP_MUL, x, y) if isinstance(x, ca.SX) or isinstance(y, ca.SX) else x * y


def dot(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Σ aᵢ bᵢ, leaving out products with an exact zero."""
    total: Scalar | None = None
    for x, y in zip(a, b):
        if isinstance(x, ca.SX) or isinstance(y, ca.SX):
            if is_zero(x) or is_zero(y):
                continue
            term = ca.SX.binary(ca.OP_MUL, x, y)
        elif x == 0 or y == 0:
            continue
        else:
            term = x * y
        total = term if total is None else plus(total, term)
    return 0.0 if total is None else total


def cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a × b, right-handed, by `dot` so that exact zeros vanish."""
    return [
        dot([a[1], a[2]], [b[2], -b[1]]),
        dot([a[2], a[0]], [b[0], -b[2]]),
        dot([a[0], a[1]], [b[1], -b[0]]),
    ]


def sum_of(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a + b entry by entry; an exact zero leaves the other entry as it is."""
    return [plus(x, y) for x, y in zip(a, b)]


def scaled(k: Scalar, x: Sequence[Scalar]) -> Vector:
    """k x."""
    return [dot([k], [entry]) for entry in x]


def matrix_sum(a: Matrix, b: Matrix) -> Matrix:
    """A + B."""
    return [sum_of(x, y) for x, y in zip(a, b)]


def spin_matrix(omega: Vector, alpha: Vector) -> Matrix:
    """[α]× + [ω]× [ω]×."""
    x, y, z = omega
    squares = [dot([w], [w]) for w in omega]
    xy, xz, yz = dot([x], [y]), dot([x], [z]), dot([y], [z])
    a, b, c = alpha
    return [
        [-plus(squares[1], squares[2]), minus(xy, c), plus(xz, b)],
        [plus(xy, c), -plus(squares[0], squares[2]), minus(yz, a)],
        [minus(xz, b), plus(yz, a), -plus(squares[0], squares[1])],
    ]


def difference(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    """a − b entry by entry; an exact zero leaves the other entry as it is, or its negative."""
    return [minus(x, y) for x, y in zip(a, b)]
