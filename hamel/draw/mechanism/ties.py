"""Constraints and loads as shapes: floors under what rolls, wheels that do not slip sideways, rods,
springs and dampers, wheels that mesh."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from derive.expressions.tree import Name, walk
from derive.model.constraint_records import Distance, Holonomic, NoSlip, Rolling
from derive.model.load_records import Bushing, Contact, JointDamper, JointSpring, PointSpring
from hamel.draw.mechanism.anchors import Anchor
from hamel.draw.mechanism.joints import PIN, bearing, hatched
from hamel.draw.mechanism.records import GROUND, Shape, Vector, spot
from hamel.draw.mechanism.scene import Scene
from hamel.draw.mechanism.solids import ring
from hamel.draw.mechanism.vectors import across, cross

AXLE, TYRE = 13.0, (7.0, 2.6)  # half an axle; half sides of a wheel, in pixels
FLOOR = 40.0  # pixels of floor beyond what rolls on it
LINES, SPACING = (4, 60), 70.0  # of a floor in space, each way: least, most; pixels between them
COIL = (17.0, 2.25)  # pixels of a spiral spring, and its turns
BESIDE = 6.0  # pixels of a spring, and a damper, beside the middle between them
WAY, EDGE, WALL = 72.0, 16.0, 12.0  # from the middle of a block to a wall; its edge; half a wall


def tie_shapes(scene: Scene, scale: float) -> list[Shape]:
    """Of all constraints, behind the bodies."""
    shapes: list[Shape] = []
    floors: set[tuple[float, ...]] = set()
    for x in scene.model.constraints:
        match x:
            case Rolling():
                shapes += _floor(scene, x, floors)
            case Distance():
                spots = tuple(
                    spot(scene.index(body), scene.numbers.vector(point))
                    for body, point in zip(x.bodies, x.points)
                )
                shapes.append(Shape("line", "rod", spots))
                shapes += [Shape("dot", "pin", (end,), size=3.2 * scale) for end in spots]
            case Holonomic():
                shapes += _meshing(scene, x)
            case _:
                pass
    for load in scene.model.loads:
        if isinstance(load, Contact):
            shapes += _floor(scene, load, floors)
    return shapes


def skates(scene: Scene, scale: float) -> list[Shape]:
    """Wheels where a body does not slip sideways, over it."""
    return [
        shape
        for x in scene.model.constraints
        if isinstance(x, NoSlip)
        for shape in _wheels(scene, x, scale)
    ]


def _wheels(scene: Scene, x: NoSlip, scale: float) -> list[Shape]:
    """An axle along the direction of no slip, a wheel at each end of it."""
    index, at = scene.index(x.body), scene.numbers.vector(x.point)
    axle = scene.numbers.vector(x.direction)
    length = float(np.linalg.norm(axle))
    if not length:
        return []
    axle = axle / length
    normal = scene.view.toward if scene.view.flat else np.array([0.0, 0.0, 1.0])
    along = cross(axle, normal)
    if not along.any():
        along = cross(axle, np.array([1.0, 0.0, 0.0]))
    pixel = scene.view.pixel * scale
    ends = [at + s * AXLE * pixel * axle for s in (-1, 1)]
    shapes = [Shape("line", "axle", tuple(spot(index, end) for end in ends))]
    for end in ends:
        corners = [
            end + pixel * (a * TYRE[0] * along + b * TYRE[1] * axle)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        shapes.append(Shape("line", "tyre", tuple(spot(index, c) for c in corners), closed=True))
    return shapes


def _floor(scene: Scene, x: Rolling | Contact, floors: set[tuple[float, ...]]) -> list[Shape]:
    """The line or plane that something rolls on or touches, each once; a surface is not drawn."""
    if x.surface is not None:
        return []
    pose = scene.pose(scene.index(x.carrier))
    normal = pose.rotation @ scene.numbers.vector(x.normal)
    normal = normal / (float(np.linalg.norm(normal)) or 1.0)
    origin = pose.point(scene.numbers.vector(x.origin))
    key = (*np.round(normal, 9).tolist(), round(float(origin @ normal), 9))
    if key in floors:
        return []
    floors.add(key)
    feet = _feet(scene, normal, origin)
    if scene.view.flat:
        along = cross(normal, scene.view.toward)
        reach = [float(along @ foot) for foot in feet]
        room = FLOOR * scene.view.pixel
        base = normal * float(origin @ normal)
        line = (base + (min(reach) - room) * along, base + (max(reach) + room) * along)
        return _carried(scene, x.carrier, hatched(scene, line, -normal, 1.0))
    return _carried(scene, x.carrier, _grid(scene, normal, origin, feet))


def _carried(scene: Scene, carrier: str, shapes: list[Shape]) -> list[Shape]:
    """What was placed on the ground, on the body that it belongs to: it moves with that."""
    index = scene.index(carrier)
    if index == GROUND:
        return shapes
    pose = scene.pose(index)
    moved = [tuple(spot(index, pose.inside(scene.place(at))) for at in x.spots) for x in shapes]
    return [replace(x, spots=spots) for x, spots in zip(shapes, moved)]


def _feet(scene: Scene, normal: Vector, origin: Vector) -> list[Vector]:
    """Under everything that rolls or touches, and where a motion takes it."""
    feet = []
    for x in (*scene.model.constraints, *scene.model.loads):
        if isinstance(x, Rolling | Contact):
            at = scene.place(spot(scene.index(x.body), scene.numbers.vector(x.centre)))
            radius = abs(scene.numbers.scalar(x.radius))
            foot = at - normal * float((at - origin) @ normal)
            feet += [foot + side for side in _around(normal, radius)]
    for corner in scene.reach:
        feet.append(corner - normal * float((corner - origin) @ normal))
    return feet


def _around(normal: Vector, radius: float) -> list[Vector]:
    first = across(normal)
    second = cross(normal, first)
    return [radius * s * axis for s in (-1, 1) for axis in (first, second)]


def _grid(scene: Scene, normal: Vector, origin: Vector, feet: list[Vector]) -> list[Shape]:
    """A piece of the plane with lines both ways."""
    level = np.eye(3)[0] - normal * normal[0]
    if float(np.linalg.norm(level)) < 0.5:
        level = np.eye(3)[1] - normal * normal[1]
    first = level / float(np.linalg.norm(level))
    second = cross(normal, first)
    base = normal * float(origin @ normal)
    room = 0.6 * FLOOR * scene.view.pixel
    spans = [
        (min(float(f @ axis) for f in feet) - room, max(float(f @ axis) for f in feet) + room)
        for axis in (first, second)
    ]
    (a0, a1), (b0, b1) = spans
    corners = [base + a * first + b * second for a, b in ((a0, b0), (a1, b0), (a1, b1), (a0, b1))]
    shapes = [Shape("line", "floor", tuple(spot(GROUND, x) for x in corners), closed=True)]
    lines = [(base + a * first + b0 * second, base + a * first + b1 * second)
             for a in _lines(scene, a0, a1)]  # fmt: skip
    lines += [(base + a0 * first + b * second, base + a1 * first + b * second)
              for b in _lines(scene, b0, b1)]  # fmt: skip
    return shapes + [Shape("line", "grid", tuple(spot(GROUND, x) for x in ends)) for ends in lines]


def _lines(scene: Scene, low: float, high: float) -> list[float]:
    """Evenly between two sides of a floor."""
    fitting = int((high - low) * scene.view.scale / SPACING)
    count = min(max(fitting, LINES[0]), LINES[1])
    return [low + k / count * (high - low) for k in range(1, count)]


def _meshing(scene: Scene, x: Holonomic) -> list[Shape]:
    """The pitch circles of two wheels on one carrier, where a formula ties their angles; what
    steers skates or wheels on the ground is no gear."""
    if not scene.view.flat:
        return []
    steered = {tie.body for tie in scene.model.constraints if isinstance(tie, NoSlip | Rolling)}
    wheels = [a for a in scene.anchors if a.type == "revolute" and a.coordinates]
    wheels = [a for a in wheels if _occurs(x, a.coordinates[0])]
    if len(wheels) != 2 or wheels[0].bodies[0] != wheels[1].bodies[0]:
        return []
    if any(scene.names[wheel.bodies[1]] in steered for wheel in wheels):
        return []
    rates = [_slope(scene, x, a.coordinates[0]) for a in wheels]
    distance = float(np.linalg.norm(wheels[0].points[0] - wheels[1].points[0]))
    whole = abs(rates[0]) + abs(rates[1])
    if distance * scene.view.scale < 4 or not whole > 0 or rates[0] * rates[1] <= 0:
        return []
    # c₁ ω₁ + c₂ ω₂ = 0 and r₁ ω₁ = −r₂ ω₂: radii are as the coefficients
    return [_pitch_circle(scene, a, distance * abs(rate) / whole) for a, rate in zip(wheels, rates)]


def _occurs(x: Holonomic, name: str) -> bool:
    return any(isinstance(node, Name) and node.name == name for node in walk(x.expression))


def _slope(scene: Scene, x: Holonomic, name: str) -> float:
    """The coefficient of a coordinate in a formula that is linear in it."""
    numbers = scene.numbers
    here = numbers.names[name]
    start = numbers.scalar(x.expression)
    numbers.names[name] = here + 1.0
    slope = numbers.scalar(x.expression) - start
    numbers.names[name] = here
    return slope if math.isfinite(slope) else 0.0


def _pitch_circle(scene: Scene, anchor: Anchor, radius: float) -> Shape:
    rim = ring(anchor.points[1], scene.view.right, scene.view.up, radius)
    return Shape("line", "pitch", tuple(spot(anchor.bodies[1], at) for at in rim), closed=True)


def load_shapes(scene: Scene, scale: float) -> list[Shape]:
    """Springs and dampers, between points and in joints."""
    shapes: list[Shape] = []
    for x in scene.model.loads:
        match x:
            case PointSpring():
                shapes += _between(scene, x)
            case Bushing():
                spots = tuple(
                    spot(scene.index(body), scene.numbers.vector(at.position))
                    for body, at in zip(x.bodies, x.placements)
                )
                shapes.append(Shape("spring", "spring", spots))
            case JointSpring():
                shapes += _in_joint(scene, x.coordinate, "spring", scale)
            case JointDamper():
                rates = {v.name: v.rate_of for v in scene.model.velocities}
                shapes += _in_joint(scene, rates.get(x.velocity, ""), "damper", scale)
            case _:
                pass
    return shapes


def _between(scene: Scene, x: PointSpring) -> list[Shape]:
    """A spring, a damper, or both side by side."""
    spots = tuple(
        spot(scene.index(body), scene.numbers.vector(point))
        for body, point in zip(x.bodies, x.points)
    )
    stiff, damped = (scene.numbers.scalar(value) != 0 for value in (x.stiffness, x.damping))
    beside = BESIDE if stiff and damped else 0.0
    shapes = [Shape("spring", "spring", spots, size=beside)] if stiff or not damped else []
    return [*shapes, Shape("damper", "damper", spots, size=-beside)] if damped else shapes


def _in_joint(scene: Scene, coordinate: str, kind: str, scale: float) -> list[Shape]:
    """Of a slide: beside its guide. Of a turn in the plane: a spiral about the pin."""
    anchor = next((a for a in scene.anchors if coordinate in a.coordinates), None)
    if anchor is None or not coordinate:
        return []
    if anchor.type == "prismatic":
        return _along(scene, anchor, kind, scale)
    if anchor.type == "revolute" and kind == "spring":
        return [_spiral(scene, anchor, scale)]
    return []


def _along(scene: Scene, anchor: Anchor, kind: str, scale: float) -> list[Shape]:
    """From the block to a wall beyond all that it reaches."""
    carrier, child = anchor.bodies
    pixel = scene.view.pixel * scale
    axis = anchor.axes[0]
    here = scene.pose(carrier).inside(scene.place(anchor.spot(1)))
    spans = [scene.spans[name] for name in anchor.coordinates if name in scene.spans]
    high = max([float((here - anchor.points[0]) @ axis), *(high for _, high in spans)])
    wall = anchor.points[0] + (high + WAY * pixel) * axis
    end = anchor.points[1] + EDGE * pixel * anchor.axes[1]
    both = {type(x) for x in scene.model.loads} >= {JointSpring, JointDamper}
    beside = (BESIDE if kind == "spring" else -BESIDE) * scale if both else 0.0
    shape = Shape(kind, kind, (spot(child, end), spot(carrier, wall)), size=beside)
    if carrier != GROUND or not scene.view.flat:
        return [shape]
    side = cross(scene.view.toward, axis)
    half = WALL * pixel * (side if side @ scene.view.up >= 0 else -side)
    return [*hatched(scene, (wall - half, wall + half), axis, scale), shape]


def _spiral(scene: Scene, anchor: Anchor, scale: float) -> Shape:
    """Carried by the parent."""
    radius, turns = COIL
    pixel = scene.view.pixel * scale
    side, up = scene.view.right, scene.view.up
    if not scene.view.flat:
        axis = anchor.axes[0]
        side = across(axis)
        up = cross(axis, side)
    angles = np.linspace(0, 2 * math.pi * turns, 48)
    at = np.array(anchor.spot(0).at)
    reach = pixel * (6 + (radius - 6) * angles / angles[-1])
    points = [at + r * (math.cos(a) * side + math.sin(a) * up) for r, a in zip(reach, angles)]
    return Shape("line", "spring", tuple(spot(anchor.bodies[0], x) for x in points))


def point_shapes(scene: Scene) -> list[Shape]:
    """Of models without bodies: rods, curves, points, and the needles of dials."""
    first = len(scene.model.bodies)
    shapes = [*scene.bonds.curves, *scene.bonds.rods]
    for rod in scene.bonds.rods:
        if rod.spots[0].body == GROUND:
            shapes += _support(scene, rod)
    for k, _ in enumerate(scene.loose):
        shapes.append(Shape("dot", "bob", (spot(first + k, np.zeros(3)),), size=8.0))
    for x in scene.dials:
        if x.turns:
            index = scene.names.index(x.label)
            ends = (spot(index, np.zeros(3)), spot(index, np.eye(3)[0]))
            shapes += [Shape("line", "bar", ends), Shape("line", "core", ends)]
    return shapes


def _support(scene: Scene, rod: Shape) -> list[Shape]:
    """The pin of a rod on the ground, in the plane with its bearing."""
    pin = Shape("dot", "pin", (rod.spots[0],), size=PIN)
    if not scene.view.flat:
        return [pin]
    here, there = (scene.place(at) for at in rod.spots)
    hangs = float((there - here) @ scene.view.up) < 0
    return [*bearing(scene, here, hangs, 1.0), rod, pin]
