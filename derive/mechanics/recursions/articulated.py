"""M v̇ = τ on a tree in O(n): M = U D Uᵀ link by link, never written out (Saha 1999, DeNOC; the
articulated-body recursion).

With M̂ᵢ the articulated inertia of link i at its joint point, pᵢ its motion axis:
    tip to base   ψ̂ᵢ = M̂ᵢ pᵢ,  m̂ᵢ = pᵢᵀ ψ̂ᵢ,  φ̂ᵢ = τᵢ − pᵢᵀ ηᵢ,
                  M̂ of the carrier += Bᵀ (M̂ᵢ − ψ̂ᵢ ψ̂ᵢᵀ/m̂ᵢ) B,   η of the carrier += Bᵀ (ηᵢ + ψ̂ᵢ
                  φ̂ᵢ/m̂ᵢ)
    base to tip   v̇ᵢ = (φ̂ᵢ − ψ̂ᵢᵀ μᵢ)/m̂ᵢ,   μ of the next = B (μᵢ + pᵢ v̇ᵢ)
m̂ are the pivots D. A joint with several velocities is eliminated one velocity after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    is_zero,
    matrix,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.links import moved, symmetric, turned_tensor
from derive.mechanics.records import Inertia, Link, System

Motions = Sequence[tuple[Vector, int]]  # axes of a link at its joint point, and their numbers


@dataclass(frozen=True)
class Articulated:
    """(n, f) = (J ω̇ + C a, Cᵀ ω̇ + K a): J, K symmetric."""

    J: Matrix
    C: Matrix
    K: Matrix


@dataclass(frozen=True)
class Elimination:
    """One velocity's ψ̂, m̂ and φ̂."""

    column: int
    axis: Vector
    psi: Vector
    m: Scalar
    phi: Scalar


@dataclass(frozen=True)
class Factored:
    """v̇, with the pivots m̂ by generalized velocity."""

    vdot: Vector
    pivots: dict[int, Scalar]


def tree_solution(
    links: Sequence[Link],
    inertias: Sequence[Inertia],
    rotors: Vector,
    tau: Vector,
    motions: Sequence[Motions] | None = None,
) -> Factored:
    """v̇ (nv) of M v̇ = τ without M, in O(n); the equations are at the head of this module. With
    `motions`, link by link, for others than the velocities of the joints; a link that has none is
    fixed to its carrier.

    `inertias` are about the links' origins, in their frames; `rotors` (nv) are added to the
    diagonal of M; `tau` holds all forces conjugate to v, the bias taken off. The pivots m̂ are
    positive where M is positive definite. Sources: Featherstone 1983; Saha 1999.
    """
    bodies = [_rigid(moved(body, (), [-x for x in link.b])) for link, body in zip(links, inertias)]
    wrenches: list[Vector] = [[0.0] * 6 for _ in links]
    steps: list[list[Elimination]] = [[] for _ in links]
    moving = [[*zip(link.motion, link.columns)] for link in links] if motions is None else motions
    for i in reversed(range(len(links))):
        link = links[i]
        for axis, j in moving[i]:
            step = _eliminated(bodies[i], axis, j, rotors[j], tau[j], wrenches[i])
            bodies[i] = _without(bodies[i], step)
            wrenches[i] = sum_of(wrenches[i], [dot([x], [step.phi / step.m]) for x in step.psi])
            steps[i].append(step)
        if link.parent >= 0:
            _hand_down(links, bodies, wrenches, i)
    return _accelerations(links, steps, len(tau))


def _rigid(body: Inertia) -> Articulated:
    x, y, z = body.moment
    zero: Matrix = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return Articulated(
        body.tensor, zero, [[body.mass if i == j else 0.0 for j in range(3)] for i in range(3)]
    )


def _applied(body: Articulated, twist: Vector) -> Vector:
    alpha, a = twist[:3], twist[3:]
    n = [dot([*x, *y], [*alpha, *a]) for x, y in zip(body.J, body.C)]
    return n + [dot([*x, *y], [*alpha, *a]) for x, y in zip(transpose(body.C), body.K)]


def _eliminated(
    body: Articulated, axis: Vector, column: int, rotor: Scalar, tau: Scalar, wrench: Vector
) -> Elimination:
    psi = _applied(body, axis)
    return Elimination(column, axis, psi, dot(axis, psi) + rotor, tau - dot(axis, wrench))


def _without(body: Articulated, step: Elimination) -> Articulated:
    """M̂ − ψ̂ ψ̂ᵀ/m̂, with exact zeros along an axis that is a unit vector and has no rotor."""
    scaled = [0.0 if is_zero(x) else x / step.m for x in step.psi]
    alone = _unit_index(step)

    def entry(i: int, j: int, value: Scalar) -> Scalar:
        """Entry (i, j) of M̂ − ψ̂ ψ̂ᵀ / m̂. Along the axis that was eliminated it is zero by
        construction and is written as zero, not as a difference that rounding leaves."""
        return 0.0 if alone in (i, j) else value - dot([step.psi[i]], [scaled[j]])

    return Articulated(
        symmetric(lambda i, j: entry(i, j, body.J[i][j])),
        [[entry(i, j + 3, body.C[i][j]) for j in range(3)] for i in range(3)],
        symmetric(lambda i, j: entry(i + 3, j + 3, body.K[i][j])),
    )


