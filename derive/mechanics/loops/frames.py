"""From a link's frame to its parent's and back."""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    dot,
    is_one,
    is_zero,
    minus,
    plus,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.loops.records import Joint
from derive.mechanics.loops.sweeps import COSINE, SINE, TURNED, Rows

Turn = tuple[int, Scalar, Scalar]  # axis, sine, cosine


def _turned(x: Vector, axis: int, s: Scalar, c: Scalar) -> Vector:
    """By a turn about a principal axis with that sine and cosine."""
    if is_zero(s) and is_one(c):
        return x
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result = list(x)
    result[i] = minus(dot([c], [x[i]]), dot([s], [x[j]]))
    result[j] = plus(dot([s], [x[i]]), dot([c], [x[j]]))
    return result


def turned_matrix(M: Matrix, turn: Turn | Matrix) -> Matrix:
    """R M Rᵀ."""
    if isinstance(turn, list):
        return product(product(turn, M), transpose(turn))
    return _turned_matrix(M, *turn)


def _turned_matrix(M: Matrix, axis: int, s: Scalar, c: Scalar) -> Matrix:
    """With k = s (M₁₁ − M₂₂) + c (M₁₂ + M₂₁) in the plane that turns: M₁₁ − s k, M₂₂ + s k,
    c k − M₂₁, c k − M₁₂."""
    if is_zero(s) and is_one(c):
        return M
    i, j, z = (axis + 1) % 3, (axis + 2) % 3, axis
    k = plus(dot([s], [minus(M[i][i], M[j][j])]), dot([c], [plus(M[i][j], M[j][i])]))
    result = [list(row) for row in M]
    sk, ck = dot([s], [k]), dot([c], [k])
    result[i][i], result[j][j] = minus(M[i][i], sk), plus(M[j][j], sk)
    result[i][j], result[j][i] = minus(ck, M[j][i]), minus(ck, M[i][j])
    result[i][z], result[j][z] = _pair(M[i][z], M[j][z], s, c)
    result[z][i], result[z][j] = _pair(M[z][i], M[z][j], s, c)
    return result


def _pair(x: Scalar, y: Scalar, s: Scalar, c: Scalar) -> tuple[Scalar, Scalar]:
    return minus(dot([c], [x]), dot([s], [y])), plus(dot([s], [x]), dot([c], [y]))


def turns(joint: Joint, row: Rows) -> list[Turn | Matrix]:
    """In the order in which a child's values are turned into its parent."""
    return [*_own(joint, row), *_placement(joint)]


def _own(joint: Joint, row: Rows) -> list[Turn | Matrix]:
    """What the joint turns the link by."""
    if joint.turned is not None:
        entries = row.vector(TURNED, 9)
        return [[entries[3 * i : 3 * i + 3] for i in range(3)]]
    return [] if joint.angle is None else [(2, row[SINE], row[COSINE])]


def _placement(joint: Joint) -> list[Turn]:
    return [(2, *joint.beta), (0, *joint.alpha), (2, *joint.gamma)]


def to_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    """A vector in the parent's axes."""
    return _through(turns(joint, row), x)


def along_shifts(joint: Joint, row: Rows, x: Vector) -> Vector:
    """A vector in the axes along which coordinates shift the link."""
    return _through(_own(joint, row), x)


def _through(turns: Sequence[Turn | Matrix], x: Vector) -> Vector:
    for turn in turns:
        x = rotated(turn, x) if isinstance(turn, list) else _turned(x, *turn)
    return x


def from_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    """A vector in the link's axes."""
    for turn in reversed(turns(joint, row)):
        if isinstance(turn, list):
            x = rotated(transpose(turn), x)
        else:
            axis, s, c = turn
            x = _turned(x, axis, -s, c)
    return x


def arm(joint: Joint) -> Vector:
    """The link's origin in its parent's frame."""
    of: dict[int, Scalar] = dict(zip(joint.shifts, joint.q))
    if not any(axis in of for axis in range(3)):
        return joint.place
    shift: Vector = [of.get(axis, 0.0) for axis in range(3)]
    return sum_of(joint.place, _through(_placement(joint), shift))
