"""Accelerations of the links' origins, gravity included, from base to tip: what a regressor needs.

With U = [ω̇]× + [ω]× [ω]×, a = acceleration − g in the link's frame, joint point at a_J (parent)
and b (link), relative twist (ω_J, v_J):
    ω̇ = Rᵀ ω̇_p + Rᵀ ω_p × ω_J + H_ω v̇
    a = Rᵀ (a_p + U_p a_J) + 2 Rᵀ ω_p × v_J + ω_J × v_J + H_v v̇ − U b
No linear velocity is needed. (Luh, Walker, Paul 1980; the matrix U after Craig and Khalil &
Dombre.)
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    rotated,
    spin_matrix,
    sum_of,
    transpose,
)
from derive.mechanics.records import Link

State = tuple[Vector, Vector, Vector, Matrix]  # ω, ω̇, a, U


def accelerations(
    links: Sequence[Link], v: Sequence[Scalar], vdot: Sequence[Scalar], gravity: Vector
) -> list[State]:
    """(ω, ω̇, a, U) of every link, in its frame; a of its origin, gravity taken off."""
    states: list[State] = []
    # gravity as an upward acceleration of the ground: every link then carries its weight by itself
    ground: State = ([0.0] * 3, [0.0] * 3, [-g for g in gravity], [[0.0] * 3 for _ in range(3)])
    for link in links:
        parent = states[link.parent] if link.parent >= 0 else ground
        states.append(
            _child(link, parent, [v[j] for j in link.columns], [vdot[j] for j in link.columns])
        )
    return states


def _child(link: Link, parent: State, v: Vector, vdot: Vector) -> State:
    """(ω, ω̇, a, U) of a link from those of its parent, in the link's frame."""
    back = transpose(link.R)
    carried_omega, carried_alpha = rotated(back, parent[0]), rotated(back, parent[1])
    carried_a = rotated(back, sum_of(parent[2], rotated(parent[3], link.a)))
    turn, slide = _combined(link, v)
    turn_rate, slide_rate = _combined(link, vdot)
    omega = sum_of(carried_omega, turn)
    alpha = sum_of(sum_of(carried_alpha, cross(carried_omega, turn)), turn_rate)
    a = sum_of(
        # 2 ω_p × v_J + ω_J × v_J: Coriolis with the parent's spin, and the turning of the slide's
        # own axis
        sum_of(carried_a, cross(sum_of(sum_of(carried_omega, carried_omega), turn), slide)),
        slide_rate,
    )
    U = spin_matrix(omega, alpha)
    return omega, alpha, difference(a, rotated(U, link.b)), U


def _combined(link: Link, values: Vector) -> tuple[Vector, Vector]:
    rows = [dot([column[i] for column in link.motion], values) for i in range(6)]
    return rows[:3], rows[3:]
