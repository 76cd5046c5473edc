"""Bodies as shapes: bars between what they carry, plates, wheels, blocks, and their centres of
mass.

A bar goes as far as the inertia of its body says: a slender rod of length 2 h about its centre of
mass has I = m h² / 3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from derive.model.constraint_records import NoSlip, Rolling
from derive.model.records import Body
from hamel.draw.mechanism.anchors import LOOSE, Anchor
from hamel.draw.mechanism.records import GROUND, Shape, Vector, spot
from hamel.draw.mechanism.scene import NEAR, Scene
from hamel.draw.mechanism.solids import box, cylinder, ring
from hamel.draw.mechanism.vectors import across, cross

SLENDER = 0.15  # of the largest moment of inertia: the smallest one of a rod
MOST_MASSES = 12  # centres of mass are marked where bodies are few
LEAST, MOST = 12.0, 46.0  # pixels: radius of a body that nothing tells the size of
BESIDE = 9.0  # pixels between a centre of mass and a joint that would hide it


def body_shapes(scene: Scene, index: int) -> list[Shape]:
    """All of one body but its joints."""
    body = scene.model.bodies[index]
    rolling = [x for x in scene.model.constraints if isinstance(x, Rolling) and x.body == body.name]
    points = distinct(scene, scene.held[index + 1])
    shapes = [shape for x in rolling for shape in _roller(scene, index, x)]
    alone = len(distinct(scene, [*points, centre(scene, body)])) < 2
    if (len(points) < 2 and rolling) or (alone and _is_block(scene, index)):
        return shapes
    if not points and _on_wheels(scene, body):
        return shapes
    points = points or [centre(scene, body)]
    points = _extended(scene, body, points, bool(rolling))
    if len(points) == 1:
        return shapes if _on_wheels(scene, body) else shapes + _lump(scene, index, body, points[0])
    frame = [*_stay(scene, index, points), *_skeleton(scene, index, points)]
    return [*frame, *shapes, *_bob(scene, index, body, points)]


def distinct(scene: Scene, points: Sequence[Vector]) -> list[Vector]:
    """Each point once."""
    return [points[k] for k in firsts(scene, points)]


def firsts(scene: Scene, points: Sequence[Vector]) -> list[int]:
    """Which points are the first at their place."""
    known, found = np.empty((len(points), 3)), list[int]()
    for k, point in enumerate(points):
        away = np.linalg.norm(known[: len(found)] - point, axis=1)
        if (away > NEAR * scene.size).all():
            known[len(found)] = point
            found.append(k)
    return found


def centre(scene: Scene, body: Body) -> Vector:
    """Of mass, in the body's frame."""
    return scene.numbers.vector(body.com)


def inertia(scene: Scene, body: Body) -> tuple[float, Vector]:
    """Mass (kg), and the tensor (kg m²) about the centre of mass."""
    xx, yy, zz, xy, xz, yz = (scene.numbers.scalar(x) for x in body.inertia)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    mass = scene.numbers.scalar(body.mass)
    return (mass if mass > 0 else 0.0), np.nan_to_num(tensor)


def gyration(scene: Scene, body: Body) -> float:
    """The radius of gyration (m), of all three axes together."""
    mass, tensor = inertia(scene, body)
    return math.sqrt(max(float(np.trace(tensor)), 0.0) / (2 * mass)) if mass > 0 else 0.0


def _is_block(scene: Scene, index: int) -> bool:
    """Whether a guide carries it: its block is the body."""
    return any(a.type == "prismatic" and a.bodies[1] == index for a in scene.anchors)


def _extended(scene: Scene, body: Body, points: list[Vector], rolls: bool) -> list[Vector]:
    """With the ends of the rod that the body is; with the centre of mass where there is but one
    point."""
    com = centre(scene, body)
    reach = [float(np.linalg.norm(point - com)) for point in points]
    far = int(np.argmax(reach))
    line = _is_line(scene, [*points, com])
    if reach[far] <= NEAR * scene.size or not line or rolls:
        return points
    along = (points[far] - com) / reach[far]
    half = min(_half_length(scene, body, along), reach[far])
    ends = [com + half * along, com - half * along]
    if len(points) == 1:
        ends.append(com)
    return distinct(scene, _ends([*points, *ends]) + points)


def _ends(points: Sequence[Vector]) -> list[Vector]:
    """The first and last along the line that they are on."""
    stacked = np.array(points)
    along = stacked[int(np.argmax(np.linalg.norm(stacked - stacked[0], axis=1)))] - stacked[0]
    order = np.argsort(stacked @ along, kind="stable")
    return [points[int(order[0])], points[int(order[-1])]]


def _half_length(scene: Scene, body: Body, along: Vector) -> float:
    """Of the slender rod with the body's inertia; 0 where the body is no rod along that line."""
    mass, tensor = inertia(scene, body)
    if mass <= 0:
        return 0.0
    if scene.view.flat:
        return math.sqrt(3 * max(float(scene.view.toward @ tensor @ scene.view.toward), 0) / mass)
    moments = np.linalg.eigvalsh(tensor)
    slender = float(along @ tensor @ along) < SLENDER * moments[-1]
    return math.sqrt(3 * max(moments[-1], 0.0) / mass) if slender else 0.0


