"""M v̇ + h on a tree, in as few operations as its numbers allow.

Newton–Euler from base to tip and back, as in derive.mechanics.accelerations, with five liberties
that change no result:

* a link's point may be any point of the axis it turns about: the one that leaves the shorter arms;
* what a joint cannot feel is moved to the carrier (mass, first moment along the axis and one moment
  of inertia across it of a link that turns; the tensor of a link that slides), and of the moments
  across it the one that leaves fewest operations: the base parameters, folded in;
* links that turn about parallel axes, one after the other, are all seen from the axes before the
  first turn: angles and rates about the common axis add up;
* a body whose numbers are parameters may keep the point about which its file gives them;
* at the end of a branch axes may be turned about the joint's: so that the first moment has one
  entry, or not at all where the link looks the same from all sides.

Sources: Luh, Walker, Paul 1980; Khalil, Kleinfinger, Minimum operations and minimum parameters of
the dynamic models of tree structure robots, IEEE J. Robotics Automation 3 (1987) 517–526; Gautier,
Khalil 1990.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from derive.expressions.counting import cheapest
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    inverse,
    is_zero,
    matrix,
    merged,
    minus,
    plus,
    product,
    rotated,
    scaled,
    sum_of,
    times,
)
from derive.joints.turns import UNIT
from derive.mechanics.limits import EXACT, FEW
from derive.mechanics.links import moved, summed
from derive.mechanics.moments import Body, Spin, body, second_moments, without_rounding, wrench
from derive.mechanics.records import Inertia, Link

NONE: Vector = [0.0, 0.0, 0.0]
Pair = tuple[Vector, Vector]  # angular, linear
MOVING = 6  # operations that a point costs which is not at rest


@dataclass(frozen=True)
class Stem:
    """A link on its joint: carrier's axes ← `outer` ← axes before the turn ← `turn` ← own axes.

    `turn` is None where the joint is not one turn about x, y or z; both sides of it are then the
    same. `motion` per joint velocity (ω, v), `point` P in the link's frame and `arm` from the
    carrier's P in the carrier's axes. `unseen`: own axes are those before the turn. `reach`: from
    the joint's point to P in own axes; nothing where P is a point of the axis.
    """

    parent: int
    outer: Rotation
    turn: Turn | None
    motion: tuple[Pair, ...]
    columns: tuple[int, ...]
    own: Rotation  # own axes ← link's frame
    point: Vector
    arm: Vector
    unseen: bool = False
    reach: Vector = field(default_factory=lambda: list(NONE))


def joint_forces_of_motion(
    links: Sequence[Link], v: Sequence[Scalar], vdot: Sequence[Scalar], gravity: Vector
) -> list[Scalar]:
    """The generalised forces (nv), conjugate to v, that give the links v̇ against gravity: of
    several ways of writing them the one with the fewest operations.

    `v`, `vdot` over all generalized velocities; `gravity` in ground axes, m/s².
    """
    stems = _stems(links)
    bodies = [
        moved(moved(link.inertia, (), [-x for x in stem.point]), stem.own, NONE)
        for link, stem in zip(links, stems)
    ]
    few, alone = len(links) <= FEW, list(range(len(links)))
    seated = [_leaves(stems, _regrouped(stems, bodies))]
    open_numbers = few and not all(_is_number(own) for own in bodies)
    if open_numbers:
        seated.append(_leaves(stems, [body(own) for own in bodies]))
    groups = [_heads(stems, True)]
    if few and groups[0] != alone:
        groups.append(_heads(stems, False))
    ways = [(*found, heads) for found in seated for heads in groups]
    if open_numbers:
        ways.append((*_about_origins(links, stems), alone))
    return cheapest([_Motion(*way, (v, vdot, gravity)).forces() for way in ways])


# ---- where links sit


def _stems(links: Sequence[Link]) -> list[Stem]:
    """With the points of the axes that leave the shortest arms."""
    stems: list[Stem] = []
    for link in links:
        pre, turn, post = _around_turn(link)
        carrier = stems[link.parent].own if link.parent >= 0 else ()
        own = _one(post)
        motion = tuple((_spun(own, list(m[:3])), _spun(own, list(m[3:]))) for m in link.motion)
        outer = _one((*carrier, *pre))
        stems.append(Stem(link.parent, outer, turn, motion, link.columns, own, link.b, []))
    points = _points(links, stems)
    return [
        replace(stem, point=points[i], arm=_arm(links, stems, points, i))
        for i, stem in enumerate(stems)
    ]


def _around_turn(link: Link) -> tuple[Rotation, Turn | None, Rotation]:
    """The link's rotation before its joint's turn, that, and behind it, if the joint is one turn
    about x, y or z; else all of it."""
    turns = [(k, x) for k, x in enumerate(link.rotation) if isinstance(x, Turn)]
    alone = link.turns_about >= 0 and len(link.columns) == 1 and len(turns) == 1
    if not alone or turns[0][1].axis not in UNIT.values():
        return link.rotation, None, ()
    k, turn = turns[0]
    return link.rotation[:k], turn, link.rotation[k + 1 :]


def _one(rotation: Rotation) -> Rotation:
    """Neighbouring constant factors as one; none where they are the unit matrix."""
    result: list[Turn | Still] = []
    for factor in rotation:
        last = result[-1] if result else None
        if isinstance(factor, Still) and isinstance(last, Still):
            result[-1] = Still(_exactly(product(last.matrix, factor.matrix)))
        else:
            result.append(factor)
    return tuple(x for x in result if not (isinstance(x, Still) and _is_unit(x.matrix)))


def _exactly(R: Matrix) -> Matrix:
    return [[_whole(x) for x in row] for row in R]


def _whole(x: Scalar) -> Scalar:
    if not isinstance(x, float):
        return x
    return float(round(x)) if abs(x - round(x)) < EXACT else x


def _is_unit(R: Matrix) -> bool:
    numbers = [x for row in R for x in row]
    return all(isinstance(x, float) for x in numbers) and all(
        x == float(i == j) for i, row in enumerate(R) for j, x in enumerate(row)
    )


def _spun(rotation: Rotation, x: Vector) -> Vector:
    """R x, factor by factor: a turn about a principal axis costs four products."""
    for factor in reversed(rotation):
        x = rotated(matrix((factor,)), x)
    return x


def _arm(links: Sequence[Link], stems: Sequence[Stem], points: Sequence[Vector], i: int) -> Vector:
    """From the carrier's P to the link's, in the carrier's axes."""
    link, stem = links[i], stems[i]
    if link.parent < 0:
        carrier, here = (), list(link.a)
    else:
        carrier, here = stems[link.parent].own, difference(link.a, points[link.parent])
    here = _spun(carrier, here)
    shift = difference(points[i], link.b)
    if all(is_zero(x) for x in shift):
        return here
    # a point of the axis: the turn leaves it where it is
    return [_whole(x) for x in sum_of(here, _spun(stem.outer, _spun(stem.own, shift)))]


