"""Joints and the ground as shapes: pins on their bearings, blocks on their guides, cylinders,
balls, crosses, and hatching where something stands on the ground.

Sizes are in pixels; a shape is in metres, so that it turns with what carries it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hamel.draw.mechanism.anchors import Anchor
from hamel.draw.mechanism.bodies import firsts
from hamel.draw.mechanism.records import GROUND, Shape, Vector, spot
from hamel.draw.mechanism.scene import Scene
from hamel.draw.mechanism.solids import box, cylinder
from hamel.draw.mechanism.vectors import across, cross

PIN = 4.5
BEARING = (11.0, 17.0)  # half width and height of the triangle under a pin
HATCH = (5.0, 6.0)  # between strokes, and how far they go
BLOCK = (16.0, 12.0)  # half sides of a block
ROOM = 26.0  # of a guide beyond its block
COLLAR = (13.0, 6.5, 6.5)
BARREL = (11.0, 6.5)  # half length and radius of a hinge
BALL = 6.5
PLATE = (20.0, 13.0)  # half sides of a piece of ground
APART = 18.0  # between joints that meet in one point


def joint_shapes(scene: Scene, scale: float = 1.0) -> list[Shape]:
    """The symbols of all joints and closures; `scale` makes them smaller where all is crowded."""
    shapes: list[Shape] = []
    for anchor in scene.anchors:
        symbols = PLANAR if scene.view.flat else SPATIAL
        if anchor.type in symbols:
            shapes += symbols[anchor.type](scene, anchor, scale)
    return shapes


def bearings(scene: Scene, scale: float = 1.0) -> list[Shape]:
    """Where joints stand on the ground, each place once."""
    standing = [x for x in scene.anchors if GROUND in x.bodies and x.type in STANDING]
    places = [anchor.at(anchor.bodies.index(GROUND)) for anchor in standing]
    shapes: list[Shape] = []
    for k in firsts(scene, places):
        anchor, at = standing[k], places[k]
        if scene.view.flat:
            shapes += bearing(scene, at, hangs(scene, anchor), scale)
        else:
            shapes += _foot(scene, at, anchor.axes[anchor.bodies.index(GROUND)], scale)
    return shapes


def hangs(scene: Scene, anchor: Anchor) -> bool:
    """Whether its body goes down from a pin, so that the ground is above."""
    other = anchor.bodies[1 - anchor.bodies.index(GROUND)]
    here = scene.place(anchor.spot(0))
    points = [scene.pose(other).point(x) for x in scene.held[other + 1]]
    points.append(scene.pose(other).point(scene.com(other)))
    away = [(x - here) @ scene.view.up for x in points]
    aside = [abs((x - here) @ scene.view.right) for x in points]
    return bool(min(away) < 0 and -min(away) > max(*away, 0.8 * max(aside)))


def bearing(scene: Scene, at: Vector, above: bool, scale: float) -> list[Shape]:
    """A triangle with hatching under (or above) a pin of the plane."""
    right, up = scene.view.right, scene.view.up * (-1.0 if above else 1.0)
    half, height = (x * scale * scene.view.pixel for x in BEARING)
    left, other = at - half * right - height * up, at + half * right - height * up
    sides = Shape("line", "support", tuple(spot(GROUND, x) for x in (at, left, other)), closed=True)
    wide = 1.6 * half
    floor = (at - wide * right - height * up, at + wide * right - height * up)
    return [sides, *hatched(scene, floor, -up, scale)]


def hatched(scene: Scene, line: tuple[Vector, Vector], side: Vector, scale: float) -> list[Shape]:
    """A line of the ground with strokes on one side of it."""
    start, end = line
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    pixel = scene.view.pixel * scale
    gap, depth = (x * pixel for x in HATCH)
    strokes = [Shape("line", "ground", (spot(GROUND, start), spot(GROUND, end)))]
    slant = depth * (side - along) / math.sqrt(2)
    for k in range(math.floor(length / gap + 1e-9)):
        foot = start + (k + 1) * gap * along
        if float(np.linalg.norm(foot - start)) <= length:
            strokes.append(Shape("line", "hatch", (spot(GROUND, foot), spot(GROUND, foot + slant))))
    return strokes


def _foot(scene: Scene, at: Vector, axis: Vector, scale: float) -> list[Shape]:
    """In space: a hatched piece of ground under a joint, and the post on which it stands."""
    up = _upward(scene)
    pixel = scene.view.pixel * scale
    level = abs(float(axis @ up)) > 0.7
    drop = (BARREL[0] if level else BARREL[0] + 6) * pixel
    base = at - drop * up
    first, second = _level_axes(scene, up)
    wide, deep = (x * pixel for x in PLATE)
    corners = [
        base + a * wide * first + b * deep * second for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    plate = Shape("line", "floor", tuple(spot(GROUND, x) for x in corners), closed=True)
    post = Shape("line", "post", (spot(GROUND, at), spot(GROUND, base)))
    return [plate, *_slanted(scene, corners, up, pixel), post]


def _slanted(scene: Scene, corners: Sequence[Vector], up: Vector, pixel: float) -> list[Shape]:
    """Strokes below the edge of a piece of ground that is nearest to the reader."""
    edges = list(zip(corners, (*corners[1:], corners[0])))
    start, end = max(edges, key=lambda edge: float((edge[0] + edge[1]) @ scene.view.toward))
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    # rounding must not decide whether there is a further stroke
    count = max(math.floor(length / (HATCH[0] * pixel) + 1e-9), 2)
    slant = HATCH[1] * pixel * (-up - along) / math.sqrt(2)
    feet = [start + (k + 1) / count * length * along for k in range(count)]
    return [Shape("line", "hatch", (spot(GROUND, x), spot(GROUND, x + slant))) for x in feet]


def _upward(scene: Scene) -> Vector:
    """The vertical of the drawing among the ground's axes."""
    axes = np.vstack([np.eye(3), -np.eye(3)])
    return axes[int(np.argmax(axes @ scene.view.up))]


