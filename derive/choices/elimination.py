"""Choosing quasi-velocities is choosing how to eliminate: Y v = [c; w] solved from base to tip.

Every link's twist is carried as a linear form over w and the generalized velocities that are not
known yet; a constraint or speed row is solved for one of those as soon as all it speaks of has been
reached. The rates v̇ follow by the same walk with the same pivots, so no inverse is ever
differentiated. (Velocity transformation: Jerkovsky 1978; Kane & Levinson 1985; the pivot sequence
is the block inversion of Mirtaheri & Zohoor, carried out one row at a time.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from derive.choices.limits import SHORT
from derive.choices.walk import (
    Coefficients,
    Step,
    Undetermined,
    Walk,
    enter_free_velocities,
    walked,
)
from derive.expressions.scalars import Scalar
from derive.mechanics.records import Carried, Link, RowForm, System
from derive.mechanics.recursions.forms import ONE, Form, Key, constant, value
from derive.mechanics.recursions.motion import (
    STILL,
    Numbers,
    Twist,
    child_numbers,
    parent_part,
    row_products,
    velocity_products,
    with_products,
)
from derive.states.sampling import States


@dataclass(frozen=True)
class Elimination:
    """v = S w + (values at w = 0), v̇ = S ẇ + σ, and the same for every link's twist; v of the tree
    that was walked."""

    tree: System | Carried
    speeds: tuple[Form, ...]  # of each generalized velocity, over ("w", k) and ONE
    v: list[Scalar]
    sigma: list[Scalar]
    twists: list[Twist]
    numbers: list[Numbers]
    rates: list[Numbers]  # of the links' twists at ẇ = 0
    steps: tuple[Step, ...]
    row_names: tuple[str, ...]
    sizes: tuple[float, ...]


@dataclass(frozen=True)
class Speeds:
    """Speed rows and what they equal, w. Where it is `valued`, forms hold what it comes to and no
    coefficients of it: v and σ take as many operations as the loops that are passed, however many
    quasi-velocities there are."""

    rows: Sequence[RowForm]
    w: ca.SX
    valued: bool = False


def elimination(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Speeds,
    sampled: States,
    sizes: Sequence[float],
    short: int = SHORT,
) -> Elimination:
    """Solve constraint `rows` and speed rows for all generalized velocities; `sizes` are the rows'
    magnitudes, against which a coefficient counts as zero. Components of twists with at most
    `short` terms are written as their forms, others by recursion.

    First walk: Y v = [c; w] gives v = S w + v₀. Second walk, with the same pivots and the velocity
    products beside the same forms: Y v̇ = [β; ẇ − Ḃ v] at ẇ = 0 gives σ, v̇ = S ẇ + σ. No inverse
    is differentiated. Twists are in the frames of the links.

    Raises Dependent where a speed depends on the constraints and on the speeds before it,
    Undetermined where a velocity is left over.
    """
    coefficients_at = Coefficients(system, sampled, sizes)
    walks = _walks(system, rows, speeds, coefficients_at, short)
    forms, rates = [walks.forms[j] for j in range(system.v.numel())], walks.rates
    return Elimination(
        system,
        tuple(forms),
        walks.v,
        [rates.resolved(rates.joints[j]).get(ONE, 0.0) for j in range(system.v.numel())],
        walks.twists,
        walks.numbers,
        [_at_rest(rates.resolved_twist(i)) for i in range(len(system.links))],
        tuple(step for stage in walks.plan for step in stage),
        tuple(row.name for row in rates.rows),
        tuple(sizes),
    )


@dataclass(frozen=True)
class _Walks:
    """What both walks found of the links that were reached: `forms` and v of their joints, v of the
    others as it stands."""

    plan: list[list[Step]]
    forms: dict[int, Form]
    v: list[Scalar]
    twists: list[Twist]
    numbers: list[Numbers]
    rates: Walk


def _walks(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Speeds,
    coefficients_at: Coefficients,
    short: int,
    most: int | None = None,
) -> _Walks:
    """Both walks, up to the link where `most` rows are solved, or to the end."""
    walk, plan = walked(
        system, rows, speeds.rows, coefficients_at, most, speeds.w if speeds.valued else None
    )
    links = system.links[: len(plan) - 1]
    forms = {j: walk.resolved(form) for j, form in walk.joints.items()}
    unknown = {key[1] for form in forms.values() for key in form if key[0] == "v"}
    if unknown and most is None:
        raise Undetermined(system.labels[min(unknown)])
    v: list[Scalar] = [*ca.vertsplit(system.v)]
    values: dict[Key, Scalar] = {("w", k): speeds.w[k] for k in range(len(speeds.rows))}
    values |= {("v", j): v[j] for j in unknown}
    for j, form in forms.items():
        v[j] = value(form, values)
    twists = [walk.resolved_twist(i) for i in range(len(links))]
    numbers = _numbers(links, twists, v, values, short)
    frame = system.frame if isinstance(system, Carried) else None
    if frame:
        v[frame.column] = frame.rate(v[frame.beside])
        numbers = frame.turning(numbers, v)
    return _Walks(plan, forms, v, twists, numbers, _rates(system, walk, plan, numbers, v))


@dataclass(frozen=True)
class Beginning:
    """The first rows of an elimination alone: how many are solved, how many pivots vary, and v and
    σ so far, over w and the velocities that are not solved yet."""

    solved: int
    varying: int
    taken: ca.SX


def beginning(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Speeds,
    coefficients_at: Coefficients,
    short: int,
    most: int,
) -> Beginning:
    """As `elimination`, up to the link where `most` rows are solved. Raises Dependent."""
    walks = _walks(system, rows, speeds, coefficients_at, short, most)
    v = [walks.v[j] for j in walks.forms]
    sigma = [walks.rates.resolved(x).get(ONE, 0.0) for x in walks.rates.joints.values()]
    steps = [step for stage in walks.plan for step in stage]
    solved = sum(len(step.rows) for step in steps)
    varying = sum(step.block.grade == 2 for step in steps)
    return Beginning(solved, varying, ca.vertcat(ca.SX(0, 1), *v, *sigma))


def _rates(
    system: System | Carried,
    first: Walk,
    plan: list[list[Step]],
    numbers: list[Numbers],
    v: list[Scalar],
) -> Walk:
    """The second walk: rates at ẇ = 0, with the velocity products beside the same forms and the
    same pivots."""
    symbols = ca.vertcat(*v)
    sides: list[Form] = []
    for row in first.rows:
        rate = (
            row.rate
            if not isinstance(row.rate, ca.SX)
            else ca.substitute(row.rate, system.v, symbols)
        )
        sides.append(constant(rate))
    walk = Walk(system, first.rows, sides, {j: {} for j in first.known})
    here = [_in_numbers(row, system, symbols) for row in first.rows]
    enter_free_velocities(walk)
    _follow(walk, plan[0], here, numbers)
    joint_rates = system.frame.relative(v) if isinstance(system, Carried) else v
    for i, link in enumerate(system.links[: len(plan) - 1]):
        parent = numbers[link.parent] if link.parent >= 0 else STILL
        products = velocity_products(link, parent, [joint_rates[j] for j in link.columns])
        walk.enter(
            link, with_products(parent_part(link, walk.resolved_twist(link.parent)), products)
        )
        _follow(walk, plan[i + 1], here, numbers)
    return walk


def _in_numbers(row: RowForm, system: System | Carried, v: ca.SX) -> RowForm:
    """The row with the generalized velocities inside its rates replaced by their values."""
    terms = tuple(
        replace(
            term,
            direction_rate=_substituted(term.direction_rate, system, v),
            point_rate=_substituted(term.point_rate, system, v),
            moment_rate=_substituted(term.moment_rate, system, v),
        )
        if term.fixed == "state"
        else term
        for term in row.terms
    )
    return replace(row, terms=terms)


def _substituted(vector: list[Scalar], system: System | Carried, v: ca.SX) -> list[Scalar]:
    return [ca.substitute(x, system.v, v) if isinstance(x, ca.SX) else x for x in vector]


def _follow(
    walk: Walk, steps: Sequence[Step], rows: Sequence[RowForm], numbers: list[Numbers]
) -> None:
    for step in steps:
        walk.solve([walk.residual(i, row_products(rows[i], numbers)) for i in step.rows], step.keys)


def _at_rest(x: Twist) -> Numbers:
    return [f.get(ONE, 0.0) for f in x[0]], [f.get(ONE, 0.0) for f in x[1]]


def _numbers(
    links: Sequence[Link],
    twists: list[Twist],
    v: list[Scalar],
    values: dict[Key, Scalar],
    short: int,
) -> list[Numbers]:
    """Every link's twist as numbers: from its form where that is short, else by the recursion."""
    result: list[Numbers] = []
    for link, forms in zip(links, twists):
        parent = result[link.parent] if link.parent >= 0 else STILL
        by_recursion = child_numbers(link, parent, [v[j] for j in link.columns])
        result.append(
            (
                _short_values(forms[0], by_recursion[0], values, short),
                _short_values(forms[1], by_recursion[1], values, short),
            )
        )
    return result


def _short_values(
    forms: Sequence[Form], numbers: Sequence[Scalar], values: dict[Key, Scalar], short: int
) -> list[Scalar]:
    return [value(form, values) if len(form) <= short else x for form, x in zip(forms, numbers)]


def transformation(speeds: Sequence[Form], nw: int) -> ca.SX:
    """S as a matrix with nw columns, zeros not stored, from forms of the generalized velocities."""
    result = ca.SX(len(speeds), nw)
    for j, form in enumerate(speeds):
        for key, coefficient in form.items():
            if key[0] == "w":
                result[j, key[1]] = coefficient
    return result
