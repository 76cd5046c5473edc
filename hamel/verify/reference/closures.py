"""Joints that close loops, as rows in maximal coordinates.

Two joint frames, one placed on each body, have origins p and axes a, b; the joint's axis is the
third axis of both. φ and its order are the project's convention, for λ to mean the same: points
first, p₂ − p₁ along the ground's axes (revolute, ball, universal, fixed) or along axes of the first
frame (the sliding joints), or of the frame that the model says; then bⱼ · aᵢ of axes that stay at
right angles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from derive.diagnostics import AssumptionError
from derive.model.records import GROUND, Closure, Placement
from hamel.verify.reference.jets import (
    Jet,
    direction,
    dot,
    frame_axes,
    frame_origin,
    product,
    stays,
)
from hamel.verify.reference.layout import Layout, Rows, stacked
from hamel.verify.reference.states import State, placed
from hamel.verify.reference.vectors import UNIT, Array, cross

NORMAL = {"xy": UNIT["z"], "xz": -UNIT["y"], "yz": UNIT["x"], "": UNIT["z"]}
NO_TURN = ((0, 2), (1, 2), (1, 0))


@dataclass(frozen=True)
class Loop:
    """A closure at one state: the two joint frames as jets, as far as its rows need them."""

    closure: Closure
    plane: str
    place: Layout
    state: State

    @cached_property
    def origins(self) -> tuple[Jet, ...]:
        """Of both joint frames."""
        return tuple(frame_origin(self.place, self.state, *side) for side in self._sides)

    @cached_property
    def axes(self) -> tuple[tuple[Jet, ...], ...]:
        """The three axes of each."""
        turned = triad(self.state.vector(self.closure.axis), self.plane)
        return tuple(frame_axes(self.place, self.state, *side, turned) for side in self._sides)

    @cached_property
    def seen_from(self) -> tuple[Jet, ...]:
        """The axes of the body whose axes take the rows."""
        body = self.closure.seen_from
        return tuple(direction(self.place, self.state, body, UNIT[letter]) for letter in "xyz")

    @property
    def _sides(self) -> Iterable[tuple[str, Placement]]:
        return zip(self.closure.bodies, self.closure.placements)

    @property
    def gap(self) -> Jet:
        """p₂ − p₁, from the first joint frame to the second, along the ground's axes."""
        return self.origins[1] - self.origins[0]


_Closing = Callable[[Loop], Rows]


def closure_rows(closure: Closure, plane: str, place: Layout, state: State) -> Rows:
    """The rows of one closure; NotImplementedError for a type the reference does not know."""
    if closure.type not in _ROWS:
        raise AssumptionError(
            f"verify cannot derive the closure '{closure.name}' again: its reference does not know "
            f"{closure.type}",
            "it takes a derivation of its own in hamel/verify/reference/closures.py",
        )
    return _ROWS[closure.type](Loop(closure, plane, place, state))


def triad(axis: Array, plane: str = "") -> Array:
    """Columns x, axis × x, axis; in a plane x lies in the plane across the axis, in space across
    the axis' least component."""
    unit = axis if axis.any() else NORMAL[plane]
    x = cross(NORMAL[plane], unit)
    if not plane or not x.any():
        x = cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))])
    x = x / np.linalg.norm(x)
    return np.column_stack([x, cross(unit, x), unit])


def _meeting(loop: Loop) -> list[Jet]:
    """p₂ − p₁ along the ground's axes: λ is the force on the second body. Along those of a joint
    frame where the model says so."""
    if loop.closure.along >= 0:
        along = loop.axes[loop.closure.along] if loop.closure.along < 2 else loop.seen_from
        return [dot(axis, loop.gap) for axis in along[: len(loop.plane or "xyz")]]
    return [_component(loop.gap, UNIT[letter]) for letter in loop.plane or "xyz"]


def _component(x: Jet, along: Array) -> Jet:
    return Jet(along @ x.value, along @ x.rate, along @ x.over, along @ x.rest)


def _across(loop: Loop, axes: Sequence[int]) -> list[Jet]:
    """aᵢ · (p₂ − p₁)."""
    if loop.closure.along > 1 and len(axes) == 2:
        return _kept(loop, product(loop.axes[0][2], loop.gap))
    return [dot(loop.axes[loop.closure.along == 1][i], loop.gap) for i in axes]


def _kept(loop: Loop, turned: Jet) -> list[Jet]:
    """Along all axes of the body that the closure is seen from but that one."""
    return [dot(g, turned) for k, g in enumerate(loop.seen_from) if k != loop.closure.along - 2]


