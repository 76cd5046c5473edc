"""The analytic form: kinetic and potential energy given as formulas of q, q̇ and t (Lagrange's
equations by differentiation)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.diagnostics import Diagnostic, ModelError
from derive.expressions.one_sided import gradient
from derive.joints import joint_type
from derive.mechanics.symbols import Symbols
from derive.model.records import Model


@dataclass(frozen=True)
class Lagrangian:
    """M, h conjugate to v (h holds the potential's forces too), and the energies over (t, q, v).

    T = T₂ + T₁ + T₀ by powers of the rates. What the motion of an autonomous system conserves is
    Jacobi's integral q̇·∂T/∂q̇ − T + V = T₂ − T₀ + V (Goldstein, Poole, Safko, Classical Mechanics,
    §2.7), and `missing` = T₁ + 2 T₀ is what it is less than T + V; a zero where T is T₂ alone.
    `explicit` = ∂T/∂t at held q and q̇ is what it loses where time stands in T. `given` is the part
    of M that comes from T, where rotors are added to it.
    """

    M: ca.SX
    h: ca.SX
    T: ca.SX
    V: ca.SX
    missing: ca.SX
    explicit: ca.SX
    given: ca.SX


def lagrangian(model: Model, s: Symbols, qdot: ca.SX) -> Lagrangian:
    """The equations of T(t, q, q̇, v) and V(t, q) over v, where q̇ = N v:

        Nᵀ (d/dt ∂T/∂q̇ − ∂T/∂q + ∂V/∂q) + d/dt ∂T/∂v + turned(v, ∂T/∂v) = M v̇ + h.

    The first part is Lagrange's. The second is of velocities in the axes of a body that turns,
    which carry their momenta along (Poincaré 1901; Kirchhoff's equations of a body in a fluid). h
    holds the forces of the potential, so they are not in Q again. Raises ModelError where T is not
    quadratic in the rates and velocities.
    """
    T = ca.SX(s.scalar(model.kinetic)) if model.kinetic is not None else ca.SX(0)
    V = ca.SX(s.scalar(model.potential)) if model.potential is not None else ca.SX(0)
    over_rates = ca.gradient(T, s.qd) if s.qd.numel() else ca.SX(0, 1)
    over_v = ca.gradient(T, s.v) if s.v.numel() else ca.SX(0, 1)
    # linear in q̇ and v: their slopes are the inertia
    momenta, moving = ca.vertcat(over_rates, over_v), ca.vertcat(s.qd, s.v)
    inertia = ca.jacobian(momenta, moving)
    if ca.depends_on(inertia, moving):
        raise ModelError(
            Diagnostic(
                file=model.file, message="the kinetic energy is not quadratic in the rates der(…)"
            )
        )
    forces = ca.jtimes(momenta, ca.vertcat(s.t, s.q), ca.vertcat(1, s.qd))
    forces[: s.qd.numel()] -= gradient(T - V, s.q)
    M, h = _over_v(inertia, forces, s, qdot)
    h = h + turned(model, s.v, over_v)
    formulas = [h, T, _missing(T, momenta, moving), ca.jtimes(T, s.t, ca.SX(1))]
    bias, energy, missing, explicit = ca.substitute(formulas, [s.qd], [qdot])
    return Lagrangian(M, bias, energy, V, missing, explicit, given=M)


def turned(model: Model, v: ca.SX, momenta: ca.SX) -> ca.SX:
    """What momenta (nv) conjugate to v change by because axes of velocities turn along."""
    result = ca.SX(v.numel(), 1)
    places = {velocity.name: j for j, velocity in enumerate(model.velocities)}
    for joint in model.joints:
        change = joint_type(joint.type, joint.orientation).turned
        own = [places[name] for name in joint.velocities]
        if change is not None and not momenta[own].is_zero():
            result[own] = ca.vertcat(*change(*([x[j] for j in own] for x in (v, momenta))))
    return ca.sparsify(result)


def _over_v(inertia: ca.SX, forces: ca.SX, s: Symbols, qdot: ca.SX) -> tuple[ca.SX, ca.SX]:
    """M and h of the generalized velocities; what they were over q̇ where those are the rates."""
    nq, N = s.qd.numel(), ca.jacobian(qdot, s.v)
    alone = not inertia[nq:, :].nnz() and forces[nq:].is_zero()
    if alone and _is_identity(N):
        return inertia[:nq, :nq], forces[:nq]
    # N depends on q, so q̈ = N v̇ + Ṅ v: the second part is a bias
    turning = ca.jtimes(qdot, s.q, qdot)  # Ṅ v
    forces = ca.substitute(forces, s.qd, qdot) + ca.mtimes(inertia[:, :nq], turning)
    both = ca.vertcat(N, ca.SX.eye(s.v.numel()))
    if alone:
        both, inertia, forces = N, inertia[:nq, :nq], forces[:nq]
    return ca.mtimes(both.T, ca.mtimes(inertia, both)), ca.mtimes(both.T, forces)


def _missing(T: ca.SX, momenta: ca.SX, moving: ca.SX) -> ca.SX:
    """T₁ + 2 T₀ of a kinetic energy that is at most quadratic in the rates."""
    still = ca.SX.zeros(moving.numel())
    linear, constant = ca.substitute([momenta, T], [moving], [still])
    return ca.simplify(ca.dot(linear, moving) + 2 * constant)


def _is_identity(N: ca.SX) -> bool:
    return N.is_square() and bool((N - ca.SX.eye(N.size1())).is_zero())
