"""Many right-hand sides at once by M = Lᵀ D L, from the tip to the base; zeros are seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import dot, is_zero, minus, times
from derive.mechanics.elimination.solve import ldl_solution, scalars

Solve = Callable[[Matrix, Sequence[Vector]], list[Vector]]


def tip_to_base(n: int) -> list[int]:
    """The order of elimination that fills nothing in."""
    return list(reversed(range(n)))


def factorization(M: Matrix) -> tuple[dict[tuple[int, int], Scalar], Vector]:
    """L of M = Lᵀ D L by (row, unknown) in the order of elimination, and D."""
    A, order = [list(row) for row in M], tip_to_base(len(M))
    factors: dict[tuple[int, int], Scalar] = {}
    for step, k in enumerate(order):
        beyond = [i for i in order[step + 1 :] if not is_zero(A[i][k])]
        factors |= {(i, k): A[i][k] / A[k][k] for i in beyond}
        for a, i in enumerate(beyond):
            for j in beyond[a:]:
                A[i][j] = A[j][i] = minus(A[i][j], times(factors[i, k], A[j][k]))
    return factors, [A[k][k] for k in range(len(M))]


def _forward(factors: dict[tuple[int, int], Scalar], side: Vector) -> Vector:
    """L⁻¹ b."""
    b = list(side)
    for (i, k), factor in factors.items():
        if not is_zero(b[k]):
            b[i] = minus(b[i], times(factor, b[k]))
    return b


def inverse_matrix(M: Matrix) -> Matrix:
    """M⁻¹ of a symmetric M: with M = L D Lᵀ in the order of elimination, Σ L⁻ᵀ D⁻¹ L⁻¹, entries of
    one half alone."""
    n = len(M)
    units: list[Vector] = [[1.0 if i == k else 0.0 for i in range(n)] for k in range(n)]
    factors, pivots = factorization(M)
    columns = [_forward(factors, unit) for unit in units]
    scaled = [[0.0 if is_zero(x) else x / d for x, d in zip(column, pivots)] for column in columns]
    lower = {(i, j): dot(columns[i], scaled[j]) for i in range(n) for j in range(i + 1)}
    return [[lower[max(i, j), min(i, j)] for j in range(n)] for i in range(n)]


def by_factors(M: Matrix, sides: Sequence[Vector]) -> list[Vector]:
    """M⁻¹ of each side, by substitution."""
    return ldl_solution(M, sides, tip_to_base(len(M))).x


def by_inverse(M: Matrix, sides: Sequence[Vector]) -> list[Vector]:
    """The same by M⁻¹ and products."""
    X = inverse_matrix(M)
    return [[dot(row, side) for row in X] for side in sides]


def of_sides(M: Matrix, sides: Sequence[Vector], solve: Solve) -> ca.SX:
    """Of the sides that are not zero by structure; a column each."""
    wanted = [k for k, side in enumerate(sides) if not all(is_zero(x) for x in side)]
    solutions = solve(M, [sides[k] for k in wanted])
    result = ca.SX(len(M), len(sides))
    for k, column in zip(wanted, solutions):
        for i, x in enumerate(column):
            if not is_zero(x):
                result[i, k] = x
    return result


def filled(sides: ca.SX) -> list[tuple[int, int]]:
    """Columns with something in them, as ranges."""
    ranges: list[tuple[int, int]] = []
    for j in sorted(set(sides.sparsity().get_triplet()[1])):
        if ranges and ranges[-1][1] == j:
            ranges[-1] = (ranges[-1][0], j + 1)
        else:
            ranges.append((j, j + 1))
    return ranges


def columns_of(rows: Matrix) -> list[Vector]:
    """The columns of a matrix."""
    return [list(column) for column in zip(*rows)] if rows else []


def entries(column: ca.SX) -> Vector:
    """Numbers as floats, so that zeros are seen."""
    return [row[0] for row in scalars(column)]


def column(values: Vector) -> ca.SX:
    """As a column, 0 × 1 where there are none."""
    return ca.vertcat(*values) if values else ca.SX(0, 1)


def matrix_of(rows: Matrix, columns: int) -> ca.SX:
    """Sparse: exact zeros are not stored."""
    result = ca.SX(len(rows), columns)
    for i, row in enumerate(rows):
        for j, x in enumerate(row):
            if not is_zero(x):
                result[i, j] = x
    return result
