"""Udwadia and Phohomsiri's equation of motion for mass matrices that may be singular, in the
generalized velocities.

    v̇ = [ (1 − A⁺A) M ]⁺ [ F ]       F = Q − h with a nonideal constraint's force C in it; rank [M;
    A] = nv
        [      A      ]  [ β ],
The regular square system with the same v̇ (Udwadia, Schutte 2010): A v̇ = β is added to the
equations with weights W,
    M_A = M + Aᵀ W A,   F_A = F + Aᵀ W β,
M_A is positive definite exactly where rank [M; A] = nv, and v̇ = a + M_A⁻¹ Aᵀ (A M_A⁻¹ Aᵀ)⁻¹ (β − A
a) with a = M_A⁻¹ F_A. The added terms cancel where A v̇ = β, so λ is that of M v̇ = F + Aᵀ λ, and
v̇ depends on no weight.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.choices.pivots import quadratic_guards, sampled
from derive.choices.survey import Survey
from derive.formulations.assembly import column, entries, in_generalized_velocities
from derive.formulations.fitness import first_of, undetermined, unwritten
from derive.formulations.formulation import Formulation
from derive.formulations.limits import LIGHT
from derive.formulations.records import Equations
from derive.mechanics.elimination.gauss import constrained_motion, named, rows_of
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.mechanics.records import Named
from derive.model.records import Choice
from derive.numerics import NONZERO


def _equations(survey: Survey, choice: Choice) -> Equations:
    """Udwadia and Kalaba's equation with M_A and F_A in the place of M and Q − h."""
    system, rows = survey.system, survey.independent_rows
    A, beta = rows.A, rows.beta
    W = ca.diag(ca.SX(ca.DM(_weights(survey)))) if survey.rank else ca.SX(0, 0)
    # Aᵀ W (A v̇ − β) is zero on every motion that the constraints allow: it only makes M_A regular
    weighted = ca.mtimes(A.T, W)
    M_A = system.M + ca.mtimes(weighted, A)
    F_A = entries(system.Q - system.h + ca.mtimes(weighted, beta))
    order = list(reversed(range(system.v.numel())))
    motion = constrained_motion(
        A, entries(beta), ldl_solution(scalars(M_A), [F_A, *rows_of(A)], order).x
    )
    guards = quadratic_guards(survey, rows.names, motion.pivots)
    masses = Named("M_A", "M + Aᵀ W A", M_A), Named("F_A", "Q − h + Aᵀ W β", column(F_A))
    shown = (*masses, Named("W", "weights of the rows", W), *named(motion, A, entries(beta)))
    return in_generalized_velocities(
        survey, FORMULATION.name, motion.vdot, motion.lam, guards, shown
    )


def _weights(survey: Survey) -> list[float]:
    """W, one number per row: about the mass that the row feels, 1/Σ (Aᵢⱼ²/Mⱼⱼ), so that units do
    not matter."""
    weights = [
        _row_weights(M, A)
        for M, A in zip(
            sampled(survey, survey.system.M), sampled(survey, survey.independent_rows.A)
        )
    ]
    return [float(f"{x:.2g}") for x in np.median(weights, axis=0)]


def _row_weights(M: np.ndarray, A: np.ndarray) -> np.ndarray:
    diagonal = np.diag(M)
    heavy = diagonal > LIGHT * np.max(diagonal, initial=0.0)
    mobility = np.sum(A[:, heavy] ** 2 / diagonal[heavy], axis=1)
    typical = float(np.median(diagonal[heavy])) if heavy.any() else 1.0
    lengths = np.maximum(np.sum(A**2, axis=1), NONZERO)
    seen: np.ndarray = 1.0 / np.maximum(mobility, NONZERO)
    return np.where(mobility > LIGHT * lengths / typical, seen, typical / lengths)


FORMULATION = Formulation(
    name="udwadia_phohomsiri",
    about="explicit equation of motion for singular mass matrices too, rank [M; A] = nv; state "
    "x = (q, v)",
    source="Udwadia, Phohomsiri: Proc. R. Soc. A 462 (2006) 2097-2117; M + AᵀWA after Udwadia, "
    "Schutte: J. Appl. Mech. 77 (2010)",
    chooses=False,
    misfit=first_of(unwritten, undetermined),
    build=_equations,
)
