"""What every road speaks of: forces without inertia, momenta, and what is left at rest.

T is that of the system, in generalized velocities; h = inertia + potential, M v̇ + h = Q + Aᵀ λ.
"""

from __future__ import annotations

import casadi as ca

from derive.mechanics.records import System
from derive.textbook.formulas.terms import Terms


def potential_bias(system: System) -> ca.SX:
    """h_V (nv × 1): what of the bias h is gravity and potential, h at v = 0 without the terms of a
    kinetic energy T₁ + T₀ that rates are prescribed in."""
    rest = ca.SX.zeros(system.v.numel())
    at_rest = ca.substitute(system.h, system.v, rest)
    if system.homogeneous:
        return at_rest
    T0 = ca.substitute(system.T, system.v, rest)
    momentum = ca.substitute(ca.gradient(system.T, system.v), system.v, rest)
    forward = ca.mtimes(system.N.T, ca.gradient(T0, system.q))
    return at_rest + forward - ca.jtimes(momentum, system.t, ca.SX(1))


def active(system: System) -> ca.SX:
    """Q − h_V (nv × 1): every force that is not inertia or constraint."""
    return system.Q - potential_bias(system)


def column_bias(terms: Terms) -> ca.SX:
    """h_w = Sᵀ (h + M σ), nw × 1: Sᵀ (M v̇ + h) where ẇ = 0."""
    s = terms.system
    return ca.mtimes(terms.named("S").T, s.h + ca.mtimes(s.M, terms.named("sigma")))


def column_force(terms: Terms) -> ca.SX:
    """f_w = Sᵀ Q, nw × 1."""
    return ca.mtimes(terms.named("S").T, terms.system.Q)


def balance(terms: Terms, wdot: ca.SX) -> ca.SX:
    """M_w ẇ + h_w − f_w at any ẇ: what every road has to come to."""
    return ca.mtimes(terms.named("M_w"), wdot) + column_bias(terms) - column_force(terms)


def along(terms: Terms, value: ca.SX, wdot: ca.SX) -> ca.SX:
    """d/dt of a term over (t, q, w) where the quasi-velocities change by ẇ."""
    s = terms.system
    qdot = ca.substitute(s.qdot, s.v, terms.named("v"))
    return ca.jtimes(value, ca.vertcat(s.t, s.q, terms.w), ca.vertcat(1, qdot, wdot))


def at_quasi_velocities(terms: Terms, value: ca.SX) -> ca.SX:
    """The term with v = S w + R c in it."""
    return ca.substitute(ca.SX(value), terms.system.v, terms.named("v"))


def solved(terms: Terms, left: ca.SX, wdot: ca.SX) -> ca.SX:
    """ẇ of equations left(ẇ) = 0 that are affine in the symbols ẇ."""
    mass = ca.jacobian(left, wdot)
    rest = ca.substitute(left, wdot, ca.SX.zeros(wdot.numel()))
    return -ca.solve(ca.densify(mass), ca.densify(rest))
