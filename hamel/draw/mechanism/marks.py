"""Shapes laid on the paper: lines, areas and discs in pixels, the far ones first."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hamel.draw.mechanism.records import Mark, Point, Shape, Vector
from hamel.draw.mechanism.scene import Scene

COILS, AMPLITUDE, LEAD = 7, 4.5, 0.14  # of a spring: windings, half width (px), straight ends
CUP, PISTON = 4.6, 3.2  # of a damper: half widths in pixels
HEAD = (7.5, 2.7)  # of an arrow: length and half width in pixels
QUARTER = 9  # corners of a quarter disc


def marks(scene: Scene, shapes: Sequence[Shape]) -> list[Mark]:
    """In space by depth, in the plane in the order given."""
    order = list(range(len(shapes)))
    if not scene.view.flat:
        depths = [_depth(scene, shape) for shape in shapes]
        order.sort(key=lambda k: (depths[k], k))
    return [mark for k in order for mark in laid(scene, shapes[k])]


def _depth(scene: Scene, shape: Shape) -> float:
    """Of the middle; floors lie behind all."""
    if shape.style in ("floor", "grid", "hatch"):
        return -math.inf
    depths = [scene.view.depth(scene.place(at)) for at in shape.spots]
    return round(float(np.mean(depths)), 6)


def laid(scene: Scene, shape: Shape) -> list[Mark]:
    """One shape."""
    points = [scene.view.paper(scene.place(at)) for at in shape.spots]
    match shape.kind:
        case "dot":
            return [Mark(shape.style, (points[0],), radius=shape.size)]
        case "mass":
            return quartered(points[0], shape.size)
        case "spring":
            return [Mark("spring", zigzag(points[0], points[1], shape.size))]
        case "damper":
            return dashpot(points[0], points[1], shape.size)
        case "solid":
            return _solid(shape, points)
        case _:
            return [Mark(shape.style, tuple(points), shape.closed)]


def _solid(shape: Shape, points: Sequence[Point]) -> list[Mark]:
    """The outline, then the faces that look at the reader."""
    result = [Mark(shape.style, tuple(hull(points)), True)]
    for face in shape.faces:
        corners = tuple(points[k] for k in face)
        if area(corners) < 0:
            result.append(Mark(shape.style, corners, True))
    return result


def area(points: Sequence[Point]) -> float:
    """Signed; negative where a face whose corners go counter-clockwise looks at the reader, as
    pixels count downwards."""
    total = 0.0
    for (x0, y0), (x1, y1) in zip(points, (*points[1:], points[0])):
        total += x0 * y1 - x1 * y0
    return total / 2


def hull(points: Sequence[Point]) -> list[Point]:
    """The convex hull (Andrew 1979)."""
    order = sorted({(round(x, 3), round(y, 3)) for x, y in points})
    if len(order) < 3:
        return order
    return _half(order)[:-1] + _half(order[::-1])[:-1]


def _half(order: Sequence[Point]) -> list[Point]:
    chain: list[Point] = []
    for point in order:
        while len(chain) > 1 and area((chain[-2], chain[-1], point)) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _along(start: Point, end: Point, beside: float) -> tuple[Vector, Vector, Vector, float]:
    """Start, unit vector, normal and length of a line moved sideways."""
    a, b = np.array(start), np.array(end)
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length if length > 0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    return a + beside * across, along, across, length


def _point(at: Vector) -> Point:
    return float(at[0]), float(at[1])


def zigzag(start: Point, end: Point, beside: float) -> tuple[Point, ...]:
    """A spring."""
    a, along, across, length = _along(start, end, beside)
    wire = [(0.0, 0.0)]
    for k in range(2 * COILS):
        way = LEAD + (1 - 2 * LEAD) * (k + 0.5) / (2 * COILS)
        wire.append((way * length, AMPLITUDE if k % 2 else -AMPLITUDE))
    wire = [wire[0], (LEAD * length, 0.0), *wire[1:], ((1 - LEAD) * length, 0.0), (length, 0.0)]
    return tuple(_point(a + x * along + y * across) for x, y in wire)


def dashpot(start: Point, end: Point, beside: float) -> list[Mark]:
    """A cup, and a piston in it."""
    a, along, across, length = _along(start, end, beside)

    def line(*wire: Point) -> Mark:
        return Mark("damper", tuple(_point(a + x * along + y * across) for x, y in wire))

    bottom, middle, rim = 0.38 * length, 0.52 * length, 0.64 * length
    return [
        line((0.0, 0.0), (bottom, 0.0)),
        line((rim, CUP), (bottom, CUP), (bottom, -CUP), (rim, -CUP)),
        line((middle, PISTON), (middle, -PISTON)),
        line((middle, 0.0), (length, 0.0)),
    ]


def quartered(at: Point, radius: float) -> list[Mark]:
    """The sign of a centre of mass."""
    x, y = at
    result = [Mark("mass", (at,), radius=radius)]
    for start in (0.0, math.pi):
        angles = np.linspace(start, start + math.pi / 2, QUARTER)
        arc = [(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles]
        result.append(Mark("quarter", (at, *arc), True))
    return result


def arrow_head(style: str, before: Point, tip: Point) -> Mark:
    """A head at the tip of a line that comes from `before`."""
    _, along, across, length = _along(before, tip, 0.0)
    long, wide = HEAD
    size = min(1.0, max(length, 1e-9) / long) if length < long else 1.0
    back = np.array(tip) - long * size * along
    corners = (np.array(tip), back + wide * size * across, back - wide * size * across)
    return Mark(f"{style}-head", tuple(_point(x) for x in corners), True)


def arrow(style: str, points: Sequence[Point], both: bool = False) -> list[Mark]:
    """A line with a head at its end; the line stops inside the head."""
    heads = [arrow_head(style, _before(points), points[-1])]
    if both:
        heads.append(arrow_head(style, _before(points[::-1]), points[0]))
    return [Mark(style, tuple(points)), *heads]


def _before(points: Sequence[Point]) -> Point:
    """A point of the line about a head's length before its end."""
    end = points[-1]
    for point in reversed(points[:-1]):
        if math.dist(point, end) >= HEAD[0]:
            return point
    return points[0]
