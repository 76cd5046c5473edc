"""Gauss's principle written out: of all v̇ with A v̇ = β the one nearest to a = M⁻¹ F in the metric
of M."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.joints.rotations import dot, plus
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import Named, System
from derive.mechanics.recursions.articulated import motions_of, tree_solution


@dataclass(frozen=True)
class Constrained:
    """v̇ and λ of M v̇ = F + Aᵀ λ, A v̇ = β; `free` is a = M⁻¹ F, `G` is A M⁻¹ Aᵀ with its
    pivots."""

    vdot: Vector
    lam: Vector
    free: Vector
    G: Matrix
    pivots: Vector


def constrained_motion(A: ca.SX, beta: Vector, inverse: Sequence[Vector]) -> Constrained:
    """Gauss's principle in closed form, with F the applied forces less the bias:

        G = A M⁻¹ Aᵀ,   λ = G⁻¹ (β − A a),   v̇ = a + M⁻¹ Aᵀ λ,   a = M⁻¹ F.

    `inverse` holds a, then M⁻¹ of every row of A (nv each). A has full row rank: the pivots of G,
    which the caller guards, vanish where it loses it. Source: Gauss 1829; Udwadia, Kalaba 1992.
    """
    free, response = inverse[0], inverse[1:]
    rows = rows_of(A)
    G = [
        # G is symmetric: both halves from one product, so that rounding keeps it so
        [dot(rows[max(i, j)], response[min(i, j)]) for j in range(len(rows))]
        for i in range(len(rows))
    ]
    side = [b - dot(row, free) for b, row in zip(beta, rows)]
    solution = ldl_solution(G, [side], range(len(rows)))
    lam = solution.x[0]
    vdot = [a + dot([x[j] for x in response], lam) for j, a in enumerate(free)]
    return Constrained(vdot, lam, free, G, solution.pivots)


def inverse_applied(system: System, sides: Sequence[Vector]) -> list[Vector]:
    """M⁻¹ of each side (nv each): L D Lᵀ from tip to base, which on a tree fills nothing in, or the
    O(n) recursion over the links where M is not written out."""
    n = system.v.numel()
    if system.written:
        return ldl_solution(scalars(system.M), sides, list(reversed(range(n)))).x
    return tree_inverse_applied(system, sides)


def tree_inverse_applied(system: System, sides: Sequence[Vector]) -> list[Vector]:
    """The same by the recursion: of each side it is O(n)."""
    n = system.v.numel()
    rotors = [system.M_extra[j, j] if system.M_extra.has_nz(j, j) else 0.0 for j in range(n)]
    return [
        tree_solution(system.links, system.inertias[-1], rotors, side).vdot for side in sides
    ]  # regrouped: cheaper


def is_of_links(system: System) -> bool:
    """All inertia is in bodies, or in rotors of single velocities: what the recursion knows."""
    rows, columns = system.M_extra.sparsity().get_triplet()
    carried = {j for link in system.links for j in link.columns}
    return rows == columns and len(carried) == system.v.numel()


@dataclass(frozen=True)
class Held:
    """v̇ = S v̇' + σ where single velocities are given, the recursion over the others v̇', and the
    rows that are left, A v̇' = β."""

    S: ca.SX
    sigma: ca.SX
    A: ca.SX
    beta: Vector
    solve: Callable[[Vector], Vector]  # M'⁻¹ of a force conjugate to v'

    def motion(self, force: ca.SX) -> tuple[ca.SX, Vector]:
        """v̇ and λ for forces (nv) conjugate to v, those at v̇ = σ taken off.

        Refined once: a link at the rows that is lighter than the others by 1/ε leaves G with a part
        of that size, in which as many digits of λ are lost, and A v̇ = β is missed by them.
        """
        responses = [self.solve(row) for row in rows_of(self.A)]
        free = self.solve(_entries(ca.mtimes(self.S.T, force)))
        found = constrained_motion(self.A, self.beta, [free, *responses])
        again = constrained_motion(self.A, self.beta, [found.vdot, *responses])
        lam = [plus(x, more) for x, more in zip(found.lam, again.lam)]
        return ca.densify(ca.mtimes(self.S, _column(again.vdot)) + self.sigma), lam


def held_tree(system: System, A: ca.SX, beta: ca.SX) -> Held:
    """What single velocities are given by rows of one number each, and what is left."""
    nv, single = system.v.numel(), velocities_alone(A)
    sigma = ca.SX(nv, 1)
    for i, j in single.items():
        sigma[j] = beta[i] / A[i, j]
    S = ca.SX.eye(nv)[:, [j for j in range(nv) if j not in single.values()]]
    rest = [i for i in range(A.size1()) if i not in single]
    motions = motions_of(system, S) or [[] for _ in system.links]  # where all are given
    rotors = _entries(ca.diag(ca.mtimes(S.T, ca.mtimes(system.M_extra, S))))

    def solve(force: Vector) -> Vector:
        return tree_solution(system.links, system.inertias[-1], rotors, force, motions).vdot

    left = _entries(beta[rest, 0] - ca.mtimes(A[rest, :], sigma))
    return Held(S, sigma, ca.sparsify(ca.mtimes(A[rest, :], S)), left, solve)


def velocities_alone(A: ca.SX) -> dict[int, int]:
    """By row the velocity that it speaks of alone, times a number."""
    columns: list[list[int]] = [[] for _ in range(A.size1())]
    for i, j in zip(*A.sparsity().get_triplet()):
        columns[i].append(j)
    alone = {i: own[0] for i, own in enumerate(columns) if len(own) == 1}
    return {i: j for i, j in alone.items() if A[i, j].is_constant()}


def rows_of(A: ca.SX) -> Matrix:
    """The rows of a matrix as lists, what is not stored as the float 0: `solve` skips those."""
    return scalars(A)


def named(found: Constrained, A: ca.SX, beta: Vector) -> tuple[Named, ...]:
    """What the derivation shows; A and β of the independent rows."""
    G = ca.vertcat(*[ca.horzcat(*row) for row in found.G]) if found.G else ca.SX(0, 0)
    terms = (
        Named("A_kept", "independent rows of A", A),
        Named("beta_kept", "β of these", _column(beta)),
    )
    forces = Named("lam_kept", "λ of these", _column(found.lam))
    return (
        Named("a", "accelerations without constraints", _column(found.free)),
        Named("G", "A M⁻¹ Aᵀ", G),
        *terms,
        forces,
    )


def _column(x: Vector) -> ca.SX:
    return ca.vertcat(*x) if x else ca.SX(0, 1)


def _entries(column: ca.SX) -> Vector:
    return [*ca.vertsplit(ca.densify(column))] if column.numel() else []
