"""The traditional reference: the augmented system with multipliers, in the base velocities.

    [ M  −Aᵀ ] [ v̇ ]   [ Q − h ]
    [ A   0  ] [ λ ] = [ β     ]
solved by one unrolled L D Lᵀ of the quasi-definite matrix [M Aᵀ; A 0] (unknowns v̇, −λ), tip to base, multipliers last.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.joints.records import Vector
from derive.mechanics.records import System
from derive.mechanics.solve import ldl_solution, scalars


@dataclass(frozen=True)
class Augmented:
    vdot: ca.SX
    lam: ca.SX


def augmented(system: System, kept: tuple[int, ...]) -> Augmented:
    """v̇ and λ over (t, q, v, u, p); multipliers of redundant rows are zero."""
    rows = list(kept)
    force = _entries(system.Q - system.h)
    vdot, minus = bordered_solution(system.M, system.A[rows, :], force, _entries(system.beta[rows]))
    lam = ca.SX.zeros(len(system.rows))
    for i, x in zip(rows, minus):
        lam[i] = -x
    return Augmented(_column(vdot), lam)


def bordered_solution(M: ca.SX, A: ca.SX, top: Vector, bottom: Vector) -> tuple[Vector, Vector]:
    """x, y of M x + Aᵀ y = top, A x = bottom, for M positive definite and A of full row rank."""
    nv, nc = M.size1(), A.size1()
    matrix = scalars(ca.blockcat([[M, A.T], [A, ca.SX(nc, nc)]]))
    order = [*reversed(range(nv)), *range(nv, nv + nc)]
    x = ldl_solution(matrix, [[*top, *bottom]], order).x[0]
    return x[:nv], x[nv:]


def _entries(column: ca.SX) -> Vector:
    return [column[i] for i in range(column.numel())]


def _column(entries: Vector) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
