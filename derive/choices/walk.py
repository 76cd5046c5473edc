"""The walk of an elimination, from base to tip: every link's twist as linear forms over w and the
generalized velocities that are not known yet, and which row is solved for which of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from derive.choices.limits import CHAINED, NO_PIVOT
from derive.expressions.scalars import Scalar
from derive.joints.rotations import is_zero
from derive.mechanics.elimination.pivoting import Table
from derive.mechanics.elimination.solve import Block, reflected_solution, small_inverse
from derive.mechanics.limits import COFACTORS, SAFE, VANISHES
from derive.mechanics.records import Carried, Link, RowForm, System
from derive.mechanics.recursions.forms import Form, Key, constant, total
from derive.mechanics.recursions.motion import (
    REST,
    Twist,
    joint_part,
    parent_part,
    row_form,
    shifted,
    twist,
)
from derive.mechanics.recursions.tree import path
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


@dataclass
class Walk:
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


def walked(
    system: System | Carried,
    rows: Sequence[RowForm],
    speeds: Sequence[RowForm],
    coefficients_at: Coefficients,
    most: int | None = None,
    given: ca.SX | None = None,
) -> tuple[Walk, list[list[Step]]]:
    """The walk over velocities for constraint `rows`, which equal c, and speed rows, which equal w;
    the pivots it finds, link by link, are the plan of the walk over rates. With `most` it ends at
    the link where so many rows are solved. With `given`, w, forms hold its values and no
    coefficients of it.

    Raises Dependent where a speed depends on the constraints and on the speeds before it.
    """
    everything = [*rows, *speeds]
    own = _own_forms(len(speeds), given)
    sides = [constant(row.value) for row in rows] + own
    outright = {s.coefficients[0][0]: k for k, s in enumerate(speeds) if is_single(s)}
    waiting = [
        i for i in range(len(everything)) if not (i >= len(rows) and is_single(everything[i]))
    ]
    known: dict[int, Form] = {
        j: total([(1.0 / speeds[k].coefficients[0][1], own[k])]) for j, k in outright.items()
    }
    if isinstance(system, Carried) and system.frame:
        known[system.frame.column] = {}  # neither row nor mass feels how the frame itself turns
    walk = Walk(system, everything, sides, known)
    return walk, _plan(_Rows(walk, waiting, len(rows), coefficients_at), most)


def _own_forms(count: int, given: ca.SX | None) -> list[Form]:
    """What speed rows equal: w, or its values."""
    if given is None:
        return [{("w", k): 1.0} for k in range(count)]
    return [constant(x) for x in ca.vertsplit(given)] if count else []


def is_single(row: RowForm) -> bool:
    """A speed that is a number times one generalized velocity."""
    return (
        len(row.coefficients) == 1
        and not row.terms
        and isinstance(_number(row.coefficients[0][1]), float)
    )


def _plan(rows: _Rows, most: int | None) -> list[list[Step]]:
    walk, solved = rows.walk, 0
    plan = [_stage(rows, -1)]
    for i, link in enumerate(walk.system.links):
        solved += sum(len(step.rows) for step in plan[-1])
        if most is not None and solved >= most:
            break
        walk.enter(link, parent_part(link, walk.resolved_twist(link.parent)))
        plan.append(_stage(rows, i))
    return plan


class _Rows:
    """The rows that are not solved yet: those that are ready, all they speak of having been
    reached, with their coefficients at the samples, and how many of the others speak of each
    velocity."""

    def __init__(
        self, walk: Walk, waiting: Sequence[int], constraints: int, coefficients_at: Coefficients
    ) -> None:
        self.walk, self.constraints, self.coefficients_at = walk, constraints, coefficients_at
        self.table = Table(coefficients_at.count, len(walk.rows), NO_PIVOT)
        self.later: dict[int, list[int]] = {}  # by the link that completes them
        self.spoken: Counter[int] = Counter()  # velocities, by rows that are not ready
        carrier = {j: i for i, link in enumerate(walk.system.links) for j in link.columns}
        unknowns = unknowns_of(walk.system, [walk.rows[i] for i in waiting])
        self.unknowns = {i: own - walk.known.keys() for i, own in zip(waiting, unknowns)}
        self.own = _diagonal_blocks(self.unknowns)
        for i in waiting:
            row = walk.rows[i]
            links = (
                *(t.link for t in row.terms),
                *(carrier.get(j, -1) for j, _ in row.coefficients),
            )
            self.later.setdefault(max(links, default=-1), []).append(i)
            self.spoken.update(self._within(i))

    def reach(self, link: int) -> None:
        """Rows that are ready with this link."""
        for i in self.later.pop(link, ()):
            self.spoken.subtract(self._within(i))
            self._put(i)

    def _within(self, i: int) -> set[int]:
        """The velocities that a row can be solved for as it is written; what is solved for before
        brings in more of its block."""
        if i in self.own:
            return self.unknowns[i] & self.own[i]
        return speaks_of(self.walk.system, self.walk.rows[i])

    def _put(self, i: int) -> None:
        entries, numbers = self.coefficients_at.row(i, self.walk.current(i))
        if i in self.own:
            entries = {j: x for j, x in entries.items() if j in self.own[i]}
        self.table.put_row(i, entries, numbers & entries.keys())

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
        enter_free_velocities(rows.walk)
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


def _diagonal_blocks(speaks: Mapping[int, set[int]]) -> dict[int, set[int]]:
    """By row the velocities of its diagonal block, where rows and velocities can be put in an order
    in which they are block triangular: whatever the others are, each block is regular for itself or
    all of them is singular. Nothing where there are more rows than velocities."""
    rows, columns = sorted(speaks), sorted({j for own in speaks.values() for j in own})
    if len(rows) != len(columns) or not rows:
        return {}
    place = {j: b for b, j in enumerate(columns)}
    places = [(a, place[j]) for a, i in enumerate(rows) for j in sorted(speaks[i])]
    pattern = ca.Sparsity.triplet(len(rows), len(columns), *(list(x) for x in zip(*places)))
    count, row_order, column_order, row_first, column_first, *_ = pattern.btf()
    if ca.sprank(pattern) < len(rows):
        return {}
    result: dict[int, set[int]] = {}
    for k in range(count):
        own = {columns[b] for b in column_order[column_first[k] : column_first[k + 1]]}
        for a in row_order[row_first[k] : row_first[k + 1]]:
            result[rows[a]] = own
    return result


def speaks_of(system: System | Carried, row: RowForm) -> set[int]:
    """The generalized velocities that may stand in a row: those of all joints on the way."""
    carried = {
        j
        for term in row.terms
        for i in path(system.links, term.link)
        for j in system.links[i].columns
    }
    return carried | {j for j, _ in row.coefficients}


def unknowns_of(system: System | Carried, rows: Sequence[RowForm]) -> list[set[int]]:
    """The velocities whose unknowns may stand in each row: of a joint that turns it is the link's
    own spin, and the joint's rate has the carrier's in it."""
    carrier = {j: i for i, link in enumerate(system.links) for j in link.columns}
    result: list[set[int]] = []
    for row in rows:
        own = speaks_of(system, row)
        for j, _ in row.coefficients:
            for i in path(system.links, carrier.get(j, -1)):
                own.update(system.links[i].columns)
        result.append(own)
    return result


def enter_free_velocities(walk: Walk) -> None:
    """Velocities that belong to no link: coordinates of the analytic form."""
    carried = {j for link in walk.system.links for j in link.columns}
    for j in range(walk.system.v.numel()):
        if j not in carried:
            walk.joints[j] = walk.known.get(j, {("v", j): 1.0})


def _idle(
    walk: Walk, index: int, residual: Form, constraints: int, coefficients_at: Coefficients
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


class Coefficients:
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


def _number(x: Scalar) -> Scalar:
    return float(x) if not isinstance(x, ca.SX) or x.is_constant() else x
