"""Maggi's equations with Kane's generalised speeds, the classical way: everything written out, then
projected.

The whole matrix Y = [A; B] is inverted by Gauss elimination, Y⁻¹ = [R S], so that v = S w + R c,
and
    Sᵀ (M v̇ + h − Q) = 0,  v̇ = S ẇ + σ,  σ = R β − S Ḃ v
is solved for ẇ on the written mass matrix, without any recursion over the bodies.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from derive.choices.explicit import Explicit
from derive.choices.named import carried_through
from derive.choices.orthonormal import LENGTH
from derive.choices.pivots import block_guards, in_words, solved
from derive.choices.reduction import Reduction
from derive.choices.survey import Survey
from derive.diagnostics import AssumptionError
from derive.expressions.counting import operations
from derive.expressions.scalars import Vector
from derive.formulations.assembly import column, entries, reduced
from derive.formulations.fitness import first_of, undetermined, unwritten
from derive.formulations.formulation import Formulation
from derive.formulations.records import Equations
from derive.mechanics.elimination.solve import ldl_solution, scalars
from derive.model.records import Choice


def _equations(survey: Survey, choice: Choice) -> Equations:
    """λ = Rᵀ (M v̇ + h − Q): multiplying M v̇ + h − Q = Aᵀ λ by Rᵀ from the left leaves λ, as A R =
    1."""
    carried = carried_through(survey, choice)
    R, reduction = _inverted(survey, carried.reduction)
    explicit = _projected(survey, reduction)
    system = survey.system
    missing = ca.mtimes(system.M, explicit.vdot) + ca.substitute(
        system.h - system.Q, system.v, reduction.v
    )
    lam = survey.independent_rows.spread(entries(ca.mtimes(R.T, missing)))
    return reduced(survey, FORMULATION.name, choice.name, carried.reason, reduction, explicit, lam)


def _inverted(survey: Survey, reduction: Reduction) -> tuple[ca.SX, Reduction]:
    """R, and the reduction by Y⁻¹ = [R S] as a whole."""
    system, rows, n = survey.system, survey.independent_rows, survey.system.v.numel()
    Y = ca.vertcat(rows.A, reduction.B)
    sides: list[Vector] = [[1.0 if i == k else 0.0 for i in range(n)] for k in range(n)]
    try:
        solution = solved(survey, Y, sides, reduction)
    except ZeroDivisionError:
        name = survey.system.model.name
        raise AssumptionError(
            f"{name}: [A; B] is singular at the sampled states, so Maggi's S does not exist"
        ) from None
    inverse = _matrix(solution.columns, n)
    R, S = inverse[:, : survey.rank], inverse[:, survey.rank :]
    v = ca.mtimes(S, reduction.w) + ca.mtimes(R, rows.c)
    # Ḃ v, as the derivative of B v along the motion with v held
    turning = ca.jtimes(
        ca.mtimes(reduction.B, system.v), ca.vertcat(system.t, system.q), ca.vertcat(1, system.qdot)
    )
    # Y v̇ = [β; ẇ − Ḃ v], and Y⁻¹ = [R S]
    sigma = ca.mtimes(R, rows.beta) - ca.mtimes(S, turning)
    names = [*rows.names, *reduction.names]
    # of a frame that is based anew while they tell so
    lengths = [guard for guard in reduction.guards if guard.name.startswith(LENGTH)]
    return R, replace(
        reduction,
        S=S,
        v=v,
        sigma=ca.substitute(sigma, system.v, v),
        walked=None,
        guards=(*lengths, *block_guards(survey, solution, names, reduction)),
        pivots=in_words(survey, solution, names),
        constant_pivots=all(block.grade < 2 for block in solution.blocks),
    )


def _matrix(columns: list[Vector], n: int) -> ca.SX:
    """Sparse: exact zeros are not stored."""
    result = ca.SX(n, n)
    for k, entries_ in enumerate(columns):
        for j, x in enumerate(entries_):
            if isinstance(x, ca.SX) or x != 0.0:
                result[j, k] = x
    return ca.sparsify(result)


def _projected(survey: Survey, reduction: Reduction) -> Explicit:
    """(Sᵀ M S) ẇ = Sᵀ (Q − h − M σ) with M, h and Q as they are written."""
    system, S = survey.system, reduction.S
    force = ca.substitute(system.Q - system.h, system.v, reduction.v) - ca.mtimes(
        system.M, reduction.sigma
    )
    f_w = ca.mtimes(S.T, force)
    M_w = ca.mtimes(S.T, ca.mtimes(system.M, S))
    n = len(reduction.names)
    wdot = column(ldl_solution(scalars(M_w), [entries(f_w)], list(reversed(range(n)))).x[0])
    qdot = ca.substitute(system.qdot, system.v, reduction.v)
    vdot = ca.densify(ca.mtimes(S, wdot) + reduction.sigma)
    count = operations(qdot, wdot)
    return Explicit(
        qdot=qdot,
        operations=count,
        gathered="mass matrix and forces as written, then projected",
        wdot=wdot,
        vdot=vdot,
        mass=M_w,
        force=f_w,
    )


FORMULATION = Formulation(
    name="maggi",
    about="Maggi's and Kane's equations: [A; B] inverted as a whole, M v̇ + h − Q as written "
    "projected on S",
    source="Maggi 1896, 1901; Kane, Levinson: Dynamics, Theory and Applications, 1985; "
    "Kurdila, Papastavridis, Kamat, J. Guidance 13 (1990) 113-120",
    chooses=True,
    misfit=first_of(unwritten, undetermined),
    build=_equations,
)
