"""Forward dynamics of a tree in O(n): M = U D Uᵀ link by link and never written out, in the
generalized velocities."""

from __future__ import annotations

from derive.choices.survey import Survey
from derive.expressions.counting import cheapest
from derive.expressions.scalars import Scalar
from derive.formulations.assembly import column, entries, in_generalized_velocities
from derive.formulations.fitness import constrained, first_of, not_of_links, singular
from derive.formulations.formulation import Formulation
from derive.formulations.records import Equations
from derive.mechanics.records import Named
from derive.mechanics.recursions.articulated import Factored, tree_solution
from derive.model.records import Choice


def _equations(survey: Survey, choice: Choice) -> Equations:
    """v̇ of M v̇ = Q − h over the links; of equivalent sets of inertias the one with fewest
    operations."""
    system, n = survey.system, survey.system.v.numel()
    rotors: list[Scalar] = [
        system.M_extra[j, j] if system.M_extra.has_nz(j, j) else 0.0 for j in range(n)
    ]
    force = entries(system.Q - system.h)
    solution = cheapest(
        [
            _solved(tree_solution(system.links, inertias, rotors, force), n)
            for inertias in system.inertias
        ]
    )
    vdot, pivots = solution[:n], solution[n:]
    return in_generalized_velocities(
        survey,
        FORMULATION.name,
        vdot,
        [],
        (),
        (Named("D", "pivots of M = U D Uᵀ", column(pivots)),),
    )


def _solved(found: Factored, n: int) -> list[Scalar]:
    """v̇, then the pivots in the order of the velocities."""
    return [*found.vdot, *(found.pivots[j] for j in range(n))]


FORMULATION = Formulation(
    name="recursive",
    about="O(n) recursion over the links of a tree (decoupled natural orthogonal complement); "
    "state x = (q, v)",
    source="Saha: J. Appl. Mech. 66 (1999) 986-996; Featherstone: Int. J. Robotics Research 2 "
    "(1983) 13-30",
    chooses=False,
    misfit=first_of(constrained, not_of_links, singular),
    build=_equations,
)
