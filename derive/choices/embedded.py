"""Trees whose loops overlap, as ladders and lattices: ẇ by constraint embedding.

Where each loop shares links with the one before it, what closes the last depends on all
quasi-velocities: S is full below its diagonal, and Sᵀ M S takes the square of their number to be
written and the cube to be solved. Neither is needed where joints of its own close each loop: v and
σ follow from base to tip with the values of w, and ẇ from the sweep of
derive.mechanics.recursions.embedding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.choices.elimination import Elimination, Speeds, elimination
from derive.choices.explicit import (
    Explicit,
    Nearest,
    forces_at,
    forces_on_tree,
    reduced_mass,
)
from derive.choices.limits import EMBEDDED, FULL
from derive.choices.reduction import Reduction, Task, Way
from derive.choices.survey import Survey
from derive.choices.walk import Dependent, Step, Undetermined, is_single, unknowns_of
from derive.expressions.counting import alternatives, operations
from derive.expressions.deferred import Deferred
from derive.expressions.scalars import Scalar, Vector
from derive.mechanics.elimination.gauss import is_of_links
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.records import RowForm, System
from derive.mechanics.recursions.embedding import Embedded, Pivots, embedded


def has_overlapping_loops(
    survey: Survey, task: Task, reduction: Reduction, speeds: Sequence[RowForm]
) -> bool:
    """Several quasi-velocities, each a velocity of a joint, on all of which most other velocities
    depend, and all inertia in the links."""
    system, nw = survey.system, len(task.names)
    if min(nw, survey.rank) < EMBEDDED or not system.definite or not is_of_links(system):
        return False
    full = reduction.S.nnz() - nw > FULL * nw * (reduction.S.size1() - nw)
    return full and all(is_single(row) for row in speeds)


def by_embedding(
    survey: Survey, task: Task, ways: Sequence[Way], reduction: Reduction
) -> tuple[Reduction, Explicit] | None:
    """The choice with v and σ over the values of w, and ẇ without Sᵀ M S. Of the ways of writing
    the rows v and σ take one and the sweep another, whichever need the fewest operations. None
    where no way can be gone to the end."""
    found: list[tuple[Way, Elimination]] = []
    for way in ways:
        try:
            found.append((way, _valued(survey, task, way, reduction)))
        except (Dependent, Undetermined):
            continue
    if not found:
        return None
    motions = [(ca.vertcat(*x.v), ca.vertcat(*x.sigma)) for _, x in found]
    v, sigma = motions[_fewest([ca.vertcat(*x) for x in motions])]
    force = ca.SX.sym("force", v.numel())
    sweeps = [_sweep(survey.system, *x) for x in found]
    best = _fewest([_column(x.motion(_entries(force))[0]) for x in sweeps])
    result = replace(reduction, v=v, sigma=sigma, walked=None)
    kept = () if survey.combines or not _same_rows(found[best][0], ways[0]) else task.kept
    equations = _explicit(survey.system, result, sweeps[best], kept)
    first = [x for x in found if not survey.combines and _same_rows(x[0], ways[0])]
    return result, replace(equations, nearest=_nearest(survey, *first[0]) if first else None)


def _nearest(survey: Survey, way: Way, walked: Elimination) -> Nearest | None:
    """The least δ in the metric of M for A δ of the kept rows."""
    system = survey.system
    groups = _pivots(system, way, walked)
    if {i for group in groups for x in group for i in x.rows} != {*survey.kept}:
        return None

    def step(sides: Sequence[Scalar]) -> Vector:
        rotors = _entries(ca.diag(system.M_extra))
        sweep = embedded(system.links, system.inertias[-1], rotors, way.rows, groups, True)
        return sweep.motion([0.0] * len(rotors), dict(zip(survey.kept, sides)))[0]

    return step


def _same_rows(way: Way, first: Way) -> bool:
    """Whether λ is of the rows as the system has them, which are those of the first way; a row
    along a rod is the same in every way."""
    return all(x is y or x.rod for x, y in zip(way.rows, first.rows))


def _valued(survey: Survey, task: Task, way: Way, reduction: Reduction) -> Elimination:
    speeds = Speeds(way.speeds, reduction.w, valued=True)
    return elimination(survey.system, way.rows, speeds, task.sampled, task.sizes, short=1)


def _fewest(results: Sequence[ca.SX]) -> int:
    counts = alternatives([*results])
    return counts.index(min(counts))


def _sweep(system: System, way: Way, walked: Elimination) -> Embedded:
    rotors, groups = _entries(ca.diag(system.M_extra)), _pivots(system, way, walked)
    return embedded(system.links, system.inertias[-1], rotors, way.rows, groups)


def _pivots(system: System, way: Way, walked: Elimination) -> list[list[Pivots]]:
    steps = [step for step in walked.steps if step.rows[0] < len(way.rows)]
    return [
        [Pivots(step.rows, tuple(key[1] for key in step.keys)) for step in group]
        for group in _groups(system, way, steps)
    ]


def _groups(system: System, way: Way, steps: Sequence[Step]) -> list[list[Step]]:
    """Steps that speak of what each other is solved for."""
    solved = {key[1]: k for k, step in enumerate(steps) for key in step.keys}
    unknowns = unknowns_of(system, way.rows)
    places = {
        (k, solved[j])
        for k, step in enumerate(steps)
        for i in step.rows
        for j in unknowns[i] & solved.keys()
    }
    speaks = ca.Sparsity.triplet(len(steps), len(steps), *(list(x) for x in zip(*sorted(places))))
    count, order, offset = speaks.scc()
    return [[steps[k] for k in sorted(order[offset[i] : offset[i + 1]])] for i in range(count)]


def _explicit(
    system: System, reduction: Reduction, sweep: Embedded, kept: Sequence[int]
) -> Explicit:
    force = forces_at(system, reduction.v, reduction.sigma)
    moved, multipliers = sweep.motion(_entries(force))
    wdot = ca.densify(ca.mtimes(reduction.B, _column(moved)))
    qdot = ca.substitute(system.qdot, system.v, reduction.v)
    nw = len(reduction.names)

    def solve(side: Vector) -> Vector:
        """B S = 1, so Bᵀ side is a force along v that S takes to the side."""
        applied = ca.mtimes(reduction.B.T, _column(side))
        found, _ = sweep.motion(_entries(applied))
        return _entries(ca.mtimes(reduction.B, _column(found)))

    return Explicit(
        qdot=qdot,
        operations=operations(qdot, wdot),
        gathered="articulated bodies, loops embedded",
        wdot=wdot,
        vdot=ca.densify(_column(moved) + reduction.sigma),
        mass=Deferred(lambda: reduced_mass(system, reduction), nw**2),
        force=Deferred(lambda: _column(forces_on_tree(system, reduction)), nw),
        solve=solve,
        lam=_column([multipliers[i] for i in kept]) if {*kept} == {*multipliers} else None,
    )


def _entries(column: ca.SX) -> Vector:
    """What is not stored as the float 0: the sweep skips it."""
    return [row[0] for row in scalars(column)]


def _column(entries: Sequence[ca.SX | float]) -> ca.SX:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
