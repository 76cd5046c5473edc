"""The mechanism as lines: joints, centres of mass and round bodies, moved along a mode and drawn as
SVG that plays by itself."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import numpy as np

from derive.expressions.scalars import Matrix, Vector
from derive.linearize.sensitivity import Mode
from derive.linearize.study import Study
from derive.mechanics.records import System
from derive.mechanics.recursions.tree import (
    ground_positions,
    ground_rotations,
    link_direction,
    link_point,
)
from derive.model.constraint_records import Rolling
from hamel.draw.canvas import COLOURS, coordinates, element

FRAMES = 24
AROUND = 25  # points on a ring
WIDTH, HEIGHT, MARGIN = 420, 260, 24
DRAWN = COLOURS[:-1]  # black is for outlines
SWING = 0.12  # how far the point that moves most is moved, relative to the figure's size
AZIMUTH, ELEVATION = math.radians(-35), math.radians(18)


def lines(system: System) -> list[ca.SX]:
    """Polylines over (q, p), 3 × k each: from joint to joints and centre of mass on every link, and
    round what rolls."""
    rotations = ground_rotations(system.links)
    positions = ground_positions(system.links, rotations)
    polylines = []
    for i, link in enumerate(system.links):
        for end in _ends(system, i):
            polylines.append(_points(positions[i], rotations[i], [link.b, end]))
    for constraint in system.model.constraints:
        if isinstance(constraint, Rolling):
            polylines.append(_ring(system, constraint, positions, rotations))
    return polylines


def _ends(system: System, i: int) -> list[Vector]:
    """Joints that a link carries, and its centre of mass, in its own frame."""
    ends = [child.a for child in system.links if child.parent == i]
    inertia = system.links[i].inertia
    massless = isinstance(inertia.mass, float) and inertia.mass == 0.0
    return ends if massless else [*ends, [m / inertia.mass for m in inertia.moment]]


def _points(position: Vector, rotation: Matrix, points: list[Vector]) -> ca.SX:
    R, origin = ca.vertcat(*[ca.horzcat(*row) for row in rotation]), ca.vertcat(*position)
    return ca.horzcat(*[origin + ca.mtimes(R, ca.vertcat(*point)) for point in points])


def _ring(
    system: System, constraint: Rolling, positions: list[Vector], rotations: list[Matrix]
) -> ca.SX:
    """The circle of a wheel with two of its spokes, or a great circle of a sphere."""
    s, place = system.symbols, dict(system.places)[constraint.body]
    centre = link_point(place, s.vector(constraint.centre))
    radius = s.scalar(constraint.radius)
    first, second = _across(_numbers(link_direction(place, s.vector(constraint.axis))))
    rim = []
    for angle in np.linspace(0, 2 * math.pi, AROUND):
        direction = math.cos(angle) * first + math.sin(angle) * second
        rim.append([c + radius * float(d) for c, d in zip(centre, direction)])
    return _points(positions[place.link], rotations[place.link], [*rim, centre])


def _numbers(vector: Vector) -> np.ndarray:
    """Its entries; zero for those that are no numbers."""
    return np.array(
        [0.0 if isinstance(x, ca.SX) and not x.is_constant() else float(x) for x in vector]
    )


def _across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that are perpendicular to the axis and to each other."""
    axis = axis / (np.linalg.norm(axis) or 1.0)
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def projection(system: System) -> np.ndarray:
    """2 × 3: right and up on the page."""
    if system.model.plane:
        return np.array([np.eye(3)["xyz".index(letter)] for letter in system.model.plane])
    g = _gravity(system)
    up = -g / np.linalg.norm(g) if np.any(g) else np.array([0.0, 0.0, 1.0])
    ahead = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    side = np.cross(up, ahead)
    across = math.cos(AZIMUTH) * ahead + math.sin(AZIMUTH) * side
    away = -math.sin(AZIMUTH) * ahead + math.cos(AZIMUTH) * side
    return np.array([across, math.cos(ELEVATION) * up + math.sin(ELEVATION) * away])


def _gravity(system: System) -> np.ndarray:
    """At the parameters of the file, m/s²."""
    function = ca.Function("g", [system.own_p], [ca.vertcat(*system.gravity)])
    return function(list(system.own_parameters)).full().ravel()


