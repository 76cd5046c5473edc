"""System → Equations: one formulation, one choice of quasi-velocities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.formulations.choices import Ranking, Resolved, Workshop, ranked_partitions, resolved, workshop
from derive.formulations.configuration import configuration, is_plain
from derive.formulations.derivatives import derivatives
from derive.formulations.functions import Motion, arguments, functions
from derive.formulations.multipliers import augmented
from derive.formulations.records import Equations
from derive.formulations.reduction import Reduction
from derive.joints.records import Vector
from derive.mechanics.records import Named, System
from derive.mechanics.solve import Block, lu_solution, pivot_order, scalars
from derive.model.records import Choice


@dataclass(frozen=True)
class Formulation:
    """`build` makes the equations of a workshop's system for a declared choice."""

    name: str
    about: str
    source: str
    build: Callable[[Workshop, Choice], Equations]


def equations(system: System, choice: str | None = None, formulation: str = "quasi_velocities") -> Equations:
    """The functions of the generated module for a choice (the first declared one when not named) and a formulation.

    Raises AssumptionError for an unknown name and where the choice does not fit the constraints.
    """
    known = {f.name: f for f in FORMULATIONS}
    if formulation not in known:
        raise AssumptionError(f"unknown formulation '{formulation}'", did_you_mean(formulation, known) or listed(known))
    found = known[formulation].build(workshop(system), declared(system, choice))
    moves = configuration(system) if is_plain(system) else ()
    return replace(found, requests=(*found.requests, *derivatives(found.arguments, found.functions), *moves))


def declared(system: System, name: str | None) -> Choice:
    """The choice of that name; `auto` and `orthonormal` can always be asked for."""
    known = {c.name: c for c in system.model.choices}
    if name is None:
        return system.model.choices[0]
    if name in known:
        return known[name]
    if name in ("auto", "orthonormal"):
        return Choice(name, name, (), system.model.choices[0].span)
    offered = [*known, "auto", "orthonormal"]
    raise AssumptionError(
        f"unknown choice of quasi-velocities '{name}'", did_you_mean(name, offered) or f"known: {listed(offered)}"
    )


def choices(system: System) -> tuple[Ranking, ...]:
    """What `auto` compared, best first, with the declared choices among them."""
    return tuple(x.ranking for x in ranked_partitions(workshop(system)))


def _quasi_velocities(shop: Workshop, choice: Choice) -> Equations:
    system, found = shop.system, resolved(shop, choice)
    reduction, result = found.reduction, found.explicit
    force = system.Q - system.h
    residual = ca.mtimes(system.M, result.vdot) - ca.substitute(force, system.v, reduction.v)
    motion = Motion(
        w=reduction.w,
        names=reduction.names,
        units=_units(system, reduction),
        B=reduction.B,
        v=reduction.v,
        qdot=result.qdot,
        wdot=result.wdot,
        lam=_multipliers(shop, reduction, residual),
        guards=reduction.guards,
        named=result.named(reduction),
        kept=reduction.kept,
        closing=shop.closing,
        projects_velocity=False,
    )
    return _finished(shop, "quasi_velocities", choice.name, found, motion, _shown(shop, reduction))


def _units(system: System, reduction: Reduction) -> tuple[str, ...]:
    """Of the quasi-velocities: that of the base velocity a speed is a plain multiple of, else none."""
    entries: dict[int, list[int]] = {}
    for k, j in zip(*reduction.B.sparsity().get_triplet()):
        entries.setdefault(k, []).append(j)
    return tuple(_unit(system, reduction, k, entries.get(k, [])) for k in range(len(reduction.names)))


def _unit(system: System, reduction: Reduction, k: int, columns: list[int]) -> str:
    if len(columns) != 1 or not reduction.B[k, columns[0]].is_constant():
        return ""
    return system.model.velocities[columns[0]].unit


def _multipliers(shop: Workshop, reduction: Reduction, residual: ca.SX) -> ca.SX:
    """λ from Yᵀ [λ; 0] = M v̇ + h − Q, Y = [A; B]; multipliers of redundant rows are zero."""
    system, rows = shop.system, list(reduction.kept)
    lam = ca.SX.zeros(len(system.rows))
    if rows:
        Y = ca.vertcat(system.A[rows, :], reduction.B)
        found = lu_solution(scalars(Y.T), [_entries(residual)], _pivots(shop, Y.T)).x[0]
        for i, x in zip(rows, found):
            lam[i] = x
    return lam


