"""Linear systems written out: no loops, no pivoting at run time, structural zeros skipped.

`ldl_solution` for symmetric positive (or quasi-) definite matrices in a given order; `lu_solution` with a pivot order that
`pivot_order` finds beforehand: constant pivots first, then those that stay farthest from zero over sampled matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.joints.records import Matrix, Scalar, Vector
from derive.joints.rotations import is_zero


def scalars(matrix: ca.SX) -> Matrix:
    """Rows of scalars; entries that are not stored, and constants, are floats."""
    rows: Matrix = [[0.0] * matrix.size2() for _ in range(matrix.size1())]
    for i, j in zip(*matrix.sparsity().get_triplet()):
        x = matrix[i, j]
        rows[i][j] = float(x) if x.is_constant() else x
    return rows


@dataclass(frozen=True)
class Solution:
    x: list[Vector]  # one vector per right-hand side
    pivots: Vector  # in elimination order


def ldl_solution(M: Matrix, sides: Sequence[Vector], order: Sequence[int]) -> Solution:
    """M x = b by M = L D Lᵀ, eliminating unknowns in `order` (tip to base on a tree: no fill)."""
    A = [list(row) for row in M]
    right = [list(b) for b in sides]
    weights: list[dict[int, Scalar]] = []
    for step, k in enumerate(order):
        rest = [i for i in order[step + 1 :] if not is_zero(A[i][k])]
        factors = {i: A[i][k] / A[k][k] for i in rest}
        for a, i in enumerate(rest):
            for j in rest[a:]:
                A[i][j] = A[j][i] = A[i][j] - factors[i] * A[j][k]
        for b in right:
            for i in rest:
                if not is_zero(b[k]):
                    b[i] = b[i] - factors[i] * b[k]
        weights.append(factors)
    pivots = [A[k][k] for k in order]
    for b in right:
        _back(b, A, order, weights)
    return Solution(right, pivots)


def _back(b: Vector, A: Matrix, order: Sequence[int], weights: Sequence[dict[int, Scalar]]) -> None:
    for k, factors in reversed(list(zip(order, weights))):
        b[k] = 0.0 if is_zero(b[k]) else b[k] / A[k][k]
        for i, factor in factors.items():
            if not is_zero(b[i]):
                b[k] = b[k] - factor * b[i]


def lu_solution(A: Matrix, sides: Sequence[Vector], pivots: Sequence[tuple[int, int]]) -> Solution:
    """A x = b by Gauss elimination with the given (row, column) pivots."""
    rows = [list(row) for row in A]
    right = [list(b) for b in sides]
    for step, (r, c) in enumerate(pivots):
        for i, _ in pivots[step + 1 :]:
            if is_zero(rows[i][c]):
                continue
            factor = rows[i][c] / rows[r][c]
            for _, j in pivots[step + 1 :]:
                if not is_zero(rows[r][j]):
                    rows[i][j] = rows[i][j] - factor * rows[r][j]
            for b in right:
                if not is_zero(b[r]):
                    b[i] = b[i] - factor * b[r]
    return Solution([_substituted(rows, b, pivots) for b in right], [rows[r][c] for r, c in pivots])


def _substituted(rows: Matrix, b: Vector, pivots: Sequence[tuple[int, int]]) -> Vector:
    x: Vector = [0.0] * len(b)
    for step, (r, c) in reversed(list(enumerate(pivots))):
        rest = b[r]
        for _, j in pivots[step + 1 :]:
            if not is_zero(rows[r][j]) and not is_zero(x[j]):
                rest = rest - rows[r][j] * x[j]
        x[c] = 0.0 if is_zero(rest) else rest / rows[r][c]
    return x


def pivot_order(samples: np.ndarray, structure: np.ndarray, constant: np.ndarray) -> list[tuple[int, int]]:
    """Pivots for matrices of one pattern: `samples` (k, n, n) values, `structure` and `constant` (n, n) flags.

    Greedy: a constant entry before a varying one, then the largest smallest |pivot| over the samples (each sample's
    matrix scaled by rows), then the least fill. Raises ZeroDivisionError where every remaining pivot vanishes somewhere everywhere.
    """
    values, fixed = samples.copy(), constant & structure
    pattern = structure.copy()
    rows, columns = list(range(values.shape[1])), list(range(values.shape[2]))
    chosen: list[tuple[int, int]] = []
    while rows:
        r, c = _best(values, pattern, fixed, rows, columns)
        chosen.append((r, c))
        rows.remove(r)
        columns.remove(c)
        _eliminate(values, pattern, fixed, rows, columns, (r, c))
    return chosen


def _best(values: np.ndarray, pattern: np.ndarray, fixed: np.ndarray, rows: list[int], columns: list[int]) -> tuple[int, int]:
    size = np.abs(values)
    scale = np.maximum(size[:, rows][:, :, columns].max(axis=2), 1e-300)
    best, score = None, None
    for a, r in enumerate(rows):
        for c in columns:
            if not pattern[r, c]:
                continue
            least = float(np.min(size[:, r, c] / scale[:, a]))
            fill = (pattern[r, columns].sum() - 1) * (pattern[rows, c].sum() - 1)
            trial = (bool(fixed[r, c]) and least > 1e-3, round(np.log10(max(least, 1e-14))), -fill)
            if np.max(size[:, r, c]) > 0 and (score is None or trial > score):
                best, score = (r, c), trial
    if best is None:
        raise ZeroDivisionError("the matrix is singular at every sampled state")
    return best


def _eliminate(
    values: np.ndarray, pattern: np.ndarray, fixed: np.ndarray, rows: list[int], columns: list[int], at: tuple[int, int]
) -> None:
    r, c = at
    pivot = np.where(values[:, r, c] == 0, np.nan, values[:, r, c])
    for i in rows:
        if not pattern[i, c]:
            continue
        factor = np.nan_to_num(values[:, i, c] / pivot)
        for j in columns:
            if pattern[r, j]:
                fixed[i, j] = fixed[i, j] and fixed[i, c] and fixed[r, j] and fixed[r, c] and pattern[i, j]
                pattern[i, j] = True
                values[:, i, j] -= factor * values[:, r, j]
