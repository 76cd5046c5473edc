"""Trees of many links that few rows hold: v from [A; B] v = [c; w] as it stands, and ẇ from Gauss's
principle.

Where a chain is held at its tip every joint moves with all others: S is dense, and Sᵀ M S takes the
square of their number to be written and the cube to be solved. Of all v̇ with A v̇ = β the motion
takes the one nearest to the free one in the metric of M, and that needs M⁻¹ of the forces and of
each row alone, which the recursion gives in O(n):

    v̇ = a + M⁻¹ Aᵀ (A M⁻¹ Aᵀ)⁻¹ (β − A a),   a = M⁻¹ (Q − h),   ẇ = B v̇ + Ḃ v.

Rows that give one velocity each, as of prescribed joints, are no rows of A there: the recursion
goes over the other velocities, and v̇ starts from what they give.

Source: Gauss 1829; Udwadia, Kalaba: J. Appl. Mech. 68 (2001) 462-467.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.choices.explicit import Explicit, forces_at, forces_on_tree, reduced_mass
from derive.choices.limits import FEW_ROWS, MANY, REFLECTED
from derive.choices.pivots import block_guards, in_words, solved
from derive.choices.reduction import Reduction, Task, symbols_for
from derive.choices.survey import Survey
from derive.expressions.counting import operations
from derive.expressions.deferred import Deferred
from derive.expressions.scalars import Vector
from derive.mechanics.elimination.gauss import held_tree, is_of_links, velocities_alone
from derive.mechanics.records import RowForm, System


def has_few_rows(survey: Survey) -> bool:
    """Many links, few rows that tie several velocities and are independent as they stand, and all
    inertia in the links."""
    system, nv = survey.system, survey.system.v.numel()
    if nv < MANY or not survey.rank or survey.combines or not system.definite:
        return False
    return 0 < tying_rows(survey) <= FEW_ROWS * nv and is_of_links(system)


def tying_rows(survey: Survey) -> int:
    """How many rows are of several velocities."""
    return survey.rank - len(velocities_alone(survey.independent_rows.A))


def by_few_rows(
    survey: Survey, task: Task, speeds: Sequence[RowForm]
) -> tuple[Reduction, Explicit] | None:
    """The choice with v, σ and ẇ found so; None where too many rows of [A; B] have no safe
    pivots."""
    system, rows = survey.system, survey.independent_rows
    Y, w = ca.vertcat(rows.A, task.B), symbols_for(task.names)
    names = [*rows.names, *task.names]
    try:
        found = solved(survey, Y, [[*_entries(rows.c), *_entries(w)]])
    except ZeroDivisionError:
        return None
    if any(len(block.rows) > REFLECTED for block in found.blocks):
        return None
    v = _column(found.columns[0])
    beta = ca.substitute(rows.beta, system.v, v)
    turning = [ca.substitute(ca.SX(row.rate), system.v, v) for row in speeds]  # −Ḃ v
    sigma = solved(survey, Y, [[*_entries(beta), *turning]])
    reduction = Reduction(
        names=task.names,
        w=w,
        B=task.B,
        S=_transformation(survey, Y, w.numel()),
        v=v,
        sigma=_column(sigma.columns[0]),
        walked=None,
        guards=block_guards(survey, found, names),
        pivots=in_words(survey, found, names),
        kept=task.kept,
        constant_pivots=all(block.grade < 2 for block in found.blocks),
    )
    return reduction, _explicit(system, reduction, rows.A, beta, _column(turning))


def _transformation(survey: Survey, Y: ca.SX, nw: int) -> ca.SX:
    """S of Y S = [0; 1]."""
    still, rank = [0.0] * Y.size1(), Y.size1() - nw
    sides: list[Vector] = [[*still[: rank + k], 1.0, *still[rank + k + 1 :]] for k in range(nw)]
    columns = [_column(x) for x in solved(survey, Y, sides).columns]
    return ca.sparsify(ca.horzcat(*columns)) if columns else ca.SX(Y.size1(), 0)


def _explicit(
    system: System, reduction: Reduction, A: ca.SX, beta: ca.SX, turning: ca.SX
) -> Explicit:
    v, B, nw, tree = reduction.v, reduction.B, len(reduction.names), held_tree(system, A, beta)
    vdot, lam = tree.motion(forces_at(system, v, tree.sigma))
    wdot = ca.densify(ca.mtimes(B, vdot) - turning)
    qdot = ca.substitute(system.qdot, system.v, v)

    def solve(side: Vector) -> Vector:
        """B S = 1, so Bᵀ side is a force along v that S takes to the side."""
        still = replace(tree, sigma=ca.SX(v.numel(), 1), beta=[0.0] * len(tree.beta))
        moved, _ = still.motion(ca.mtimes(B.T, _column(side)))
        return _entries(ca.mtimes(B, moved))

    return Explicit(
        qdot=qdot,
        operations=operations(qdot, wdot),
        gathered="articulated bodies, held by Gauss's principle",
        wdot=wdot,
        vdot=vdot,
        mass=Deferred(lambda: reduced_mass(system, reduction), nw**2),
        force=Deferred(lambda: _column(forces_on_tree(system, reduction)), nw),
        solve=solve,
        lam=None if velocities_alone(A) else _column(lam),
    )


def _entries(column: ca.SX) -> Vector:
    return [*ca.vertsplit(ca.densify(column))] if column.numel() else []


def _column(entries: Sequence[ca.SX | float]) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