def _pivots(shop: Workshop, matrix: ca.SX) -> list[Block]:
    system, s = shop.system, shop.sampled
    function = ca.Function("Y", [system.t, system.q, system.p], [ca.densify(matrix)])
    values = np.array([np.asarray(function(t, q, p)) for t, q, p in zip(s.t, s.q, s.p)])
    rows = scalars(matrix)
    structure = np.array([[not isinstance(x, float) or x != 0 for x in row] for row in rows])
    constant = np.array([[isinstance(x, float) for x in row] for row in rows])
    return pivot_order(values, structure, constant)


def _entries(column: ca.SX) -> Vector:
    return [column[i] for i in range(column.numel())]


def _shown(shop: Workshop, reduction: Reduction) -> tuple[Named, ...]:
    """A, B, Y, S and R as matrices: W = Y⁻¹ = [R S] by the same pivots as λ."""
    system, rows = shop.system, list(reduction.kept)
    A = system.A[rows, :]
    shown = [Named("A", "constraint rows, A v = c", A), Named("B", "speed rows, B v = w", reduction.B)]
    if rows:
        Y = ca.vertcat(A, reduction.B)
        n = system.v.numel()
        sides: list[Vector] = [[1.0 if i == k else 0.0 for i in range(n)] for k in range(len(rows))]
        columns = lu_solution(scalars(Y), sides, _pivots(shop, Y)).x
        shown.append(Named("Y", "[A; B]", Y))
        shown.append(Named("R", "v = S w + R c", ca.horzcat(*[ca.vertcat(*column) for column in columns])))
    shown.append(Named("S", "base velocities per quasi-velocity", reduction.S))
    return tuple(shown)


def _finished(
    shop: Workshop, formulation: str, choice: str, found: Resolved, motion: Motion, shown: tuple[Named, ...]
) -> Equations:
    system = shop.system
    return Equations(
        system=system,
        formulation=formulation,
        choice=choice,
        reason=found.reason,
        arguments=arguments(system, motion),
        functions=functions(system, motion),
        named=(*shown, *motion.named[1:]),
        pivots=found.reduction.pivots,
        w=motion.names,
        parameters=system.parameters,
        assumptions=(*system.assumptions, *shop.repetitions),
    )


def _augmented(shop: Workshop, choice: Choice) -> Equations:
    """The base velocities are the quasi-velocities; the constraints hold through λ only."""
    system = shop.system
    free = Choice("augmented", "rows", (), choice.span)
    if not system.definite:
        raise AssumptionError(
            f"{system.model.name}: the mass matrix is singular, so the augmented system has no L D Lᵀ; "
            "use the formulation quasi_velocities"
        )
    kept = shop.kept
    result = augmented(system, kept)
    motion = Motion(
        w=system.v,
        names=tuple(_identifier(v.name) for v in system.model.velocities),
        units=tuple(v.unit for v in system.model.velocities),
        B=ca.SX.eye(system.v.numel()),
        v=system.v,
        qdot=system.qdot,
        wdot=result.vdot,
        lam=result.lam,
        guards=(),
        named=(Named("M", "mass matrix", system.M), Named("h", "bias", system.h), Named("beta", "A v̇ = β", system.beta)),
        kept=kept,
        closing=shop.closing,
        projects_velocity=True,
    )
    return Equations(
        system=system,
        formulation="augmented",
        choice=free.name,
        reason="the base velocities themselves, held together by multipliers: the traditional reference",
        arguments=arguments(system, motion),
        functions=functions(system, motion),
        named=(Named("A", "constraint rows, A v = c", system.A), *motion.named),
        pivots=(),
        w=motion.names,
        parameters=system.parameters,
        assumptions=(*system.assumptions, *shop.repetitions),
    )


def _identifier(name: str) -> str:
    return name.replace("der(", "").replace(")", "_dot").replace(".", "_")


FORMULATIONS = (
    Formulation(
        "quasi_velocities",
        "explicit equations in quasi-velocities, no multipliers; [A; B] inverted block by block",
        "Mirtaheri & Zohoor, Quasi-velocities definition in Lagrangian multibody dynamics",
        _quasi_velocities,
    ),
    Formulation(
        "augmented",
        "base velocities and multipliers from one bordered system, the traditional reference",
        "Lagrange's equations of the first kind",
        _augmented,
    ),
)
