"""Explicit equations in quasi-velocities: [A; B] inverted block by block, walking from base to
tip."""

from __future__ import annotations

import casadi as ca

from derive.choices.explicit import Explicit
from derive.choices.named import carried_through
from derive.choices.pivots import by_reflections, solved
from derive.choices.reduction import Reduction
from derive.choices.survey import Survey
from derive.expressions.counting import alternatives
from derive.formulations.assembly import entries, reduced
from derive.formulations.fitness import undetermined
from derive.formulations.formulation import Formulation
from derive.formulations.limits import MANY
from derive.formulations.records import Equations
from derive.mechanics.elimination.solve import reflected_solution, scalars
from derive.mechanics.records import System
from derive.mechanics.system import inertial_forces
from derive.model.records import Choice


def _equations(survey: Survey, choice: Choice) -> Equations:
    carried = carried_through(survey, choice)
    reduction, result = carried.reduction, carried.explicit
    lam = _multipliers(survey, reduction, result)
    return reduced(survey, FORMULATION.name, choice.name, carried.reason, reduction, result, lam)


def _missing(system: System, reduction: Reduction, vdot: ca.SX) -> ca.SX:
    """M v̇ + h − Q over w; by Newton–Euler where M is not written out, or where that takes fewer
    operations."""
    found: list[ca.SX] = []
    if system.written:
        by_M = ca.substitute(system.Q - system.h, system.v, reduction.v)
        found.append(ca.mtimes(system.M, vdot) - by_M)
    if system.links and (not system.written or system.v.numel() >= MANY):
        forces = inertial_forces(system, vdot) + ca.mtimes(system.M_extra, vdot) + system.h_extra
        found.append(ca.substitute(forces - system.Q, system.v, reduction.v))
    if len(found) == 1:
        return found[0]
    counts = alternatives(found)
    return found[counts.index(min(counts))]


def _multipliers(survey: Survey, reduction: Reduction, result: Explicit) -> ca.SX:
    """λ from Yᵀ [λ; 0] = M v̇ + h − Q, Y = [A; B].

    Where Y has no safe pivots it may be far worse conditioned than A alone: then λ is the least
    squares solution of Aᵀ λ = M v̇ + h − Q, which the choice has no part in.
    """
    rows = survey.independent_rows
    if not survey.rank:
        return rows.spread([])
    if result.lam is not None and not survey.combines:
        return rows.spread(entries(result.lam))
    missing = _missing(survey.system, reduction, result.vdot)
    Y = ca.vertcat(rows.A, reduction.B)
    found = solved(survey, Y.T, [entries(missing)], reduction)
    if by_reflections(found):
        sides = [[x] for x in entries(missing)]
        column, _ = reflected_solution(scalars(ca.SX(rows.A).T), sides)
        return rows.spread([x for (x,) in column])
    return rows.spread(found.columns[0])


FORMULATION = Formulation(
    name="quasi_velocities",
    about="explicit equations in quasi-velocities, no multipliers; [A; B] inverted block by block",
    source="Mirtaheri, Zohoor: Quasi-velocities definition in Lagrangian multibody dynamics",
    chooses=True,
    misfit=undetermined,
    build=_equations,
)
