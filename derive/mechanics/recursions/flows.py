"""Flows of a subtree: where its mass goes, p = ∫ ẋ dm and G = ∫ ẋ xᵀ dm about one point.

They give what velocities of a joint (e, s), held, need besides the composite inertia:
B (e, s) = (tr(G) e − G e, e × p). Source: S. Echeandia, P. M. Wensing, J. Comput. Nonlinear Dyn. 16
(2021) 021001.
"""

from __future__ import annotations

from dataclasses import dataclass

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    dot,
    matrix_sum,
    minus,
    plus,
    scaled,
    sum_of,
    times,
    transpose,
)
from derive.mechanics.records import Inertia
from derive.mechanics.recursions.motion import Numbers
from derive.mechanics.recursions.tree import Wrench


@dataclass(frozen=True)
class Flow:
    """p (kg m/s) and G (kg m²/s) of a subtree, about one point and along one frame."""

    p: Vector
    G: Matrix


def own_flow(body: Inertia, omega: Vector) -> Flow:
    """Points that turn with the link, ẋ = ω × x: p = ω × h, G = ω × ∫ x xᵀ dm, column by
    column."""
    half = times(0.5, plus(plus(body.tensor[0][0], body.tensor[1][1]), body.tensor[2][2]))
    second = [
        [minus(half if i == j else 0.0, body.tensor[i][j]) for j in range(3)] for i in range(3)
    ]
    return Flow(cross(omega, body.moment), transpose([cross(omega, x) for x in second]))


def combined(a: Flow, b: Flow) -> Flow:
    """Of both together, about the same point."""
    return Flow(sum_of(a.p, b.p), matrix_sum(a.G, b.G))


def shifted(flow: Flow, mass: Scalar, moment: Vector, r: Vector, rate: Vector) -> Flow:
    """About a point −r away that moves with −ṙ, h the first moment: p' = p + m ṙ,
    G' = G + p' rᵀ + ṙ hᵀ."""
    p = sum_of(flow.p, scaled(mass, rate))
    outer = [[dot([a], [b]) for b in r] for a in p]
    swung = [[dot([a], [b]) for b in moment] for a in rate]
    return Flow(p, matrix_sum(flow.G, matrix_sum(outer, swung)))


def flow_wrench(flow: Flow, motion: Numbers) -> Wrench:
    """B (e, s) = (tr(G) e − G e, e × p)."""
    return _swept(flow.G, motion[0]), cross(motion[0], flow.p)


def flow_couple(flow: Flow, motion: Numbers) -> Vector:
    """c = tr(G) e − Gᵀ e + p × s."""
    return sum_of(_swept(transpose(flow.G), motion[0]), cross(flow.p, motion[1]))


def power(motion: Numbers, wrench: Wrench) -> Scalar:
    """e · n + s · f."""
    return dot([*motion[0], *motion[1]], [*wrench[0], *wrench[1]])


def _swept(G: Matrix, e: Vector) -> Vector:
    """tr(G) e − G e, without the diagonal terms that cancel."""
    return [
        minus(
            dot([plus(G[(i + 1) % 3][(i + 1) % 3], G[(i + 2) % 3][(i + 2) % 3])], [e[i]]),
            dot(
                [G[i][(i + 1) % 3], G[i][(i + 2) % 3]],
                [e[(i + 1) % 3], e[(i + 2) % 3]],
            ),
        )
        for i in range(3)
    ]
