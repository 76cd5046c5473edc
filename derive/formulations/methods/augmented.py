"""The traditional reference: the augmented system with multipliers, in the generalized velocities.

    [ M  −Aᵀ ] [ v̇ ]   [ Q − h ]
    [ A   0  ] [ λ ] = [ β     ]
solved by one unrolled L D Lᵀ of the quasi-definite matrix [M Aᵀ; A 0] (unknowns v̇, −λ), tip to
base, multipliers last.
"""

from __future__ import annotations

from derive.choices.pivots import quadratic_guards
from derive.choices.survey import Survey
from derive.formulations.assembly import entries, in_generalized_velocities
from derive.formulations.fitness import first_of, singular, undetermined, unwritten
from derive.formulations.formulation import Formulation
from derive.formulations.multipliers import bordered_solution
from derive.formulations.records import Equations
from derive.model.records import Choice


def _equations(survey: Survey, choice: Choice) -> Equations:
    """The bordered system solved for v̇ and −λ; guards watch the pivots of −A M⁻¹ Aᵀ."""
    system, rows = survey.system, survey.independent_rows
    solution = bordered_solution(system.M, rows.A, entries(system.Q - system.h), entries(rows.beta))
    guards = quadratic_guards(survey, rows.names, solution.pivots)
    return in_generalized_velocities(
        survey, FORMULATION.name, solution.x, [-y for y in solution.y], guards, ()
    )


FORMULATION = Formulation(
    name="augmented",
    about="generalized velocities and multipliers from one bordered system, the traditional "
    "reference; state x = (q, v)",
    source="Lagrange: Mécanique analytique, equations of the first kind",
    chooses=False,
    misfit=first_of(unwritten, undetermined, singular),
    build=_equations,
)
