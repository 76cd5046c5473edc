"""Equations out of what a formulation found: in quasi-velocities of a choice, or in the generalized
velocities themselves."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.choices.explicit import Explicit
from derive.choices.locks import locks, locks_of
from derive.choices.pivots import by_reflections, quadratic_guards, solved
from derive.choices.records import Guard
from derive.choices.reduction import Reduction
from derive.choices.survey import Survey, speed_name
from derive.expressions.deferred import Deferred, passed_on
from derive.expressions.scalars import Scalar, Vector
from derive.formulations.control import control
from derive.formulations.derivatives import derivatives
from derive.formulations.functions import functions
from derive.formulations.motion import Minimal, Motion, arguments
from derive.formulations.named_frames import families
from derive.formulations.records import Equations
from derive.formulations.regression import regression
from derive.formulations.units import units
from derive.mechanics.records import Named


def reduced(
    survey: Survey,
    formulation: str,
    choice: str,
    reason: str,
    reduction: Reduction,
    found: Explicit,
    lam: ca.SX,
) -> Equations:
    """Equations with x = (q, w) and v = S w + R c, out of a choice that was carried through.

    `found` holds q̇, ẇ, v̇; `lam` (nc × 1) is the force along each constraint row, zero or shared
    where rows repeat others. A v = c holds identically in these velocities, so only φ can drift.
    """
    Y = ca.vertcat(survey.independent_rows.A, reduction.B)

    def per_c() -> ca.SX:
        if not survey.rank:
            return ca.SX(survey.system.v.numel(), 0)
        return per_unit_of_c(survey, Y, survey.rank, reduction)

    # of many rows it is a large matrix, which few functions need
    late = survey.without_zeros is not None
    size = survey.system.v.numel() * survey.rank
    R = Deferred(functools.cache(per_c), size) if late else per_c()
    own = locks_of(survey.system, reduction.B)
    motion = Motion(
        w=reduction.w,
        names=reduction.names,
        units=units(survey.system, choice, reduction),
        B=reduction.B,
        v=reduction.v,
        qdot=found.qdot,
        wdot=passed_on(found, "wdot"),
        vdot=passed_on(found, "vdot"),
        lam=lam,
        guards=(*_combining(survey), *reduction.guards, *own),
        solving=tuple(x for x in locks(survey.system) if x.name not in {y.name for y in own}),
        named=found.named(reduction),
        kept=reduction.kept,
        closing=survey.closing,
        projects_velocity=False,
        frame=reduction.frame,
        minimal=_minimal(survey, reduction, found, lam, (Y, R)),
    )
    named = (*_matrices(survey, reduction, Y, R), *motion.named[1:])
    result = _finished(survey, formulation, choice, reason, motion, named, reduction.pivots)
    said = _dependent_at_start(survey, choice, reduction)
    return replace(result, assumptions=(*result.assumptions, *said))


def _dependent_at_start(survey: Survey, choice: str, reduction: Reduction) -> tuple[str, ...]:
    if reduction.constant_pivots:
        return ()
    if not survey.depends_at_start(reduction.at_frame(reduction.B)):
        return ()
    return (
        f"choice '{choice}' does not tell the velocities at the initial state, as its speeds "
        "depend on each other there: a motion from it takes another choice",
    )


def _minimal(
    survey: Survey,
    reduction: Reduction,
    found: Explicit,
    lam: ca.SX,
    matrices: tuple[ca.SX, ca.SX | Deferred[ca.SX]],
) -> Minimal:
    rows, (Y, R) = survey.independent_rows, matrices
    return Minimal(
        S=reduction.S,
        sigma=reduction.sigma,
        mass=passed_on(found, "mass"),
        force=passed_on(found, "force"),
        R=R,
        A=rows.A,
        c=rows.c,
        beta=rows.beta,
        lam=ca.SX(0, 1) if survey.combines else lam[list(survey.kept), :],
        shift=Deferred(lambda: _shift(survey, reduction, Y), Y.size2()),
        solve=found.solve,
        nearest=found.nearest,
    )


def _shift(survey: Survey, reduction: Reduction, Y: ca.SX) -> ca.SX | None:
    """δ of A δ = −φ, B δ = 0."""
    system, kept = survey.system, survey.kept
    regular = reduction.constant_pivots and not reduction.guards and reduction.frame is None
    if not kept or survey.combines or set(kept) != set(survey.closing) or not regular:
        return None
    phi = [system.excess[system.rows[i].position] for i in kept]
    side = [*(-x for x in phi), *([0.0] * len(reduction.names))]
    found = solved(survey, Y, [side], reduction)
    return None if by_reflections(found) else column(found.columns[0])


def in_generalized_velocities(
    survey: Survey,
    formulation: str,
    vdot: Vector,
    lam: Vector,
    solving: tuple[Guard, ...],
    named: tuple[Named, ...],
) -> Equations:
    """Equations with x = (q, v): the constraints hold through their forces only, A v̇ = β, so both
    φ and A v − c can drift where nothing enforces them.

    `vdot` (nv) and `lam`, the multipliers of the independent rows, come from the formulation;
    `solving` are the pivots it divided by.
    """
    system = survey.system
    motion = Motion(
        w=system.v,
        names=tuple(speed_name(system, j) for j in range(system.v.numel())),
        units=tuple(v.unit for v in system.model.velocities),
        B=ca.SX.eye(system.v.numel()),
        v=system.v,
        qdot=system.qdot,
        wdot=column(vdot),
        vdot=column(vdot),
        lam=survey.independent_rows.spread(lam),
        guards=(),
        solving=(*_combining(survey), *solving, *locks(system)),
        named=(
            Named("M", "mass matrix", system.M),
            Named("h", "bias", system.h),
            Named("beta", "A v̇ = β", system.beta),
        ),
        kept=survey.kept,
        closing=survey.closing,
        projects_velocity=True,
    )
    reason = "the generalized velocities themselves, held together by the constraint forces"
    shown = (
        Named("A", "constraint rows, A v = c", system.A),
        *combination(survey),
        *motion.named,
        *named,
    )
    return _finished(survey, formulation, formulation, reason, motion, shown, ())


def _finished(
    survey: Survey,
    formulation: str,
    choice: str,
    reason: str,
    motion: Motion,
    named: tuple[Named, ...],
    pivots: tuple[str, ...],
) -> Equations:
    system = survey.system
    slots, offered = arguments(system, motion), functions(system, motion)
    return Equations(
        system=system,
        formulation=formulation,
        choice=choice,
        reason=reason,
        arguments=slots,
        functions=offered,
        named=named,
        pivots=pivots,
        w=motion.names,
        z=tuple(state.name for state in system.model.states),
        parameters=(*system.own_parameters, *(motion.frame.values if motion.frame else ())),
        assumptions=(*system.assumptions, *survey.repetitions),
        generalized_velocities=motion.projects_velocity,
        closing=motion.closing,
        kept=survey.kept,
        frame=motion.frame,
        requests=(
            *control(system, motion),
            *regression(system, motion),
            *derivatives(slots, offered, (system, motion)),
        ),
        families=families(system, motion),
    )


def entries(vector: ca.SX) -> Vector:
    """The entries of an SX column as a list of scalars, which is what the recursions work on."""
    return [vector[i] for i in range(vector.numel())]


def column(vector: Sequence[Scalar]) -> ca.SX:
    """Scalars as an SX column, n × 1; 0 × 1 where there are none."""
    return ca.vertcat(*vector) if vector else ca.SX(0, 1)


def _matrices(
    survey: Survey, reduction: Reduction, Y: ca.SX, R: ca.SX | Deferred[ca.SX]
) -> tuple[Named, ...]:
    """A, B, Y, S and R as matrices: W = Y⁻¹ = [R S] by the same pivots as λ."""
    A = survey.independent_rows.A
    shown = [
        Named("A", "constraint rows, A v = c", A),
        Named("B", "speed rows, B v = w", reduction.B),
    ]
    if survey.rank:
        shown += [
            *combination(survey),
            Named("Y", "[A; B]", Y),
            Named("R", "v = S w + R c", R),
        ]
    shown.append(Named("S", "generalized velocities per quasi-velocity", reduction.S))
    return tuple(shown)


def _combining(survey: Survey) -> tuple[Guard, ...]:
    """Of what combines rows that repeat each other."""
    pivots = survey.independent_rows.pivots
    return quadratic_guards(survey, [name for name, _ in pivots], [x for _, x in pivots])


def combination(survey: Survey) -> tuple[Named, ...]:
    """E (r × nc), where rows that repeat others are kept: E A are independent rows that stand for
    all. Nothing where no row repeats another or those that do are dropped."""
    E = Named("E", "independent combinations of the constraint rows", survey.independent_rows.E)
    return (E,) if survey.combines else ()


def per_unit_of_c(survey: Survey, Y: ca.SX, rows: int, given: Reduction | None = None) -> ca.SX:
    """R (nv × rows), the first columns of Y⁻¹ = [R S] with Y = [A; B]: A R = 1, B R = 0. It carries
    what moving constraints prescribe, v = S w + R c."""
    sides: list[Vector] = [[1.0 if i == k else 0.0 for i in range(Y.size1())] for k in range(rows)]
    return ca.horzcat(*[ca.vertcat(*x) for x in solved(survey, Y, sides, given).columns])
