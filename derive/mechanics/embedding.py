"""M v̇ = τ on a tree whose loops are closed by rows A v̇ = 0, in one sweep from the tips to the base
and one back: constraint embedding.

The motion is the least of ½ Σ Tᵢᵀ Iᵢ Tᵢ + ½ Σ mⱼ v̇ⱼ² − Σ τⱼ v̇ⱼ over the rates of twists Tᵢ and
v̇. Unknown by unknown it becomes one of fewer:

    Tᵢ = X Tₚ + Σ pⱼ v̇ⱼ           a link's rate of twist follows from its carrier's and its joint,
    v̇_d = −C⁻¹ (row without v̇_d)   as soon as all joints of a pivot block are reached,
    v̇ⱼ = (τⱼ − ψᵀ x)/m̂ⱼ            as soon as no row speaks of it any more.

What is left between two links is a quadratic form in the rates of the carriers' twists: of one
carrier on a tree (the articulated inertia), of two on a ladder. No matrix over all velocities is
made, and where loops overlap in few links the work grows with their number.

Sources: R. Featherstone 1983; A. Jain, Multibody System Dynamics 22 (2009) 225–241 and 28 (2012)
1–23.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.expressions.settled import settled
from derive.joints.records import Rotation
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    is_one,
    is_zero,
    matrix,
    minus,
    merged,
    plus,
    rotated,
    sum_of,
    times,
    transpose,
)
from derive.mechanics.limits import COFACTORS
from derive.mechanics.links import moved
from derive.mechanics.records import Inertia, Link, RowForm
from derive.mechanics.solve import reflected_solution, small_inverse

Combination = dict[int, Scalar]  # Σ coefficient · unknown


@dataclass(frozen=True)
class Pivots:
    """Rows that are solved for velocities (columns of v) together."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class _Replaced:
    """unknown = Σ coefficient · others."""

    unknown: int
    by: Combination


@dataclass(frozen=True)
class _Minimised:
    """unknown = (its force − Σ ψ · others)/m̂."""

    unknown: int
    m: Scalar
    psi: Combination


@dataclass(frozen=True)
class _Held:
    """Rows by which unknowns are held: Cᵀ λ = Σ ψ · others − force − Σ λ of rows that wait, for
    each of the unknowns."""

    rows: tuple[int, ...]
    unknowns: tuple[int, ...]
    block: Matrix
    psi: tuple[Combination, ...]
    waiting: tuple[Combination, ...]  # by row, what it has of each unknown


_Step = _Replaced | _Minimised | _Held


@dataclass(frozen=True)
class Embedded:
    """The sweep, with what takes the place of each unknown; `motion` is for one force after the
    other."""

    nv: int
    steps: tuple[_Step, ...]

    def motion(self, tau: Vector) -> tuple[Vector, dict[int, Scalar]]:
        """v̇ (nv), A v̇ = 0, of forces (nv) conjugate to v, and λ of the rows, of M v̇ = τ + Aᵀ λ."""
        force: dict[int, Scalar] = {j: x for j, x in enumerate(tau) if not is_zero(x)}
        held: list[Vector] = []
        for step in self.steps:
            if isinstance(step, _Held):
                held.append([force.get(k, 0.0) for k in step.unknowns])
                continue
            own = force.pop(step.unknown, 0.0)
            if is_zero(own):
                continue
            if isinstance(step, _Minimised):
                force[step.unknown] = own = own / step.m
                _add(force, step.psi, times(-1.0, own))
            else:
                _add(force, step.by, own)
        found: dict[int, Scalar] = {}
        multipliers: dict[int, Scalar] = {}
        for step in reversed(self.steps):
            if isinstance(step, _Held):
                sides = [
                    minus(minus(_value(psi, found), own), _value(rows, multipliers))
                    for psi, own, rows in zip(step.psi, held.pop(), step.waiting)
                ]
                multipliers |= zip(step.rows, _solved(transpose(step.block), sides))
            elif step.unknown not in found:  # else it was joined to another for a while
                found[step.unknown] = _found(step, found, force.get(step.unknown, 0.0))
        return [found.get(j, 0.0) for j in range(self.nv)], multipliers