def _level_axes(scene: Scene, up: Vector) -> tuple[Vector, Vector]:
    first = cross(scene.view.toward, up)
    first = -np.eye(3)[int(np.argmax(np.abs(first)))]
    return first, cross(up, first)


# the plane


def _pin(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    return [Shape("dot", "pin", (anchor.spot(1),), size=PIN * scale)]


def _slider(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A block on the child; its guide on the parent, hatched where that is the ground."""
    carrier, child = anchor.bodies
    axis, pixel = anchor.axes[0], scene.view.pixel * scale
    here = scene.pose(carrier).inside(scene.place(anchor.spot(1)))
    low, high = _way(scene, anchor, here)
    start, end = (
        anchor.points[0] + (low - ROOM * pixel) * axis,
        anchor.points[0] + (high + ROOM * pixel) * axis,
    )
    across = scene.pose(child).inside(scene.pose(child).position + _across(scene, anchor))
    half = np.array([BLOCK[0] * pixel, BLOCK[1] * pixel])
    at, along = anchor.points[1], anchor.axes[1]
    corners = [
        at + a * half[0] * along + b * half[1] * across
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    block = Shape("line", "block", tuple(spot(child, x) for x in corners), closed=True)
    if carrier != GROUND:
        return [Shape("line", "rail", (spot(carrier, start), spot(carrier, end))), block]
    below = -half[1] * _across(scene, anchor)
    floor = hatched(scene, (start + below, end + below), -_across(scene, anchor), scale)
    return [*floor, block]


def _across(scene: Scene, anchor: Anchor) -> Vector:
    """To the upper side of a guide in the plane, in ground axes."""
    axis = scene.pose(anchor.bodies[0]).rotation @ anchor.axes[0]
    across = cross(scene.view.toward, axis)
    return across if across @ scene.view.up >= -1e-9 else -across


def _way(scene: Scene, anchor: Anchor, here: Vector) -> tuple[float, float]:
    """How far the joint goes along its axis: its place, its zero, and what a motion reaches."""
    at = float((here - anchor.points[0]) @ anchor.axes[0])
    spans = [scene.spans[name] for name in anchor.coordinates if name in scene.spans]
    lows, highs = [low for low, _ in spans], [high for _, high in spans]
    if anchor.type != "prismatic" or not anchor.coordinates:
        return min(at, *lows, at), max(at, *highs, at)
    return min(at, 0.0, *lows), max(at, 0.0, *highs)


# space


def _hinge(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A cylinder about the axis, which shows at both ends."""
    return [*_axis(scene, anchor, scale, 1.9), _barrel(scene, anchor, scale, 1.0)]


def _barrel(scene: Scene, anchor: Anchor, scale: float, longer: float) -> Shape:
    pixel = scene.view.pixel * scale
    at = np.array(anchor.spot(0).at)
    half, radius = BARREL[0] * longer * pixel, BARREL[1] * pixel
    return cylinder(anchor.bodies[0], at, anchor.axes[0], half, radius, "joint")


def _axis(scene: Scene, anchor: Anchor, scale: float, longer: float) -> list[Shape]:
    """The axis of a joint as a thin line of dashes and dots."""
    reach = BARREL[0] * longer * scale * scene.view.pixel
    at, axis = np.array(anchor.spot(0).at), anchor.axes[0]
    ends = (spot(anchor.bodies[0], at - reach * axis), spot(anchor.bodies[0], at + reach * axis))
    return [Shape("line", "axis", ends)]


def _collar(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A block that slides: on its parent, the child runs through it."""
    carrier, child = anchor.bodies
    pixel = scene.view.pixel * scale
    here = scene.pose(carrier).inside(scene.place(anchor.spot(1)))
    low, high = _way(scene, anchor, here)
    axis = anchor.axes[0]
    rail = [anchor.points[0] + reach * axis for reach in (low, high + COLLAR[0] * pixel)]
    line = Shape("line", "rail", tuple(spot(carrier, x) for x in rail))
    halves = np.array(COLLAR) * pixel
    axes = _triad(axis)
    block = box(carrier, anchor.points[0], axes, halves, "joint")
    if scene.spans or float(np.linalg.norm(here - anchor.points[0])) < 2 * halves[0]:
        return [line, block]
    end = Shape("dot", "pin", (anchor.spot(1),), size=3.0 * scale)
    return [line, block, end] if child != GROUND else [line, block]


def _triad(axis: Vector) -> Vector:
    """Columns: the axis and two across."""
    side = across(axis)
    return np.column_stack([axis, side, cross(axis, side)])


def _sleeve(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    return [*_axis(scene, anchor, scale, 2.6), _barrel(scene, anchor, scale, 1.5)]


def _nut(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A sleeve with a thread."""
    barrel = _barrel(scene, anchor, scale, 1.5)
    pixel = scene.view.pixel * scale
    at, triad = np.array(anchor.spot(0).at), _triad(anchor.axes[0])
    angles = np.linspace(0, 6 * math.pi, 40)
    half, radius = 1.5 * BARREL[0] * pixel, BARREL[1] * pixel
    thread = [
        at
        + triad
        @ np.array([half * (a / (3 * math.pi) - 1), radius * math.cos(a), radius * math.sin(a)])
        for a in angles
    ]
    line = Shape("line", "fine", tuple(spot(anchor.bodies[0], x) for x in thread))
    return [*_axis(scene, anchor, scale, 2.6), barrel, line]


def _socket(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A ball."""
    return [Shape("dot", "ball", (anchor.spot(1),), size=BALL * scale)]


def _cross(scene: Scene, anchor: Anchor, scale: float) -> list[Shape]:
    """A universal joint: a ring with the cross of its two axes, one on each body."""
    pixel = scene.view.pixel * scale
    reach = BARREL[0] * pixel
    first, second = anchor.axes[0], anchor.axis2
    lines = []
    for body, at, axis in zip(anchor.bodies, anchor.points, (first, second)):
        if axis is not None:
            ends = (spot(body, at - reach * axis), spot(body, at + reach * axis))
            lines.append(Shape("line", "cross", ends))
            lines += [Shape("dot", "pin", (end,), size=2.6 * scale) for end in ends]
    return [Shape("dot", "pin", (anchor.spot(1),), size=PIN * scale), *lines]


PLANAR = {"revolute": _pin, "prismatic": _slider}
SPATIAL = {
    "revolute": _hinge,
    "prismatic": _collar,
    "cylindrical": _sleeve,
    "screw": _nut,
    "ball": _socket,
    "universal": _cross,
}
STANDING = ("revolute", "cylindrical", "ball", "universal", "screw")
