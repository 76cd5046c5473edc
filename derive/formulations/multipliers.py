"""The bordered system [M Aᵀ; A 0], for accelerations with multipliers and for projections in the
metric of M."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Vector
from derive.mechanics.solve import ldl_solution, sparse_rows


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