def _found(step: _Replaced | _Minimised, found: Mapping[int, Scalar], own: Scalar) -> Scalar:
    if isinstance(step, _Replaced):
        return _value(step.by, found)
    rest = _value(step.psi, found)
    return own if is_zero(rest) else minus(own, rest / step.m)


def _solved(block: Matrix, sides: Vector) -> Vector:
    if len(block) > COFACTORS:
        return [x for (x,) in reflected_solution(block, [[x] for x in sides])[0]]
    return [dot(row, sides) for row in small_inverse(block)[0]]


def embedded(
    links: Sequence[Link],
    inertias: Sequence[Inertia],
    rotors: Vector,
    rows: Sequence[RowForm],
    groups: Sequence[Sequence[Pivots]],
) -> Embedded:
    """The sweep for links with `inertias` about their origins, `rotors` (nv) on the diagonal of M,
    and `rows` that are solved for the velocities of `groups`: those of a group one after the other
    in their order, the groups each for itself. All other velocities are free; M is positive
    definite on them."""
    sweep = _Sweep(links, rotors, rows, groups)
    for j, rotor in enumerate(rotors):
        sweep.form.add(j, j, rotor)
    for i in sorted(range(len(links)), key=lambda i: (sweep.depths[i], i), reverse=True):
        sweep.take(i, inertias[i])
    return Embedded(len(rotors), tuple(sweep.form.steps))


@dataclass
class _Form:
    """A quadratic form, ½ xᵀ Q x, and rows over the same unknowns, from which unknowns are taken
    out one by one."""

    entries: dict[int, Combination] = field(default_factory=dict[int, Combination])
    rows: dict[int, Combination] = field(default_factory=dict[int, Combination])
    speaking: dict[int, set[int]] = field(default_factory=dict[int, set[int]])  # rows by unknown
    steps: list[_Step] = field(default_factory=list[_Step])
    last: int = -1
    carried: set[int] = field(default_factory=set[int])
    joined: dict[int, tuple[int, Combination]] = field(
        default_factory=dict[int, tuple[int, Combination]]
    )

    def add(self, i: int, j: int, x: Scalar) -> None:
        """A symmetric pair of entries."""
        if is_zero(x):
            return
        row = self.entries.setdefault(i, {})
        row[j] = plus(row[j], x) if j in row else x
        self.entries.setdefault(j, {})[i] = row[j]

    def add_to_row(self, i: int, by: Mapping[int, Scalar], weight: Scalar = 1.0) -> None:
        """Row i + weight · by."""
        _add(self.rows[i], by, weight)
        for j in by:
            if is_zero(self.rows[i][j]):
                del self.rows[i][j]
                self.speaking.get(j, set()).discard(i)
            else:
                self.speaking.setdefault(j, set()).add(i)

    def _without(self, unknown: int) -> tuple[Scalar, Combination]:
        """Its diagonal entry and the others, taken out of Q."""
        row = self.entries.pop(unknown, {})
        own = row.pop(unknown, 0.0)
        for j in row:
            del self.entries[j][unknown]
        return own, row

    def replace(self, unknown: int, by: Combination) -> None:
        """Put `by` in the place of an unknown."""
        own, row = self._without(unknown)
        terms = sorted(by.items())
        for place, (j, x) in enumerate(terms):
            for k, y in row.items():
                change = times(x, y)
                self.add(j, k, times(2.0, change) if j == k else change)
            if not is_zero(own):
                weighed = times(own, x)
                for k, y in terms[place:]:
                    self.add(j, k, times(weighed, y))
        for i in sorted(self.speaking.pop(unknown, set())):
            weight = self.rows[i].pop(unknown)
            self.add_to_row(i, by, weight)
        self.steps.append(_Replaced(unknown, by))

    def minimise(self, unknown: int) -> None:
        """Take out an unknown that no row speaks of: Q − ψ ψᵀ/m̂."""
        m, psi = self._without(unknown)
        terms = sorted(psi.items())
        for place, (j, x) in enumerate(terms):
            weighed = times(-1.0, x / m)
            for k, y in terms[place:]:
                self.add(j, k, times(weighed, y))
        self.steps.append(_Minimised(unknown, m, psi))

    def solve(self, indices: Sequence[int], unknowns: Sequence[int]) -> None:
        """Rows solved for unknowns, which they are put in the place of."""
        self._join(indices)
        rows = [self.rows.pop(i) for i in indices]
        for i, row in zip(indices, rows):
            for j in row:
                self.speaking[j].discard(i)
        block = [[row.pop(j, 0.0) for j in unknowns] for row in rows]
        psi = tuple(dict(self.entries.get(j, {})) for j in unknowns)
        waiting = tuple({i: self.rows[i][j] for i in sorted(self.speaking[j])} for j in unknowns)
        self.steps.append(_Held(tuple(indices), tuple(unknowns), block, psi, waiting))
        others = sorted({j for row in rows for j in row})
        sides = [[row.get(j, 0.0) for j in others] for row in rows]
        if len(block) > COFACTORS:
            found, _ = reflected_solution(block, sides)
        else:
            inverse, _ = small_inverse(block)
            columns = transpose(sides)
            found = [[dot(row, column) for column in columns] for row in inverse]
        for j, row in zip(unknowns, found):
            self.replace(j, {k: times(-1.0, x) for k, x in zip(others, row) if not is_zero(x)})


    def _join(self, indices: Sequence[int]) -> None:
        """Twists of carriers of which the rows know the sum or difference alone: that becomes one
        unknown, until the carriers' own take their place."""
        others = {j for i in indices for j in self.rows[i]} & self.carried
        by_column: dict[tuple[float, ...], int] = {}
        for j in sorted(others):
            column = [self.rows[i].get(j, 0.0) for i in indices]
            if not all(isinstance(x, float) for x in column):
                continue
            known = by_column.pop(tuple(column), None)
            opposite = by_column.pop(tuple(-x for x in column), None)
            if known is None and opposite is None:
                by_column[tuple(column)] = j
                continue
            first, sign = (known, -1.0) if known is not None else (opposite, 1.0)
            self.last += 1
            self.replace(j, {first: sign, self.last: 1.0})
            self.joined[first] = self.joined[j] = (self.last, {j: 1.0, first: -sign})

    def part(self, unknown: int) -> None:
        """Take back what it was joined to another by."""
        joined, by = self.joined.pop(unknown, (-1, {}))
        if joined in self.entries or joined in self.speaking:
            self.replace(joined, by)


