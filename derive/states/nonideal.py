"""Nonideal constraints whose own force depends on a reaction, as sliding friction does; and loads
that do, as rolling resistance, belts and journals.

A nonideal constraint does work: wᵀ Q_c = wᵀ C for every w in ker A (Udwadia & Kalaba 2001, 2002).
C(q, v, u, t, λ°) may use the multipliers λ° of the ideal problem, the one with C = 0:
    M v̇° + h = Q° + Aᵀ λ°,   A v̇° = β.
λ° does not depend on C, so the equations stay explicit: λ° is solved for once and C becomes an
applied force.
"""

from __future__ import annotations

from collections.abc import Collection

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic
from derive.expressions.deferred import Deferred, changed, is_deferred
from derive.expressions.scalars import Vector
from derive.mechanics.elimination.pivoting import pivot_order
from derive.mechanics.elimination.solve import ldl_solution, lu_solution, scalars
from derive.mechanics.records import Named, System
from derive.mechanics.system import ideal_system
from derive.model.memory import without_collections
from derive.model.records import Model
from derive.numerics import refuses_numerically
from derive.states.axes import well_turned
from derive.states.closing import Kinematics
from derive.states.independence import independent
from derive.states.limits import RANK, SAMPLES
from derive.states.sampling import no_states, row_lengths, states


@refuses_numerically("the mechanics")
@without_collections()
def system(model: Model, constants: Collection[str] | str = ()) -> System:
    """The mechanics of a model, nonideal constraint forces included.

    `constants` names the parameters to bake in as numbers ("all" for every one). Raises ModelError
    where the kinetic energy is not quadratic in the rates, AssumptionError where a nonideal force
    uses a reaction that is not unique.
    """
    ideal, C = well_turned(*ideal_system(model, constants))
    return ideal if C.is_zero() else with_nonideal(ideal, C)


def with_nonideal(system: System, C: ca.SX) -> System:
    """The system, whose Q has no nonideal forces yet, with C (conjugate to v) among the applied
    ones.

    Of C only what works on admissible motions matters, wᵀC for w in ker A; what lies along Aᵀ
    changes λ and not the motion. Raises AssumptionError where C uses a reaction that is not unique.
    """
    used = [i for i, row in enumerate(system.rows) if _depends(system, C, f"reaction.{row.name}")]
    if not used:
        return _with_applied(system, C)
    symbols = system.symbols.reactions([system.rows[i].name for i in used])
    ideal = ideal_reactions(system, used)
    shown = (
        Named("lam_ideal", "reactions of the ideal problem", ideal),
        Named("C", "nonideal forces over them", C),
    )
    known = changed(system, names=(*system.names, *shown))
    return _with_applied(known, ca.substitute(C, symbols, ideal[used]))


def _with_applied(system: System, force: ca.SX) -> System:
    pushed = system.pushed if force.is_zero() else None
    Q = system.Q + force
    if is_deferred(system, "power"):
        power = Deferred(lambda: system.power + ca.dot(force, system.v))
        return changed(system, Q=Q, power=power, pushed=pushed)
    return changed(system, Q=Q, power=system.power + ca.dot(force, system.v), pushed=pushed)


def _depends(system: System, C: ca.SX, name: str) -> bool:
    symbol = system.symbols.names.get(name)
    return isinstance(symbol, ca.SX) and ca.depends_on(C, symbol)


def ideal_reactions(system: System, used: list[int]) -> ca.SX:
    """λ° of every row (nc × 1) over (t, q, v, u, p), zero for those that repeat others: M v̇° + h =
    Q° + Aᵀ λ°, A v̇° = β. Raises AssumptionError where a row in `used` repeats others, or a motion
    that the constraints allow has no mass."""
    solver = Kinematics(system)
    samples = states(system, SAMPLES, solver=solver)
    if not len(samples.t):
        raise no_states(system)
    sampled = solver.rows(samples.t, samples.q, samples.p)[0]
    rows = list(independent(sampled / row_lengths(sampled)[:, None], range(len(system.rows))))
    for i in used:
        _check_unique(system, sampled, i)
    M, A, nv = system.M, system.A[rows, :], system.v.numel()
    sides: list[Vector] = [_entries(ca.vertcat(system.Q - system.h, system.beta[rows, 0]))]
    bordered = ca.blockcat([[M, A.T], [A, ca.SX(len(rows), len(rows))]])
    if system.definite:
        x = ldl_solution(
            scalars(bordered), sides, [*reversed(range(nv)), *range(nv, nv + len(rows))]
        ).x[0]
    else:
        values = solver.values(bordered, samples.t, samples.q, samples.p)
        x = _by_pivots(system, bordered, sides, values)
    result = ca.SX.zeros(len(system.rows))
    for i, y in zip(rows, x[nv:]):
        result[i] = -y
    return result


def _by_pivots(system: System, matrix: ca.SX, sides: list[Vector], values: np.ndarray) -> Vector:
    """For singular M: Gauss elimination with pivots that stay away from zero over the sampled
    states. AssumptionError where there are none: a motion that the constraints allow has no
    mass."""
    rows = scalars(matrix)
    structure = np.array([[not isinstance(x, float) or x != 0.0 for x in row] for row in rows])
    constant = np.array([[isinstance(x, float) for x in row] for row in rows])
    try:
        order = pivot_order(values, structure, constant)
    except ZeroDivisionError:
        raise AssumptionError(
            Diagnostic(
                file=system.model.file,
                message="the reactions that a nonideal force uses are not determined: the mass "
                "matrix is singular along a motion that the constraints allow",
                expected="inertia along every motion that the constraints allow",
            )
        ) from None
    return lu_solution(rows, sides, order).x[0]


def _rank(sampled: np.ndarray) -> int:
    lengths = np.linalg.norm(sampled, axis=2, keepdims=True)
    scaled = sampled / np.where(lengths > 0, lengths, 1.0)
    return int(np.median(np.linalg.matrix_rank(scaled, tol=RANK))) if sampled.size else 0


def _check_unique(system: System, sampled: np.ndarray, i: int) -> None:
    """A row's multiplier is unique only if the row is no combination of the others."""
    others = [k for k in range(sampled.shape[1]) if k != i]
    if _rank(sampled) > (_rank(sampled[:, others]) if others else 0):
        return
    name = system.rows[i].name
    message = (
        f"a force uses reaction.{name}, which is not unique: '{name}' repeats other constraints"
    )
    span = system.model.place(name.partition(".")[0])
    raise AssumptionError(system.model.diagnostic(span, message, "independent constraints"))


def _entries(column: ca.SX) -> Vector:
    return [column[i] for i in range(column.numel())]
