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
from derive.mechanics.forms import ONE, Form, Key, constant, value
from derive.mechanics.motion import (
    STILL,
    Numbers,
    Twist,
    child_numbers,
    parent_part,
    row_products,
    velocity_products,
    with_products,
)
from derive.mechanics.records import Carried, Link, RowForm, System
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


def elimination(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Sequence[RowForm],
    w: ca.SX,
    sampled: States,
    sizes: Sequence[float],
    short: int = SHORT,
) -> Elimination:
    """Solve constraint `rows` and speed rows (whose values are w) for all generalized velocities;
    `sizes` are the rows' magnitudes, against which a coefficient counts as zero. Components of
    twists with at most `short` terms are written as their forms, others by recursion.

    First walk: Y v = [c; w] gives v = S w + v₀. Second walk, with the same pivots and the velocity
    products beside the same forms: Y v̇ = [β; ẇ − Ḃ v] at ẇ = 0 gives σ, v̇ = S ẇ + σ. No inverse
    is differentiated. Twists are in the frames of the links.

    Raises Dependent where a speed depends on the constraints and on the speeds before it,
    Undetermined where a velocity is left over.
    """
    walk, plan = walked(system, rows, speeds, Coefficients(system, sampled, sizes))
    values: dict[Key, Scalar] = {("w", k): w[k] for k in range(len(speeds))}
    forms = [walk.resolved(walk.joints[j]) for j in range(system.v.numel())]
    unknown = {key[1] for form in forms for key in form if key[0] == "v"}
    if unknown:
        raise Undetermined(system.labels[min(unknown)])
    v = [value(form, values) for form in forms]
    twists = [walk.resolved_twist(i) for i in range(len(system.links))]
    numbers = _numbers(system.links, twists, v, values, short)
    frame = system.frame if isinstance(system, Carried) else None
    if frame:
        v[frame.column] = frame.rate(v[frame.beside])
        numbers = frame.turning(numbers, v)
    rates = _rates(system, walk, plan, numbers, v)
    sigma = [rates.resolved(rates.joints[j]).get(ONE, 0.0) for j in range(system.v.numel())]
    bias = [rates.resolved_twist(i) for i in range(len(system.links))]
    names = tuple(row.name for row in walk.rows)
    done = tuple(step for stage in plan for step in stage)
    return Elimination(
        system,
        tuple(forms),
        v,
        sigma,
        twists,
        numbers,
        [_at_rest(x) for x in bias],
        done,
        names,
        tuple(sizes),
    )


@dataclass(frozen=True)
class Beginning:
    """The first rows of an elimination alone: the pivots that vary, and v of the links reached over
    w and what is not solved yet."""

    varying: int
    v: ca.SX


def beginning(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Sequence[RowForm],
    w: ca.SX,
    sampled: States,
    sizes: Sequence[float],
    most: int,
) -> Beginning:
    """As `elimination`, the velocities of it, up to the link where `most` rows are solved. Raises
    Dependent."""
    walk, plan = walked(system, rows, speeds, Coefficients(system, sampled, sizes), most)
    values: dict[Key, Scalar] = {("w", k): w[k] for k in range(len(speeds))}
    values |= {("v", j): system.v[j] for j in range(system.v.numel())}
    forms = [walk.resolved(form) for form in walk.joints.values()]
    varying = sum(step.block.grade == 2 for stage in plan for step in stage)
    return Beginning(varying, ca.vertcat(ca.SX(0, 1), *[value(form, values) for form in forms]))


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
    for i, link in enumerate(system.links):
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
