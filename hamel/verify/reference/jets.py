"""Quantities with their first and second time derivatives along the motion, in maximal coordinates
z.

x has the rate ẋ = X z and the acceleration ẍ = X ż + rest. Points and directions of bodies are the
beginning, sums and products make everything else, so that φ(q) of a closure becomes a row X ż =
−rest without a formula for its derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.model.records import GROUND, Placement
from hamel.verify.reference.layout import Layout, Rows, centripetal, point_velocity
from hamel.verify.reference.states import State, placed
from hamel.verify.reference.vectors import Array, cross, skew


@dataclass(frozen=True)
class Jet:
    """Three components (or one, then scalars and a row): value, rate, `over` = X (k × nz),
    `rest`."""

    value: Array
    rate: Array
    over: Array
    rest: Array

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.rate, -self.over, -self.rest)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(
            self.value - other.value,
            self.rate - other.rate,
            self.over - other.over,
            self.rest - other.rest,
        )

    def __add__(self, other: Jet) -> Jet:
        return Jet(
            self.value + other.value,
            self.rate + other.rate,
            self.over + other.over,
            self.rest + other.rest,
        )

    def scaled(self, factor: float) -> Jet:
        """A constant times the quantity: value and derivatives alike."""
        return Jet(factor * self.value, factor * self.rate, factor * self.over, factor * self.rest)


def direction(place: Layout, state: State, body: str, fixed: Array) -> Jet:
    """A vector fixed in a body: ḋ = ω × d, d̈ = α × d + ω × (ω × d), along the ground's axes. X has
    −[d]× over the body's angular velocity, rest is ω × (ω × d)."""
    frame = state.frames[body]
    d = frame.point(fixed)
    over = np.zeros((3, place.size))
    if body != GROUND:
        over[:, place.twist(body)][:, :3] = -skew(d)
    return Jet(d, cross(frame.omega, d), over, centripetal(frame, d))


def point(place: Layout, state: State, body: str, position: Array) -> Jet:
    """A material point of a body, from the ground's origin, `position` in body coordinates: ṙ = v +
    ω × s, r̈ = a + α × s + ω × (ω × s) with the arm s = R · position."""
    frame = state.frames[body]
    arm = frame.point(position)
    over = np.zeros((3, place.size))
    if body != GROUND:
        over[:, place.twist(body)] = point_velocity(arm)
    return Jet(frame.origin + arm, frame.speed(arm), over, centripetal(frame, arm))


def frame_origin(place: Layout, state: State, body: str, at: Placement) -> Jet:
    """The origin of a frame placed on a body."""
    return point(place, state, body, placed(state, at)[0])


def frame_axes(
    place: Layout, state: State, body: str, at: Placement, turned: Array
) -> tuple[Jet, ...]:
    """The three axes of a frame placed on a body; `turned` has them in the placed frame as
    columns."""
    columns = placed(state, at)[1] @ turned
    return tuple(direction(place, state, body, columns[:, k]) for k in range(3))


def joint_frame(
    place: Layout, state: State, body: str, at: Placement, turned: Array
) -> tuple[Jet, tuple[Jet, ...]]:
    """Both."""
    return frame_origin(place, state, body, at), frame_axes(place, state, body, at, turned)


def dot(a: Jet, b: Jet) -> Jet:
    """s = a · b, a scalar: ṡ = ȧ · b + a · ḃ, and s̈ has 2 ȧ · ḃ besides ä · b + a · b̈."""
    rate = a.rate @ b.value + a.value @ b.rate
    rest = a.rest @ b.value + a.value @ b.rest + 2.0 * a.rate @ b.rate
    return Jet(a.value @ b.value, rate, b.value @ a.over + a.value @ b.over, rest)


def product(a: Jet, b: Jet) -> Jet:
    """a × b: its acceleration has 2 ȧ × ḃ besides ä × b + a × b̈."""
    rate = cross(a.rate, b.value) + cross(a.value, b.rate)
    rest = cross(a.rest, b.value) + cross(a.value, b.rest) + 2.0 * cross(a.rate, b.rate)
    return Jet(cross(a.value, b.value), rate, skew(a.value) @ b.over - skew(b.value) @ a.over, rest)


def length(a: Jet) -> Jet:
    """s = |a|: s ṡ = a · ȧ, s s̈ = a · ä + ȧ · ȧ − ṡ²."""
    s = float(np.linalg.norm(a.value))
    rate = a.value @ a.rate / s
    return Jet(
        np.array(s), rate, a.value @ a.over / s, (a.value @ a.rest + a.rate @ a.rate - rate**2) / s
    )


def stays(phi: Sequence[Jet], size: int) -> Rows:
    """Scalars that stay zero: φ = 0, X z = 0, X ż = −rest."""
    if not phi:
        return Rows(np.zeros((0, size)), np.zeros(0), np.zeros(0), np.zeros(0))
    over, rest = np.array([x.over for x in phi]), np.array([x.rest for x in phi])
    return Rows(over, -rest, np.zeros(len(phi)), np.array([x.value for x in phi]))
