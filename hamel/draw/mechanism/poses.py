"""Where the bodies are: the recursions of the System evaluated at states."""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from derive.expressions.scalars import Matrix
from derive.expressions.scalars import Vector as Numbers
from derive.joints.rotations import matrix, product
from derive.mechanics.records import Place, System
from derive.mechanics.recursions.tree import ground_point, ground_positions, ground_rotations
from hamel.draw.mechanism.points import Dial, Loose
from hamel.draw.mechanism.records import Pose, Vector

ORIGIN: Numbers = [0.0, 0.0, 0.0]
MOVING = 12  # numbers of a pose: three rows of the rotation, and the position


class Bodies:
    """Poses of all bodies of a system, then of its loose points and dials, in the order of
    `names`."""

    def __init__(
        self, system: System, loose: tuple[Loose, ...] = (), dials: tuple[Dial, ...] = ()
    ) -> None:
        self.system, self.loose, self.dials = system, loose, dials
        own = [body.name for body in system.model.bodies]
        points = [f"point {x.name}" for x in loose]
        self.names = (*own, *points, *(x.label for x in dials))

    @cached_property
    def function(self) -> ca.Function:
        """(t, q, p) → 12 numbers a body."""
        links, places = self.system.links, dict(self.system.places)
        rotations = ground_rotations(links)
        positions = ground_positions(links, rotations)
        entries = [ca.SX(0, 1)]
        for body in self.system.model.bodies:
            place = places[body.name]
            R = _rotation(place, rotations)
            r = ground_point(place, ORIGIN, positions, rotations)
            entries.append(ca.vertcat(*R[0], *R[1], *R[2], *r))
        s = self.system
        entries += [_point(s.q, x) for x in self.loose] + [_needle(s.q, x) for x in self.dials]
        return ca.Function("poses", [s.t, s.q, s.own_p], [ca.densify(ca.vertcat(*entries))])

    def many(self, t: Vector, q: Vector, p: Vector) -> Vector:
        """At k states (rows of q): k × bodies × 12."""
        numbers = self.function.map(len(t))(t[None, :], q.T, np.tile(p[:, None], (1, len(t))))
        return np.asarray(numbers).T.reshape(len(t), len(self.names), MOVING)

    def at(self, t: float, q: Vector, p: Vector) -> tuple[Pose, ...]:
        """At one state."""
        rows = np.asarray(self.function(t, q, p)).reshape(len(self.names), MOVING)
        return tuple(pose(row) for row in rows)


def pose(row: Vector) -> Pose:
    """The pose of twelve numbers."""
    return Pose(row[:9].reshape(3, 3), row[9:])


def _rotation(place: Place, rotations: list[Matrix]) -> Matrix:
    """Ground ← body."""
    own = matrix(place.rotation)
    return own if place.link < 0 else product(rotations[place.link], own)


def _point(q: ca.SX, point: Loose) -> ca.SX:
    """It does not turn."""
    at = [q[k] if k >= 0 else 0.0 for k in point.indices]
    return ca.vertcat(1, 0, 0, 0, 1, 0, 0, 0, 1, *at)


def _needle(q: ca.SX, dial: Dial) -> ca.SX:
    x = q[dial.index]
    if dial.turns:
        c, s = ca.cos(x), ca.sin(x)
        return ca.vertcat(c, -s, 0, s, c, 0, 0, 0, 1, dial.centre, 0, 0)
    return ca.vertcat(1, 0, 0, 0, 1, 0, 0, 0, 1, dial.centre + dial.factor * x, 0, 0)
