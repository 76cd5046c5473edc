"""Equations of motion in quasi-velocities, without multipliers (Mirtaheri & Zohoor; Maggi; Kane).

With v = S w + v₀ and v̇ = S ẇ + σ, projecting M v̇ + h = Q + Aᵀ λ on the columns of S (A S = 0)
leaves
    (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ).
Both sides can be gathered link by link, from the links' twists as forms in w (Kane's partial
velocities), or joint by joint (composite bodies, Newton–Euler from tip to base, then Sᵀ). Which is
cheaper depends on the model: both are counted.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product as combinations

import casadi as ca

from derive.choices.elimination import Elimination, transformation
from derive.choices.limits import EXPLICIT_MANY
from derive.choices.reduction import Reduction
from derive.expressions.counting import alternatives, instructions
from derive.expressions.deferred import Deferred, Term, is_deferred, passed_on
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import dot, minus, plus
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.inverse.dynamics import joint_forces_of_motion
from derive.mechanics.inverse.layouts import layouts
from derive.mechanics.records import Carried, Inertia, Named, System
from derive.mechanics.recursions.articulated import Motions, motions_of, tree_solution
from derive.mechanics.recursions.forms import Form
from derive.mechanics.recursions.motion import Numbers
from derive.mechanics.recursions.tree import (
    Wrench,
    gravities,
    ground_rotations,
    inertia_force,
    joint_forces,
    mass_matrix,
    momentum,
)

Nearest = Callable[[Sequence[Scalar]], Vector]


@dataclass(frozen=True)
class Explicit:
    """q̇, ẇ and v̇ over (t, q, w, u, p), with the reduced mass matrix and force they come from;
    `solve` gives the ẇ of mass ẇ = f for other f, none where nothing is written out; `nearest` the
    least δ in the metric of M for the A δ of the kept rows, where a way to it is known that no
    pivot of the choice is in."""

    qdot: ca.SX
    operations: int  # none where they are not written out
    gathered: str
    wdot: Term[ca.SX] = Term()
    vdot: Term[ca.SX] = Term()
    mass: Term[ca.SX] = Term()
    force: Term[ca.SX] = Term()
    solve: Callable[[Vector], Vector] | None = None
    nearest: Nearest | None = None
    lam: ca.SX | None = None  # of the independent rows, where it is found on the way

    def named(self, reduction: Reduction) -> tuple[Named, ...]:
        """What the generated code names its sections after."""
        shown = (
            Named("S", "generalized velocities per quasi-velocity, v = S w + R c", reduction.S),
            Named("v", "generalized velocities", reduction.v),
            Named("sigma", "v̇ where ẇ = 0", reduction.sigma),
        )
        if is_deferred(self, "wdot"):
            return shown
        return (
            *shown,
            Named("M_w", "mass matrix of the quasi-velocities, Sᵀ M S", passed_on(self, "mass")),
            Named("f_w", "right-hand side, Sᵀ (Q − h − M σ)", passed_on(self, "force")),
        )


def explicit(system: System, reduction: Reduction) -> Explicit:
    """The explicit equations (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ), gathered in the way that needs the
    fewest operations: by joints, by links, with inertias as given or regrouped, or by the O(n)
    recursion. All ways give the same ẇ up to rounding; only the operations of q̇ and ẇ are
    compared."""
    if system.long and not system.rows and motions_of(system, reduction.S):
        return _deferred(system, reduction)
    solution = _articulated(system, reduction)
    if not solution or system.written:
        solution += _by_matrices(system, reduction)
    qdot = _position_rates(system, reduction)
    results = [ca.vertcat(qdot, x.wdot) for x in solution]
    counts = alternatives(results) if len(solution) > 1 else [instructions(results[0])]
    best = solution[counts.index(min(counts))]
    vdot = ca.densify(ca.mtimes(reduction.S, best.wdot) + reduction.sigma)
    return Explicit(
        qdot=qdot,
        operations=min(counts),
        gathered=best.gathered,
        wdot=best.wdot,
        vdot=vdot,
        mass=_mass(system, reduction, best),
        force=_column(best.force),
        solve=best.solve,
    )


def _mass(system: System, reduction: Reduction, best: _Gathered) -> ca.SX | Deferred[ca.SX]:
    """Sᵀ M S. The recursion makes none: where M is not written out either, it is gathered when it
    is asked for."""
    if best.mass is not None:
        return _sparse(best.mass)
    if system.written:
        return reduced_mass(system, reduction)
    return Deferred(lambda: reduced_mass(system, reduction), len(reduction.names) ** 2)


def reduced_mass(system: System, reduction: Reduction) -> ca.SX:
    """Sᵀ M S; M of the links where it is not written out."""
    if system.written:
        return _symmetric_product(reduction.S, system.M)
    own = mass_matrix(system.links, system.inertias[-1], system.v.numel())
    return _symmetric_product(reduction.S, _sparse(own) + system.M_extra)


def _position_rates(system: System, reduction: Reduction) -> ca.SX:
    """q̇ at v of the choice, over the velocities that were walked."""
    tree, walked = reduction.tree, reduction.walked
    if tree is None or walked is None:
        return ca.substitute(system.qdot, system.v, reduction.v)
    return ca.substitute(tree.qdot, tree.v, _column(walked.v))


def _deferred(system: System, reduction: Reduction) -> Explicit:
    """The O(n) recursion of a long tree, which loops over links do not need written out."""

    @functools.cache
    def found() -> _Gathered:
        return _articulated(system, reduction)[0]

    def late(make: Callable[[], ca.SX]) -> Deferred[ca.SX]:
        return Deferred(make, len(reduction.names))

    return Explicit(
        qdot=ca.substitute(system.qdot, system.v, reduction.v),
        operations=0,
        gathered="articulated bodies",
        wdot=late(lambda: found().wdot),
        vdot=late(lambda: ca.densify(ca.mtimes(reduction.S, found().wdot) + reduction.sigma)),
        mass=late(lambda: reduced_mass(system, reduction)),
        force=late(lambda: _column(found().force)),
        solve=lambda side: found().solve(side),
    )


@dataclass(frozen=True)
class _Gathered:
    """One way to ẇ."""

    gathered: str
    mass: Matrix | None  # None: not made on the way
    force: Vector
    wdot: ca.SX
    solve: Callable[[Vector], Vector]


def _by_matrices(system: System, reduction: Reduction) -> list[_Gathered]:
    """ẇ by an unrolled L D Lᵀ, tip to base, from every pair of a mass matrix and a force; where
    solving is long, from the pair that is made with the fewest operations."""
    pairs = list(
        combinations(_masses(system, reduction).items(), _forces(system, reduction).items())
    )
    if len(reduction.names) > EXPLICIT_MANY:
        sides = [
            ca.vertcat(reduction.v, *[_column(row) for row in mass], _column(force))
            for (_, mass), (_, force) in pairs
        ]
        counts = alternatives(sides)
        pairs = [pairs[counts.index(min(counts))]]
    return [
        _Gathered(
            f"{a}, {b}",
            mass,
            force,
            _column(_of_matrix(mass, force)),
            functools.partial(_of_matrix, mass),
        )
        for (a, mass), (b, force) in pairs
    ]


def _of_matrix(mass: Matrix, force: Vector) -> Vector:
    return ldl_solution(mass, [force], list(reversed(range(len(force))))).x[0]


def _articulated(system: System, reduction: Reduction) -> list[_Gathered]:
    """ẇ by the O(n) recursion, where each quasi-velocity moves one joint of a tree, what else the
    joints do is prescribed, and T is the bodies' alone."""
    motions = motions_of(system, reduction.S)
    if not motions:
        return []
    rotors = _entries(ca.densify(ca.diag(_symmetric_product(reduction.S, system.M_extra))))
    candidates: list[_Gathered] = []
    force = forces_on_tree(system, reduction)
    for label, inertias in _inertias(system):
        solve = functools.partial(_of_tree, system, inertias, rotors, motions)
        wdot = _column(solve(force))
        candidates.append(_Gathered(f"articulated bodies{label}", None, force, wdot, solve))
    return candidates


