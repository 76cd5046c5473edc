"""Choosing quasi-velocities is choosing how to eliminate: Y v = [c; w] solved from base to tip.

Every link's twist is carried as a linear form over w and the generalized velocities that are not
known yet; a constraint or speed row is solved for one of those as soon as all it speaks of has been
reached. The rates v̇ follow by the same walk with the same pivots, so no inverse is ever
differentiated. (Velocity transformation: Jerkovsky 1978; Kane & Levinson 1985; the pivot sequence
is the block inversion of Mirtaheri & Zohoor, carried out one row at a time.)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from derive.choices.limits import CHAINED, SHORT
from derive.expressions.scalars import Scalar
from derive.joints.rotations import is_zero
from derive.mechanics.forms import ONE, Form, Key, constant, total, value
from derive.mechanics.limits import COFACTORS, SAFE, VANISHES
from derive.mechanics.motion import (
    REST,
    STILL,
    Numbers,
    Twist,
    child_numbers,
    joint_part,
    parent_part,
    row_form,
    row_products,
    shifted,
    twist,
    velocity_products,
    with_products,
)
from derive.mechanics.pivoting import Table
from derive.mechanics.records import Carried, Link, RowForm, System
from derive.mechanics.solve import Block, reflected_solution, small_inverse
from derive.mechanics.tree import path
from derive.states.sampling import States


class Dependent(Exception):
    """A speed row says nothing new: `speed` depends on the constraint rows before it."""

    def __init__(self, speed: str) -> None:
        super().__init__(speed)
        self.speed = speed


class Undetermined(Exception):
    """A velocity is left over: a row had no pivot at the sampled states although the rank of A
    counts on it."""

    def __init__(self, velocity: str) -> None:
        super().__init__(velocity)
        self.velocity = velocity


@dataclass(frozen=True)
class Step:
    """`rows` are solved for `keys` together; `pivot` is the determinant, `block` says how it
    behaves over the samples."""

    rows: tuple[int, ...]
    keys: tuple[Key, ...]
    pivot: Scalar
    block: Block


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


@dataclass
class _Walk:
    """One walk over the tree, on velocities or on their rates."""

    system: System | Carried
    rows: Sequence[RowForm]
    sides: Sequence[Form]  # what each row equals
    known: dict[int, Form]  # generalized velocities given outright
    twists: list[Twist] = field(default_factory=list[Twist])
    joints: dict[int, Form] = field(default_factory=dict[int, Form])
    solved: dict[Key, Form] = field(default_factory=dict[Key, Form])
    residuals: dict[int, Form] = field(default_factory=dict[int, Form])  # of rows that wait

    def resolved(self, form: Form) -> Form:
        """The form with solved keys replaced, as often as needed."""
        if len(self.rows) >= CHAINED:
            for key in [key for key in form if key in self.solved]:
                self._settle(key)
        while any(key in self.solved for key in form):
            parts: list[tuple[Scalar, Form]] = [
                (c, self.solved[k]) if k in self.solved else (c, {k: 1.0}) for k, c in form.items()
            ]
            form = total(parts)
        return form

    def _settle(self, key: Key) -> None:
        """Replace what has been solved since in the form of a solved key, once for all that speak
        of it: in a long row of loops each follows from the next."""
        chain = [key]
        while chain:
            deeper = [k for k in self.solved[chain[-1]] if k in self.solved]
            unsettled = [k for k in deeper if any(x in self.solved for x in self.solved[k])]
            if unsettled:
                chain += unsettled
                continue
            last = chain.pop()
            form = self.solved[last]
            if deeper:
                self.solved[last] = total(
                    (c, self.solved[k]) if k in self.solved else (c, {k: 1.0})
                    for k, c in form.items()
                )

    def resolved_twist(self, i: int) -> Twist:
        """The twist (ω, v) of link i in its own frame, over what is not eliminated yet; the ground
        rests. It replaces the stored one: what has been solved for is put in once, however many
        links follow."""
        if i < 0:
            return REST
        omega, velocity = self.twists[i]
        self.twists[i] = ([self.resolved(f) for f in omega], [self.resolved(f) for f in velocity])
        return self.twists[i]

    def enter(self, link: Link, before: Twist) -> None:
        """The next link, its joint velocities known outright or unknown."""
        axis = link.turns_about
        if axis >= 0 and link.columns[0] not in self.known:
            self._enter_turning(link, before, axis)
            return
        for j in link.columns:
            self.joints[j] = self.known.get(j, {("v", j): 1.0})
        self.twists.append(
            twist(link, before, joint_part(link, [self.joints[j] for j in link.columns]))
        )

    def _enter_turning(self, link: Link, before: Twist, axis: int) -> None:
        """The unknown is the link's own spin about the joint, not the joint's rate: it then stands
        alone in the twist."""
        j, sign = link.columns[0], link.motion[0][axis]
        spin: Form = {("v", j): 1.0}
        self.joints[j] = total([(1.0 / sign, spin), (-1.0 / sign, before[0][axis])])
        omega = [spin if i == axis else form for i, form in enumerate(before[0])]
        self.twists.append((omega, shifted(link, omega, before[1])))

    def residual(self, index: int, extra: Scalar = 0.0) -> Form:
        """Row minus its side, with everything solved so far put in."""
        row = self.rows[index]
        form = row_form(
            row, {term.link: self.resolved_twist(term.link) for term in row.terms}, self.joints
        )
        return self.resolved(
            total([(1.0, form), (-1.0, self.sides[index]), (1.0, constant(extra))])
        )

    def current(self, index: int) -> Form:
        """The residual, worked out again only where something it speaks of has been solved
        since."""
        known = self.residuals.get(index)
        if known is None or any(key in self.solved for key in known):
            self.residuals[index] = known = self.residual(index)
        return known

    def solve(self, residuals: Sequence[Form], keys: Sequence[Key]) -> Scalar:
        """Put each key as a form of the others: keys = −(block)⁻¹ rest. Returns the block's
        determinant, which is the pivot that a guard watches."""
        if len(keys) > COFACTORS:
            return self._solve_by_reflections(residuals, keys)
        inverse, determinant = small_inverse(
            [[form.get(key, 0.0) for key in keys] for form in residuals]
        )
        rests = [{k: c for k, c in form.items() if k not in keys} for form in residuals]
        for key, row in zip(keys, inverse):
            self.solved[key] = total((-weight, rest) for weight, rest in zip(row, rests))
        return determinant

    def _solve_by_reflections(self, residuals: Sequence[Form], keys: Sequence[Key]) -> Scalar:
        others = sorted({key for form in residuals for key in form if key not in keys})
        block = [[form.get(key, 0.0) for key in keys] for form in residuals]
        sides = [[form.get(key, 0.0) for key in others] for form in residuals]
        solution, determinant = reflected_solution(block, sides)
        for key, row in zip(keys, solution):
            self.solved[key] = {other: -x for other, x in zip(others, row) if not is_zero(x)}
        return determinant


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
    everything = [*rows, *speeds]
    outright = {s.coefficients[0][0]: k for k, s in enumerate(speeds) if _single(s)}
    # constraint rows equal c, speed rows equal w
    sides = [constant(row.value) for row in rows] + [{("w", k): 1.0} for k in range(len(speeds))]
    waiting = [i for i in range(len(everything)) if not (i >= len(rows) and _single(everything[i]))]
    known: dict[int, Form] = {
        j: {("w", k): 1.0 / speeds[k].coefficients[0][1]} for j, k in outright.items()
    }
    frame = system.frame if isinstance(system, Carried) else None
    if frame:
        known[frame.column] = {}  # neither row nor mass feels how the frame itself turns
    walk = _Walk(system, everything, sides, known)
    plan = _velocities(walk, waiting, len(rows), _Coefficients(system, sampled, sizes))
    values: dict[Key, Scalar] = {("w", k): w[k] for k in range(len(speeds))}
    forms = [walk.resolved(walk.joints[j]) for j in range(system.v.numel())]
    unknown = {key[1] for form in forms for key in form if key[0] == "v"}
    if unknown:
        raise Undetermined(system.labels[min(unknown)])
    v = [value(form, values) for form in forms]
    twists = [walk.resolved_twist(i) for i in range(len(system.links))]
    numbers = _numbers(system.links, twists, v, values, short)
    if frame:
        v[frame.column] = frame.rate(v[frame.beside])
        numbers = frame.turning(numbers, v)
    rates = _rates(system, walk, plan, numbers, v)
    sigma = [rates.resolved(rates.joints[j]).get(ONE, 0.0) for j in range(system.v.numel())]
    bias = [rates.resolved_twist(i) for i in range(len(system.links))]
    names = tuple(row.name for row in everything)
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


def _single(row: RowForm) -> bool:
    """A speed that is a number times one generalized velocity."""
    return (
        len(row.coefficients) == 1
        and not row.terms
        and isinstance(_number(row.coefficients[0][1]), float)
    )


def _number(x: Scalar) -> Scalar:
    return float(x) if not isinstance(x, ca.SX) or x.is_constant() else x


def _velocities(
    walk: _Walk, waiting: list[int], constraints: int, coefficients_at: _Coefficients
) -> list[list[Step]]:
    """The walk over velocities; the pivots it finds, link by link, are the plan of the second
    walk."""
    rows = _Rows(walk, waiting, constraints, coefficients_at)
    plan = [_stage(rows, -1)]
    for i, link in enumerate(walk.system.links):
        walk.enter(link, parent_part(link, walk.resolved_twist(link.parent)))
        plan.append(_stage(rows, i))
    return plan


class _Rows:
    """The rows that are not solved yet: those that are ready, all they speak of having been
    reached, with their coefficients at the samples, and how many of the others speak of each
    velocity."""

    def __init__(
        self, walk: _Walk, waiting: Sequence[int], constraints: int, coefficients_at: _Coefficients
    ) -> None:
        self.walk, self.constraints, self.coefficients_at = walk, constraints, coefficients_at
        self.table = Table(coefficients_at.count, len(walk.rows))
        self.later: dict[int, list[int]] = {}  # by the link that completes them
        self.spoken: Counter[int] = Counter()  # velocities, by rows that are not ready
        carrier = {j: i for i, link in enumerate(walk.system.links) for j in link.columns}
        for i in waiting:
            row = walk.rows[i]
            links = (
                *(t.link for t in row.terms),
                *(carrier.get(j, -1) for j, _ in row.coefficients),
            )
            self.later.setdefault(max(links, default=-1), []).append(i)
            self.spoken.update(_speaks_of(walk.system, row))

    def reach(self, link: int) -> None:
        """Rows that are ready with this link."""
        for i in self.later.pop(link, ()):
            self.spoken.subtract(_speaks_of(self.walk.system, self.walk.rows[i]))
            self._put(i)

    def _put(self, i: int) -> None:
        entries, numbers = self.coefficients_at.row(i, self.walk.current(i))
        self.table.put_row(i, entries, numbers)

    def best(self) -> Block | None:
        """The best pivot among the rows that are ready and their unknowns, rows over their sizes so
        that m/s and rad/s compare; None where nothing is away from zero."""
        block = self.table.best()
        return None if block is None else self.table.steady(block)

    def others_may_help(self) -> bool:
        """Whether a row that is not ready yet will speak of the same unknowns: then a pivot that
        comes near zero can wait for it."""
        return any(self.spoken[j] > 0 for j in self.table.columns)

    def solve(self, block: Block) -> Step:
        """The rows of the block for its unknowns; what else speaks of these is put in again."""
        keys: tuple[Key, ...] = tuple(("v", j) for j in block.columns)
        pivot = self.walk.solve([self.walk.current(i) for i in block.rows], keys)
        touched = {i for j in block.columns for i in self.table.columns[j]} - {*block.rows}
        for i in block.rows:
            self.table.drop_row(i)
        for i in sorted(touched):
            self._put(i)
        return Step(block.rows, keys, pivot, block)

    def idle(self) -> None:
        """None of the rows that are ready has a pivot."""
        for i in sorted(self.table.rows):
            _idle(self.walk, i, self.walk.current(i), self.constraints, self.coefficients_at)
            self.table.drop_row(i)


def _stage(rows: _Rows, reached: int) -> list[Step]:
    """Solve every row that is ready once link `reached` is there, best pivot first."""
    if reached < 0:
        _enter_free_velocities(rows.walk)
    rows.reach(reached)
    steps: list[Step] = []
    while rows.table.rows:
        block = rows.best()
        if block is None:
            rows.idle()
            return steps
        if block.grade == 2 and block.quality < SAFE and rows.others_may_help():
            return steps
        steps.append(rows.solve(block))
    return steps


def _speaks_of(system: System | Carried, row: RowForm) -> set[int]:
    carried = {
        j
        for term in row.terms
        for i in path(system.links, term.link)
        for j in system.links[i].columns
    }
    return carried | {j for j, _ in row.coefficients}


def _enter_free_velocities(walk: _Walk) -> None:
    """Velocities that belong to no link: coordinates of the analytic form."""
    carried = {j for link in walk.system.links for j in link.columns}
    for j in range(walk.system.v.numel()):
        if j not in carried:
            walk.joints[j] = walk.known.get(j, {("v", j): 1.0})


def _idle(
    walk: _Walk, index: int, residual: Form, constraints: int, coefficients_at: _Coefficients
) -> None:
    """A row without a pivot: it repeats earlier rows, or it contradicts the choice of speeds."""
    if index >= constraints:
        raise Dependent(walk.rows[index].name)
    involved = [
        key
        for key in residual
        if key[0] == "w"
        and coefficients_at.size(residual[key]) > VANISHES * coefficients_at.sizes[index]
    ]
    if involved:
        raise Dependent(walk.rows[constraints + involved[0][1]].name)


def _rates(
    system: System | Carried,
    first: _Walk,
    plan: list[list[Step]],
    numbers: list[Numbers],
    v: list[Scalar],
) -> _Walk:
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
    walk = _Walk(system, first.rows, sides, {j: {} for j in first.known})
    here = [_in_numbers(row, system, symbols) for row in first.rows]
    _enter_free_velocities(walk)
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
    walk: _Walk, steps: Sequence[Step], rows: Sequence[RowForm], numbers: list[Numbers]
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


class _Coefficients:
    """Coefficients at sampled consistent states."""

    def __init__(self, system: System | Carried, sampled: States, sizes: Sequence[float]) -> None:
        self.sizes = sizes
        symbols = ca.vertsplit(ca.vertcat(system.t, system.q, system.p))
        self.samples = np.vstack([sampled.t.reshape(1, -1), sampled.q.T, sampled.p.T])
        self.places = {x.element_hash(): k for k, x in enumerate(symbols)}
        self.count = len(sampled.t)

    def values(self, entries: Sequence[Scalar]) -> np.ndarray:
        """(samples, entries)."""
        if not entries:
            return np.zeros((self.count, 0))
        column = ca.densify(ca.vertcat(*[ca.SX(x) for x in entries]))
        # of many coordinates the few that it depends on
        symbols = ca.symvar(column)
        if not symbols:
            return np.tile(ca.DM(column).full().ravel(), (self.count, 1))
        given = self.samples[[self.places[x.element_hash()] for x in symbols]]
        function = ca.Function("x", [ca.vertcat(*symbols)], [column])
        return np.asarray(function(given)).reshape(len(entries), -1).T

    def row(self, i: int, form: Form) -> tuple[dict[int, np.ndarray], set[int]]:
        """The coefficients of the unknowns in a row, over its size, at the samples (samples,), by
        velocity; and which of them are numbers."""
        keys = [key[1] for key, x in form.items() if key[0] == "v" and not is_zero(x)]
        entries = [form["v", j] for j in keys]
        values = self.values(entries) / self.sizes[i]
        numbers = {j for j, x in zip(keys, entries) if isinstance(_number(x), float)}
        return dict(zip(keys, values.T)), numbers

    def size(self, x: Scalar) -> float:
        """Largest |x| over the samples."""
        return float(np.max(np.abs(self.values([x]))))


def transformation(speeds: Sequence[Form], nw: int) -> ca.SX:
    """S as a matrix with nw columns, zeros not stored, from forms of the generalized velocities."""
    result = ca.SX(len(speeds), nw)
    for j, form in enumerate(speeds):
        for key, coefficient in form.items():
            if key[0] == "w":
                result[j, key[1]] = coefficient
    return result
