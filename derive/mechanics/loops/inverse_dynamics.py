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

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import cross, dot, is_zero, minus, plus, scaled, sum_of, times
from derive.mechanics.loops.forward_dynamics import ZERO, axis_of, falls
from derive.mechanics.loops.frames import arm, from_parent, to_parent
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import Rows, falling, rising, rows_of

WRENCH = 2  # where the link's own stands


def inverse_dynamics(
    joints: Sequence[Joint], gravity: Vector, rate: Scalar
) -> tuple[tuple[Sweep, ...], Rows]:
    """The two loops for these kinds; `rate` is v̇ of the link at hand, 0 for the bias."""
    rows = rows_of(joints)
    start = [*ZERO, *falls(gravity)]
    sweeps = (
        rising("motion, from base to tip", joints, rows, partial(_motion, rate), start),
        falling("wrenches, from tip to base", joints, rows, partial(_balance, rate), 6),
    )
    return sweeps, rows[0]


def _motion(rate: Scalar, joint: Joint, row: Rows, received: Vector) -> Visit:
    moved = motion(joint, row, received, rate)
    return Visit({WRENCH + k: x for k, x in enumerate(wrench(joint, moved))}, moved)


def motion(joint: Joint, row: Rows, received: Vector, rate: Scalar) -> Vector:
    """(ω, α, a) of a link from those of its parent."""
    omega, alpha, a = received[:3], received[3:6], received[6:9]
    p = arm(joint, row)
    a = sum_of(a, sum_of(cross(alpha, p), cross(omega, cross(omega, p))))
    omega, alpha, a = (from_parent(joint, row, x) for x in (omega, alpha, a))
    across: Vector = [dot([omega[1]], [joint.v]), -dot([omega[0]], [joint.v]), rate]
    if joint.slides:
        across = [*(times(2.0, x) if not is_zero(x) else 0.0 for x in across[:2]), rate]
        return [*omega, *alpha, *sum_of(a, across)]
    return [*omega[:2], plus(omega[2], joint.v), *sum_of(alpha, across), *a]


def wrench(joint: Joint, moved: Vector) -> Vector:
    """(n, f) that a link alone takes to move so."""
    omega, alpha, a = moved[:3], moved[3:6], moved[6:9]
    spin = [dot(line, omega) for line in joint.tensor]
    n = sum_of([dot(line, alpha) for line in joint.tensor], cross(omega, spin))
    n = sum_of(n, cross(joint.moment, a))
    f = sum_of(cross(alpha, joint.moment), cross(omega, cross(omega, joint.moment)))
    return [*n, *sum_of(scaled(joint.mass, a), f)]


def _balance(rate: Scalar, joint: Joint, row: Rows, received: Vector) -> Visit:
    carried = sum_of(received, row.vector(WRENCH, 6))
    needed = plus(carried[axis_of(joint)], dot([joint.rotor], [rate]))
    return Visit({}, at_parent(joint, row, carried), {"force": minus(needed, joint.tau)})


def at_parent(joint: Joint, row: Rows, carried: Vector) -> Vector:
    """A wrench about the parent's origin."""
    n, f = (to_parent(joint, row, x) for x in (carried[:3], carried[3:]))
    return [*sum_of(n, cross(arm(joint, row), f)), *f]