def _of_tree(
    system: System,
    inertias: Sequence[Inertia],
    rotors: Vector,
    motions: Sequence[Motions],
    force: Vector,
) -> Vector:
    return tree_solution(system.links, inertias, rotors, force, motions).vdot


def forces_on_tree(system: System, reduction: Reduction) -> Vector:
    """Sᵀ (Q − h − M σ) by Newton–Euler with v̇ = σ."""
    return _by_joints(system, reduction, _beside_links(system, reduction), reduction.sigma)


def forces_at(system: System, v: ca.SX, vdot: ca.SX) -> ca.SX:
    """Q − h − M v̇ (nv) by Newton–Euler."""
    given = _entries(v), _entries(ca.densify(vdot))
    inertial = _column(joint_forces_of_motion(system.layouts, *given, system.gravity))
    beside = ca.substitute(system.Q - system.h_extra, system.v, v)
    return beside - ca.mtimes(system.M_extra, vdot) - inertial


def _beside_links(system: System, reduction: Reduction) -> ca.SX:
    """Q − h − M σ, of h and M what is beside the links."""
    Q = _at(system, reduction, system.Q - system.h_extra)
    return Q - ca.mtimes(system.M_extra, reduction.sigma)


def _column(entries: Vector) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)


def _sparse(rows: Matrix) -> ca.SX:
    return ca.vertcat(*[ca.horzcat(*row) for row in rows]) if rows else ca.SX(0, 0)


