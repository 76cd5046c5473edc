"""Where links sit: their joints, the points that stand for them, and the axes they are seen in.

A link's point may be any point of the axis it turns about: the one that leaves the shorter arms.
Links that turn about parallel axes, one after the other, may all be seen from the axes before the
first turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import (
    difference,
    dot,
    inverse,
    is_zero,
    matrix,
    minus,
    plus,
    product,
    rotated,
    scaled,
    sum_of,
)
from derive.joints.turns import UNIT
from derive.mechanics.limits import EXACT
from derive.mechanics.records import Link

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


def stems_of(links: Sequence[Link]) -> list[Stem]:
    """With the points of the axes that leave the shortest arms."""
    stems: list[Stem] = []
    for link in links:
        pre, turn, post = _around_turn(link)
        carrier = stems[link.parent].own if link.parent >= 0 else ()
        own = _one(post)
        motion = tuple((spun(own, list(m[:3])), spun(own, list(m[3:]))) for m in link.motion)
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


def spun(rotation: Rotation, x: Vector) -> Vector:
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
    here = spun(carrier, here)
    shift = difference(points[i], link.b)
    if all(is_zero(x) for x in shift):
        return here
    # a point of the axis: the turn leaves it where it is
    return [_whole(x) for x in sum_of(here, spun(stem.outer, spun(stem.own, shift)))]


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
    rests = (steady and is_nothing(arms[0])) or stems[near[0]].parent < 0
    moving = sum(not (rests and is_nothing(arm)) for arm in arms[1:])
    return cost + MOVING * (moving + (not rests))


def is_nothing(x: Vector) -> bool:
    return all(map(is_zero, x))


def _choices(
    links: Sequence[Link], stems: Sequence[Stem], points: Sequence[Vector], near: Sequence[int]
) -> list[Vector]:
    """Points of the axis of the first of `near`, the others being what it carries."""
    i, *carried = near
    link, stem = links[i], stems[i]
    axis = spun(inverse(stem.own), list(stem.motion[0][0]))
    ways = [dot(axis, difference(links[k].a, link.b)) for k in carried]
    if link.parent >= 0:
        start = spun(stem.outer, list(stem.motion[0][0]))
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


def stems_at_origins(links: Sequence[Link], stems: Sequence[Stem]) -> list[Stem]:
    """With the points about which the file gives the bodies' numbers."""
    seats: list[Stem] = []
    for link, stem in zip(links, stems):
        carrier = stems[link.parent].own if link.parent >= 0 else ()
        arm, reach = spun(carrier, list(link.a)), spun(stem.own, [minus(0.0, x) for x in link.b])
        seats.append(replace(stem, point=list(NONE), arm=arm, reach=reach))
    return seats


def heads_of(stems: Sequence[Stem], joined: bool) -> list[int]:
    """Of every link the one at which a row of parallel axes begins: itself, where it is alone."""
    heads: list[int] = []
    for i, stem in enumerate(stems):
        above = stems[stem.parent].turn if stem.parent >= 0 else None
        same = stem.turn and above and stem.turn.axis == above.axis and not stem.outer
        heads.append(heads[stem.parent] if joined and same else i)
    return heads