def _points(links: Sequence[Link], stems: Sequence[Stem]) -> list[Vector]:
    """P of every link, in its frame: the joint's own point or another of the axis, beside the point
    of the carrier or of a link that it carries, whichever leaves fewest products. Symbols are left
    where they are."""
    points = [list(link.b) for link in links]
    turning, resting = _turning(stems), [False] * len(links)
    children = _children(links)
    for i, stem in enumerate(stems):
        steady = stem.parent < 0 or resting[stem.parent]
        if stem.turn is not None:
            near, given = [i, *children[i]], points[i]
            trials = _choices(links, stems, points, near)
            arms: list[list[Vector]] = []
            for points[i] in trials:
                arms.append([_arm(links, stems, points, k) for k in near])
            points[i] = given
            if all(isinstance(x, float) for found in arms for arm in found for x in arm):
                costs = [_cost(turning, stems, near, found, steady) for found in arms]
                points[i] = trials[costs.index(min(costs))]
        own = _arm(links, stems, points, i) if stem.parent >= 0 else NONE
        resting[i] = stem.turn is not None and steady and all(is_zero(x) for x in own)
    return points


def _children(links: Sequence[Link]) -> list[list[int]]:
    result: list[list[int]] = [[] for _ in links]
    for k, link in enumerate(links):
        if link.parent >= 0:
            result[link.parent].append(k)
    return result


