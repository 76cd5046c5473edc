"""Where links are and how they move, from base to tip, for what acts on each of them by itself."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import cross, minus, rotated, sum_of
from derive.mechanics.loops.frames import arm, from_parent
from derive.mechanics.loops.records import Joint
from derive.mechanics.loops.sweeps import PUSH, Rows

OF_A_POSE = 15  # numbers handed on behind ω: v, R row by row, r
STILL: Vector = [0.0, 0.0, 0.0]


def have_pushes(joints: Sequence[Joint]) -> bool:
    """Whether something acts on some link by itself."""
    return any(joint.push is not None for joint in joints)


def of_ground(axes: Matrix) -> Vector:
    """The pose of the ground, whose frame in the loops has these axes."""
    return [*STILL, *(x for row in axes for x in row), *STILL]


def pose(joint: Joint, row: Rows, omega: Vector, received: Vector, relative: Vector) -> Vector:
    """v, R and r of a link from those of its parent: v = Rᵀ (v_λ + ω_λ × p) + v_r,
    r = r_λ + R_λ p. `omega` is the parent's, `relative` the link's own linear velocity."""
    v, R, r = received[:3], received[3:12], received[12:]
    rows = [R[3 * k : 3 * k + 3] for k in range(3)]
    p = arm(joint)
    moved = from_parent(joint, row, sum_of(v, cross(omega, p)))
    turned = [from_parent(joint, row, line) for line in rows]
    return [
        *sum_of(moved, relative),
        *(x for line in turned for x in line),
        *sum_of(r, rotated(rows, p)),
    ]


def push(joint: Joint, omega: Vector, at: Vector) -> dict[int, Scalar]:
    """What acts on the link at that ω and pose, by place in its row."""
    if joint.push is None:
        return dict.fromkeys(range(PUSH, PUSH + 6), 0.0)
    symbols, wrench = joint.push
    v, R, r = at[:3], at[3:12], at[12:]
    values = ca.vertcat(*[ca.SX(x) for x in (*R, *r, *omega, *v)])
    found = ca.substitute(ca.vertcat(*[ca.SX(x) for x in wrench]), symbols, values)
    return {PUSH + k: found[k] for k in range(6)}


def less_push(row: Rows, wrench: Vector) -> Vector:
    """A wrench without what acts on the link by itself."""
    return [minus(x, y) for x, y in zip(wrench, row.vector(PUSH, 6))]
