"""Which quasi-velocities: the user's rows, an orthonormal basis, or the best partition of the
generalized velocities (derive/choices/ranking.py says by what)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from derive.choices.candidates import candidates, suited
from derive.choices.elimination import Beginning
from derive.choices.embedded import by_embedding, has_overlapping_loops
from derive.choices.explicit import Explicit, explicit
from derive.choices.few_rows import by_few_rows, has_few_rows, tying_rows
from derive.choices.limits import (
    ALONE,
    CUBIC,
    DEPENDENT,
    FEW,
    FEWEST_ROWS,
    FINALISTS,
    NAMED,
    ROUNDOFF,
    TELLING,
    WORTHWHILE,
)
from derive.choices.orthonormal import orthonormal
from derive.choices.ranking import Ranking, judged, numeric_rows, reason_of, score
from derive.choices.reduction import (
    Reduction,
    Task,
    Way,
    by_elimination,
    first_rows,
    unreduced,
)
from derive.choices.survey import Survey, even_rows, row_lengths, ways_of
from derive.choices.walk import Dependent, Undetermined
from derive.diagnostics import AssumptionError
from derive.expressions.counting import alternatives
from derive.expressions.scalars import Scalar
from derive.expressions.settled import settled
from derive.joints.rotations import is_one, is_zero
from derive.mechanics.records import Carried, RowForm, System
from derive.mechanics.rows import velocity_row
from derive.model.records import Choice


@dataclass(frozen=True)
class Resolved:
    """A choice carried through to its explicit equations, with the reason it was taken."""

    ranking: Ranking
    reduction: Reduction
    explicit: Explicit
    reason: str


def resolved(survey: Survey, choice: Choice) -> Resolved:
    """The choice of the given declaration, carried through: `auto` (best partition), `orthonormal`,
    or rows of its own. Raises AssumptionError where the rows are not as many as degrees of freedom,
    or depend on the constraints and on each other."""
    match choice.kind:
        case "orthonormal":
            return _orthonormal(survey, choice)
        case "auto":
            return _best(survey, choice)
        case _:
            return _declared(survey, choice)


def _declared(survey: Survey, choice: Choice) -> Resolved:
    rows = speed_rows(survey.system, choice)
    if len(rows) != survey.freedom:
        raise _refused(
            survey.system,
            choice,
            f"choice '{choice.name}' has {_counted(len(rows), 'speed')}, "
            f"but the system has {_counted(survey.freedom, 'degree')} of freedom",
            f"{survey.freedom} independent rows",
        )
    try:
        return carried_out(survey, choice.name, "rows", rows, _reason(choice))
    except Dependent as problem:
        raise _dependent(survey, choice, rows, problem.speed) from None
    except Undetermined as problem:
        if _is_dependent(survey, rows):
            raise _dependent(survey, choice, rows, rows[-1].name) from None
        message = (
            f"choice '{choice.name}': the sampled states are too near singular positions "
            f"to find a pivot for '{problem.velocity}'"
        )
        raise _refused(
            survey.system,
            choice,
            message,
            "initial values away from singular positions, or another choice",
        ) from None


def _reason(choice: Choice) -> str:
    return "the model declares it" if choice.span.line else "it was asked for by name"


def _dependent(
    survey: Survey, choice: Choice, rows: Sequence[RowForm], speed: str
) -> AssumptionError:
    return _refused(
        survey.system,
        choice,
        f"choice '{choice.name}': the speed '{speed}' depends on the constraints and the other "
        f"speeds at every sampled state ({_culprits(survey, rows)})",
        "speeds that, with the constraint rows, determine all velocities; `auto` finds such a set",
    )


def _is_dependent(survey: Survey, rows: Sequence[RowForm]) -> bool:
    """Whether [A; B] is singular at every sampled state."""
    A = survey.rows[:, list(survey.kept)]
    B = even_rows(numeric_rows(survey, _matrix(rows, survey.system.v.numel())))
    least = np.linalg.svd(np.concatenate([A, B], axis=1), compute_uv=False)[:, -1]
    return bool(np.max(least, initial=0.0) < DEPENDENT)


def _counted(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def _culprits(survey: Survey, rows: Sequence[RowForm]) -> str:
    """The constraints that take part in the dependency: the left null vector of [A; B] at a sampled
    state."""
    Y = np.vstack(
        [
            survey.rows[0],
            even_rows(numeric_rows(survey, _matrix(rows, survey.system.v.numel())))[0],
        ]
    )
    weights = np.abs(np.linalg.svd(Y)[0][:, -1])
    names = [row.name for row in survey.system.rows] + [row.name for row in rows]
    return "with " + ", ".join(n for n, x in zip(names, weights) if x > NAMED)


def _matrix(rows: Sequence[RowForm], nv: int) -> ca.SX:
    B = ca.SX(len(rows), nv)
    for k, row in enumerate(rows):
        for j, coefficient in row.coefficients:
            B[k, j] = coefficient
    return B


def speed_rows(system: System, choice: Choice) -> list[RowForm]:
    """The declared speeds as rows over the generalized velocities; the loader has seen to it that
    they are linear and homogeneous."""
    result: list[RowForm] = []
    for name, expression in choice.rows:
        velocity = ca.substitute(
            ca.SX(system.symbols.scalar(expression)), system.symbols.qd, system.qdot
        )
        coefficients, _, rate = velocity_row(system.symbols, system.qdot, velocity)
        result.append(RowForm(name, (), coefficients, 0.0, rate))
    return result


def _rows_over(system: System, tree: Carried, rows: Sequence[RowForm]) -> list[RowForm]:
    """Speed rows over the velocities of a tree with a further frame."""
    over = replace(system.symbols, v=tree.v)
    result: list[RowForm] = []
    for row in rows:
        velocity = ca.SX(0)
        for j, coefficient in row.coefficients:
            velocity += coefficient * tree.speeds[j]
        coefficients, _, rate = velocity_row(over, tree.qdot, velocity)
        known = _settled(coefficients)
        moves = any(isinstance(x, ca.SX) and not x.is_constant() for _, x in known)
        result.append(RowForm(row.name, (), known, 0.0, rate if moves else 0.0))
    return result


def _settled(coefficients: Sequence[tuple[int, Scalar]]) -> tuple[tuple[int, Scalar], ...]:
    """Coefficients with numbers in the place of formulas that are nothing else; zeros left out."""
    values = settled([x for _, x in coefficients])
    return tuple((j, x) for (j, _), x in zip(coefficients, values) if not is_zero(x))


def carried_out(
    survey: Survey, name: str, kind: str, rows: Sequence[RowForm], reason: str
) -> Resolved:
    """The elimination in every way of writing the constraint blocks; see `_least`. Raises Dependent
    where a speed depends on the constraints and the others, to rounding: no digit is left."""
    names = tuple(row.name for row in rows)
    if not survey.system.rows and _are_the_base(rows):
        reduction = unreduced(survey.system, names)
        equations = explicit(survey.system, reduction)
        ranking = Ranking(
            name, kind, names, True, 1.0, 1.0, equations.operations, (), equations.gathered
        )
        return Resolved(ranking, reduction, equations, reason)
    B = _matrix(rows, survey.system.v.numel())
    sizes = [*survey.form_sizes, *row_lengths(numeric_rows(survey, B)).tolist()]
    task = Task(names, B, survey.kept, survey.sampled_for(B), sizes)
    reduction, equations = _least(survey, task, rows)
    ranking = judged(survey, name, kind, names, reduction, equations)
    if not ranking.condition < 1 / ROUNDOFF:
        raise Dependent(names[-1])
    return Resolved(ranking, reduction, equations, reason)


def _least(survey: Survey, task: Task, rows: Sequence[RowForm]) -> tuple[Reduction, Explicit]:
    """Of the system's own velocities and of trees with a further frame, with short twists as forms
    and without: the safest pivots, then the fewest operations."""
    system = survey.system
    held = by_few_rows(survey, task, rows) if has_few_rows(survey) else None
    if held and len(task.names) > CUBIC and tying_rows(survey) <= FEWEST_ROWS:
        return held
    ways = [Way(system, forms, rows) for forms in survey.forms]
    found = [_shortest(task, ways)]
    overlapping = has_overlapping_loops(survey, task, found[0][1], rows)
    shortest = found[0][0]
    tried = ways[:1] if shortest is ways[0] else [ways[0], shortest]
    embedded = by_embedding(survey, task, tried, found[0][1]) if overlapping else None
    if embedded and len(task.names) > ALONE:
        return embedded
    held = embedded or held
    for tree in system.carried if system.rows and not survey.combines else ():
        over = _rows_over(system, tree, rows)
        try:
            found.append(
                _shortest(task, [Way(tree, x, over) for x in ways_of(survey.whole(tree.blocks))])
            )
        except (Dependent, Undetermined):
            continue  # the system's own velocities will do
    results = [(x, explicit(system, x)) for _, x in found]
    best = min(range(len(found)), key=lambda k: _preference(*results[k]))
    if held and _preference(*held) < _preference(*results[best]):
        return held
    if len(system.links) > FEW:
        return results[best]
    reduction = by_elimination(task, replace(found[best][0], short=1))
    by_recursion = explicit(system, reduction)
    shorter = by_recursion.operations < WORTHWHILE * results[best][1].operations
    return (reduction, by_recursion) if shorter else results[best]


def _shortest(task: Task, ways: Sequence[Way]) -> tuple[Way, Reduction]:
    """Of the ways of writing the rows the one with the safest pivots, then the one that gives v and
    v̇ with the fewest operations, for what follows hardly differs. Of very many rows the first
    tell."""
    if len(ways) > 1 and len(ways[0].rows) > TELLING:
        return _carried_through(task, _by_their_first_rows(task, ways), 1)[0]
    found = _carried_through(task, ways, len(ways))
    counts = alternatives([ca.vertcat(x.v, x.sigma) for _, x in found])
    return found[min(range(len(found)), key=lambda k: (_risk(found[k][1]), counts[k]))]


def _carried_through(task: Task, ways: Sequence[Way], most: int) -> list[tuple[Way, Reduction]]:
    """The first `most` ways that can be gone to the end. Raises what is in the way of the first
    where there are none."""
    found: list[tuple[Way, Reduction]] = []
    refused: Dependent | Undetermined | None = None
    for way in ways:
        if len(found) == most:
            break
        try:
            found.append((way, by_elimination(task, way)))
        except (Dependent, Undetermined) as error:
            refused = refused or error
    if refused and not found:
        raise refused
    return found


def _by_their_first_rows(task: Task, ways: Sequence[Way]) -> list[Way]:
    """The ways that can be gone that far, in the order in which `_shortest` prefers them, judged by
    their first TELLING rows; then the others."""
    begun: dict[int, Beginning] = {}
    for k, way in enumerate(ways):
        try:
            begun[k] = first_rows(task, way, TELLING)
        except Dependent:
            continue  # the whole of it will say why
    counts = dict(zip(begun, alternatives([x.taken for x in begun.values()])))
    solved = {k: max(1, x.solved) for k, x in begun.items()}  # one way may get farther in one step

    def preference(k: int) -> tuple[float, float]:
        return round(begun[k].varying / solved[k], 1), counts[k] / solved[k]

    preferred = sorted(begun, key=preference)
    others = [k for k in range(len(ways)) if k not in begun]
    return [ways[k] for k in (*preferred, *others)]


def _risk(reduction: Reduction) -> tuple[bool, int]:
    return not reduction.constant_pivots, len(reduction.guards)


def _preference(reduction: Reduction, equations: Explicit) -> tuple[tuple[bool, int], int]:
    return _risk(reduction), equations.operations


def _are_the_base(rows: Sequence[RowForm]) -> bool:
    """Whether the speeds are the generalized velocities themselves, in order."""
    singles = [row.coefficients[0] for row in rows if len(row.coefficients) == 1]
    return len(singles) == len(rows) and all(
        j == k and is_one(x) for k, (j, x) in enumerate(singles)
    )


def _orthonormal(survey: Survey, choice: Choice) -> Resolved:
    reduction = orthonormal(survey)
    equations = explicit(survey.system, reduction)
    ranking = judged(survey, choice.name, "orthonormal", reduction.names, reduction, equations)
    return Resolved(
        ranking,
        reduction,
        equations,
        f"{_reason(choice)}: [A; B] is as well conditioned as A allows",
    )


def _best(survey: Survey, choice: Choice) -> Resolved:
    """The winner of the ranking, with the reason in words."""
    ranked = ranked_partitions(survey)
    if not ranked:
        message = (
            "no set of generalized velocities is independent of the constraints at the "
            "sampled states"
        )
        raise _refused(
            survey.system,
            choice,
            message,
            "a well-posed constraint set, or the choice `orthonormal`",
        )
    best = ranked[0]
    return Resolved(
        best.ranking,
        best.reduction,
        best.explicit,
        reason_of(best.ranking, [x.ranking for x in ranked[1:]]),
    )


def partition_for(survey: Survey, k: int) -> Resolved | None:
    """The partition that is far from singular at one of the `many` states."""
    return _try(survey, *suited(survey, k))


def ranked_partitions(survey: Survey) -> list[Resolved]:
    """Sets of generalized velocities (and the user's own rows) that determine the rest, best
    first."""
    return [*_ranked(survey)]


@lru_cache(maxsize=1)  # a module with charts looks at the same ones again
def _ranked(survey: Survey) -> tuple[Resolved, ...]:
    finalists = sorted(candidates(survey), key=lambda x: x[0])[:FINALISTS]
    carried = [_try(survey, name, rows) for _, name, rows in finalists]
    carried += [
        _try(survey, c.name, tuple(speed_rows(survey.system, c)))
        for c in survey.system.model.choices
        if _fits(survey, c)
    ]
    unique = {x.ranking.rows: x for x in reversed([y for y in carried if y is not None])}
    return tuple(sorted(unique.values(), key=lambda x: score(x.ranking)))


def _fits(survey: Survey, choice: Choice) -> bool:
    return choice.kind == "rows" and len(choice.rows) == survey.freedom


def _try(survey: Survey, name: str, rows: tuple[RowForm, ...]) -> Resolved | None:
    try:
        return carried_out(survey, name, "rows", rows, "")
    except (Dependent, Undetermined):
        return None


def _refused(system: System, choice: Choice, message: str, expected: str) -> AssumptionError:
    return AssumptionError(system.model.diagnostic(choice.span, message, expected))
