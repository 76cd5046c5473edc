"""The bordered system [M Aᵀ; A 0], for accelerations with multipliers and for projections in the
metric of M."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import dot, minus
from derive.mechanics.elimination.solve import SparseRow, ldl_solution, sparse_rows


@dataclass(frozen=True)
class Bordered:
    """`pivots` are those of the lower block, −A M⁻¹ Aᵀ: they vanish where A loses rank."""

    x: Vector
    y: Vector
    pivots: Vector


def bordered_solution(M: ca.SX, A: ca.SX, top: Vector, bottom: Vector) -> Bordered:
    """x (nv), y (nc) of M x + Aᵀ y = top, A x = bottom, by one unrolled L D Lᵀ.

    M must be positive definite and A of full row rank: then the matrix is quasi-definite and every
    order of pivots is safe. Multipliers come last, so that their pivots are those of −A M⁻¹ Aᵀ. The
    multipliers of M v̇ = F + Aᵀ λ are λ = −y.
    """
    nv, nc = M.size1(), A.size1()
    matrix = sparse_rows(ca.blockcat([[M, A.T], [A, ca.SX(nc, nc)]]))
    solution = ldl_solution(matrix, [[*top, *bottom]], [*reversed(range(nv)), *range(nv, nv + nc)])
    return Bordered(solution.x[0][:nv], solution.x[0][nv:], solution.pivots[nv:])


def least_change(M: ca.SX, A: ca.SX, change: Vector) -> Vector:
    """δ (nv) of A δ = change, least in the metric of M.

    Rows that hold one entry of δ alone, as those of prescribed coordinates do, fix it, and so may
    leave further rows with one alone. The rest is the least over the free entries: M_ff δ_f + A_fᵀ
    y = −M_fp δ_p. In the bordered matrix such rows would fill a block of their number.
    """
    fixed, left = _fixed_entries(sparse_rows(A), change)
    free = [j for j in range(M.size1()) if j not in fixed]
    if not fixed:
        return bordered_solution(M, A, [0.0] * M.size1(), change).x
    if not free:
        return [fixed[j] for j in range(M.size1())]
    top = [-x for x in _products(sparse_rows(M[free, :]), fixed)]
    known = _products(sparse_rows(A[left, :]), fixed)
    bottom = [minus(change[i], x) for i, x in zip(left, known)]
    moved = bordered_solution(M[free, free], A[left, free], top, bottom).x
    entries = fixed | dict(zip(free, moved))
    return [entries[j] for j in range(M.size1())]


def _fixed_entries(
    rows: Sequence[SparseRow], change: Vector
) -> tuple[dict[int, Scalar], list[int]]:
    """The entries that rows fix one after the other, and the rows that are left."""
    fixed: dict[int, Scalar] = {}
    left, before = list(range(len(rows))), -1
    while len(left) != before:
        before = len(left)
        for i in tuple(left):
            free = [j for j in rows[i] if j not in fixed]
            if len(free) == 1:
                rest = minus(change[i], _products([rows[i]], fixed)[0])
                fixed[free[0]] = rest / rows[i][free[0]]
                left.remove(i)
    return fixed, left


def _products(rows: Sequence[SparseRow], x: Mapping[int, Scalar]) -> Vector:
    """Of each row the part over the entries that are given."""
    return [dot([row[j] for j in row if j in x], [x[j] for j in row if j in x]) for row in rows]