def moving(study: Study, mode: Mode) -> str:
    """An SVG element that repeats the mode: an oscillation over one period, a growth or decay over
    two time constants."""
    system, motions = study.equations.system, study.motions({})
    polylines = lines(system)
    if not polylines:
        return ""
    function = ca.Function("lines", [system.q, system.own_p], polylines)
    view, p, q = projection(system), motions.p[0], motions.x[0, : system.q.numel()]

    def seen(q: np.ndarray) -> list[np.ndarray]:
        return [view @ x.full() for x in _several(function(q, p))]

    rest = seen(q)
    if not any(np.ptp(line, axis=1).any() for line in rest):
        return ""  # points alone: nothing of it would be seen
    change = _change(study, mode)
    size = float(np.ptp(np.hstack(rest), axis=1).max()) or 1.0
    swing = SWING * size / (_reach(seen, rest, q, change) or 1.0)
    frames = [seen(q + (change * f).real * swing) for f in _factors(mode.eigenvalue)]
    return _svg(rest, frames, _seconds(mode.eigenvalue))


def _change(study: Study, mode: Mode) -> np.ndarray:
    """δq of the mode."""
    motions, nq = study.motions({}), study.equations.system.q.numel()
    arguments = [a.symbols for a in study.equations.arguments]
    T = ca.Function("T", arguments, [ca.densify(study.linear.T)])
    matrix = T(0.0, motions.x[0], motions.u[0], motions.p[0]).full()
    change = (matrix @ mode.vector)[:nq]
    change[[k for k in _carried_along(study) if k < nq]] = 0.0
    return change


def _carried_along(study: Study) -> set[int]:
    """Cyclic coordinates are left where they are: what a mode does to place and heading would hide
    the rest."""
    return {study.linear.independent[k] for k in study.cyclic}


def _several(found) -> list:
    return list(found) if isinstance(found, list | tuple) else [found]


def _reach(seen, rest: list[np.ndarray], q: np.ndarray, change: np.ndarray) -> float:
    """How far the point that moves most moves per unit of the mode."""
    small = 1e-4
    parts = [change.real, change.imag]
    moved = [x - y for part in parts for x, y in zip(seen(q + small * part), rest)]
    return max((float(np.max(np.abs(x))) for x in moved), default=0.0) / small


def _factors(eigenvalue: complex) -> list[complex]:
    if eigenvalue.imag:
        return [complex(np.exp(2j * math.pi * k / FRAMES)) for k in range(FRAMES + 1)]
    ways = [math.exp(2 * k / FRAMES - 2) for k in range(FRAMES + 1)]
    return [complex(x) for x in (ways if eigenvalue.real > 0 else reversed(ways))]


def _seconds(eigenvalue: complex) -> float:
    """Real time where an eye can follow it."""
    time = (
        2 * math.pi / abs(eigenvalue.imag) if eigenvalue.imag else 2 / (abs(eigenvalue.real) or 1.0)
    )
    return min(max(time, 1.0), 6.0)


def _svg(rest: list[np.ndarray], frames: list[list[np.ndarray]], seconds: float) -> str:
    place = _fitted(np.hstack([x for frame in (rest, *frames) for x in frame]))
    parts = [element("polyline", class_="still", points=place(x)) for x in rest]
    for i, still in enumerate(rest):
        play = element(
            "animate",
            attributeName="points",
            dur=f"{seconds:.2f}s",
            repeatCount="indefinite",
            values=";".join(place(frame[i]) for frame in frames),
        )
        colour = DRAWN[i % len(DRAWN)]
        line = {"fill": "none", "stroke": colour, "stroke_width": 2, "points": place(still)}
        parts.append(element("polyline", play, **line))
    size = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" class="mode">'
    return "\n".join([head, *parts, "</svg>"])


def _fitted(points: np.ndarray) -> Callable[[np.ndarray], str]:
    """Coordinates on the page, on which all of these points find room."""
    low, high = points.min(axis=1), points.max(axis=1)
    room = np.array([WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN])
    scale = float(np.min(room / np.maximum(high - low, 1e-12)))
    offset = np.array([WIDTH, HEIGHT]) / 2 - scale * (low + high) / 2

    def place(line: np.ndarray) -> str:
        pixels = scale * line + offset[:, np.newaxis]
        return coordinates((x, HEIGHT - y) for x, y in pixels.T)

    return place
