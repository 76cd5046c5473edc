"""The analytic form: kinetic and potential energy given as formulas of q, q̇ and t (Lagrange's
equations by differentiation)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.diagnostics import Diagnostic, ModelError
from derive.expressions.one_sided import gradient
from derive.mechanics.symbols import Symbols
from derive.model.records import Model


@dataclass(frozen=True)
class Lagrangian:
    """M, h conjugate to v (h holds the potential's forces too), and the energies over (t, q, v).

    T = T₂ + T₁ + T₀ by powers of the rates. What the motion of an autonomous system conserves is
    Jacobi's integral q̇·∂T/∂q̇ − T + V = T₂ − T₀ + V (Goldstein, Poole, Safko, Classical Mechanics,
    §2.7), and `missing` = T₁ + 2 T₀ is what it is less than T + V; a zero where T is T₂ alone.
    `explicit` = ∂T/∂t at held q and q̇ is what it loses where time stands in T.
    """

    M: ca.SX
    h: ca.SX
    T: ca.SX
    V: ca.SX
    missing: ca.SX
    explicit: ca.SX


def lagrangian(model: Model, s: Symbols, qdot: ca.SX) -> Lagrangian:
    """Lagrange's equations in q̇, carried over to v by q̇ = N v:

        d/dt ∂T/∂q̇ − ∂T/∂q + ∂V/∂q = M_q q̈ + h_q,   M = Nᵀ M_q N,   h = Nᵀ (h_q + M_q Ṅ v).

    h holds the forces of the potential, so they are not in Q again. Raises ModelError where T is
    not quadratic in the rates.
    """
    nq = s.q.numel()
    T = ca.SX(s.scalar(model.kinetic)) if model.kinetic is not None else ca.SX(0)
    V = ca.SX(s.scalar(model.potential)) if model.potential is not None else ca.SX(0)
    # ∂T/∂q̇, linear in q̇: its slope is M_q
    momentum = ca.gradient(T, s.qd) if nq else ca.SX(0, 1)
    M_q = ca.jacobian(momentum, s.qd)
    if ca.depends_on(M_q, s.qd):
        raise ModelError(
            Diagnostic(
                file=model.file, message="the kinetic energy is not quadratic in the rates der(…)"
            )
        )
    along = ca.vertcat(s.t, s.q)
    h_q = ca.jtimes(momentum, along, ca.vertcat(1, s.qd)) - gradient(T - V, s.q)
    M, h = _over_v(M_q, h_q, s, qdot)
    formulas = [h, T, _missing(T, momentum, s), ca.jtimes(T, s.t, ca.SX(1))]
    bias, energy, missing, explicit = ca.substitute(formulas, [s.qd], [qdot])
    return Lagrangian(M, bias, energy, V, missing, explicit)


def _over_v(M_q: ca.SX, h_q: ca.SX, s: Symbols, qdot: ca.SX) -> tuple[ca.SX, ca.SX]:
    """M and h of the generalized velocities; what they were where those are the rates."""
    N = ca.jacobian(qdot, s.v)
    if _is_identity(N):
        return M_q, h_q
    # N depends on q, so q̈ = N v̇ + Ṅ v: the second part is a bias
    turning = ca.jtimes(qdot, s.q, qdot)  # Ṅ v
    h = ca.mtimes(N.T, ca.substitute(h_q, s.qd, qdot) + ca.mtimes(M_q, turning))
    return ca.mtimes(N.T, ca.mtimes(M_q, N)), h


def _missing(T: ca.SX, momentum: ca.SX, s: Symbols) -> ca.SX:
    """T₁ + 2 T₀ of a kinetic energy that is at most quadratic in the rates."""
    still = ca.SX.zeros(s.qd.numel())
    linear, constant = ca.substitute([momentum, T], [s.qd], [still])
    return ca.simplify(ca.dot(linear, s.qd) + 2 * constant)


def _is_identity(N: ca.SX) -> bool:
    return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())
