"""Paths a second time: ropes as forces, and the length by its own rates.

A rope without friction pulls with one tension T along each straight part, at the points where it
leaves one body and meets the next. What it does round a pulley or cylinder follows: there the body
carries the pulls of both parts. The rate of the length is the same sum over the straight parts,
u · (v₂ − v₁), and is differentiated once more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from derive.expressions.tree import ZERO
from derive.model.records import GROUND, Path, Waypoint
from hamel.verify.reference.closures import NORMAL, triad
from hamel.verify.reference.jets import Jet, direction, dot, point
from hamel.verify.reference.layout import Layout, point_velocity
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array, cross


@dataclass(frozen=True)
class Line:
    """A straight part: from a point of one body to a point of the next, both from the ground's
    origin, along `u`."""

    bodies: tuple[str, str]
    ends: tuple[Array, Array]
    u: Array
    length: float


def pull(path: Path, plane: str, place: Layout, state: State) -> Array:
    """The force along z (nz) of a tension of one newton."""
    force = np.zeros(place.size)
    for line in _lines(path, plane, state):
        for body, end, sign in zip(line.bodies, line.ends, (1.0, -1.0)):
            if body != GROUND:
                arm = end - state.frames[body].origin
                force[place.twist(body)] += sign * point_velocity(arm).T @ line.u
    return force


def length(path: Path, plane: str, place: Layout, state: State) -> Jet:
    """The length with its rates: ẍ = over ż + rest."""
    return _planar(path, plane, place, state) if plane else _spatial(path, place, state)


def _lines(path: Path, plane: str, state: State) -> list[Line]:
    if plane:
        return _planar_lines(path, plane, state)
    lines: list[Line] = []
    points = path.points
    for k, (first, second) in enumerate(pairwise(points)):
        if _is_round(first):
            lines += _helix_lines(points[k - 1], first, second, state)
        elif not _is_round(second):
            ends = (_here(first, state), _here(second, state))
            gap = ends[1] - ends[0]
            size = float(np.linalg.norm(gap))
            lines.append(Line((first.body, second.body), ends, gap / size, size))
    return lines


def _is_round(x: Waypoint) -> bool:
    return x.radius != ZERO


def _here(x: Waypoint, state: State) -> Array:
    frame = state.frames[x.body]
    return frame.origin + frame.point(state.vector(x.point))


def _planar_lines(path: Path, plane: str, state: State) -> list[Line]:
    """The line at the angle β + asin(δ/d) from the line of the centres touches both circles, each
    at its centre less ρ times the line's left normal."""
    lines: list[Line] = []
    normal = NORMAL[plane]
    for first, second in zip(path.points, path.points[1:]):
        start, end = _here(first, state), _here(second, state)
        one, other = (x.side * state.value(x.radius) for x in (first, second))
        gap = end - start
        size = float(np.linalg.norm(gap))
        lean = -np.arcsin((other - one) / size)
        u = (np.cos(lean) * gap + np.sin(lean) * cross(normal, gap)) / size
        left = cross(normal, u)
        ends = (start - one * left, end - other * left)
        lines.append(Line((first.body, second.body), ends, u, size * float(np.cos(lean))))
    return lines


def _planar(path: Path, plane: str, place: Layout, state: State) -> Jet:
    """Of each part u · (ċ₂ − ċ₁) between the centres: round a pulley the two tangent points turn
    with its body by the same ρ ω, which cancels. u turns by (n · ċ)/t with its normal n."""
    lines = _planar_lines(path, plane, state)
    normal, total = NORMAL[plane], 0.0
    rate, over, rest = 0.0, np.zeros(place.size), 0.0
    for line, first, second in zip(lines, path.points, path.points[1:]):
        gap = _centre(second, place, state) - _centre(first, place, state)
        across = float(cross(normal, line.u) @ gap.rate)
        rate += float(line.u @ gap.rate)
        over += line.u @ gap.over
        rest += float(line.u @ gap.rest) + across**2 / line.length
        total += line.length
    for k, x in enumerate(path.points[1:-1]):
        if _is_round(x):
            angle = _wrapped(x.side * _between(lines[k].u, lines[k + 1].u, normal))
            total += state.value(x.radius) * (angle + 2.0 * np.pi * x.turns)
    return Jet(np.array(total), np.array(rate), over, np.array(rest))


def _centre(x: Waypoint, place: Layout, state: State) -> Jet:
    return point(place, state, x.body, state.vector(x.point))


def _between(a: Array, b: Array, normal: Array) -> float:
    return float(np.arctan2(cross(a, b) @ normal, a @ b))


def _wrapped(angle: float) -> float:
    """Between −90° and 270°."""
    return angle + 2.0 * np.pi if angle < -np.pi / 2 else angle


def _spatial(path: Path, place: Layout, state: State) -> Jet:
    total = Jet(np.array(0.0), np.array(0.0), np.zeros(place.size), np.array(0.0))
    points = path.points
    for k, (first, second) in enumerate(pairwise(points)):
        if _is_round(first):
            total = total + _helix(points[k - 1], first, second, place, state)
        elif not _is_round(second):
            gap = _centre(second, place, state) - _centre(first, place, state)
            total = total + _root(dot(gap, gap))
    return total