def _is_line(scene: Scene, points: Sequence[Vector]) -> bool:
    stacked = np.array(points)
    values = np.linalg.svd(stacked - stacked.mean(axis=0), compute_uv=False)
    return bool(values[1] < 0.02 * max(values[0], NEAR * scene.size)) if len(points) > 2 else True


def _skeleton(scene: Scene, index: int, points: list[Vector]) -> list[Shape]:
    """A bar, a plate, or in space bars from the joint that carries the body."""
    if _is_line(scene, points):
        first, last = _ends(points)
        return _bar(index, [first, last])
    if scene.view.flat:
        order = _around(scene, points)
        spots = tuple(spot(index, points[k]) for k in order)
        return [Shape("line", "plate", spots, closed=True)]
    hub = _hub(scene, index, points)
    return [
        bar
        for point in points
        if float(np.linalg.norm(point - hub)) > NEAR * scene.size
        for bar in _bar(index, [hub, point])
    ]


def _hub(scene: Scene, index: int, points: Sequence[Vector]) -> Vector:
    """Where the bars of a body meet: at the joint that carries it, else at its centre of mass."""
    for anchor in scene.anchors:
        if anchor.bodies[1] == index and anchor.coordinates and anchor.type not in LOOSE:
            return anchor.at(1)
    return scene.com(index) if len(points) > 2 else points[0]


def _stay(scene: Scene, index: int, points: Sequence[Vector]) -> list[Shape]:
    """A thin line to a centre of mass that is not on the bars."""
    com = scene.com(index)
    if not _is_line(scene, points):
        return []
    first, last = _ends(points)
    length = float(np.linalg.norm(last - first))
    along = (last - first) / (length or 1.0)
    foot = first + min(max(float((com - first) @ along), 0.0), length) * along
    if float(np.linalg.norm(com - foot)) * scene.view.scale < BESIDE:
        return []
    return [Shape("line", "stay", (spot(index, foot), spot(index, com)))]


def _on_wheels(scene: Scene, body: Body) -> bool:
    """Whether wheels that do not slip are what is seen of it."""
    return any(isinstance(x, NoSlip) and x.body == body.name for x in scene.model.constraints)


def _bar(index: int, points: Sequence[Vector]) -> list[Shape]:
    """Drawn twice: its edge, and what is between its edges."""
    spots = tuple(spot(index, point) for point in points)
    return [Shape("line", "bar", spots), Shape("line", "core", spots)]


def _around(scene: Scene, points: list[Vector]) -> list[int]:
    """The convex hull, counter-clockwise (Andrew 1979)."""
    flat = [(float(x @ scene.view.right), float(x @ scene.view.up)) for x in points]
    order = sorted(range(len(flat)), key=lambda k: flat[k])
    return _chain(flat, order)[:-1] + _chain(flat, order[::-1])[:-1]


def _chain(flat: Sequence[tuple[float, float]], order: Sequence[int]) -> list[int]:
    chain: list[int] = []
    for k in order:
        while len(chain) > 1 and _turn(flat[chain[-2]], flat[chain[-1]], flat[k]) <= 0:
            chain.pop()
        chain.append(k)
    return chain


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _bob(scene: Scene, index: int, body: Body, points: Sequence[Vector]) -> list[Shape]:
    """A point mass at the free end of its bar."""
    mass, tensor = inertia(scene, body)
    com, near = centre(scene, body), NEAR * scene.size
    pins = scene.held[index + 1]
    free = all(float(np.linalg.norm(com - pin)) > near for pin in pins)
    small = mass > 0 and math.sqrt(np.trace(tensor) / mass) * scene.view.scale < LEAST / 2
    if not (free and small and any(float(np.linalg.norm(com - x)) <= near for x in points)):
        return []
    return [Shape("dot", "bob", (spot(index, com),), size=8.0)]


def _lump(scene: Scene, index: int, body: Body, at: Vector) -> list[Shape]:
    """A body about which nothing but its inertia is known: a disc of that inertia, a wheel on its
    axle, or a block."""
    mass, tensor = inertia(scene, body)
    if mass <= 0 or not tensor.any():
        return [Shape("dot", "bob", (spot(index, at),), size=7.0)]
    if scene.view.flat:
        radius = math.sqrt(2 * max(float(scene.view.toward @ tensor @ scene.view.toward), 0) / mass)
        return disc(scene, index, at, _sensible(scene, radius))
    axle = next((a for a in scene.anchors if _is_axle(scene, a, index, tensor)), None)
    if axle is not None:
        axis = axle.axes[axle.bodies.index(index)]
        radius = math.sqrt(2 * float(axis @ tensor @ axis) / mass)
        return wheel(scene, index, at, axis, _sensible(scene, radius))
    return [_block(scene, index, mass, tensor, at)]


def _is_axle(scene: Scene, anchor: Anchor, index: int, tensor: Vector) -> bool:
    if index not in anchor.bodies or anchor.type not in ("revolute", "cylindrical"):
        return False
    axis = anchor.axes[anchor.bodies.index(index)]
    most = float(np.linalg.eigvalsh(tensor)[-1])
    return float(axis @ tensor @ axis) > 0.99 * most


