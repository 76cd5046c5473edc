"""The second-order contraction Σₖ yₖ ∂²ẋₖ [dx, du], forward over reverse.

With r(z, ẇ) = M_w ẇ − f = 0, z = (x, u), and multipliers μ = M_w⁻¹ y_w, the function

    L(z, ẇ, μ) = y_q·q̇ + y_w·ẇ − μ·r(z, ẇ)

has the slopes of y·ẋ along every z, for it is stationary in ẇ and μ. So y·∂²ẋ [dz] is the rate of
∂L/∂z along (dz, ẇ', μ') with M_w ẇ' = −∂r/∂z dz and M_w μ' = −∂(M_w μ)/∂z dz: two more solutions
with the same factors, and neither they nor ẇ are differentiated. On a tree r is Newton–Euler.

Source: J. Nganga, P. M. Wensing, Accelerating second-order differential dynamic programming for
rigid-body systems, IEEE RA-L 6 (2021) 7659–7666.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Vector
from derive.formulations.motion import Motion, at_motion, is_unit
from derive.formulations.structured.factors import column, entries
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.inverse.dynamics import joint_forces_of_motion
from derive.mechanics.records import System
from derive.mechanics.system import inertial_forces


@dataclass(frozen=True)
class _Residual:
    """r over (z, ẇ), the product of M_w with μ, and the solution of M_w x = side."""

    wdot: ca.SX
    mu: ca.SX
    value: ca.SX
    product: ca.SX
    solve: Callable[[Vector], Vector]


def contractions(system: System, motion: Motion, z: ca.SX, y: ca.SX, dz: ca.SX) -> Iterator[ca.SX]:
    """y·∂²ẋ [dz] (nz × 1) by every residual there is; by none with first-order states, and where
    nothing is solved for."""
    if system.model.states or not motion.wdot.numel():
        return
    for residual in _residuals(system, motion):
        yield _contraction(system, motion, residual, z, y, dz)


def _residuals(system: System, motion: Motion) -> Iterator[_Residual]:
    wdot, mu = (ca.SX.sym(name, motion.wdot.numel()) for name in ("wdot", "mu"))
    minimal = motion.minimal
    if not system.rows and is_unit(motion.B):
        if system.written:
            by_factors = _by_factors(at_motion(system, motion, system.M))
            yield _newton_euler(system, motion, wdot, mu, by_factors)
        elif minimal is not None and minimal.solve is not None:
            yield _newton_euler(system, motion, wdot, mu, minimal.solve)
    if minimal is not None and system.written:
        value = ca.mtimes(minimal.mass, wdot) - minimal.force
        product = ca.mtimes(minimal.mass, mu)
        yield _Residual(wdot, mu, value, product, _by_factors(minimal.mass))


def _newton_euler(
    system: System, motion: Motion, vdot: ca.SX, mu: ca.SX, solve: Callable[[Vector], Vector]
) -> _Residual:
    forces = inertial_forces(system, vdot) + ca.mtimes(system.M_extra, vdot)
    value = forces + system.h_extra - system.Q
    still = [0.0] * mu.numel()
    product = column(joint_forces_of_motion(system.layouts, still, entries(mu), [0.0, 0.0, 0.0]))
    product = product + ca.mtimes(system.M_extra, mu)
    value, product = (at_motion(system, motion, x) for x in (value, product))
    return _Residual(vdot, mu, value, product, solve)


def _contraction(
    system: System, motion: Motion, of: _Residual, z: ca.SX, y: ca.SX, dz: ca.SX
) -> ca.SX:
    nq, n = system.q.numel(), of.wdot.numel()
    mu = _solved(of, y[nq:])
    lagrangian = ca.dot(y[:nq], motion.qdot) - ca.dot(of.mu, of.value)
    slope = ca.gradient(lagrangian, z)
    wdot_rate = _solved(of, -ca.substitute(ca.jtimes(of.value, z, dz), of.wdot, motion.wdot))
    mu_rate = _solved(of, -ca.substitute(ca.jtimes(of.product, z, dz), of.mu, mu))
    d_wdot, d_mu = ca.SX.sym("d_wdot", n), ca.SX.sym("d_mu", n)
    along = ca.jtimes(slope, ca.vertcat(z, of.wdot, of.mu), ca.vertcat(dz, d_wdot, d_mu))
    along = ca.substitute(along, ca.vertcat(d_wdot, d_mu), ca.vertcat(wdot_rate, mu_rate))
    return ca.substitute(along, ca.vertcat(of.wdot, of.mu), ca.vertcat(motion.wdot, mu))


def _solved(of: _Residual, side: ca.SX) -> ca.SX:
    return column(of.solve(entries(side)))


def _by_factors(mass: ca.SX) -> Callable[[Vector], Vector]:
    """By L D Lᵀ, tip to base."""

    def solution(side: Vector) -> Vector:
        return ldl_solution(scalars(mass), [side], list(reversed(range(len(side))))).x[0]

    return solution