class _Sweep:
    """From the tips to the base: the unknowns 0 … nv − 1 are v̇, the others components of rates of
    twists. Those that nothing moves, as of a mechanism in a plane, are left out."""

    def __init__(
        self,
        links: Sequence[Link],
        rotors: Vector,
        rows: Sequence[RowForm],
        groups: Sequence[Sequence[Pivots]],
    ) -> None:
        self.links, self.groups, self.form = links, groups, _Form()
        self.chains = _chains(links)
        self.form.last = len(rotors) - 1
        self.depths: list[int] = []
        self.twists: list[list[int]] = []  # by link the unknowns of T, −1 where it is nothing
        self.joints: list[list[_Replaced]] = []  # from the twist before a link's joint to its own
        self.ways: list[list[_Replaced]] = []  # from a link's twist to those before joints on it
        self.seats: dict[tuple[int | float, ...], list[int]] = {}  # those, by carrier and arm
        self.unknowns: dict[int, int] = {}  # what stands for a velocity, where it is not itself
        for i, link in enumerate(links):
            self.depths.append(self.depths[link.parent] + 1 if link.parent >= 0 else 0)
            self._enter(i, link, rotors)
        self.form.carried = {step.unknown for way in self.ways for step in way}
        for i in sorted({i for group in groups for x in group for i in x.rows}):
            self._put_row(i, rows[i])
        self.group_of = {
            j: k for k, group in enumerate(groups) for pivots in group for j in pivots.columns
        }
        self.missing = [sum(len(x.columns) for x in group) for group in groups]
        self.waiting: set[int] = set()  # velocities that are reached and free

    def _enter(self, i: int, link: Link, rotors: Vector) -> None:
        way: list[_Replaced] = []
        chain = self.chains[i]
        twist = self._seat(link) if link.parent >= 0 else [-1] * 6
        for factor in chain.before if link.parent >= 0 else ():
            twist = self._turned(self.ways[link.parent], twist, transpose(matrix((factor,))))
        axes = [_seen(chain, axis) for axis in link.motion]
        spin = _spin(axes) if len(axes) == 1 and is_zero(rotors[link.columns[0]]) else -1
        own = [_unknown(k) for k in twist]
        if spin >= 0 and own[spin]:
            # the spin itself is the unknown: nothing beyond the joint feels how its carrier turns
            (j,), before, back = link.columns, own[spin], 1.0 / axes[0][spin]
            self.form.last += 1
            self.unknowns[j] = self.form.last
            own[spin] = {self.form.last: 1.0}
            difference_of = {self.form.last: back} | {k: -back for k in before}
            self.twists.append([self._named(way, by) for by in own])
            way.append(_Replaced(j, difference_of))
        else:
            for axis, j in zip(axes, link.columns):
                for a, x in enumerate(axis):
                    if not is_zero(x):
                        own[a] = own[a] | {j: x}
            self.twists.append([self._named(way, by) for by in own])
        self.joints.append(way)
        self.ways.append([])

    def _seat(self, link: Link) -> list[int]:
        """The twist of the carrier at the joint of a link; joints at one point have it in common."""
        arm = difference(link.a, self.links[link.parent].b)
        place = (link.parent, *(x.element_hash() if isinstance(x, ca.SX) else x for x in arm))
        if place not in self.seats:
            seen = rotated(matrix(self.chains[link.parent].turn), arm)
            way, twist = self.ways[link.parent], self.twists[link.parent]
            self.seats[place] = self._shifted(way, twist, seen)
        return self.seats[place]

    def _shifted(self, way: list[_Replaced], twist: Sequence[int], arm: Vector) -> list[int]:
        """To a point at `arm`: v + ω × arm."""
        moved = [_unknown(k) for k in twist[3:]]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            for k, x in ((twist[b], arm[c]), (twist[c], times(-1.0, arm[b]))):
                if k >= 0 and not is_zero(x):
                    _add(moved[a], {k: 1.0}, x)
        return [*twist[:3], *(self._named(way, by) for by in moved)]

    def _turned(self, way: list[_Replaced], twist: Sequence[int], R: Matrix) -> list[int]:
        turned: list[int] = []
        for part in (twist[:3], twist[3:]):
            for row in R:
                by: Combination = {}
                for k, x in zip(part, row):
                    if k >= 0 and not is_zero(x):
                        _add(by, {k: 1.0}, x)
                turned.append(self._named(way, by))
        return turned

    def _named(self, way: list[_Replaced], by: Combination) -> int:
        """An unknown for a combination: a new one where it is not one already."""
        if not by:
            return -1
        ((k, x), *others) = by.items()
        if not others and is_one(x):
            return k
        self.form.last += 1
        way.append(_Replaced(self.form.last, by))
        return self.form.last

    def _put_row(self, i: int, row: RowForm) -> None:
        by: Combination = {}
        for term in row.terms:
            if term.link < 0:
                continue
            arm = difference(term.point, self.links[term.link].b)
            moment = sum_of(term.moment, cross(arm, term.direction))
            seen = _seen(self.chains[term.link], [*moment, *term.direction])
            for k, x in zip(self.twists[term.link], seen):
                if k >= 0 and not is_zero(x):
                    _add(by, {k: 1.0}, x)
        for j, x in row.coefficients:
            _add(by, {j: 1.0}, x)
        self.form.rows[i] = {}
        self.form.add_to_row(i, dict(zip(by, settled([*by.values()]))))

    def take(self, i: int, body: Inertia) -> None:
        """Link i, all it carries having been taken: its T, then what its joint completes."""
        link, twist = self.links[i], self.twists[i]
        for step in self.ways[i]:
            self.form.part(step.unknown)
        for step in reversed(self.ways[i]):
            self.form.replace(step.unknown, step.by)
        about_joint = moved(body, (), [-x for x in link.b])
        inertia = _matrix(moved(about_joint, self.chains[i].turn, [0.0, 0.0, 0.0]))
        for a in range(6):
            for b in range(a, 6):
                if twist[a] >= 0 and twist[b] >= 0:
                    self._add_inertia(twist[a], twist[b], inertia[a][b], a == b)
        for step in reversed(self.joints[i]):
            self.form.replace(step.unknown, step.by)
        for j in link.columns:
            if j in self.group_of:
                self._complete(self.group_of[j])
            else:
                self.waiting.add(j)
        for j in sorted(self.waiting):
            unknown = self.unknowns.get(j, j)
            if not self.form.speaking.get(unknown):
                self.form.minimise(unknown)
                self.waiting.remove(j)

    def _add_inertia(self, i: int, j: int, x: Scalar, diagonal: bool) -> None:
        """Two components may be one unknown."""
        self.form.add(i, j, times(2.0, x) if i == j and not diagonal else x)

    def _complete(self, k: int) -> None:
        self.missing[k] -= 1
        if not self.missing[k]:
            for pivots in self.groups[k]:
                self.form.solve(pivots.rows, [self.unknowns.get(j, j) for j in pivots.columns])


