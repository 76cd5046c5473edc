"""The mechanism as data for a page whose parameters change: shapes in the frames of their bodies,
and how their points move with each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from derive.mechanics.records import System
from hamel.draw.mechanism.anchors import LOOSE
from hamel.draw.mechanism.figure import bounds, shapes
from hamel.draw.mechanism.marks import marks
from hamel.draw.mechanism.moving import FLOORS, Stage, shape_data, staged, view_data
from hamel.draw.mechanism.poses import Bodies
from hamel.draw.mechanism.records import Mark, Shape, Vector
from hamel.draw.mechanism.scene import Scene, scene
from hamel.live.limits import LEGIBLE, STEP, STILL


@dataclass(frozen=True)
class Drawing:
    """`data` for the script, the marks of the first picture, its box in pixels and the bodies whose
    poses it wants."""

    data: Mapping[str, Any]
    marks: Sequence[Mark]
    box: tuple[float, float, float, float]
    bodies: Bodies
    stage: Stage


def drawing_of(system: System, t: Vector, q: Vector, p: Vector) -> Drawing:
    """At the scale at which the motion q fits; at that of its start where that would be too
    small."""
    stage = staged(system, t, q, p)
    if _small(stage):
        stage = staged(system, t[:2], q[[0, 0]], p)
    space = stage.scene
    slopes = _slopes(space, stage.parts, q[0], p)
    data = {
        "shapes": [
            {**shape_data(space, shape), **({"d": slope} if slope else {})}
            for shape, slope in zip(stage.parts, slopes)
        ],
        "view": view_data(space),
        "free": any(anchor.type in LOOSE for anchor in space.anchors),
        "box": [round(x, 1) for x in stage.box],
    }
    bodies = Bodies(system, space.loose, space.dials)
    return Drawing(data, stage.marks_at(0, space), stage.box, bodies, stage)


def _small(stage: Stage) -> bool:
    """Whether the mechanism is hardly seen at the start."""
    parts = [part for part in stage.parts if part.style not in FLOORS]
    box = bounds(marks(stage.at(0), parts))
    return max(box.right - box.left, box.bottom - box.top) < LEGIBLE


def _slopes(
    space: Scene, parts: Sequence[Shape], q: Vector, p: Vector
) -> list[dict[int, list[float]]]:
    """Of every shape: parameter → derivatives of the coordinates of its points. What changes its
    kind with a parameter is drawn as it is."""
    slopes: list[dict[int, list[float]]] = [{} for _ in parts]
    here = _parts(space, q, p)
    for k, value in enumerate(p.tolist()):
        step = STEP * (abs(value) or 1.0)
        other = p.copy()
        other[k] += step
        there = _parts(space, q, other)
        if [_kind(x) for x in there] != [_kind(x) for x in here] or len(here) != len(parts):
            continue
        for slope, a, b in zip(slopes, here, there):
            change = (_points(b) - _points(a)) / step
            if np.max(np.abs(change), initial=0.0) * step > STILL * space.size:
                slope[k] = [round(x, 6) for x in change.tolist()]
    return slopes


def _parts(space: Scene, q: Vector, p: Vector) -> list[Shape]:
    """The shapes with these parameters, on the same paper."""
    other = scene(space.system, q, p, space.view, space.spans)
    return [x for x in shapes(replace(other, reach=space.reach)) if x.style != "curve"]


def _kind(shape: Shape) -> tuple[Any, ...]:
    return shape.kind, shape.style, tuple(at.body for at in shape.spots)


def _points(shape: Shape) -> Vector:
    return np.array([x for at in shape.spots for x in at.at])
