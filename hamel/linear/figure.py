"""The mechanism as lines: joints, centres of mass and round bodies, moved along a mode and drawn as
SVG that plays by itself."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np

from derive.joints.records import Matrix, Vector
from derive.linearize.sensitivity import Mode
from derive.linearize.study import Study
from derive.mechanics.records import System
from derive.mechanics.tree import ground_positions, ground_rotations, link_direction, link_point
from derive.model.records import Rolling

FRAMES = 24
AROUND = 25  # points on a ring
WIDTH, HEIGHT, MARGIN = 420.0, 260.0, 24.0
SWING = 0.12  # how far the point that moves most is moved, relative to the figure's size
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
AZIMUTH, ELEVATION = math.radians(-35), math.radians(18)


def lines(system: System) -> list[ca.SX]:
    """Polylines over (q, p), 3 × k each: from joint to joints and centre of mass on every link, and
    round what rolls."""
    rotations = ground_rotations(system.links)
    positions = ground_positions(system.links, rotations)
    found = []
    for i, link in enumerate(system.links):
        spokes = [child.a for child in system.links if child.parent == i]
        mass = link.inertia.mass
        if not (isinstance(mass, float) and mass == 0.0):
            spokes.append([m / mass for m in link.inertia.moment])
        found += [_points(positions[i], rotations[i], [link.b, spoke]) for spoke in spokes]
    found += [
        _ring(system, constraint, positions, rotations)
        for constraint in system.model.constraints
        if isinstance(constraint, Rolling)
    ]
    return found


def _points(position: Vector, rotation: Matrix, points: list[Vector]) -> ca.SX:
    R, origin = ca.vertcat(*[ca.horzcat(*row) for row in rotation]), ca.vertcat(*position)
    return ca.horzcat(*[origin + ca.mtimes(R, ca.vertcat(*point)) for point in points])


def _ring(
    system: System, constraint: Rolling, positions: list[Vector], rotations: list[Matrix]
) -> ca.SX:
    """The circle of a wheel with two of its spokes, or a great circle of a sphere."""
    s, place = system.symbols, dict(system.places)[constraint.body]
    centre = link_point(place, s.vector(constraint.centre))
    axis = np.array(
        [
            float(x) if not isinstance(x, ca.SX) or x.is_constant() else 0.0
            for x in link_direction(place, s.vector(constraint.axis))
        ]
    )
    axis = axis / (np.linalg.norm(axis) or 1.0)
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    second, radius = np.cross(axis, first), s.scalar(constraint.radius)
    turns = [
        math.cos(a) * first + math.sin(a) * second for a in np.linspace(0, 2 * math.pi, AROUND)
    ]
    rim = [[c + radius * float(d) for c, d in zip(centre, turn)] for turn in turns]
    return _points(positions[place.link], rotations[place.link], [*rim, centre])


def projection(system: System) -> np.ndarray:
    """2 × 3: right and up on the page."""
    plane = system.model.plane
    if plane:
        return np.array(
            [[1.0 if "xyz"[k] == letter else 0.0 for k in range(3)] for letter in plane]
        )
    g = np.array([float(x) if not isinstance(x, ca.SX) else math.nan for x in system.gravity])
    values = dict(
        zip((x.name for x in system.model.parameters), (x.value for x in system.model.parameters))
    )
    if np.any(np.isnan(g)):
        symbols = [system.p]
        g = (
            ca.Function("g", symbols, [ca.vertcat(*system.gravity)])(
                [values[x.name] for x in system.model.parameters if x.name not in system.constants]
            )
            .full()
            .ravel()
        )
    up = -g / np.linalg.norm(g) if np.any(g) else np.array([0.0, 0.0, 1.0])
    ahead = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    side = np.cross(up, ahead)
    across = math.cos(AZIMUTH) * ahead + math.sin(AZIMUTH) * side
    away = -math.sin(AZIMUTH) * ahead + math.cos(AZIMUTH) * side
    return np.array([across, math.cos(ELEVATION) * up + math.sin(ELEVATION) * away])


def moving(study: Study, mode: Mode) -> str:
    """An SVG element that repeats the mode: an oscillation over one period, a growth or decay over
    two time constants."""
    system, motions = study.equations.system, study.motions({})
    drawn = lines(system)
    if not drawn:
        return ""
    nq, p = system.q.numel(), motions.p[0]
    function = ca.Function("lines", [system.q, system.p], drawn)
    T = ca.Function(
        "T", [a.symbols for a in study.equations.arguments], [ca.densify(study.linear.T)]
    )
    change = (T(0.0, motions.x[0], motions.u[0], p).full() @ mode.vector)[:nq]
    change = np.where([k in _carried_along(study) for k in range(nq)], 0.0, change)
    view = projection(system)

    def seen(q: np.ndarray) -> list[np.ndarray]:
        return [view @ x.full() for x in _several(function(q, p))]

    rest = seen(motions.x[0, :nq])
    size = float(np.ptp(np.hstack(rest), axis=1).max()) or 1.0
    reach = _reach(seen, rest, motions.x[0, :nq], change)
    factors = _factors(mode.eigenvalue)
    frames = [
        seen(motions.x[0, :nq] + (change * f).real * SWING * size / (reach or 1.0)) for f in factors
    ]
    return _svg(rest, frames, _seconds(mode.eigenvalue))


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
    everything = np.hstack([x for frame in (rest, *frames) for x in frame])
    low, high = everything.min(axis=1), everything.max(axis=1)
    scale = min(
        (WIDTH - 2 * MARGIN) / max(high[0] - low[0], 1e-12),
        (HEIGHT - 2 * MARGIN) / max(high[1] - low[1], 1e-12),
    )
    offset = np.array([WIDTH, HEIGHT]) / 2 - scale * (low + high) / 2

    def text(points: np.ndarray) -> str:
        placed = scale * points + offset[:, np.newaxis]
        return " ".join(f"{x:.1f},{HEIGHT - y:.1f}" for x, y in placed.T)

    parts = [f'<polyline class="still" points="{text(x)}"/>' for x in rest]
    for i, still in enumerate(rest):
        values = ";".join(text(frame[i]) for frame in frames)
        play = f'<animate attributeName="points" dur="{seconds:.2f}s" repeatCount="indefinite" values="{values}"/>'
        colour = COLOURS[i % len(COLOURS)]
        parts.append(
            f'<polyline fill="none" stroke="{colour}" stroke-width="2" points="{text(still)}">{play}</polyline>'
        )
    size = f'viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" width="{WIDTH:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" class="mode">'
    return "\n".join([head, *parts, "</svg>"])