def _parallel(loop: Loop) -> list[Jet]:
    """The axis of one frame at right angles to the first two of the other, that the model says;
    with the sign that a small turn of the second body gives in both cases."""
    first, second = loop.axes
    if loop.closure.along > 1:
        return _kept(loop, product(first[2], second[2]))
    if loop.closure.along < 1:
        return [dot(first[i], second[2]) for i in (0, 1)]
    return [-dot(first[2], second[i]) for i in (0, 1)]


def _square(loop: Loop, pairs: Sequence[tuple[int, int]]) -> list[Jet]:
    """bⱼ · aᵢ."""
    return [dot(loop.axes[0][i], loop.axes[1][j]) for i, j in pairs]


def _locked(points: Callable[[Loop], list[Jet]], in_plane: tuple[int, int]) -> _Closing:
    """Points and axes at right angles that leave no turn."""

    def rows(loop: Loop) -> Rows:
        pairs = (in_plane,) if loop.plane else NO_TURN
        apart = points(loop)
        found = stays([*apart, *_square(loop, pairs)], loop.place.size)
        return replace(found, own_excess=np.array([*(x.value for x in apart), *_turn(loop, pairs)]))

    return rows


def _turn(loop: Loop, pairs: Sequence[tuple[int, int]]) -> list[float]:
    """By what bⱼ · aᵢ change, but for the sign, where the second body turns back by 2 sin(θ/2): the
    turn from a to b as the quaternion (w, e), the eigenvector of its four by four matrix."""
    first, second = (np.array([axis.value for axis in axes]) for axes in loop.axes)
    R = first @ second.T
    odd = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    K = np.block([[np.trace(R), odd], [odd[:, None], R + R.T - np.trace(R) * np.eye(3)]])
    w, *e = np.linalg.eigh(K)[1][:, -1]
    back = 2.0 * np.sign(w) * (np.array(e) @ first)
    return [float(back @ cross(second[j], first[i])) for i, j in pairs]


def _positions(*phi: Callable[[Loop], list[Jet]]) -> Callable[[Loop], Rows]:
    return lambda loop: stays([x for part in phi for x in part(loop)], loop.place.size)


def _cross_angle(loop: Loop) -> list[Jet]:
    """A universal joint's two axes, one fixed in each body, are at right angles."""
    axes = (loop.closure.axis, loop.closure.axis2 or loop.closure.axis)
    arms = [
        direction(loop.place, loop.state, body, placed(loop.state, at)[1] @ loop.state.vector(axis))
        for body, at, axis in zip(loop.closure.bodies, loop.closure.placements, axes)
    ]
    return [dot(*arms)]


def _advance(loop: Loop) -> Rows:
    """d(a · (p₂ − p₁))/dt − pitch/2π a · (ω₂ − ω₁) = 0: velocities only, the turn has no
    single-valued angle."""
    axis, slide = loop.axes[0][2], dot(loop.axes[0][2], loop.gap)
    per_radian = loop.state.value(loop.closure.pitch) / (2.0 * np.pi)
    spin = np.zeros(loop.place.size)
    for body, sign in zip(loop.closure.bodies, (-1.0, 1.0)):
        if body != GROUND:
            spin[loop.place.twist(body)][:3] += sign * axis.value
    first, second = (loop.state.frames[body].omega for body in loop.closure.bodies)
    gamma = -slide.rest + per_radian * axis.rate @ (second - first)
    return Rows(
        (slide.over - per_radian * spin)[None, :], np.array([gamma]), np.zeros(1), np.zeros(0)
    )


_cylindrical = _positions(lambda loop: _across(loop, (0, 1)), _parallel)


def _screw(loop: Loop) -> Rows:
    return stacked([_cylindrical(loop), _advance(loop)], loop.place.size)


_ROWS: dict[str, _Closing] = {
    "revolute": _positions(_meeting, lambda loop: [] if loop.plane else _parallel(loop)),
    "ball": _positions(_meeting),
    "universal": _positions(_meeting, _cross_angle),
    "fixed": _locked(_meeting, (0, 1)),
    "prismatic": _locked(lambda loop: _across(loop, (0,) if loop.plane else (0, 1)), (0, 2)),
    "cylindrical": _cylindrical,
    "planar": _positions(lambda loop: _across(loop, (2,)), _parallel),
    "screw": _screw,
}