def _unit_index(step: Elimination) -> int:
    """Where the axis is a unit vector of which m̂ is exactly the entry of M̂ (no rotor), that
    index, else −1."""
    places = [k for k, x in enumerate(step.axis) if not is_zero(x)]
    plain = len(places) == 1 and step.psi[places[0]] is step.m
    return places[0] if plain else -1


def _hand_down(
    links: Sequence[Link], bodies: list[Articulated], wrenches: list[Vector], i: int
) -> None:
    """Body and wrench to the carrier's joint point: turn, shift to the carrier's origin, then to
    its own joint point."""
    link, carrier = links[i], links[links[i].parent]
    arm = difference(link.a, carrier.b)
    seen = _shifted(_turned(bodies[i], link.rotation), arm)
    bodies[link.parent] = _summed(bodies[link.parent], seen)
    n, f = rotated(link.R, wrenches[i][:3]), rotated(link.R, wrenches[i][3:])
    wrenches[link.parent] = sum_of(wrenches[link.parent], [*sum_of(n, cross(arm, f)), *f])


def _summed(a: Articulated, b: Articulated) -> Articulated:
    return Articulated(
        *[[sum_of(x, y) for x, y in zip(p, q)] for p, q in ((a.J, b.J), (a.C, b.C), (a.K, b.K))]
    )


def _turned(body: Articulated, rotation: Rotation) -> Articulated:
    for factor in reversed(rotation):
        R = matrix((factor,))
        C = product(product(R, body.C), transpose(R))
        body = Articulated(turned_tensor(body.J, factor), C, turned_tensor(body.K, factor))
    return body


def _shifted(body: Articulated, arm: Vector) -> Articulated:
    """To a point −arm away: C' = C + [a]× K,  J' = J + [a]× Cᵀ − C' [a]×."""
    if all(is_zero(x) for x in arm):
        return body
    C = [
        sum_of(x, y)
        for x, y in zip(body.C, transpose([cross(arm, column) for column in transpose(body.K)]))
    ]
    left = transpose([cross(arm, row) for row in body.C])  # [a]× Cᵀ
    right = [cross(row, arm) for row in C]  # C' [a]×
    return Articulated(symmetric(lambda i, j: body.J[i][j] + left[i][j] - right[i][j]), C, body.K)


def _accelerations(
    links: Sequence[Link], steps: Sequence[Sequence[Elimination]], nv: int
) -> Factored:
    """Base to tip: v̇ᵢ = (φ̂ᵢ − ψ̂ᵢᵀ μᵢ)/m̂ᵢ, μ the twist rate that the carrier hands on."""
    vdot: Vector = [0.0] * nv
    pivots: dict[int, Scalar] = {}
    twists: list[Vector] = []
    for link, eliminated in zip(links, steps):
        mu = _received(links, twists, link)
        # the velocity eliminated last is known first
        for step in reversed(eliminated):
            vdot[step.column] = (step.phi - dot(step.psi, mu)) / step.m
            pivots[step.column] = step.m
            mu = sum_of(mu, [dot([x], [vdot[step.column]]) for x in step.axis])
        twists.append(mu)
    return Factored(vdot, pivots)


def _received(links: Sequence[Link], twists: Sequence[Vector], link: Link) -> Vector:
    """The carrier's rate of twist, seen at this link's joint point in its frame."""
    if link.parent < 0:
        return [0.0] * 6
    carrier = links[link.parent]
    arm = difference(link.a, carrier.b)
    alpha, a = twists[link.parent][:3], twists[link.parent][3:]
    back = transpose(link.R)
    return [*rotated(back, alpha), *rotated(back, sum_of(a, cross(alpha, arm)))]


def motions_of(system: System, S: ca.SX) -> list[list[tuple[Vector, int]]]:
    """By link the motions of the quasi-velocities that move its joint; nothing where one moves
    several joints, or where inertia beside the bodies couples them."""
    owners = {j: i for i, link in enumerate(system.links) for j in link.columns}
    rows: list[list[int]] = [[] for _ in range(S.size2())]
    for j, k in zip(*ca.sparsify(S).sparsity().get_triplet()):
        rows[k].append(j)
    moved = [{owners.get(j, -1) for j in own} for own in rows]
    if not rows or any(len(own) != 1 or -1 in own for own in moved):
        return []
    if not _is_diagonal(ca.mtimes(S.T, ca.mtimes(system.M_extra, S))):
        return []
    result: list[list[tuple[Vector, int]]] = [[] for _ in system.links]
    for k, (own, (i,)) in enumerate(zip(rows, moved)):
        link = system.links[i]
        axes = [link.motion[link.columns.index(j)] for j in own]
        axis = [dot([S[j, k] for j in own], [x[a] for x in axes]) for a in range(6)]
        result[i].append((axis, k))
    return result


def _is_diagonal(M: ca.SX) -> bool:
    rows, columns = M.sparsity().get_triplet()
    beside = [k for k, (i, j) in enumerate(zip(rows, columns)) if i != j]
    return not beside or all(is_zero(x) for x in ca.vertsplit(M.nz[beside]))
