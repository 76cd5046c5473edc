"""Baumgarte's stabilisation: A v̇ = β − 2 α (A v − c) − α² φ on holonomic rows, A v̇ = β − α (A v −
c) on nonholonomic ones."""

from __future__ import annotations

import casadi as ca

from derive.enforcement.records import Enforcement, Options
from derive.expressions.deferred import changed
from derive.formulations.manifold import keeps_velocities
from derive.formulations.records import Equations
from derive.mechanics.records import System


def _refusal(equations: Equations, options: Options) -> str:
    if not equations.system.rows:
        return "there are no constraints"
    if not keeps_velocities(equations):
        return (
            "A v = c holds identically in these quasi-velocities, so that A v̇ = β is not "
            "integrated; use feedback"
        )
    return ""


def _stabilised(system: System, options: Options) -> System:
    """β − 2 α (A v − c) − α² φ in the place of β, before any formulation sees it."""
    alpha = options.alpha or 0.0
    slip = ca.mtimes(system.A, system.v) - system.c
    pulls = [_pull(system, i, slip[i], alpha) for i in range(len(system.rows))]
    return changed(system, beta=system.beta - ca.vertcat(*pulls)) if pulls else system


def _pull(system: System, i: int, slip: ca.SX, alpha: float) -> ca.SX:
    position = system.rows[i].position
    # φ̈ + 2 α φ̇ + α² φ = 0 is critically damped; a nonholonomic row has no φ to come back to
    return alpha * slip if position < 0 else 2 * alpha * slip + alpha**2 * system.phi[position]


BAUMGARTE = Enforcement(
    name="baumgarte",
    about="the constraints' accelerations pull violations back at the rate alpha; first order "
    "on nonholonomic rows",
    source="J. Baumgarte: Stabilization of constraints and integrals of motion in dynamical "
    "systems, CMAME 1, 1972",
    level="rates",
    refusal=_refusal,
    system=_stabilised,
)