def _cost(
    turning: Sequence[Vector],
    stems: Sequence[Stem],
    near: Sequence[int],
    arms: Sequence[Vector],
    steady: bool,
) -> int:
    """Operations of the arms to a link and to those that it carries. `steady`: its carrier's P is
    at rest; a point that is not has more acceleration than gravity."""
    cost = sum(_products(turning, stems[k].parent, arm) for k, arm in zip(near, arms))
    rests = (steady and _is_nothing(arms[0])) or stems[near[0]].parent < 0
    moving = sum(not (rests and _is_nothing(arm)) for arm in arms[1:])
    return cost + MOVING * (moving + (not rests))


def _is_nothing(x: Vector) -> bool:
    return all(map(is_zero, x))


def _choices(
    links: Sequence[Link], stems: Sequence[Stem], points: Sequence[Vector], near: Sequence[int]
) -> list[Vector]:
    """Points of the axis of the first of `near`, the others being what it carries."""
    i, *carried = near
    link, stem = links[i], stems[i]
    axis = _spun(inverse(stem.own), list(stem.motion[0][0]))
    ways = [dot(axis, difference(links[k].a, link.b)) for k in carried]
    if link.parent >= 0:
        start = _spun(stem.outer, list(stem.motion[0][0]))
        ways.append(minus(0.0, dot(start, _arm(links, stems, points, i))))
    return [points[i], *(sum_of(link.b, scaled(way, axis)) for way in ways)]


def _turning(stems: Sequence[Stem]) -> list[Vector]:
    """1 for each axis of a link about which it may turn, by structure."""
    result: list[Vector] = []
    for stem in stems:
        above = result[stem.parent] if stem.parent >= 0 else NONE
        R = matrix((*stem.outer, *((stem.turn,) if stem.turn else ())))
        along = [[0.0 if is_zero(R[i][j]) else 1.0 for i in range(3)] for j in range(3)]
        seen = [dot(row, above) for row in along]
        own = [dot([abs(x) if isinstance(x, float) else 1.0 for x in column], [1.0] * len(column))
               for column in zip(*(m[0] for m in stem.motion))]  # fmt: skip
        result.append([0.0 if is_zero(plus(x, y)) else 1.0 for x, y in zip(seen, own)])
    return result


def _products(turning: Sequence[Vector], carrier: int, arm: Vector) -> int:
    """Of U r and of r × f; of a link that turns about one axis alone that axis feels no arm along
    it, and nothing else is asked for."""
    about = [1.0, 1.0, 1.0] if carrier < 0 else turning[carrier]
    alone = sum(map(bool, about)) == 1
    costs = [(0 if about[k] else 3) if alone else 5 for k in range(3)]
    return sum(cost for cost, x in zip(costs, arm) if not is_zero(x)) if carrier >= 0 else 0


def _about_origins(links: Sequence[Link], stems: Sequence[Stem]) -> tuple[list[Stem], list[Body]]:
    """With the points about which the file gives the bodies' numbers. About a mass centre these
    make no products with one another: neither m r nor I + m r²."""
    seats: list[Stem] = []
    for link, stem in zip(links, stems):
        carrier = stems[link.parent].own if link.parent >= 0 else ()
        arm, reach = _spun(carrier, list(link.a)), _spun(stem.own, [minus(0.0, x) for x in link.b])
        seats.append(replace(stem, point=list(NONE), arm=arm, reach=reach))
    return seats, [body(moved(link.inertia, stem.own, NONE)) for link, stem in zip(links, stems)]