def _masses(system: System, reduction: Reduction) -> dict[str, Matrix]:
    """Sᵀ M S, by joints and, where the walk gave twists as forms, by links."""
    result: dict[str, Matrix] = {}
    if reduction.tree is not None:
        result |= _masses_by_joints(system, reduction, reduction.tree)
    elif system.written:
        result["mass matrix by joints"] = scalars(_symmetric_product(reduction.S, system.M))
    if reduction.walked is not None and system.links and system.rows:
        for label, inertias in _inertias(reduction.tree or system):
            result[f"mass matrix by links{label}"] = _mass_by_links(system, reduction, inertias)
    return result


def _masses_by_joints(system: System, reduction: Reduction, tree: Carried) -> dict[str, Matrix]:
    walked, nv = reduction.walked, tree.v.numel()
    assert walked is not None
    S = transformation(walked.speeds, len(reduction.names))
    extra = _symmetric_product(reduction.S, system.M_extra)
    result: dict[str, Matrix] = {}
    for label, inertias in _inertias(tree):
        M = _sparse(mass_matrix(tree.links, inertias, nv))
        result[f"mass matrix by joints{label}"] = scalars(_symmetric_product(S, M) + extra)
    return result


def _inertias(system: System | Carried) -> list[tuple[str, tuple[Inertia, ...]]]:
    return list(zip(("", " (regrouped inertias)")[-len(system.inertias) :], system.inertias))


def _symmetric_product(S: ca.SX, M: ca.SX) -> ca.SX:
    return M if _is_identity(S) else ca.mtimes(S.T, ca.mtimes(M, S))


def _is_identity(S: ca.SX) -> bool:
    return S.is_square() and bool((S - ca.SX.eye(S.size1())).is_zero())


def _forces(system: System, reduction: Reduction) -> dict[str, Vector]:
    """Sᵀ (Q − h − M σ), likewise: with accelerations recomputed from v and σ, or with the rates the
    rows needed anyway."""
    Q = _beside_links(system, reduction)
    applied = ca.mtimes(reduction.S.T, Q)
    result = {"forces by joints": _by_joints(system, reduction, Q, reduction.sigma)}
    tree = reduction.tree or system
    for label, inertias in _inertias(tree):
        if reduction.walked is None or not system.rows:
            continue
        wrenches = _wrenches(tree, reduction.walked, inertias)
        result[f"forces by joints from rates{label}"] = _carried(system, reduction, Q, wrenches)
        by_links = _force_by_links(reduction, wrenches)
        result[f"forces by links{label}"] = [
            minus(applied[k], by_links[k]) for k in range(len(by_links))
        ]
    return result


