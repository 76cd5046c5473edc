"""Forces and torques on a drawing: arrows of inputs at their joints, and of loads."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from derive.expressions.tree import Expression
from derive.model.load_records import Force, Torque, Wrench
from derive.model.mechanism.named_frames import frame_named
from hamel.draw.mechanism.anchors import Anchor
from hamel.draw.mechanism.joints import hangs
from hamel.draw.mechanism.marks import arrow
from hamel.draw.mechanism.notes import (
    INPUT_ARC,
    PUSH,
    Note,
    about,
    arc,
    arm,
    driving,
    heading,
    headings,
    own_axes,
    paper,
    polar,
    symbol,
)
from hamel.draw.mechanism.records import GROUND, Label, Vector
from hamel.draw.mechanism.scene import Scene


def inputs(scene: Scene) -> list[Note]:
    """Forces and torques of actuators, and loads that are forces or torques."""
    notes: list[Note] = []
    rates = {v.name: (v.owner, v.rate_of) for v in scene.model.velocities}
    for x in scene.model.inputs:
        owner, coordinate = rates.get(x.velocity, ("", ""))
        anchor = next((a for a in scene.anchors if a.name in (owner, coordinate)), None)
        if anchor is None:
            notes += _on_point(scene, coordinate, symbol(scene, x.name))
        elif not driving(scene, anchor):
            notes += _driven(scene, anchor, x.velocity, coordinate, symbol(scene, x.name))
    for x in scene.model.loads:
        if isinstance(x, Force | Torque):
            notes += _load(scene, x)
        elif isinstance(x, Wrench):
            notes += _wrench(scene, x)
    return notes


def _on_point(scene: Scene, coordinate: str, latex: str) -> list[Note]:
    """A force along a coordinate of a loose point."""
    all_names = [x.name for x in scene.model.coordinates]
    index = all_names.index(coordinate) if coordinate in all_names else -2
    for k, point in enumerate(scene.loose):
        if index in point.indices:
            axis = np.eye(3)[point.indices.index(index)]
            at = scene.pose(len(scene.model.bodies) + k).position
            return [push(scene, at, axis, latex, 9.0)]
    return []


def _driven(scene: Scene, anchor: Anchor, velocity: str, coordinate: str, latex: str) -> list[Note]:
    """The arrow of an actuator at its joint."""
    slot = velocity.rpartition(".")[2]
    turning = anchor.type in ("revolute", "screw") or slot.startswith("w")
    if anchor.type == "universal":
        second = anchor.axis2 if coordinate == anchor.coordinates[-1] else None
        axis = anchor.axes[1] if second is None else second
        axis = scene.pose(anchor.bodies[1]).rotation @ axis
        return [about(scene, scene.place(anchor.spot(1)), -axis, latex, "input")]
    if turning and scene.view.flat:
        return [_torque(scene, anchor, latex)]
    if turning:
        axis = scene.pose(anchor.bodies[0]).rotation @ anchor.axes[0]
        return [about(scene, scene.place(anchor.spot(0)), -axis, latex, "input", 24.0)]
    body = scene.pose(anchor.bodies[1])
    if anchor.type in ("prismatic", "cylindrical"):
        direction = body.rotation @ anchor.axes[1]
        short = 17.0 if scene.view.flat else 15.0
    else:
        axis = np.eye(3)["xyz".index(slot[-1])] if slot[-1:] in "xyz" and slot else np.eye(3)[0]
        direction, short = body.rotation @ axis, 6.0
    return [push(scene, scene.place(anchor.spot(1)), direction, latex, short)]


def _torque(scene: Scene, anchor: Anchor, latex: str) -> Note:
    """About a pin, on the side away from the link."""
    at = paper(scene, anchor.spot(1))
    along = scene.pose(anchor.bodies[1]).rotation @ arm(scene, anchor)
    axis = scene.pose(anchor.bodies[1]).rotation @ anchor.axes[1]
    sign = 1.0 if axis @ scene.view.toward >= 0 else -1.0
    middle = _free_side(scene, anchor, heading(scene, along))
    sweep = sign * 2.0
    points = arc(at, INPUT_ARC, middle - sweep / 2, sweep)
    label = Label(latex, "input", polar(at, INPUT_ARC, middle), headings(middle), 5.0)
    return Note(tuple(arrow("input", points)), (label,))


def _free_side(scene: Scene, anchor: Anchor, link: float) -> float:
    """A heading away from the link, and from the bearing of a pin on the ground."""
    headings = [link + math.pi + turn for turn in (0.0, 0.5, -0.5, 0.9, -0.9, 1.3, -1.3)]
    if GROUND not in anchor.bodies:
        return headings[0]
    bearing = math.pi / 2 if hangs(scene, anchor) else -math.pi / 2
    free = [x for x in headings if abs(math.remainder(x - bearing, math.tau)) > 1.75]
    return free[0] if free else headings[0]


def push(scene: Scene, at: Vector, direction: Vector, latex: str, short: float) -> Note:
    """A force: its arrow ends so many pixels before the point."""
    x, y = scene.view.paper(at)
    dx, dy = scene.view.paper(direction)
    length = math.hypot(dx, dy)
    if length < 0.15 * scene.view.scale:
        return Note((), ())
    dx, dy = dx / length, dy / length
    tip = (x - short * dx, y - short * dy)
    tail = (tip[0] - PUSH * dx, tip[1] - PUSH * dy)
    way = math.degrees(math.atan2(-dy, dx))
    label = Label(latex, "input", tail, (way + 90, way - 90, way + 180), 5.0)
    return Note(tuple(arrow("input", [tail, tip])), (label,))


def _load(scene: Scene, x: Force | Torque) -> list[Note]:
    """At its point, or at the centre of mass."""
    index = scene.index(x.body)
    pose = scene.pose(index)
    axes = pose.rotation if x.frame == "body" else _axes_named(scene, x.frame)
    direction = axes @ _driven_by_ones(scene, x.components)
    if isinstance(x, Force):
        return _force(
            scene, pose.point(scene.numbers.vector(x.point)), direction, symbol(scene, x.name)
        )
    return _moment(scene, pose.point(scene.com(index)), direction, symbol(scene, x.name))


def _axes_named(scene: Scene, name: str) -> Vector:
    """Of the ground, a body, a joint or a frame, as columns in the axes of the ground."""
    frame = frame_named(scene.model, name)
    return scene.pose(scene.index(frame.body)).rotation @ own_axes(scene, frame)


def _wrench(scene: Scene, x: Wrench) -> list[Note]:
    """At the origin of its frame."""
    frame = frame_named(scene.model, x.frame)
    pose = scene.pose(scene.index(frame.body))
    at = pose.point(scene.numbers.vector(frame.at.position))
    axes = _axes_named(scene, x.frame if x.axes == "frame" else x.axes)
    force, moment = (axes @ _driven_by_ones(scene, part) for part in (x.force, x.moment))
    return _force(scene, at, force, symbol(scene, x.name)) + _moment(
        scene, at, moment, symbol(scene, x.name)
    )


def _driven_by_ones(scene: Scene, components: Sequence[Expression]) -> Vector:
    """What a load is worth with every input at one."""
    numbers, before = scene.numbers, dict(scene.numbers.names)
    numbers.names.update({x.name: 1.0 for x in scene.model.inputs})
    vector = numbers.vector(components)
    numbers.names.update(before)
    return vector


def _force(scene: Scene, at: Vector, vector: Vector, latex: str) -> list[Note]:
    """Nothing where it is zero."""
    size = float(np.linalg.norm(vector))
    return [push(scene, at, vector / size, latex, 3.0)] if size > 0 else []


def _moment(scene: Scene, at: Vector, vector: Vector, latex: str) -> list[Note]:
    """Nothing where it is zero."""
    size = float(np.linalg.norm(vector))
    if not size > 0:
        return []
    if not scene.view.flat:
        return [about(scene, at, vector / size, latex, "input")]
    sweep = 2.4 if vector @ scene.view.toward > 0 else -2.4
    points = arc(scene.view.paper(at), INPUT_ARC, 0.4, sweep)
    label = Label(latex, "input", points[len(points) // 2], (45.0, 135.0), 5.0)
    return [Note(tuple(arrow("input", points)), (label,))]
