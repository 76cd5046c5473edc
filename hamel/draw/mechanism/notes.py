"""What is written on a drawing: coordinates as arcs and dimensions, inputs and loads as arrows,
frames, gravity, and names.

A note is a few marks on the paper with the label that belongs to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from derive.model.records import NamedFrame
from derive.textbook import names
from hamel.draw.mechanism.anchors import LOOSE, Anchor
from hamel.draw.mechanism.marks import arrow
from hamel.draw.mechanism.points import plane_of
from hamel.draw.mechanism.records import Label, Mark, Point, Spot, Vector, spot
from hamel.draw.mechanism.scene import Scene
from hamel.draw.mechanism.typeset import extent
from hamel.draw.mechanism.vectors import cross

ARC, INPUT_ARC, TURN = 30.0, 19.0, 15.0  # radii in pixels: of an angle, of a torque, in space
SHORT = math.radians(9.0)  # an arc less than that shows a sense only
SENSE = math.radians(48.0)
PUSH, AXIS, BODY_AXIS, GRAVITY = 32.0, 30.0, 22.0, 34.0  # lengths of arrows in pixels
OFFSET = 20.0  # of a dimension from what it measures
LEAST = 14.0  # pixels: a dimension shorter than that is left out
MERGED = 34.0  # pixels: a longer name of an input has an arrow of its own
MOST_FRAMES = 6  # named ones that are drawn
PARTS = 24  # of an arc


@dataclass(frozen=True)
class Note:
    """Marks, and the names that belong to them."""

    marks: tuple[Mark, ...]
    labels: tuple[Label, ...]


def paper(scene: Scene, at: Spot) -> Point:
    """A spot on the paper."""
    return scene.view.paper(scene.place(at))


def coordinates(scene: Scene, wanted: Sequence[str]) -> list[Note]:
    """A note for every coordinate of `wanted` that has a place in the drawing."""
    notes: list[Note] = []
    for anchor in scene.anchors:
        if not set(anchor.coordinates) & set(wanted):
            continue
        match anchor.type:
            case "revolute" if scene.view.flat:
                notes.append(_angle(scene, anchor))
            case "revolute" | "screw":
                notes.append(_turn(scene, anchor, anchor.coordinates[0], driving(scene, anchor)))
            case "prismatic":
                notes.append(_slide(scene, anchor))
            case "planar":
                notes += _platform(scene, anchor)
            case "point":
                notes += _shifts(scene, anchor)
            case "free":
                notes += _free(scene, anchor)
            case "ball":
                notes += _euler(scene, anchor, anchor.coordinates)
            case "universal":
                notes += _universal(scene, anchor)
            case "cylindrical":
                notes.append(_turn(scene, anchor, anchor.coordinates[0]))
                notes.append(_slide(scene, anchor))
            case _:
                pass
    return notes


def driving(scene: Scene, anchor: Anchor) -> str:
    """The input of a hinge in space, which shares its arrow with the coordinate."""
    own = [v.name for v in scene.model.velocities if v.owner == anchor.name]
    if anchor.type != "revolute" or scene.view.flat:
        return ""
    latex = ", ".join(symbol(scene, x.name) for x in scene.model.inputs if x.velocity in own)
    return latex if extent(latex)[0] < MERGED else ""


def point_coordinates(scene: Scene, wanted: Sequence[str]) -> list[Note]:
    """Of models without bodies: the way from the origin to each point."""
    notes: list[Note] = []
    all_names = [x.name for x in scene.model.coordinates]
    for k, point in enumerate(scene.loose):
        end = scene.pose(len(scene.model.bodies) + k).position
        used = [(axis, j) for axis, j in zip(np.eye(3), point.indices) if j >= 0]
        labels = [all_names[j] for _, j in used]
        if set(labels) & set(wanted):
            axes = [axis for axis, _ in used]
            notes += _offsets(scene, end, axes, [float(end @ axis) for axis in axes], labels)
    return notes


def symbol(scene: Scene, name: str) -> str:
    """What the derivation calls it too."""
    return scene.labels.get(name) or names.symbol(name, dict(scene.model.symbols))


def arm(scene: Scene, anchor: Anchor) -> Vector:
    """The direction of the second body from the joint, in its own frame: to the farthest point that
    it carries, else its first axis."""
    index, at = anchor.bodies[1], anchor.at(1)
    points = [*scene.held[index + 1], scene.com(index)]
    lengths = [float(np.linalg.norm(point - at)) for point in points]
    far = int(np.argmax(lengths)) if lengths else 0
    if not lengths or lengths[far] < 1e-6 * scene.size:
        return anchor.frames[1] @ scene.view.right if scene.view.flat else np.eye(3)[0]
    return (points[far] - at) / lengths[far]


def _angle(scene: Scene, anchor: Anchor) -> Note:
    """From where the body points at zero to where it points now; of a small angle the sense."""
    name = anchor.coordinates[0]
    along = arm(scene, anchor)
    zero = scene.pose(anchor.bodies[0]).rotation @ anchor.frames[0] @ anchor.frames[1].T @ along
    start = heading(scene, zero)
    axis = scene.pose(anchor.bodies[1]).rotation @ anchor.axes[1]
    sign = 1.0 if axis @ scene.view.toward >= 0 else -1.0
    sweep = sign * math.remainder(scene.numbers.names[name], math.tau)
    if abs(sweep) < SHORT:
        sweep = sign * SENSE
    at = paper(scene, anchor.spot(1))
    radius = _radius(scene, anchor)
    line = arc(at, radius, start, sweep)
    far = polar(at, radius + 9, start)
    marks = (Mark("reference", (at, far)), *arrow("dimension", line))
    middle = start + sweep / 2
    where = polar(at, radius, middle)
    label = Label(symbol(scene, name), "coordinate", where, headings(middle), 5.0)
    return Note(marks, (label,))


def _radius(scene: Scene, anchor: Anchor) -> float:
    """Of an arc: inside short links."""
    here = paper(scene, anchor.spot(1))
    others = [paper(scene, spot(anchor.bodies[1], x)) for x in scene.held[anchor.bodies[1] + 1]]
    reach = [math.dist(here, other) for other in others if math.dist(here, other) > 1]
    return min(ARC, max(0.62 * min(reach, default=ARC / 0.62), 14.0))


def heading(scene: Scene, direction: Vector) -> float:
    """The angle of a direction on the paper, counter-clockwise."""
    return math.atan2(float(direction @ scene.view.up), float(direction @ scene.view.right))


def headings(angle: float) -> tuple[float, ...]:
    first = math.degrees(angle)
    return (first, first + 25, first - 25)


def polar(at: Point, radius: float, angle: float) -> Point:
    return at[0] + radius * math.cos(angle), at[1] - radius * math.sin(angle)


def arc(at: Point, radius: float, start: float, sweep: float) -> list[Point]:
    """On the paper, counter-clockwise for a positive sweep."""
    return [polar(at, radius, start + sweep * k / PARTS) for k in range(PARTS + 1)]


def _turn(scene: Scene, anchor: Anchor, name: str, input_name: str = "") -> Note:
    """In space: an arrow around the axis, beside the joint."""
    axis = scene.pose(anchor.bodies[0]).rotation @ anchor.axes[0]
    latex = f"{symbol(scene, name)}, {input_name}" if input_name else symbol(scene, name)
    return about(scene, scene.place(anchor.spot(0)), axis, latex, "dimension")


def about(
    scene: Scene, at: Vector, axis: Vector, latex: str, style: str, out: float = 17.0
) -> Note:
    """An arrow around an axis, at the freer end of it."""
    end = _freer_end(scene, at, axis, out)
    towards = scene.view.toward - axis * float(axis @ scene.view.toward)
    if float(np.linalg.norm(towards)) < 0.15:
        towards = scene.view.up - axis * float(axis @ scene.view.up)
    first = towards / float(np.linalg.norm(towards))
    second = cross(axis, first)
    radius = TURN * scene.view.pixel
    angles = np.linspace(-2.0, 2.0, PARTS + 1)
    points = [
        scene.view.paper(end + radius * (math.cos(a) * first + math.sin(a) * second))
        for a in angles
    ]
    here, middle = scene.view.paper(end), scene.view.paper(at)
    outwards = math.atan2(middle[1] - here[1], here[0] - middle[0])
    label = Label(latex, _label_style(style), here, headings(outwards), TURN + 3)
    return Note(tuple(arrow(style, points)), (label,))


def _label_style(style: str) -> str:
    return "coordinate" if style == "dimension" else style


def _freer_end(scene: Scene, at: Vector, axis: Vector, out: float) -> Vector:
    """Of two points on an axis, in pixels from `at`, the one with more room around."""
    ends = [at + s * out * scene.view.pixel * axis for s in (1.0, -1.0)]
    others = [
        scene.view.paper(scene.pose(k - 1).point(x))
        for k, some in enumerate(scene.held)
        for x in some
    ]
    here = scene.view.paper(at)
    others = [x for x in others if math.dist(x, here) > 3]
    room = [min((math.dist(scene.view.paper(end), x) for x in others), default=0.0) for end in ends]
    return ends[1] if room[1] > 1.3 * room[0] + 2 else ends[0]


def _slide(scene: Scene, anchor: Anchor) -> Note:
    """From the zero of a slide to where the body is, beside the guide; a short one as its sense."""
    name = anchor.coordinates[-1]
    start, end = scene.place(anchor.spot(0)), scene.place(anchor.spot(1))
    axis = scene.pose(anchor.bodies[0]).rotation @ anchor.axes[0]
    first, last = scene.view.paper(start), scene.view.paper(end)
    side = 1.0
    if math.dist(first, last) < LEAST:
        reach = PUSH * scene.view.pixel
        last = scene.view.paper(start + reach * axis)
    if scene.view.flat and axis @ scene.view.right >= -0.1:
        side = -1.0
    return dimension(first, last, symbol(scene, name), side * (OFFSET + 8 * scene.view.flat))


def dimension(first: Point, last: Point, latex: str, beside: float) -> Note:
    """An arrow from a tick at one point to the other, moved sideways, with lines to what is
    measured."""
    length = math.dist(first, last)
    if length < 1e-9:
        return Note((), ())
    along = ((last[0] - first[0]) / length, (last[1] - first[1]) / length)
    across = (along[1] * beside, -along[0] * beside)
    a = (first[0] + across[0], first[1] + across[1])
    b = (last[0] + across[0], last[1] + across[1])
    lines = [Mark("reference", pair) for pair in ((first, a), (last, b))] if beside else []
    tick = (along[1] * 4, -along[0] * 4)
    start = Mark("dimension", ((a[0] - tick[0], a[1] - tick[1]), (a[0] + tick[0], a[1] + tick[1])))
    middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
    outwards = math.degrees(math.atan2(-across[1], across[0])) if beside else 90.0
    label = Label(latex, "coordinate", middle, (outwards, outwards + 180), 4.0)
    return Note((*lines, start, *arrow("dimension", [a, b])), (label,))


def _platform(scene: Scene, anchor: Anchor) -> list[Note]:
    """x and y of a body in the plane, and its angle."""
    angle = anchor.coordinates[2]
    axes, end = _plane_axes(scene, anchor), scene.place(anchor.spot(1))
    notes = _shifts(scene, anchor)
    if scene.view.flat:
        notes.append(_tilt(scene, anchor, axes[0], angle))
    else:
        normal = cross(axes[0], axes[1])
        notes.append(about(scene, end, normal, symbol(scene, angle), "dimension"))
    return notes


def _shifts(scene: Scene, anchor: Anchor) -> list[Note]:
    """x and y of a body in the plane."""
    axes, end = _plane_axes(scene, anchor), scene.place(anchor.spot(1))
    way = end - scene.place(anchor.spot(0))
    values = [float(way @ axis) for axis in axes]
    return _offsets(scene, end, axes, values, anchor.coordinates[:2])


def _plane_axes(scene: Scene, anchor: Anchor) -> list[Vector]:
    if scene.view.flat:
        return [scene.view.right, scene.view.up]
    frame = scene.pose(anchor.bodies[0]).rotation @ anchor.frames[0]
    return [frame[:, 0], frame[:, 1]]


def _offsets(
    scene: Scene,
    end: Vector,
    axes: Sequence[Vector],
    values: Sequence[float],
    labels: Sequence[str],
) -> list[Note]:
    """The way from the origin along one axis after the other, each part with its name; what is too
    short to be seen is left out."""
    notes, here = [], end - sum((v * axis for v, axis in zip(values, axes)), np.zeros(3))
    for axis, v, name in zip(axes, values, labels):
        there = here + v * axis
        first, last = scene.view.paper(here), scene.view.paper(there)
        if math.dist(first, last) >= LEAST:
            middle = ((first[0] + last[0]) / 2, (first[1] + last[1]) / 2)
            way = math.degrees(math.atan2(first[1] - last[1], last[0] - first[0]))
            label = Label(symbol(scene, name), "coordinate", middle, (way - 90, way + 90), 4.0)
            notes.append(Note(tuple(arrow("dimension", [first, last])), (label,)))
        here = there
    return notes


def _tilt(scene: Scene, anchor: Anchor, level: Vector, name: str) -> Note:
    """The angle of a platform against the first axis of its plane."""
    sweep = math.remainder(scene.numbers.names[name], math.tau)
    sweep = sweep if abs(sweep) > SHORT else SENSE
    at = paper(scene, anchor.spot(1))
    start, radius = heading(scene, level), ARC + 8
    line = arc(at, radius, start, sweep)
    reference = Mark("reference", (at, polar(at, radius + 12, start)))
    own = Mark("reference", (at, polar(at, radius + 12, start + sweep)))
    middle = start + sweep / 2
    where = polar(at, radius, middle)
    label = Label(symbol(scene, name), "coordinate", where, headings(middle), 5.0)
    return Note((reference, own, *arrow("dimension", line)), (label,))


def _free(scene: Scene, anchor: Anchor) -> list[Note]:
    """The position of a body in space, and the angles of its orientation about their axes."""
    parent = scene.pose(anchor.bodies[0])
    frame = parent.rotation @ anchor.frames[0]
    end = scene.place(anchor.spot(1))
    axes = [frame[:, k] for k in range(3)]
    values = [float((end - scene.place(anchor.spot(0))) @ axis) for axis in axes]
    notes = _offsets(scene, end, axes, values, anchor.coordinates[:3])
    return notes + _euler(scene, anchor, anchor.coordinates[3:])


def _euler(scene: Scene, anchor: Anchor, angles: Sequence[str]) -> list[Note]:
    """Each Euler angle about its axis, which the angles before it have turned; none of a
    quaternion."""
    notes: list[Note] = []
    end = scene.place(anchor.spot(1))
    frame = scene.pose(anchor.bodies[0]).rotation @ anchor.frames[0]
    sequence = anchor.orientation if len(anchor.orientation) == 3 else ""
    for k, (letter, name) in enumerate(zip(sequence, angles)):
        axis = frame[:, "xyz".index(letter)]
        notes.append(about(scene, end, axis, symbol(scene, name), "dimension", 40.0 + 4 * k))
        frame = frame @ _rotation(letter, scene.numbers.names[name])
    return notes


def _rotation(letter: str, angle: float) -> Vector:
    """About a coordinate axis."""
    k = "xyz".index(letter)
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    i, j = (k + 1) % 3, (k + 2) % 3
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def _universal(scene: Scene, anchor: Anchor) -> list[Note]:
    notes = [_turn(scene, anchor, anchor.coordinates[0])]
    if anchor.axis2 is not None and len(anchor.coordinates) > 1:
        axis = scene.pose(anchor.bodies[1]).rotation @ anchor.axis2
        name = symbol(scene, anchor.coordinates[1])
        notes.append(about(scene, scene.place(anchor.spot(1)), axis, name, "dimension"))
    return notes


# frames and gravity


def triad(scene: Scene, at: Point, rotation: Vector, length: float, letters: str = "") -> Note:
    """The axes of a frame on the paper."""
    axes = [rotation[:, k] for k in range(3)]
    shown = [(scene.view.right, ""), (scene.view.up, "")] if scene.view.flat and not letters else []
    plane = plane_of(scene.model) or "xyz"
    if letters or not scene.view.flat:
        shown = [(axes["xyz".index(letter)], letter) for letter in plane]
    elif shown:
        shown = [(rotation @ axis, "") for axis, _ in shown]
    marks: list[Mark] = []
    labels: list[Label] = []
    for axis, letter in shown:
        dx, dy = scene.view.paper(axis * scene.view.pixel * length)
        if math.hypot(dx, dy) < 5:
            continue
        tip = (at[0] + dx, at[1] + dy)
        marks += arrow("axis-arrow", [at, tip])
        if letters and letter:
            way = math.degrees(math.atan2(-dy, dx))
            labels.append(Label(letter, "frame", tip, (way, way + 40, way - 40), 3.0))
    return Note(tuple(marks), tuple(labels))


def body_frames(scene: Scene) -> list[Note]:
    """Of bodies that move freely: their axes, small."""
    notes = []
    for anchor in scene.anchors:
        if anchor.type == "free":
            at = paper(scene, anchor.spot(1))
            rotation = scene.pose(anchor.bodies[1]).rotation @ anchor.frames[1]
            notes.append(triad(scene, at, rotation, BODY_AXIS))
    return notes + [_named_frame(scene, x) for x in scene.model.frames[:MOST_FRAMES]]


def own_axes(scene: Scene, frame: NamedFrame) -> Vector:
    """Body ← frame."""
    if frame.at.rotation is None:
        return np.eye(3)
    return np.array([scene.numbers.vector(row) for row in frame.at.rotation])


def _named_frame(scene: Scene, frame: NamedFrame) -> Note:
    """Its axes, small, and its name."""
    pose, own = scene.pose(scene.index(frame.body)), own_axes(scene, frame)
    at = scene.view.paper(pose.point(scene.numbers.vector(frame.at.position)))
    axes = triad(scene, at, pose.rotation @ own, BODY_AXIS)
    return Note(axes.marks, (Label(_word(frame.name), "frame", at, (225.0, 315.0), 8.0),))


def gravity(scene: Scene, at: Point) -> Note:
    """An arrow that starts at a point of the paper."""
    vector = scene.numbers.vector(scene.model.gravity or ())
    dx, dy = scene.view.paper(vector)
    length = math.hypot(dx, dy)
    if not length > 0:
        return Note((), ())
    tip = (at[0] + GRAVITY * dx / length, at[1] + GRAVITY * dy / length)
    label = Label(
        r"\mathbf{g}", "gravity", ((at[0] + tip[0]) / 2, (at[1] + tip[1]) / 2), (0.0, 180.0), 5.0
    )
    return Note(tuple(arrow("gravity", [at, tip])), (label,))


# names


def joint_names(scene: Scene, wanted: Sequence[str]) -> list[Label]:
    """Beside their joints."""
    labels = []
    away = 8.0 if scene.view.flat else 11.0
    for anchor in scene.anchors:
        if anchor.name in wanted and anchor.type not in LOOSE:
            at = paper(scene, anchor.spot(1))
            labels.append(
                Label(
                    _word(anchor.name), "joint", at, (135.0, 45.0, 225.0, 315.0, 180.0, 0.0), away
                )
            )
    return labels


def body_names(scene: Scene, wanted: Sequence[str]) -> list[Label]:
    """Beside the middle of their bodies."""
    labels = []
    for index, body in enumerate(scene.model.bodies):
        if body.name not in wanted:
            continue
        points = [scene.view.paper(scene.pose(index).point(x)) for x in scene.held[index + 1]]
        com = scene.view.paper(scene.pose(index).point(scene.com(index)))
        points = points or [com]
        far = max(points, key=lambda x: math.dist(x, points[0]))
        if math.dist(far, points[0]) < 8:
            far = com
        middle = (0.42 * points[0][0] + 0.58 * far[0], 0.42 * points[0][1] + 0.58 * far[1])
        way = math.degrees(math.atan2(points[0][1] - far[1], far[0] - points[0][0]))
        round_ = math.dist(far, points[0]) < 8
        away = 16.0 if round_ else 9.0
        labels.append(Label(_word(body.name), "body", middle, (way + 90, way - 90), away))
    return labels


def _word(name: str) -> str:
    """A name in upright letters; an index at its end stands below."""
    return names.upright(name)