def _entries(column: ca.SX) -> Vector:
    return [column[i] for i in range(column.numel())]


def _by_joints(system: System, reduction: Reduction, Q: ca.SX, vdot: ca.SX) -> Vector:
    """Sᵀ (Q − M v̇ − h) of the links at v of the choice."""
    if reduction.tree is not None:
        return _by_joints_of_tree(reduction, reduction.tree, Q)
    motion = _entries(reduction.v), _entries(vdot)
    inertial = _column(joint_forces_of_motion(system.layouts, *motion, system.gravity))
    return _entries(ca.mtimes(reduction.S.T, Q - inertial))


def _by_joints_of_tree(reduction: Reduction, tree: Carried, Q: ca.SX) -> Vector:
    walked = reduction.walked
    assert walked is not None
    # what the further frame is short of in acceleration the joint has more: its links feel the sum
    motion = tree.frame.relative(walked.v), walked.sigma
    inertial = _column(joint_forces_of_motion(layouts(tree.links), *motion, tree.gravity))
    return _less_inertial(reduction, tree, Q, inertial)


def _less_inertial(reduction: Reduction, tree: Carried, Q: ca.SX, inertial: ca.SX) -> Vector:
    """Sᵀ Q − S'ᵀ (inertial forces), S' of the tree."""
    assert reduction.walked is not None
    S = transformation(reduction.walked.speeds, len(reduction.names))
    return _entries(ca.mtimes(reduction.S.T, Q) - ca.mtimes(S.T, inertial))


def _carried(system: System, reduction: Reduction, Q: ca.SX, wrenches: list[Wrench]) -> Vector:
    tree = reduction.tree
    if tree is not None:
        inertial = _column(joint_forces(tree.links, wrenches, tree.v.numel()))
        return _less_inertial(reduction, tree, Q, inertial)
    inertial = _column(joint_forces(system.links, wrenches, system.v.numel()))
    return _entries(ca.mtimes(reduction.S.T, Q - inertial))


def _at(system: System, reduction: Reduction, expression: ca.SX) -> ca.SX:
    return ca.substitute(expression, system.v, reduction.v)


def _wrenches(
    system: System | Carried, walked: Elimination, inertias: tuple[Inertia, ...]
) -> list[Wrench]:
    down = gravities(system.links, ground_rotations(system.links), system.gravity)
    return [inertia_force(*args) for args in zip(inertias, walked.numbers, walked.rates, down)]


def _columns(reduction: Reduction, i: int) -> list[Numbers]:
    """Link i's partial velocities: its twist per unit of each quasi-velocity."""
    assert reduction.walked is not None
    omega, velocity = reduction.walked.twists[i]
    return [
        (_coefficients(omega, k), _coefficients(velocity, k)) for k in range(len(reduction.names))
    ]


def _coefficients(forms: list[Form], k: int) -> Vector:
    return [form.get(("w", k), 0.0) for form in forms]


def _mass_by_links(system: System, reduction: Reduction, inertias: tuple[Inertia, ...]) -> Matrix:
    """Σ over links of tₐ · (𝓜 t_b), t the partial velocities: Kane's way to M_w, the lower half
    alone."""
    nw = len(reduction.names)
    extra = scalars(_symmetric_product(reduction.S, system.M_extra))
    for i, body in enumerate(inertias):
        columns = _columns(reduction, i)
        for a in range(nw):
            n, f = momentum(body, columns[a])
            for b in range(a + 1):
                extra[a][b] = plus(extra[a][b], _power(columns[b], (n, f)))
    return [[extra[max(a, b)][min(a, b)] for b in range(nw)] for a in range(nw)]


def _force_by_links(reduction: Reduction, wrenches: list[Wrench]) -> Vector:
    result: Vector = [0.0] * len(reduction.names)
    for i, wrench in enumerate(wrenches):
        for k, column in enumerate(_columns(reduction, i)):
            result[k] = plus(result[k], _power(column, wrench))
    return result


def _power(twist: Numbers, wrench: Wrench) -> Scalar:
    return plus(dot(twist[0], wrench[0]), dot(twist[1], wrench[1]))