# ---- base parameters


def _regrouped(stems: Sequence[Stem], given: Sequence[Inertia]) -> list[Body]:
    """With everything a joint cannot feel on its carrier; what reaches the ground is dropped."""
    left = list(given)
    for i in reversed(range(len(stems))):
        stem = stems[i]
        found = _parted(stem, left[i])
        if found is None:
            continue
        left[i], common = found
        if stem.parent >= 0:
            arm = stem.arm if stem.turn else NONE  # of a slide a tensor alone is handed down
            below = moved(common, stem.outer, arm)
            left[stem.parent] = _cleared(summed(left[stem.parent], below))
    return [body(own) for own in left]


def _parted(stem: Stem, own: Inertia) -> tuple[Inertia, Inertia] | None:
    """What the joint feels, and what moves with the carrier at every position of it."""
    if stem.turn is None:
        if len(stem.columns) != 1 or any(not is_zero(x) for x in stem.motion[0][0]):
            return None
        nothing: Matrix = [[0.0] * 3 for _ in range(3)]
        return Inertia(own.mass, own.moment, nothing), Inertia(0.0, list(NONE), own.tensor)
    ways = [_without(own, stem.turn.axis.index(1.0), c) for c in _across(own, stem.turn)]
    return min(ways, key=lambda way: body(way[0]).cost)


def _across(own: Inertia, turn: Turn) -> Vector:
    """Moments of inertia across the axis that may be taken off: of either axis across it or, where
    it is a number, the one that leaves no second moment along it."""
    z = turn.axis.index(1.0)
    x, y = (z + 1) % 3, (z + 2) % 3
    along = second_moments(own.tensor)[z]
    choices = [own.tensor[y][y], own.tensor[x][x]]
    return [*choices, along] if isinstance(along, float) else choices


def _without(own: Inertia, z: int, across: Scalar) -> tuple[Inertia, Inertia]:
    """The rest and the common part: mass, h along z, and diag(c, c, 0)."""
    common = Inertia(
        own.mass,
        [x if k == z else 0.0 for k, x in enumerate(own.moment)],
        [[across if a == b != z else 0.0 for b in range(3)] for a in range(3)],
    )
    tensor = [list(row) for row in own.tensor]
    for k in range(3):
        if k != z:
            tensor[k][k] = _less(own.tensor[k][k], across)
    moment = [0.0 if k == z else x for k, x in enumerate(own.moment)]
    return Inertia(0.0, moment, tensor), common


def _less(x: Scalar, across: Scalar) -> Scalar:
    return 0.0 if x is across else without_rounding(minus(x, across), [x, across])


def _cleared(own: Inertia) -> Inertia:
    """Products of inertia that are rounding alone are nothing."""
    sizes = [own.tensor[k][k] for k in range(3)]
    tensor = [
        [x if i == j else without_rounding(x, sizes) for j, x in enumerate(row)]
        for i, row in enumerate(own.tensor)
    ]
    return Inertia(own.mass, own.moment, tensor)


def _is_number(own: Inertia) -> bool:
    numbers = [own.mass, *own.moment, *(x for row in own.tensor for x in row)]
    return all(isinstance(x, float) for x in numbers)


# ---- ends of branches


def _leaves(stems: Sequence[Stem], bodies: Sequence[Body]) -> tuple[list[Stem], list[Body]]:
    """Axes at the ends of branches, turned about the joint's."""
    seats, found = list(stems), list(bodies)
    carriers = {stem.parent for stem in stems}
    for i, stem in enumerate(stems):
        if stem.turn is None or i in carriers:
            continue
        z = stem.turn.axis.index(1.0)
        if _is_round(found[i].own, z):
            seats[i] = replace(stem, unseen=True)
            continue
        turned, angle = _aligned(found[i], z)
        if turned.cost + 1 < found[i].cost:
            found[i] = turned
            seats[i] = replace(stem, turn=Turn(stem.turn.axis, stem.turn.angle + angle))
    return seats, found