@dataclass(frozen=True)
class _Chain:
    """The axes of T: `before` from the carrier's, and the link's axes turned by `turn` in them."""

    before: Rotation = ()
    turn: Rotation = ()


_NO_CHAIN = _Chain()


def _chains(links: Sequence[Link]) -> list[_Chain]:
    """Links that turn about parallel axes, one after the other, are seen from the axes before the
    first turn; the others from their own."""
    turns: list[Rotation] = []
    joined: list[bool] = []
    for link in links:
        above = turns[link.parent] if link.parent >= 0 else ()
        together = merged(above, link.rotation)
        joined.append(bool(above) and len(together) <= 1)
        last = link.rotation[-1:]
        turns.append(together if joined[-1] else last)
    followed = {link.parent for link, own in zip(links, joined) if own}
    result: list[_Chain] = []
    for i, link in enumerate(links):
        above = result[link.parent].turn if link.parent >= 0 else ()
        if joined[i]:
            result.append(_Chain((), turns[i]))
        elif i in followed:
            result.append(_Chain((*above, *link.rotation[:-1]), turns[i]))
        else:
            result.append(_Chain((*above, *link.rotation)))
    return result


def _seen(chain: _Chain, twist: Sequence[Scalar]) -> Vector:
    R = matrix(chain.turn)
    return [*rotated(R, list(twist[:3])), *rotated(R, list(twist[3:]))]


