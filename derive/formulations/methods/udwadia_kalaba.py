"""Udwadia and Kalaba's explicit equation of constrained motion, for M > 0, in the generalized
velocities.

With a = M⁻¹ (Q − h), the acceleration without constraints, and independent rows of A,
    v̇ = a + M⁻¹ Aᵀ (A M⁻¹ Aᵀ)⁻¹ (β − A a),    λ = (A M⁻¹ Aᵀ)⁻¹ (β − A a),
which is a + M^−½ (A M^−½)⁺ (β − A a): rows that repeat others change neither. A nonideal constraint
with force C enters as a + M⁻¹ C, of which the second term keeps what lies along ker A alone: M^−½
(1 − B⁺B) M^−½ C with B = A M^−½.
"""

from __future__ import annotations

from derive.choices.pivots import quadratic_guards
from derive.choices.survey import Survey
from derive.formulations.assembly import entries, in_generalized_velocities
from derive.formulations.fitness import first_of, not_of_links, singular, undetermined
from derive.formulations.formulation import Formulation
from derive.formulations.records import Equations
from derive.mechanics.elimination.gauss import constrained_motion, inverse_applied, named, rows_of
from derive.model.records import Choice


def _equations(survey: Survey, choice: Choice) -> Equations:
    """v̇ = a + M⁻¹ Aᵀ λ with M⁻¹ applied to Q − h and to every row of A, all sides at once where M
    is written out."""
    system, rows = survey.system, survey.independent_rows
    A, force, beta = rows.A, entries(system.Q - system.h), entries(rows.beta)
    motion = constrained_motion(A, beta, inverse_applied(system, [force, *rows_of(A)]))
    guards = quadratic_guards(survey, rows.names, motion.pivots)
    return in_generalized_velocities(
        survey, FORMULATION.name, motion.vdot, motion.lam, guards, named(motion, A, beta)
    )


def _unwritten_and_not_of_links(survey: Survey) -> str:
    """Where M is not written out its inverse is applied by the recursion over the links."""
    return "" if survey.system.written else not_of_links(survey)


FORMULATION = Formulation(
    name="udwadia_kalaba",
    about="explicit equation of constrained motion, v̇ = a + M⁻¹Aᵀ(A M⁻¹Aᵀ)⁺(β − A a), M > 0; "
    "state x = (q, v)",
    source="Udwadia, Kalaba: J. Appl. Mech. 68 (2001) 462-467 and 69 (2002) 335-339",
    chooses=False,
    misfit=first_of(undetermined, singular, _unwritten_and_not_of_links),
    build=_equations,
)