def _sensible(scene: Scene, radius: float) -> float:
    """Neither a dot nor all of the paper."""
    pixel = scene.view.pixel
    return min(max(radius, LEAST * pixel), _most(scene) * pixel)


def _most(scene: Scene) -> float:
    """The largest radius in pixels; a body by itself may be large."""
    return MOST if len(scene.model.bodies) > 1 else 2.2 * MOST


def _block(scene: Scene, index: int, mass: float, tensor: Vector, at: Vector) -> Shape:
    """The box of that inertia, Lᵢ² = 6 (Iⱼ + Iₖ − Iᵢ) / m, along its principal axes."""
    moments, axes = np.linalg.eigh(tensor)
    if np.linalg.det(axes) < 0:
        axes = -axes
    sides = np.sqrt(np.maximum(6 * (np.sum(moments) - 2 * moments) / mass, 0.0))
    pixel = scene.view.pixel
    longest = float(sides.max()) or 1.0
    factor = min(max(longest, 2 * LEAST * pixel), 2 * _most(scene) * pixel) / longest
    halves = np.maximum(sides * factor / 2, 3 * pixel)
    return box(index, at, axes, halves, "body")


def disc(scene: Scene, index: int, at: Vector, radius: float) -> list[Shape]:
    """A disc in the plane, with a radius drawn on it so that it is seen to turn."""
    rim = ring(at, scene.view.right, scene.view.up, radius)
    edge = at + radius * scene.view.right
    line = Shape("line", "fine", (spot(index, at), spot(index, edge)))
    return [Shape("line", "disc", tuple(spot(index, x) for x in rim), closed=True), line]


def wheel(scene: Scene, index: int, at: Vector, axis: Vector, radius: float) -> list[Shape]:
    """A wheel in space: rim, spokes, and an axle."""
    first = across(axis)
    second = cross(axis, first)
    rim = tuple(spot(index, x) for x in ring(at, first, second, radius))
    shapes = [Shape("line", "rim", rim, closed=True)]
    for angle in np.arange(3) * math.pi / 3:
        arm = radius * (math.cos(angle) * first + math.sin(angle) * second)
        shapes.append(Shape("line", "fine", (spot(index, at - arm), spot(index, at + arm))))
    hub = min(5 * scene.view.pixel, radius / 3)
    return [*shapes, cylinder(index, at, axis, hub, hub, "joint")]


def _roller(scene: Scene, index: int, x: Rolling) -> list[Shape]:
    """A disk, sphere or torus that rolls."""
    at = scene.numbers.vector(x.centre)
    radius = abs(scene.numbers.scalar(x.radius)) + abs(scene.numbers.scalar(x.tube))
    if not math.isfinite(radius) or radius == 0.0:
        return []
    if scene.view.flat:
        return disc(scene, index, at, radius)
    axis = scene.numbers.vector(x.axis)
    length = float(np.linalg.norm(axis))
    axis = axis / length if length else np.array([0.0, 0.0, 1.0])
    if x.shape == "sphere":
        return _ball(scene, index, at, radius)
    shapes = wheel(scene, index, at, axis, radius)
    if x.shape == "torus":
        shapes += _tube(scene, index, x, at, axis)
    return shapes


def _ball(scene: Scene, index: int, at: Vector, radius: float) -> list[Shape]:
    """A sphere with two great circles that turn with it."""
    size = radius * scene.view.scale
    x, y, z = np.eye(3)
    circles = [ring(at, x, y, radius), ring(at, x, z, radius)]
    lines = [
        Shape("line", "fine", tuple(spot(index, x) for x in circle), closed=True)
        for circle in circles
    ]
    return [Shape("dot", "sphere", (spot(index, at),), size=size), *lines]


def _tube(scene: Scene, index: int, x: Rolling, at: Vector, axis: Vector) -> list[Shape]:
    """Both edges of the tyre."""
    radius, tube = (abs(scene.numbers.scalar(value)) for value in (x.radius, x.tube))
    first = across(axis)
    second = cross(axis, first)
    sides = [ring(at + s * tube * axis, first, second, radius) for s in (-1.0, 1.0)]
    inner = ring(at, first, second, max(radius - tube, 0.0))
    return [
        Shape("line", "fine", tuple(spot(index, x) for x in circle), closed=True)
        for circle in (*sides, inner)
    ]


def masses(scene: Scene) -> list[Shape]:
    """The centres of mass that no joint hides."""
    model = scene.model
    if len(model.bodies) > MOST_MASSES:
        return []
    marks = []
    for index, body in enumerate(model.bodies):
        com = centre(scene, body)
        away = [float(np.linalg.norm(com - x)) for x in scene.held[index + 1]]
        clear = min(away, default=math.inf) * scene.view.scale > BESIDE
        if inertia(scene, body)[0] > 0 and (clear or not away) and index != GROUND:
            marks.append(Shape("mass", "mass", (spot(index, com),), size=5.0))
    return marks
