"""Base parameters, folded in: what a joint cannot feel is moved to the carrier.

Mass, first moment along the axis and one moment of inertia across it of a link that turns, and the
tensor of a link that slides, act as if they were the carrier's, at every motion. Of the moments
across the axis the one is taken off that leaves fewest operations. At the end of a branch axes may
be turned about the joint's as well: so that the first moment has one entry, or not at all where the
link looks the same from all sides.

Sources: Gautier, Khalil, Direct calculation of minimum set of inertial parameters of serial robots,
IEEE Trans. Robotics Automation 6 (1990) 368–373; Khalil, Kleinfinger 1987.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Still, Turn
from derive.joints.rotations import is_zero, minus
from derive.mechanics.inverse.moments import Body, body, second_moments, without_rounding
from derive.mechanics.inverse.stems import NONE, Stem
from derive.mechanics.links import moved, summed
from derive.mechanics.records import Inertia


def regrouped_bodies(stems: Sequence[Stem], given: Sequence[Inertia]) -> list[Body]:
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


def is_number(own: Inertia) -> bool:
    numbers = [own.mass, *own.moment, *(x for row in own.tensor for x in row)]
    return all(isinstance(x, float) for x in numbers)


# ---- ends of branches


def turned_leaves(stems: Sequence[Stem], bodies: Sequence[Body]) -> tuple[list[Stem], list[Body]]:
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
    if not is_number(of.own) or is_zero(along) or is_zero(beside):
        return of, 0.0
    angle = math.atan2(float(beside), float(along))
    R = [[float(i == j) for j in range(3)] for i in range(3)]
    R[x][x] = R[y][y] = math.cos(angle)
    R[x][y], R[y][x] = math.sin(angle), -math.sin(angle)
    own = moved(of.own, (Still([list(row) for row in R]),), NONE)
    moment = [0.0 if k == y else h for k, h in enumerate(own.moment)]
    return body(Inertia(own.mass, moment, own.tensor)), angle