def _cylinder(x: Waypoint, state: State) -> Array:
    """The cylinder's axes in its body, as columns; the last is its own."""
    return triad(state.vector(x.axis))


def _helix(before: Waypoint, x: Waypoint, after: Waypoint, place: Layout, state: State) -> Jet:
    """√(l² + h²), l = √(d₁² − r²) + √(d₂² − r²) + r φ, φ what is left of the angle between the two
    points, seen along the axis, by acos(r/d₁) and acos(r/d₂)."""
    axes = [direction(place, state, x.body, axis) for axis in _cylinder(x, state).T]
    centre, r = _centre(x, place, state), state.value(x.radius)
    ends = [
        [dot(axis, _centre(end, place, state) - centre) for axis in axes] for end in (before, after)
    ]
    angle = _arc(ends[1][1], ends[1][0]) - _arc(ends[0][1], ends[0][0])
    angle = angle.scaled(float(x.side))
    straight = Jet(np.array(0.0), np.array(0.0), np.zeros(place.size), np.array(0.0))
    for end in ends:
        tangent = _root(_shifted(_times(end[0], end[0]) + _times(end[1], end[1]), -(r**2)))
        straight = straight + tangent
        angle = angle - _arc(tangent, _constant(r, place))
    turned = float(np.remainder(float(angle.value) + np.pi / 2, 2 * np.pi) - np.pi / 2)
    angle = _shifted(angle, turned - float(angle.value) + 2.0 * np.pi * x.turns)
    across = straight + angle.scaled(r)
    advance = ends[1][2] - ends[0][2]
    return _root(_times(across, across) + _times(advance, advance))


def _helix_lines(before: Waypoint, x: Waypoint, after: Waypoint, state: State) -> list[Line]:
    """The straight parts: along the axis every part advances in proportion to its length."""
    frame = state.frames[x.body]
    axes, centre, r = frame.rotation @ _cylinder(x, state), _here(x, state), state.value(x.radius)
    start, end = (axes.T @ (_here(y, state) - centre) for y in (before, after))
    polar = [np.arctan2(y[1], y[0]) for y in (start, end)]
    tangents = [float(np.sqrt(y[0] ** 2 + y[1] ** 2 - r**2)) for y in (start, end)]
    leans = [float(np.arctan2(t, r)) for t in tangents]
    touching = [polar[0] + x.side * leans[0], polar[1] - x.side * leans[1]]
    arc = float(np.remainder(x.side * (touching[1] - touching[0]) + np.pi / 2, 2 * np.pi))
    arc = arc - np.pi / 2 + 2.0 * np.pi * x.turns
    across = sum(tangents) + r * arc
    pitch = (end[2] - start[2]) / across
    heights = [start[2] + pitch * tangents[0], end[2] - pitch * tangents[1]]
    feet = [
        centre + axes @ np.array([r * np.cos(a), r * np.sin(a), h])
        for a, h in zip(touching, heights)
    ]
    first, second = _here(before, state), _here(after, state)
    return [
        _line((before.body, x.body), first, feet[0]),
        _line((x.body, after.body), feet[1], second),
    ]


def _line(bodies: tuple[str, str], start: Array, end: Array) -> Line:
    size = float(np.linalg.norm(end - start))
    return Line(bodies, (start, end), (end - start) / size, size)


def _constant(value: float, place: Layout) -> Jet:
    return Jet(np.array(value), np.array(0.0), np.zeros(place.size), np.array(0.0))


def _shifted(a: Jet, by: float) -> Jet:
    return Jet(a.value + by, a.rate, a.over, a.rest)


def _times(a: Jet, b: Jet) -> Jet:
    """Of numbers."""
    rest = a.rest * b.value + a.value * b.rest + 2.0 * a.rate * b.rate
    rate = a.rate * b.value + a.value * b.rate
    return Jet(a.value * b.value, rate, b.value * a.over + a.value * b.over, rest)


def _root(a: Jet) -> Jet:
    """s = √a: 2 s ṡ = ȧ, 2 s s̈ = ä − 2 ṡ²."""
    s = np.sqrt(a.value)
    rate = a.rate / (2.0 * s)
    return Jet(s, rate, a.over / (2.0 * s), (a.rest - 2.0 * rate**2) / (2.0 * s))


def _arc(y: Jet, x: Jet) -> Jet:
    """θ of the point (x, y): r² θ̇ = x ẏ − y ẋ, r² θ̈ = x ÿ − y ẍ − 2 θ̇ (x ẋ + y ẏ)."""
    square = x.value**2 + y.value**2
    rate = (x.value * y.rate - y.value * x.rate) / square
    over = (x.value * y.over - y.value * x.over) / square
    rest = x.value * y.rest - y.value * x.rest
    rest = (rest - 2.0 * rate * (x.value * x.rate + y.value * y.rate)) / square
    return Jet(np.arctan2(y.value, x.value), rate, over, rest)
