"""The slopes of a tree of links whose generalized velocities are the quasi-velocities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.formulations.limits import UNROLLED
from derive.formulations.motion import Motion, at_motion, is_unit
from derive.formulations.records import Elimination
from derive.formulations.structured.afloat import afloat, from_afloat
from derive.formulations.structured.displacements import displacements
from derive.formulations.structured.factors import (
    Solve,
    by_factors,
    by_inverse,
    column,
    columns_of,
    entries,
    factorization,
    filled,
    matrix_of,
    of_sides,
    tip_to_base,
)
from derive.formulations.structured.records import Known, Slopes, rest_of, slopes_of
from derive.joints.rotations import dot, is_zero, minus, plus, times
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.recursions.slopes import Tree


def of_tree(system: System, motion: Motion) -> Iterator[Slopes]:
    """The slopes of a tree of links whose generalized velocities are the quasi-velocities, by each
    of equivalent sets of inertias, solved with M = Lᵀ D L and with M⁻¹."""
    for inertias in reversed(system.inertias):
        terms = _terms(system, motion, inertias)
        for solve in (by_factors, by_inverse):
            yield _of_terms(system, motion, terms, solve)


def is_tree(system: System, motion: Motion) -> bool:
    return not system.rows and bool(system.links) and is_unit(motion.B)


@dataclass(frozen=True)
class _Terms:
    """M, v̇ as the tree sees it, and the right-hand sides of M ∂v̇ = …: by displacements over v
    (with the way from q to them), by q, by v, by u."""

    mass: Matrix
    vdot: Vector
    moves: Matrix
    way: ca.SX
    by_q: ca.SX
    by_v: ca.SX
    by_u: ca.SX
    afloat: tuple[Link, ...]


def _terms(system: System, motion: Motion, inertias: Sequence[Inertia]) -> _Terms:
    roots, nv = afloat(system), system.v.numel()
    tree = tree_of(system, motion, inertias, roots)
    M, H = _masses(tree, roots)
    extra = scalars(system.M_extra)
    mass = [[plus(x, y) for x, y in zip(*rows)] for rows in zip(M, extra)]
    known = entries(at_motion(system, motion, system.Q - system.h_extra))
    products = [dot(row, tree.velocities) for row in H]
    bias = [plus(x, y) for x, y in zip(products, tree.weights())]
    force = [minus(x, y) for x, y in zip(known, bias)]
    vdot = ldl_solution(mass, [force], tip_to_base(nv)).x[0]
    rest = rest_of(system, motion, vdot, roots)
    balance = [minus(x, dot(row, vdot)) for x, row in zip(known, extra)]
    D = tree.displacements(vdot, balance)
    by_v = matrix_of([[0.0 if is_zero(x) else times(-2.0, x) for x in row] for row in H], nv)
    return _Terms(
        mass=mass,
        vdot=vdot,
        moves=[[0.0 if is_zero(x) else -x for x in row] for row in D],
        way=at_motion(system, motion, displacements(system)),
        by_q=-rest.by_q,
        by_v=by_v - rest.by_v,
        by_u=-rest.by_u,
        afloat=roots,
    )


def _masses(tree: Tree, roots: Sequence[Link]) -> tuple[Matrix, Matrix]:
    """M and ½ ∂h/∂v; what is afloat does not feel how fast it goes."""
    M, H = tree.masses()
    still = {j for link in roots for j in link.columns[:3]}
    return M, [[0.0 if j in still else x for j, x in enumerate(row)] for row in H]


def tree_of(
    system: System, motion: Motion, inertias: Sequence[Inertia], roots: Sequence[Link]
) -> Tree:
    v = entries(motion.v)
    for link in roots:
        for j in link.columns[:3]:
            v[j] = 0.0
    nothing: Vector = [0.0, 0.0, 0.0]
    free = {link.name for link in roots}
    ground = [nothing if link.name in free else system.gravity for link in system.links]
    return Tree(system.links, inertias, v, ground)


def _of_terms(system: System, motion: Motion, terms: _Terms, solve: Solve) -> Slopes:
    nv, nq = system.v.numel(), system.q.numel()
    sides = [
        *columns_of(terms.moves),
        *columns_of(scalars(terms.by_q)),
        *columns_of(scalars(terms.by_v)),
        *columns_of(scalars(terms.by_u)),
    ]
    slopes = of_sides(terms.mass, sides, solve)
    moves, by_q = slopes[:, :nv], slopes[:, nv : nv + nq]
    by_v, by_u = slopes[:, nv + nq : 2 * nv + nq], slopes[:, 2 * nv + nq :]
    by_q = by_q + ca.mtimes(moves, terms.way)
    vdot = column(terms.vdot)
    for link in terms.afloat:
        vdot, by_q, by_v = from_afloat(system, motion, link, vdot, by_q, by_v)
    return slopes_of(system, motion, Known(vdot, by_q, by_v, by_u, ca.SX(nv, nq)))


def looped(system: System, motion: Motion) -> Elimination | None:
    """[ẋ ∂ẋ/∂x ∂ẋ/∂u] of a tree with what is solved for left to a loop over the columns; None where
    that is short enough to be written out."""
    if not is_tree(system, motion) or system.model.states:
        return None
    terms = _terms(system, motion, system.inertias[-1])
    by_q = ca.mtimes(matrix_of(terms.moves, system.v.numel()), terms.way) + terms.by_q
    sides = ca.sparsify(ca.horzcat(by_q, terms.by_v, terms.by_u))
    columns = sum(end - begin for begin, end in filled(sides))
    if (4 * len(factorization(terms.mass)[0]) + len(terms.mass)) * columns <= UNROLLED:
        return None
    vdot, nv = column(terms.vdot), system.v.numel()
    direct_q, direct_v = ca.SX(nv, system.q.numel()), ca.SX(nv, nv)
    for link in terms.afloat:
        vdot, direct_q, direct_v = from_afloat(system, motion, link, vdot, direct_q, direct_v)
    direct = ca.sparsify(ca.horzcat(direct_q, direct_v, ca.SX(nv, system.u.numel())))
    return _elimination(system, motion, terms.mass, vdot, sides, direct)


def _elimination(
    system: System,
    motion: Motion,
    mass: Matrix,
    vdot: ca.SX,
    sides: ca.SX,
    direct: ca.SX,
) -> Elimination:
    """What is known where something is solved for is added later, the rest stands there at once."""
    factors, pivots = factorization(mass)
    nq, n, ranges = system.q.numel(), len(pivots), filled(sides)
    nothing = ca.SX(n, system.q.numel())
    known = Known(vdot, nothing, ca.SX(n, n), ca.SX(n, system.u.numel()), ca.SX(n, nq))
    above = slopes_of(system, motion, known)
    later = [
        (i, j)
        for i, j in zip(*direct.sparsity().get_triplet())
        if any(begin <= j < end for begin, end in ranges)
    ]
    below = ca.SX(sides)
    for i, j in zip(*direct.sparsity().get_triplet()):
        if (i, j) not in later:
            below[i, j] = direct[i, j]
    upper = ca.horzcat(above.rates[:nq], above.by_x[:nq, :], above.by_u[:nq, :])
    width = 1 + sides.size2()
    return Elimination(
        order=tuple(tip_to_base(n)),
        pairs=tuple(factors),
        values=ca.vertcat(*factors.values(), *(1.0 / pivot for pivot in pivots)),
        unsolved=ca.densify(ca.vertcat(upper, ca.horzcat(vdot, below))),
        first=nq,
        ranges=tuple((begin + 1, end + 1) for begin, end in ranges),
        added=column([direct[i, j] for i, j in later]),
        places=tuple((nq + i) * width + 1 + j for i, j in later),
    )
