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
    is_one,
    is_zero,
    matrix,
    merged,
    minus,
    rotated,
    sum_of,
    times,
    transpose,
)
from derive.mechanics.elimination.quadratic import (
    Combination,
    Held,
    Minimised,
    QuadraticForm,
    Replaced,
    Step,
    added,
    solved,
    value_of,
)
from derive.mechanics.links import moved
from derive.mechanics.records import Inertia, Link, RowForm
from derive.mechanics.recursions.tree import path


@dataclass(frozen=True)
class Pivots:
    """Rows that are solved for velocities (columns of v) together."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Embedded:
    """The sweep, with what takes the place of each unknown; `motion` is for one force after the
    other."""

    nv: int
    steps: tuple[Step, ...]
    multipliers: dict[int, int] = field(default_factory=dict[int, int])  # unknowns λ, by row

    def motion(
        self, tau: Vector, sides: Mapping[int, Scalar] | None = None
    ) -> tuple[Vector, dict[int, Scalar]]:
        """v̇ (nv), A v̇ = 0, of forces (nv) conjugate to v, and λ of the rows, of M v̇ = τ + Aᵀ λ.
        Where λ are unknowns, A v̇ may be given, by row."""
        force: dict[int, Scalar] = {j: x for j, x in enumerate(tau) if not is_zero(x)}
        for i, x in (sides or {}).items():
            force[self.multipliers[i]] = times(-1.0, x)
        held: list[Vector] = []
        for step in self.steps:
            if isinstance(step, Held):
                held.append([force.get(k, 0.0) for k in step.unknowns])
                continue
            own = force.pop(step.unknown, 0.0)
            if is_zero(own):
                continue
            if isinstance(step, Minimised):
                force[step.unknown] = own = own / step.m
                added(force, step.psi, times(-1.0, own))
            else:
                added(force, step.by, own)
        found: dict[int, Scalar] = {}
        multipliers = dict[int, Scalar]()
        for step in reversed(self.steps):
            if isinstance(step, Held):
                missing = [
                    minus(minus(value_of(psi, found), own), value_of(rows, multipliers))
                    for psi, own, rows in zip(step.psi, held.pop(), step.waiting)
                ]
                found_here = solved(transpose(step.block), [[x] for x in missing])
                multipliers |= zip(step.rows, (x for (x,) in found_here))
            elif step.unknown not in found:  # else it was joined to another for a while
                found[step.unknown] = _found(step, found, force.get(step.unknown, 0.0))
        multipliers |= {i: found[k] for i, k in self.multipliers.items()}
        return [found.get(j, 0.0) for j in range(self.nv)], multipliers


def _found(step: Replaced | Minimised, found: Mapping[int, Scalar], own: Scalar) -> Scalar:
    if isinstance(step, Replaced):
        return value_of(step.by, found)
    rest = value_of(step.psi, found)
    return own if is_zero(rest) else minus(own, rest / step.m)


def embedded(
    links: Sequence[Link],
    inertias: Sequence[Inertia],
    rotors: Vector,
    rows: Sequence[RowForm],
    groups: Sequence[Sequence[Pivots]],
    multiplied: bool = False,
) -> Embedded:
    """The sweep for links with `inertias` about their origins, `rotors` (nv) on the diagonal of M,
    and `rows` that are solved for the velocities of `groups`: those of a group one after the other
    in their order, the groups each for itself. All other velocities are free; M is positive
    definite on them.

    With `multiplied` λ are unknowns, of which the form is quasi-definite: no velocity is given by
    another, so that it holds where the pivots of a choice vanish, and A v̇ may be anything. The
    groups say when rows are complete; these have to be independent in the joints of their own.
    """
    sweep = _Sweep(links, rotors, rows, groups, multiplied)
    for j, rotor in enumerate(rotors):
        sweep.form.add(j, j, rotor)
    for i in sorted(range(len(links)), key=lambda i: (sweep.depths[i], i), reverse=True):
        sweep.take(i, inertias[i])
    assert not sweep.form.rows and not any(sweep.form.entries.values())  # all is taken out
    return Embedded(len(rotors), tuple(sweep.form.steps), sweep.multipliers)


class _Sweep:
    """From the tips to the base: the unknowns 0 … nv − 1 are v̇, the others components of rates of
    twists. Those that nothing moves, as of a mechanism in a plane, are left out."""

    def __init__(
        self,
        links: Sequence[Link],
        rotors: Vector,
        rows: Sequence[RowForm],
        groups: Sequence[Sequence[Pivots]],
        multiplied: bool,
    ) -> None:
        self.multiplied = multiplied
        self.multipliers: dict[int, int] = {}
        self.links, self.groups, self.form = links, groups, QuadraticForm()
        self.chains = _chains(links)
        self.form.last = len(rotors) - 1
        self.depths: list[int] = []
        self.twists: list[list[int]] = []  # by link the unknowns of T, −1 where it is nothing
        self.joints: list[list[Replaced]] = []  # from the twist before a link's joint to its own
        self.ways: list[list[Replaced]] = []  # from a link's twist to those before joints on it
        # those, by carrier and arm
        self.seats: dict[tuple[int | float, ...], tuple[Vector, list[int]]] = {}
        self.unknowns: dict[int, int] = {}  # what stands for a velocity, where it is not itself
        self.group_of = {
            j: k for k, group in enumerate(groups) for pivots in group for j in pivots.columns
        }
        for i, link in enumerate(links):
            self.depths.append(self.depths[link.parent] + 1 if link.parent >= 0 else 0)
            self._enter(i, link, rotors)
        self.form.lasting = {step.unknown for way in self.ways for step in way}
        for i in sorted({i for group in groups for x in group for i in x.rows}):
            self._put_row(i, rows[i])
        self.missing = [sum(len(x.columns) for x in group) for group in groups]
        self.waiting: set[int] = set()  # velocities that are reached and free

    def _enter(self, i: int, link: Link, rotors: Vector) -> None:
        chain, twist = self.chains[i], [-1] * 6
        if link.parent >= 0:
            twist = self._seat(link)
            for factor in chain.before:
                twist = self._turned(self.ways[link.parent], twist, transpose(matrix((factor,))))
        axes = [_seen(chain, axis) for axis in link.motion]
        spin = _spin(axes) if len(axes) == 1 and is_zero(rotors[link.columns[0]]) else None
        if spin is not None and twist[spin.place] >= 0 and self._may_be_its_spin(link):
            self._enter_turning(link.columns[0], twist, spin)
        else:
            self._enter_moving(link.columns, twist, axes)
        self.ways.append([])

    def _may_be_its_spin(self, link: Link) -> bool:
        """Rows hold the same beside the spin as beside the joint's velocity: where it is they that
        give it, or where they give nothing of the links before it."""
        if link.columns[0] in self.group_of or self.multiplied:
            return True
        before = [j for i in path(self.links, link.parent) for j in self.links[i].columns]
        return not self.group_of.keys() & {*before}

    def _enter_moving(
        self, columns: Sequence[int], twist: Sequence[int], axes: Sequence[Vector]
    ) -> None:
        """T = X Tₚ + Σ pⱼ v̇ⱼ."""
        way, own = list[Replaced](), [_unknown(k) for k in twist]
        for axis, j in zip(axes, columns):
            for place, x in enumerate(axis):
                if not is_zero(x):
                    own[place][j] = x
        self.twists.append([self._named(way, by) for by in own])
        self.joints.append(way)

    def _enter_turning(self, j: int, twist: Sequence[int], spin: _Spin) -> None:
        """The spin itself is the unknown, and v̇ⱼ what it has more than the carrier's: nothing
        beyond the joint feels how the carrier turns about its axis."""
        before, back = twist[spin.place], 1.0 / spin.rate
        self.form.last += 1
        self.unknowns[j] = self.form.last
        own = [*twist]
        own[spin.place] = self.form.last
        self.twists.append(own)
        self.joints.append([Replaced(j, {self.form.last: back, before: -back})])

    def _seat(self, link: Link) -> list[int]:
        """The twist of the carrier at a joint on it; joints at one point have it in common."""
        arm = difference(link.a, self.links[link.parent].b)
        place = (
            link.parent,
            *(x.element_hash() if isinstance(x, ca.SX) else x for x in arm),
        )
        if place not in self.seats:
            seen = rotated(matrix(self.chains[link.parent].turn), arm)
            way, twist = self.ways[link.parent], self.twists[link.parent]
            # with the arm, whose hash is that of no other while it lives
            self.seats[place] = arm, self._shifted(way, twist, seen)
        return self.seats[place][1]

    def _shifted(self, way: list[Replaced], twist: Sequence[int], arm: Vector) -> list[int]:
        """To a point at `arm`: v + ω × arm."""
        moved = [_unknown(k) for k in twist[3:]]
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            for k, x in ((twist[b], arm[c]), (twist[c], times(-1.0, arm[b]))):
                if k >= 0 and not is_zero(x):
                    added(moved[a], {k: x})
        return [*twist[:3], *(self._named(way, by) for by in moved)]

    def _turned(self, way: list[Replaced], twist: Sequence[int], R: Matrix) -> list[int]:
        turned: list[int] = []
        for part in (twist[:3], twist[3:]):
            for row in R:
                by: Combination = {}
                for k, x in zip(part, row):
                    if k >= 0 and not is_zero(x):
                        added(by, {k: x})
                turned.append(self._named(way, by))
        return turned

    def _named(self, way: list[Replaced], by: Combination) -> int:
        """An unknown for a combination: a new one where it is not one already."""
        if not by:
            return -1
        ((k, x), *others) = by.items()
        if not others and is_one(x):
            return k
        self.form.last += 1
        way.append(Replaced(self.form.last, by))
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
                    added(by, {k: x})
        for j, x in row.coefficients:
            added(by, {j: x})
        by = dict(zip(by, settled([*by.values()])))
        if self.multiplied:
            self.form.last += 1
            self.multipliers[i] = self.form.last
            for k, x in by.items():
                self.form.add(self.form.last, k, times(-1.0, x))
        else:
            self.form.rows[i] = {}
            self.form.add_to_row(i, by)

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
        complete = [self.group_of[j] for j in link.columns if j in self.group_of]
        self.waiting.update(j for j in link.columns if self.multiplied or j not in self.group_of)
        if not self.multiplied:
            self._complete(complete)
        for j in sorted(self.waiting):
            unknown = self.unknowns.get(j, j)
            if not self.form.speaking.get(unknown):
                self.form.minimise(unknown)
                self.waiting.remove(j)
        if self.multiplied:
            self._complete(complete)

    def _add_inertia(self, i: int, j: int, x: Scalar, diagonal: bool) -> None:
        """Two components may be one unknown."""
        self.form.add(i, j, times(2.0, x) if i == j and not diagonal else x)

    def _complete(self, groups: Sequence[int]) -> None:
        """One more joint of each of these groups."""
        for k in groups:
            self.missing[k] -= 1
            for pivots in () if self.missing[k] else self.groups[k]:
                self._take_out(pivots)

    def _take_out(self, pivots: Pivots) -> None:
        if self.multiplied:
            for i in pivots.rows:
                self.form.minimise(self.multipliers[i])
        else:
            self.form.solve(pivots.rows, [self.unknowns.get(j, j) for j in pivots.columns])


@dataclass(frozen=True)
class _Chain:
    """The axes of T: `before` from the carrier's, and the link's axes turned by `turn` in them."""

    before: Rotation = ()
    turn: Rotation = ()


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


@dataclass(frozen=True)
class _Spin:
    """Which of the three axes a joint turns about, and how fast per unit of its velocity."""

    place: int
    rate: float


def _spin(axes: Sequence[Vector]) -> _Spin | None:
    """None where a joint does anything else."""
    moving = [(place, x) for place, x in enumerate(axes[0]) if not is_zero(x)]
    (place, rate) = moving[0]
    turns = len(moving) == 1 and place < 3 and isinstance(rate, float)
    return _Spin(place, float(rate)) if turns else None


def _unknown(k: int) -> Combination:
    return {} if k < 0 else {k: 1.0}


def _matrix(body: Inertia) -> Matrix:
    """6 × 6 of (ω, v): [I, [mc]×; [mc]×ᵀ, m]."""
    x, y, z = body.moment
    crossed: Matrix = [
        [0.0, times(-1.0, z), y],
        [z, 0.0, times(-1.0, x)],
        [times(-1.0, y), x, 0.0],
    ]
    upper = [[*row, *arm] for row, arm in zip(body.tensor, crossed)]
    lower = [
        [*arm, *(body.mass if a == b else 0.0 for b in range(3))]
        for a, arm in enumerate(transpose(crossed))
    ]
    return [*upper, *lower]
