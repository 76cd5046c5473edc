"""The Coriolis matrix C of a tree: C v are the velocity products of M v̇ + h, and Ṁ = C + Cᵀ.

With the points x of a subtree seen from the origin of its link, I its composite inertia and

    p = ∫ ẋ dm,   G = ∫ ẋ xᵀ dm,   B (e, s) = (tr(G) e − G e, e × p)

the velocity (e, s) of a joint, held, needs the wrench I (e, s)˙ + B (e, s). So for a joint j, and a
joint k on the way from it to the base,

    C_kj = Φ_kᵀ (I Φ̇_j + B Φ_j),   C_jk = Φ_jᵀ (I Φ̇_k + B Φ_k),   Φ̇ = ω × Φ,

and wrenches are handed down as for the mass matrix. Where v are rates of coordinates, C is the
matrix of Christoffel's symbols. Sources: S. Echeandia, P. M. Wensing, J. Comput. Nonlinear Dyn. 16
(2021) 021001; with first moments relative to the link's origin, so that no linear velocity of the
base appears.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    plus,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.records import Inertia, Link
from derive.mechanics.recursions.flows import (
    Flow,
    combined,
    flow_couple,
    flow_wrench,
    own_flow,
    power,
    shifted,
)
from derive.mechanics.recursions.motion import Numbers
from derive.mechanics.recursions.tree import composite_inertias, handed_down, momentum, twists


@dataclass(frozen=True)
class _Tree:
    """What the columns of C are made of; `speeds`: of each link's origin from its parent's, along
    the parent's axes."""

    links: Sequence[Link]
    omegas: list[Vector]
    speeds: list[Vector]
    composites: list[Inertia]
    flows: list[Flow]


def coriolis_matrix(
    links: Sequence[Link], inertias: Sequence[Inertia], v: Sequence[Scalar]
) -> Matrix:
    """C(q, v), nv × nv; between joints on different branches it is zero."""
    result: Matrix = [[0.0] * len(v) for _ in v]
    tree = _tree(links, inertias, v)
    for i, link in enumerate(links):
        for number in range(len(link.columns)):
            _fill(result, tree, i, number)
    return result


def _tree(links: Sequence[Link], inertias: Sequence[Inertia], v: Sequence[Scalar]) -> _Tree:
    omegas = [omega for omega, _ in twists(links, v)]
    speeds = [
        _speed(link, omegas[link.parent] if link.parent >= 0 else [0.0] * 3, omega, v)
        for link, omega in zip(links, omegas)
    ]
    composites = composite_inertias(links, inertias)
    flows = [own_flow(body, omega) for body, omega in zip(inertias, omegas)]
    for i in reversed(range(len(links))):
        parent = links[i].parent
        if parent >= 0:
            below = _flow_below(links[i], speeds[i], composites[i], flows[i])
            flows[parent] = combined(flows[parent], below)
    return _Tree(links, omegas, speeds, composites, flows)


def _speed(link: Link, carrier: Vector, omega: Vector, v: Sequence[Scalar]) -> Vector:
    """ω_p × a + R (v_J − ω × b): the rate of a − R b, seen from the ground."""
    own = [v[j] for j in link.columns]
    slide = [dot([column[i] for column in link.motion], own) for i in range(3, 6)]
    return sum_of(cross(carrier, link.a), rotated(link.R, sum_of(slide, cross(link.b, omega))))


def _flow_below(link: Link, speed: Vector, body: Inertia, flow: Flow) -> Flow:
    """The same points from the parent's origin, along its axes, a distance r = a − R b away that
    changes with ṙ."""
    R = link.R
    turned = Flow(rotated(R, flow.p), product(product(R, flow.G), transpose(R)))
    r = difference(link.a, rotated(R, link.b))
    return shifted(turned, body.mass, rotated(R, body.moment), r, speed)


def _fill(result: Matrix, tree: _Tree, i: int, number: int) -> None:
    """Row and column of one joint velocity, against all joints between it and the base."""
    link, flow, body = tree.links[i], tree.flows[i], tree.composites[i]
    e, s = _at_origin(link, number)
    j = link.columns[number]
    held = momentum(body, (e, s))
    couple = flow_couple(flow, (e, s))
    turning = momentum(body, _turned(tree, i, (e, s)))
    driven = flow_wrench(flow, (e, s))
    driving = (sum_of(turning[0], driven[0]), sum_of(turning[1], driven[1]))
    for other, k in enumerate(link.columns):
        result[k][j] = power(_at_origin(link, other), driving)
    while tree.links[i].parent >= 0:
        below = tree.links[i].parent
        speed = tree.speeds[i]
        couple = rotated(tree.links[i].R, couple)
        held, driving = (handed_down(tree.links[i], x)[1] for x in (held, driving))
        couple = sum_of(couple, cross(speed, held[1]))
        i = below
        for other, k in enumerate(tree.links[i].columns):
            motion = _at_origin(tree.links[i], other)
            result[k][j] = power(motion, driving)
            rate = power(_turned(tree, i, motion), held)
            result[j][k] = plus(rate, dot(couple, motion[0]))


def _at_origin(link: Link, number: int) -> Numbers:
    """(ω, v) of the link's origin per unit of a joint velocity."""
    column = link.motion[number]
    omega = list(column[:3])
    return omega, sum_of(column[3:], cross(link.b, omega))


def _turned(tree: _Tree, i: int, motion: Numbers) -> Numbers:
    """ω × each: directions of a joint turn with its link."""
    omega = tree.omegas[i]
    return cross(omega, motion[0]), cross(omega, motion[1])