def _spin(axes: Sequence[Vector]) -> int:
    """The one axis that a joint turns about, −1 where it is none of the three."""
    places = [a for a, x in enumerate(axes[0]) if not is_zero(x)]
    (place, *others) = places or [-1]
    return place if not others and place < 3 and place >= 0 and isinstance(axes[0][place], float) else -1


def _unknown(k: int) -> Combination:
    return {} if k < 0 else {k: 1.0}


def _matrix(body: Inertia) -> Matrix:
    """6 × 6 of (ω, v): [I, [mc]×; [mc]×ᵀ, m]."""
    x, y, z = body.moment
    crossed: Matrix = [[0.0, times(-1.0, z), y], [z, 0.0, times(-1.0, x)], [times(-1.0, y), x, 0.0]]
    upper = [[*row, *arm] for row, arm in zip(body.tensor, crossed)]
    lower = [
        [*arm, *(body.mass if a == b else 0.0 for b in range(3))]
        for a, arm in enumerate(transpose(crossed))
    ]
    return [*upper, *lower]


def _add(to: Combination, by: Mapping[int, Scalar], weight: Scalar) -> None:
    for j, x in by.items():
        change = times(weight, x)
        to[j] = plus(to[j], change) if j in to else change


def _value(by: Combination, found: Mapping[int, Scalar]) -> Scalar:
    return dot(list(by.values()), [found[k] for k in by])
