"""Inverse dynamics: what has to act at the joints for given accelerations, by two loops. With e = z
and a the classical acceleration of the origin minus gravity, all in the link's frame:

    base to tip   ω = Rᵀ ω_λ + e v,   (α, a) = X (α_λ, a_λ) + c + e v̇,
                  n = I α + ω × I ω + m c × a,   f = m a + α × m c + ω × (ω × m c)
    tip to base   n_λ += R n + p × R f,   f_λ += R f,   eᵀ (n, f) + rotor v̇ − τ

Source: Luh, Walker, Paul 1980.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import cross, dot, minus, plus, scaled, sum_of
from derive.mechanics.loops.forward_dynamics import (
    ZERO,
    falls,
    numbered,
    relative,
    velocity_products,
)
from derive.mechanics.loops.frames import arm, from_parent, to_parent
from derive.mechanics.loops.poses import have_pushes, of_ground, pose, push
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import PUSH, Rows, falling, orientation, rising, rows_of

WRENCH = 2  # where the link's own stands


def inverse_dynamics(
    joints: Sequence[Joint], gravity: Vector, ground: Matrix, rate: Vector
) -> tuple[tuple[Sweep, ...], Rows]:
    """The two loops for these kinds; `rate` is v̇ of the link at hand, of as many
    velocities as a joint has at most: zeros for the bias."""
    rows = rows_of(joints)
    start = [*ZERO, *falls(gravity)]
    moving = partial(_motion, rate)
    if have_pushes(joints):
        start, moving = [*start, *of_ground(ground)], partial(_pushed_motion, rate)
    sweeps = (
        rising("motion, from base to tip", joints, rows, moving, start),
        falling("wrenches, from tip to base", joints, rows, partial(_balance, rate), 6),
    )
    return sweeps, rows[0]


def _motion(rate: Vector, joint: Joint, row: Rows, received: Vector) -> Visit:
    moved = motion(joint, row, received, rate)
    kept = {WRENCH + k: x for k, x in enumerate(wrench(joint, moved))}
    return Visit(kept | orientation(joint), moved)


def _pushed_motion(rate: Vector, joint: Joint, row: Rows, received: Vector) -> Visit:
    """The same, with where the link is, and without what acts on it there."""
    visit = _motion(rate, joint, row, received[:9])
    at = pose(joint, row, received[:3], received[9:], relative(joint)[3:])
    acting = push(joint, visit.handed[:3], at)
    needed = {WRENCH + k: minus(visit.kept[WRENCH + k], acting[PUSH + k]) for k in range(6)}
    return Visit(visit.kept | needed, [*visit.handed, *at])


def motion(joint: Joint, row: Rows, received: Vector, rate: Sequence[Scalar]) -> Vector:
    """(ω, α, a) of a link from those of its parent."""
    omega, alpha, a = received[:3], received[3:6], received[6:9]
    p = arm(joint)
    a = sum_of(a, sum_of(cross(alpha, p), cross(omega, cross(omega, p))))
    omega, alpha, a = (from_parent(joint, row, x) for x in (omega, alpha, a))
    moved = relative(joint)
    omega = sum_of(omega, moved[:3])
    of = dict(zip(joint.axes, rate))
    rates = [of.get(k, 0.0) for k in range(6)]
    turning, linear = velocity_products(omega, moved)
    return [
        *omega,
        *sum_of(alpha, sum_of(turning, rates[:3])),
        *sum_of(a, sum_of(linear, rates[3:])),
    ]


def wrench(joint: Joint, moved: Vector) -> Vector:
    """(n, f) that a link alone takes to move so."""
    omega, alpha, a = moved[:3], moved[3:6], moved[6:9]
    spin = [dot(line, omega) for line in joint.tensor]
    n = sum_of([dot(line, alpha) for line in joint.tensor], cross(omega, spin))
    n = sum_of(n, cross(joint.moment, a))
    f = sum_of(cross(alpha, joint.moment), cross(omega, cross(omega, joint.moment)))
    return [*n, *sum_of(scaled(joint.mass, a), f)]


def _balance(rate: Vector, joint: Joint, row: Rows, received: Vector) -> Visit:
    carried = sum_of(received, row.vector(WRENCH, 6))
    each = zip(joint.axes, joint.rotor, rate, joint.tau)
    needed = [minus(plus(carried[k], dot([rotor], [x])), tau) for k, rotor, x, tau in each]
    return Visit({}, at_parent(joint, row, carried), numbered("force", needed))


def at_parent(joint: Joint, row: Rows, carried: Vector) -> Vector:
    """A wrench about the parent's origin."""
    n, f = (to_parent(joint, row, x) for x in (carried[:3], carried[3:]))
    return [*sum_of(n, cross(arm(joint), f)), *f]
