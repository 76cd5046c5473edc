"""∂ẋ/∂x and ∂ẋ/∂u from the slopes of inverse dynamics: M ∂v̇ = −∂(M v̇ + h − Q), v̇ held.

With τ(q, v, v̇) = M v̇ + h − Q, v = S w + R c, v̇ = S ẇ + σ and λ = Rᵀ τ, so that Sᵀ τ = 0:

    (Sᵀ M S) ∂ẇ = −Sᵀ (∂τ/∂q − ∂(Aᵀλ)/∂q + ∂τ/∂v ∂v + M ∂v̇)        (λ held, ẇ held in ∂v̇)
    Y ∂v = [∂c − ∂(A v); −∂(B v)],   Y ∂v̇ = [∂β − ∂(A v̇); −∂(B v̇ + Ḃ v)],   Y = [A; B], Y⁻¹ = [R S]

since Y S = [0; 1] gives ∂S = −R ∂A S − S ∂B S. Nothing that was eliminated is differentiated. A
tree on a free root does not feel where it is, how it is turned and how fast it goes: with u = 0,
g = 0 and a' = u̇ + ω × u − Rᵀ g in the place of u̇ those columns are zero but for closed forms.

Sources: J. Carpentier, N. Mansard, RSS 2018; S. Singh, R. P. Russell, P. M. Wensing, IEEE RA-L 7
(2022) 1776–1783.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.formulations.limits import UNROLLED
from derive.formulations.motion import Minimal, Motion, at_motion, is_unit
from derive.formulations.records import Elimination
from derive.joints.rotations import cross, dot, is_zero, minus, plus, rotated, times, transpose
from derive.mechanics.records import Inertia, Link, System
from derive.mechanics.slopes import Tree
from derive.mechanics.solve import ldl_solution, scalars, small_inverse
from derive.mechanics.system import inertial_forces

Solve = Callable[[Matrix, Sequence[Vector]], list[Vector]]


@dataclass(frozen=True)
class Slopes:
    """ẋ (nx), ∂ẋ/∂x and ∂ẋ/∂u over (t, x, u, p), sparse."""

    rates: ca.SX
    by_x: ca.SX
    by_u: ca.SX


def by_structure(system: System, motion: Motion) -> Iterator[Slopes]:
    """Every way there is; none in generalized velocities that multipliers hold together, and none
    with first-order states."""
    if system.model.states:
        return iter(())
    return (of_tree if _is_tree(system, motion) else of_reduction)(system, motion)


def of_tree(system: System, motion: Motion) -> Iterator[Slopes]:
    """The slopes of a tree of links whose generalized velocities are the quasi-velocities, by each
    of equivalent sets of inertias, solved with M = Lᵀ D L and with M⁻¹."""
    for inertias in reversed(system.inertias):
        terms = _terms(system, motion, inertias)
        for solve in (_by_factors, _by_inverse):
            yield _of_terms(system, motion, terms, solve)


def _is_tree(system: System, motion: Motion) -> bool:
    return not system.rows and bool(system.links) and is_unit(motion.B)


@dataclass(frozen=True)
class _Rest:
    """What is not of the links, M_extra v̇ + h_extra − Q over (q, v, v̇, u), with its slopes."""

    value: ca.SX
    mass: ca.SX
    by_q: ca.SX
    by_v: ca.SX
    by_u: ca.SX


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


def afloat(system: System) -> tuple[Link, ...]:
    """Roots with six degrees of freedom, velocity of the origin first, that carry no rotors."""
    held = [j for j in range(system.v.numel()) if system.M_extra[:, j].nnz()]
    return tuple(
        link
        for link in system.links
        if link.parent < 0
        and len(link.columns) == 6
        and not set(link.columns) & set(held)
        and all(is_zero(x) for x in link.b)
    )


def displacements(system: System) -> ca.SX:
    """nv × nq: the displacement over v per change of a coordinate, N⁻¹ block by block. Turns do not
    feel the length of a quaternion, so of one it is 4 Nᵀ/|q|²."""
    N, q = system.N, system.q
    result = ca.SX(N.size2(), N.size1())
    turned: set[int] = set()
    for start in system.quaternions:
        rows = list(range(start, start + 4))
        columns = [j for j in range(N.size2()) if N[start : start + 4, j].nnz()]
        weight = 4.0 / ca.sumsqr(q[start : start + 4])
        result[columns, rows] = weight * N[rows, columns].T
        turned |= set(rows)
    for rows, columns in _blocks(N, turned):
        result[columns, rows] = _inverse(system, N[rows, columns])
    return ca.sparsify(result)


def _blocks(N: ca.SX, without: set[int]) -> list[tuple[list[int], list[int]]]:
    """Rows and columns that belong together."""
    groups: list[tuple[set[int], set[int]]] = []
    for row in (i for i in range(N.size1()) if i not in without):
        rows, columns = {row}, {j for j in range(N.size2()) if N[row, j].nnz()}
        for group in [g for g in groups if g[1] & columns]:
            groups.remove(group)
            rows, columns = rows | group[0], columns | group[1]
        groups.append((rows, columns))
    return [(sorted(rows), sorted(columns)) for rows, columns in groups]


def _inverse(system: System, block: ca.SX) -> ca.SX:
    """The transpose where the block is a rotation, as of positions that move in turned axes."""
    if _is_rotation(system, block):
        return block.T
    inverted, _ = small_inverse(scalars(block))
    return ca.vertcat(*(ca.horzcat(*row) for row in inverted))


def _is_rotation(system: System, block: ca.SX) -> bool:
    """Seen at random values: formulas are not simplified to find out."""
    symbols = ca.vertcat(system.t, system.q, system.p)
    at = ca.Function("block", [symbols], [ca.densify(block)])
    values = np.random.default_rng(0).uniform(0.5, 1.5, (symbols.numel(), 3))
    rotations = [np.array(at(column)) for column in values.T]
    return all(np.allclose(N @ N.T, np.eye(len(N)), atol=1e-12) for N in rotations)


def _terms(system: System, motion: Motion, inertias: Sequence[Inertia]) -> _Terms:
    roots, nv = afloat(system), system.v.numel()
    tree = _tree(system, motion, inertias, roots)
    M, H = _masses(tree, roots)
    extra = scalars(system.M_extra)
    mass = [[plus(x, y) for x, y in zip(*rows)] for rows in zip(M, extra)]
    known = entries(at_motion(system, motion, system.Q - system.h_extra))
    products = [dot(row, tree.velocities) for row in H]
    bias = [plus(x, y) for x, y in zip(products, tree.weights())]
    force = [minus(x, y) for x, y in zip(known, bias)]
    vdot = ldl_solution(mass, [force], _tip_to_base(nv)).x[0]
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


def _tree(
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


def rest_of(system: System, motion: Motion, vdot: Vector, roots: Sequence[Link] = ()) -> _Rest:
    """M_extra v̇ + h_extra − Q, differentiated as it is written: loads, rotors, energies by
    formula."""
    symbols = ca.SX.sym("vdot", system.v.numel())
    value = ca.mtimes(system.M_extra, symbols) + system.h_extra - system.Q
    slopes = [ca.jacobian(value, x) for x in (system.q, system.v, system.u)]
    at = column(vdot)
    rest = [
        ca.sparsify(at_motion(system, motion, ca.substitute(x, symbols, at)))
        for x in (value, *slopes)
    ]
    return _Rest(rest[0], system.M_extra, *rest[1:])


def entries(column: ca.SX) -> Vector:
    """Numbers as floats, so that zeros are seen."""
    return [row[0] for row in scalars(column)]


def column(values: Vector) -> ca.SX:
    """As a column, 0 × 1 where there are none."""
    return ca.vertcat(*values) if values else ca.SX(0, 1)


def _tip_to_base(n: int) -> list[int]:
    return list(reversed(range(n)))


def _by_factors(M: Matrix, sides: Sequence[Vector]) -> list[Vector]:
    return ldl_solution(M, sides, _tip_to_base(len(M))).x


def _by_inverse(M: Matrix, sides: Sequence[Vector]) -> list[Vector]:
    """M⁻¹ = L⁻¹ D⁻¹ L⁻ᵀ, one half of it, then products."""
    X = inverse_matrix(M)
    return [[dot(row, side) for row in X] for side in sides]


def inverse_matrix(M: Matrix) -> Matrix:
    """M⁻¹ of a symmetric M: with M = L D Lᵀ in the order of elimination, Σ L⁻ᵀ D⁻¹ L⁻¹, entries of
    one half alone."""
    n = len(M)
    units: list[Vector] = [[1.0 if i == k else 0.0 for i in range(n)] for k in range(n)]
    factors, pivots = _factors(M)
    columns = [_forward(factors, unit) for unit in units]
    scaled = [[0.0 if is_zero(x) else x / d for x, d in zip(column, pivots)] for column in columns]
    lower = {(i, j): dot(columns[i], scaled[j]) for i in range(n) for j in range(i + 1)}
    return [[lower[max(i, j), min(i, j)] for j in range(n)] for i in range(n)]


def _forward(factors: dict[tuple[int, int], Scalar], side: Vector) -> Vector:
    """L⁻¹ b."""
    b = list(side)
    for (i, k), factor in factors.items():
        if not is_zero(b[k]):
            b[i] = minus(b[i], times(factor, b[k]))
    return b


def _of_terms(system: System, motion: Motion, terms: _Terms, solve: Solve) -> Slopes:
    nv, nq = system.v.numel(), system.q.numel()
    sides = [
        *(column for column in _columns(terms.moves)),
        *_columns(scalars(terms.by_q)),
        *_columns(scalars(terms.by_v)),
        *_columns(scalars(terms.by_u)),
    ]
    slopes = _of_sides(terms.mass, sides, solve)
    moves, by_q = slopes[:, :nv], slopes[:, nv : nv + nq]
    by_v, by_u = slopes[:, nv + nq : 2 * nv + nq], slopes[:, 2 * nv + nq :]
    by_q = by_q + ca.mtimes(moves, terms.way)
    vdot = column(terms.vdot)
    for link in terms.afloat:
        vdot, by_q, by_v = _from_afloat(system, motion, link, vdot, by_q, by_v)
    return slopes_of(system, motion, _Known(vdot, by_q, by_v, by_u, ca.SX(nv, nq)))


def looped(system: System, motion: Motion) -> Elimination | None:
    """[ẋ ∂ẋ/∂x ∂ẋ/∂u] of a tree with what is solved for left to a loop over the columns; None where
    that is short enough to be written out."""
    if not _is_tree(system, motion) or system.model.states:
        return None
    terms = _terms(system, motion, system.inertias[-1])
    by_q = ca.mtimes(matrix_of(terms.moves, system.v.numel()), terms.way) + terms.by_q
    sides = ca.sparsify(ca.horzcat(by_q, terms.by_v, terms.by_u))
    columns = sum(end - begin for begin, end in _filled(sides))
    if (4 * len(_factors(terms.mass)[0]) + len(terms.mass)) * columns <= UNROLLED:
        return None
    vdot, nv = column(terms.vdot), system.v.numel()
    direct_q, direct_v = ca.SX(nv, system.q.numel()), ca.SX(nv, nv)
    for link in terms.afloat:
        vdot, direct_q, direct_v = _from_afloat(system, motion, link, vdot, direct_q, direct_v)
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
    factors, pivots = _factors(mass)
    nq, n, ranges = system.q.numel(), len(pivots), _filled(sides)
    nothing = ca.SX(n, system.q.numel())
    known = _Known(vdot, nothing, ca.SX(n, n), ca.SX(n, system.u.numel()), ca.SX(n, nq))
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
        order=tuple(_tip_to_base(n)),
        pairs=tuple(factors),
        values=ca.vertcat(*factors.values(), *(1.0 / pivot for pivot in pivots)),
        unsolved=ca.densify(ca.vertcat(upper, ca.horzcat(vdot, below))),
        first=nq,
        ranges=tuple((begin + 1, end + 1) for begin, end in ranges),
        added=column([direct[i, j] for i, j in later]),
        places=tuple((nq + i) * width + 1 + j for i, j in later),
    )


def _factors(M: Matrix) -> tuple[dict[tuple[int, int], Scalar], Vector]:
    """L of M = Lᵀ D L by (row, unknown) in the order of elimination, and D."""
    A, order = [list(row) for row in M], _tip_to_base(len(M))
    factors: dict[tuple[int, int], Scalar] = {}
    for step, k in enumerate(order):
        beyond = [i for i in order[step + 1 :] if not is_zero(A[i][k])]
        factors |= {(i, k): A[i][k] / A[k][k] for i in beyond}
        for a, i in enumerate(beyond):
            for j in beyond[a:]:
                A[i][j] = A[j][i] = minus(A[i][j], times(factors[i, k], A[j][k]))
    return factors, [A[k][k] for k in range(len(M))]


def _filled(sides: ca.SX) -> list[tuple[int, int]]:
    """Columns with something in them, as ranges."""
    filled = sorted(set(sides.sparsity().get_triplet()[1]))
    ranges: list[tuple[int, int]] = []
    for j in filled:
        if ranges and ranges[-1][1] == j:
            ranges[-1] = (ranges[-1][0], j + 1)
        else:
            ranges.append((j, j + 1))
    return ranges


def _columns(rows: Matrix) -> list[Vector]:
    return [list(column) for column in zip(*rows)] if rows else []


def _of_sides(M: Matrix, sides: Sequence[Vector], solve: Solve) -> ca.SX:
    """Of the sides that are not zero by structure; a column each."""
    wanted = [k for k, side in enumerate(sides) if not all(is_zero(x) for x in side)]
    solutions = solve(M, [sides[k] for k in wanted])
    result = ca.SX(len(M), len(sides))
    for k, column in zip(wanted, solutions):
        for i, x in enumerate(column):
            if not is_zero(x):
                result[i, k] = x
    return result


def _from_afloat(
    system: System, motion: Motion, link: Link, vdot: ca.SX, by_q: ca.SX, by_v: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """From a' back to u̇ = a' − ω × u + Rᵀ g."""
    linear, angular = list(link.columns[:3]), list(link.columns[3:])
    v = entries(motion.v)
    u, omega = [v[j] for j in linear], [v[j] for j in angular]
    fall = ca.vertcat(*rotated(transpose(link.R), system.gravity))
    vdot, by_q, by_v = ca.SX(vdot), ca.SX(by_q), ca.SX(by_v)
    vdot[linear] += fall - ca.vertcat(*cross(omega, u))
    by_q[linear, :] += ca.jacobian(fall, system.q)
    by_v[linear, linear] -= ca.skew(ca.vertcat(*omega))
    by_v[linear, angular] += ca.skew(ca.vertcat(*u))
    return vdot, by_q, by_v


@dataclass(frozen=True)
class _Known:
    """ẇ with its slopes, and ∂v/∂q."""

    wdot: ca.SX
    by_q: ca.SX
    by_w: ca.SX
    by_u: ca.SX
    v_by_q: ca.SX


def slopes_of(system: System, motion: Motion, of: _Known) -> Slopes:
    """With those of q̇ = N v."""
    turning = at_motion(system, motion, ca.jacobian(system.qdot, system.q))
    N = at_motion(system, motion, system.N)
    S = ca.jacobian(motion.v, motion.w) if motion.minimal is None else motion.minimal.S
    above = ca.horzcat(turning + ca.mtimes(N, of.v_by_q), ca.mtimes(N, S))
    by_x = ca.vertcat(above, ca.horzcat(of.by_q, of.by_w))
    by_u = ca.vertcat(ca.SX(system.q.numel(), of.by_u.size2()), of.by_u)
    rates = ca.vertcat(motion.qdot, of.wdot)
    return Slopes(rates, ca.sparsify(by_x), ca.sparsify(by_u))


def of_reduction(system: System, motion: Motion) -> Iterator[Slopes]:
    """The slopes through constraints and a choice, with ∂v and ∂v̇ in closed form and, as the
    second way, differentiated.

    Where rows that repeat others are combined, E A v̇ = E β is the rate of E A v = E c on the
    constraints alone, so that there is no closed form for every choice.
    """
    minimal = motion.minimal
    if minimal is None or not motion.names:
        return
    ways = [_carried, _differentiated]
    if minimal.A.size1() != minimal.lam.numel():
        minimal = replace(minimal, lam=_multipliers(system, motion, minimal))
        ways = [_differentiated]
    for way in ways:
        carried = way(system, motion, minimal)
        for inertias in system.inertias:
            yield _through(system, motion, minimal, carried, inertias)


def _multipliers(system: System, motion: Motion, of: Minimal) -> ca.SX:
    """λ = Rᵀ (M v̇ + h − Q), of the rows that stand for all."""
    forces = inertial_forces(system, motion.vdot) + ca.mtimes(system.M_extra, motion.vdot)
    missing = forces + system.h_extra - system.Q
    return ca.mtimes(of.R.T, at_motion(system, motion, missing))


@dataclass(frozen=True)
class _Carried:
    """Of v and v̇ at held ẇ: ∂v/∂q, ∂v̇/∂q and ∂v̇/∂w. `along`: what of the last two is S times it,
    which M_w takes off again."""

    v_by_q: ca.SX
    by_q: ca.SX
    by_w: ca.SX
    along_q: ca.SX
    along_w: ca.SX


def _carried(system: System, motion: Motion, of: Minimal) -> _Carried:
    """Y ∂v = [∂c − ∂(A v); −∂(B v)] and the same of Y v̇ = [β; ẇ − Ḃ v]."""
    q, v, vdot = system.q, system.v, ca.SX.sym("vdot", system.v.numel())
    turning = ca.jtimes(ca.mtimes(motion.B, v), ca.vertcat(system.t, q), ca.vertcat(1, system.qdot))

    def at(expression: ca.SX) -> ca.SX:
        there = ca.substitute(expression, vdot, motion.vdot)
        return ca.sparsify(at_motion(system, motion, there))

    Av, Bv = (ca.jacobian(ca.mtimes(x, v), q) for x in (of.A, motion.B))
    Aa, Ba = (ca.jacobian(ca.mtimes(x, vdot), q) for x in (of.A, motion.B))
    v_by_q = ca.mtimes(of.R, at(ca.jacobian(of.c, q) - Av)) - ca.mtimes(of.S, at(Bv))
    beta_v, turning_v = at(ca.jacobian(of.beta, v)), at(ca.jacobian(turning, v))
    across_q = at(ca.jacobian(of.beta, q) - Aa) + ca.mtimes(beta_v, v_by_q)
    along_q = -at(Ba + ca.jacobian(turning, q)) - ca.mtimes(turning_v, v_by_q)
    return _Carried(
        ca.sparsify(v_by_q),
        ca.sparsify(ca.mtimes(of.R, across_q)),
        ca.sparsify(ca.mtimes(of.R, ca.mtimes(beta_v, of.S))),
        ca.sparsify(along_q),
        ca.sparsify(-ca.mtimes(turning_v, of.S)),
    )


def _differentiated(system: System, motion: Motion, of: Minimal) -> _Carried:
    """As S and σ are written."""
    nw = len(motion.names)
    wdot = ca.SX.sym("wdot", nw)
    vdot = ca.mtimes(of.S, wdot) + of.sigma
    by_q, by_w = (
        ca.sparsify(ca.substitute(ca.jacobian(vdot, x), wdot, motion.wdot))
        for x in (system.q, motion.w)
    )
    nothing = ca.SX(nw, system.q.numel()), ca.SX(nw, nw)
    return _Carried(ca.jacobian(motion.v, system.q), by_q, by_w, *nothing)


def _through(
    system: System,
    motion: Motion,
    of: Minimal,
    carried: _Carried,
    inertias: Sequence[Inertia],
) -> Slopes:
    """M_w ∂ẇ = −Sᵀ (∂τ/∂q − ∂(Aᵀλ)/∂q + ∂τ/∂v ∂v + M ∂v̇)."""
    M, by_q, by_v = _tree_slopes(system, motion, inertias)
    rest = rest_of(system, motion, entries(motion.vdot))
    held = ca.SX.sym("lam", of.A.size1())
    turned = ca.jacobian(ca.mtimes(of.A.T, held), system.q)
    turned = at_motion(system, motion, ca.substitute(turned, held, of.lam))
    by_q, by_v = by_q + rest.by_q - turned, by_v + rest.by_v
    r_q = by_q + ca.mtimes(by_v, carried.v_by_q) + ca.mtimes(M, carried.by_q)
    r_w = ca.mtimes(by_v, of.S) + ca.mtimes(M, carried.by_w)
    sides = ca.sparsify(ca.mtimes(of.S.T, -ca.horzcat(r_q, r_w, rest.by_u)))
    solutions = _of_sides(scalars(of.mass), _columns(scalars(sides)), _by_factors)
    nq, nw = system.q.numel(), len(motion.names)
    wdot_q, wdot_w = (
        solutions[:, :nq] - carried.along_q,
        solutions[:, nq : nq + nw] - carried.along_w,
    )
    known = _Known(motion.wdot, wdot_q, wdot_w, solutions[:, nq + nw :], carried.v_by_q)
    return slopes_of(system, motion, known)


def _tree_slopes(
    system: System, motion: Motion, inertias: Sequence[Inertia]
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M, and of the links alone ∂(M v̇ + h)/∂q and ∂h/∂v."""
    tree = _tree(system, motion, inertias, ())
    M, H = tree.masses()
    D = tree.displacements(entries(motion.vdot))
    way = at_motion(system, motion, displacements(system))
    doubled = [[0.0 if is_zero(x) else times(2.0, x) for x in row] for row in H]
    nv = system.v.numel()
    mass = matrix_of(M, nv) + at_motion(system, motion, system.M_extra)
    return mass, ca.mtimes(matrix_of(D, nv), way), matrix_of(doubled, nv)


def matrix_of(rows: Matrix, columns: int) -> ca.SX:
    """Sparse: exact zeros are not stored."""
    result = ca.SX(len(rows), columns)
    for i, row in enumerate(rows):
        for j, x in enumerate(row):
            if not is_zero(x):
                result[i, j] = x
    return result