def _is_round(own: Inertia, z: int) -> bool:
    """Whether it looks the same after every turn about z."""
    x, y = (z + 1) % 3, (z + 2) % 3
    beside = [own.moment[x], own.moment[y], own.tensor[x][y], own.tensor[x][z], own.tensor[y][z]]
    across = _less(own.tensor[x][x], own.tensor[y][y])
    alike = is_zero(across) or (is_zero(own.tensor[x][x]) and is_zero(own.tensor[y][y]))
    return alike and all(is_zero(value) for value in beside)


def _aligned(of: Body, z: int) -> tuple[Body, float]:
    """With the first moment along one axis across z, and the angle of that axis."""
    x, y = (z + 1) % 3, (z + 2) % 3
    along, beside = of.own.moment[x], of.own.moment[y]
    if not _is_number(of.own) or is_zero(along) or is_zero(beside):
        return of, 0.0
    angle = math.atan2(float(beside), float(along))
    R = [[float(i == j) for j in range(3)] for i in range(3)]
    R[x][x] = R[y][y] = math.cos(angle)
    R[x][y], R[y][x] = math.sin(angle), -math.sin(angle)
    own = moved(of.own, (Still([list(row) for row in R]),), NONE)
    moment = [0.0 if k == y else h for k, h in enumerate(own.moment)]
    return body(Inertia(own.mass, moment, own.tensor)), angle


# ---- the motion


def _heads(stems: Sequence[Stem], joined: bool) -> list[int]:
    """Of every link the one at which a row of parallel axes begins: itself, where it is alone."""
    heads: list[int] = []
    for i, stem in enumerate(stems):
        above = stems[stem.parent].turn if stem.parent >= 0 else None
        same = stem.turn and above and stem.turn.axis == above.axis and not stem.outer
        heads.append(heads[stem.parent] if joined and same else i)
    return heads


@dataclass(frozen=True)
class _State:
    """Of a link. Before the turns: ω and ω̇ without what the row of parallel axes adds, which is
    `rate` and `second`, and a of P; `chain` leads back there. Own axes: `spin` and a."""

    omega: Vector
    alpha: Vector
    a: Vector
    rate: Vector
    second: Vector
    chain: Rotation
    spin: Spin
    own: Vector


