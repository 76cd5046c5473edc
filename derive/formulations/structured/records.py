"""What the ways share: the slopes of ẋ out of those of ẇ, and of what is not of the links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Vector
from derive.formulations.motion import Motion, at_motion
from derive.formulations.structured.factors import column
from derive.mechanics.records import Link, System


@dataclass(frozen=True)
class Slopes:
    """ẋ (nx), ∂ẋ/∂x and ∂ẋ/∂u over (t, x, u, p), sparse."""

    rates: ca.SX
    by_x: ca.SX
    by_u: ca.SX


@dataclass(frozen=True)
class Known:
    """ẇ with its slopes, and ∂v/∂q."""

    wdot: ca.SX
    by_q: ca.SX
    by_w: ca.SX
    by_u: ca.SX
    v_by_q: ca.SX


def slopes_of(system: System, motion: Motion, of: Known) -> Slopes:
    """With those of q̇ = N v."""
    turning = at_motion(system, motion, ca.jacobian(system.qdot, system.q))
    N = at_motion(system, motion, system.N)
    S = ca.jacobian(motion.v, motion.w) if motion.minimal is None else motion.minimal.S
    above = ca.horzcat(turning + ca.mtimes(N, of.v_by_q), ca.mtimes(N, S))
    by_x = ca.vertcat(above, ca.horzcat(of.by_q, of.by_w))
    by_u = ca.vertcat(ca.SX(system.q.numel(), of.by_u.size2()), of.by_u)
    rates = ca.vertcat(motion.qdot, of.wdot)
    return Slopes(rates, ca.sparsify(by_x), ca.sparsify(by_u))


@dataclass(frozen=True)
class Rest:
    """What is not of the links, M_extra v̇ + h_extra − Q over (q, v, v̇, u), with its slopes."""

    value: ca.SX
    mass: ca.SX
    by_q: ca.SX
    by_v: ca.SX
    by_u: ca.SX


def rest_of(system: System, motion: Motion, vdot: Vector, roots: Sequence[Link] = ()) -> Rest:
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
    return Rest(rest[0], system.M_extra, *rest[1:])
