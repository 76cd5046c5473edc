"""From a link's frame to its parent's and back."""

from __future__ import annotations

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import dot, is_one, is_zero, minus, plus, sum_of
from derive.mechanics.loops.records import Joint
from derive.mechanics.loops.sweeps import COSINE, SINE, Rows


def _turned(x: Vector, axis: int, s: Scalar, c: Scalar) -> Vector:
    """By a turn about a principal axis with that sine and cosine."""
    if is_zero(s) and is_one(c):
        return x
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result = list(x)
    result[i] = minus(dot([c], [x[i]]), dot([s], [x[j]]))
    result[j] = plus(dot([s], [x[i]]), dot([c], [x[j]]))
    return result


def turned_matrix(M: Matrix, axis: int, s: Scalar, c: Scalar) -> Matrix:
    """R M Rᵀ. With k = s (M₁₁ − M₂₂) + c (M₁₂ + M₂₁) in the plane that turns: M₁₁ − s k, M₂₂ + s k,
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


def turns(joint: Joint, row: Rows) -> list[tuple[int, Scalar, Scalar]]:
    """(axis, sine, cosine), in the order in which a child's values are turned into its parent."""
    return [(2, row[SINE], row[COSINE]), (0, *joint.alpha), (2, *joint.gamma)]


def to_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    """A vector in the parent's axes."""
    for axis, s, c in turns(joint, row):
        x = _turned(x, axis, s, c)
    return x


def from_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    """A vector in the link's axes."""
    for axis, s, c in reversed(turns(joint, row)):
        x = _turned(x, axis, -s, c)
    return x


def arm(joint: Joint, row: Rows) -> Vector:
    """The link's origin in its parent's frame."""
    if not joint.slides:
        return joint.place
    return sum_of(joint.place, to_parent(joint, row, [0.0, 0.0, joint.q]))