class _Motion:
    """Of links with a head of each row of parallel axes."""

    def __init__(
        self,
        stems: Sequence[Stem],
        bodies: Sequence[Body],
        heads: Sequence[int],
        motion: tuple[Sequence[Scalar], Sequence[Scalar], Vector],
    ) -> None:
        self.stems, self.heads = stems, heads
        self.v, self.vdot, gravity = motion
        ground = Spin(list(NONE), list(NONE))
        self.ground = (ground, [-x for x in gravity])
        self.states: list[_State] = []
        for i in range(len(stems)):
            self.states.append(self._state(i))
        self.wrenches = [
            wrench(of, state.spin, state.own) for of, state in zip(bodies, self.states)
        ]

    def _state(self, i: int) -> _State:
        stem = self.stems[i]
        carrier, a = self._carrier(stem.parent)
        swing = NONE if all(is_zero(x) for x in stem.arm) else carrier.swung(stem.arm)
        rates = [_combined(stem, values) for values in (self.v, self.vdot)]
        if self.heads[i] != i:
            return self._joined(i, swing, rates)
        back = inverse(stem.outer)
        start = (
            _spun(back, carrier.omega),
            _spun(back, carrier.alpha),
            _spun(back, sum_of(a, swing)),
        )
        if stem.turn is not None:
            chain: Rotation = () if stem.unseen else (stem.turn,)
            found = _turned(start, (rates[0][0], rates[1][0]), chain)
        else:
            found = _moved_on(start, rates[0], rates[1])
        if _is_nothing(stem.reach):
            return found
        return replace(found, own=sum_of(found.own, found.spin.swung(stem.reach)))

    def _joined(self, i: int, swing: Vector, rates: list[Pair]) -> _State:
        """To a row of parallel axes."""
        stem = self.stems[i]
        assert stem.turn is not None
        above = self.states[stem.parent]
        start = (above.omega, above.alpha, sum_of(above.a, _spun(above.chain, swing)))
        chain: Rotation = () if stem.unseen else merged(above.chain, (stem.turn,))
        return _turned(
            start, (sum_of(above.rate, rates[0][0]), sum_of(above.second, rates[1][0])), chain
        )

    def _carrier(self, i: int) -> tuple[Spin, Vector]:
        return (self.states[i].spin, self.states[i].own) if i >= 0 else self.ground

    def forces(self) -> list[Scalar]:
        """From tip to base: each joint feels the wrench along its motion."""
        result: list[Scalar] = [0.0] * len(self.v)
        own = [(list(n), list(f)) for n, f in self.wrenches]
        row = [(list(NONE), list(NONE)) for _ in self.stems]  # of links beyond, before the turns
        for i in reversed(range(len(self.stems))):
            stem, state = self.stems[i], self.states[i]
            at_joint = sum_of(own[i][0], cross(stem.reach, own[i][1]))
            turned = _spun(state.chain, at_joint), _spun(state.chain, own[i][1])
            n, f = sum_of(turned[0], row[i][0]), sum_of(turned[1], row[i][1])
            for motion, j in zip(stem.motion, stem.columns):
                result[j] = dot([*motion[0], *motion[1]], [*n, *f])
            below = stem.parent
            if below < 0:
                continue
            if self.heads[i] == i:
                n, f = _spun(stem.outer, n), _spun(stem.outer, f)
                own[below] = _added(own[below], n, f, stem.arm)
            else:
                row[below] = _added(row[below], n, f, _spun(self.states[below].chain, stem.arm))
        return result


def _combined(stem: Stem, values: Sequence[Scalar]) -> Pair:
    own = [values[j] for j in stem.columns]
    turn, slide = ([dot([m[k][i] for m in stem.motion], own) for i in range(3)] for k in (0, 1))
    return turn, slide


def _turned(start: tuple[Vector, Vector, Vector], rates: Pair, chain: Rotation) -> _State:
    """A link that turns about an axis of its own: ω̇ = Rᵀ ω̇_p + Rᵀ ω_p × e θ̇ + e θ̈."""
    back = inverse(chain)
    omega, alpha, a = (_spun(back, x) for x in start)
    alpha = sum_of(sum_of(alpha, cross(omega, rates[0])), rates[1])
    spin = Spin(sum_of(omega, rates[0]), alpha)
    return _State(*start, rates[0], rates[1], chain, spin, a)


def _moved_on(start: tuple[Vector, Vector, Vector], rates: Pair, seconds: Pair) -> _State:
    """By any other joint, in the axes of the link."""
    omega, alpha, a = start
    turn, slide = rates
    twice = sum_of([times(2.0, x) for x in omega], turn)
    alpha = sum_of(sum_of(alpha, seconds[0]), cross(omega, turn))
    a = sum_of(sum_of(a, seconds[1]), cross(twice, slide))
    spin = Spin(sum_of(omega, turn), alpha)
    return _State(*start, turn, seconds[0], (), spin, a)


def _added(wrench: Pair, n: Vector, f: Vector, arm: Vector) -> Pair:
    return sum_of(wrench[0], sum_of(n, cross(arm, f))), sum_of(wrench[1], f)
