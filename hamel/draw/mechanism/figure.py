"""The figure of a mechanism: shapes and notes at one state, scaled so that all of it fits a page of
a phone, with every label in a place of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from derive.diagnostics import HamelError
from derive.mechanics.limits import LONG
from derive.mechanics.records import System
from derive.model.constraint_records import Rolling
from hamel.draw.mechanism import notes as write
from hamel.draw.mechanism.anchors import LOOSE
from hamel.draw.mechanism.bodies import body_shapes, gyration, masses
from hamel.draw.mechanism.forces import inputs
from hamel.draw.mechanism.joints import bearings, joint_shapes
from hamel.draw.mechanism.marks import marks
from hamel.draw.mechanism.notes import Note
from hamel.draw.mechanism.placing import Ground, placed
from hamel.draw.mechanism.points import plane_of
from hamel.draw.mechanism.records import GROUND, Box, Label, Lettering, Mark, Point, Shape, spot
from hamel.draw.mechanism.ropes import rope_shapes
from hamel.draw.mechanism.scene import Scene, scene
from hamel.draw.mechanism.state import Configuration, configuration
from hamel.draw.mechanism.ties import load_shapes, point_shapes, skates, tie_shapes
from hamel.draw.mechanism.view import View, axonometric, planar
from hamel.draw.mechanism.words import described

WIDTH = 420.0  # pixels at most, so that letters stay readable on a phone
ROOM = (300.0, 250.0)  # for the mechanism itself
MARGIN = 10.0
TRIES = 6
SPARE = 3.0  # pixels below the width
MOST_LABELS, MOST_IN_SPACE = 20, 14
MOST_NAMED = 14  # bodies, above which only some are named
CROWDED = 30.0  # pixels between joints: symbols shrink where they are nearer
FEW = 4  # inputs that are always drawn
SMALLEST, LEGIBLE = 0.42, 0.66
DIAL = 62.0  # pixels of a needle


@dataclass(frozen=True)
class Figure:
    """Marks and letters in pixels from the upper left corner; `unplaced` labels found no room,
    `unnamed` were left out as there are too many."""

    title: str
    about: str
    width: float
    height: float
    marks: tuple[Mark, ...]
    letterings: tuple[Lettering, ...]
    unplaced: tuple[Label, ...]
    unnamed: int
    state: Configuration
    bar: float  # pixels: how wide a link is


def figure(system: System, state: Configuration | None = None) -> Figure:
    """The mechanism at the configuration of state.py. Raises ModelError where it has none."""
    state = state or configuration(system)
    space = framed(system, state)
    drawing = _drawn(space, state)
    for _ in range(TRIES):
        if drawing.width <= WIDTH:
            break
        # letters and symbols keep their size: what is too wide has to come from the mechanism
        inner = max(float(_extent(space)[0]), 1.0)
        by = (inner - (drawing.width - WIDTH) - SPARE) / inner
        space = _scaled(space, min(max(by, 0.6), 0.99))
        drawing = _drawn(space, state)
    return drawing


def picture(system: System) -> Figure | None:
    """The same for a page, which stands without it; None where the model has no such state, numbers
    of which no drawing can be made, or so many links that nothing could be told apart."""
    if len(system.links) >= LONG:
        return None
    try:
        return figure(system)
    except (HamelError, ArithmeticError, ValueError):
        return None


def framed(
    system: System, state: Configuration, spans: Mapping[str, tuple[float, float]] | None = None
) -> Scene:
    """The scene with a view whose scale fits the paper; `spans`: what a motion reaches."""
    plane = plane_of(system.model)
    right, up, toward = np.eye(3)
    flat = planar(plane) if plane else View(right, up, toward, flat=False)
    space = scene(system, state.q, state.p, flat, spans)
    points = [space.pose(k - 1).point(x) for k, some in enumerate(space.held) for x in some]
    points += _extremes(space)
    view = planar(plane) if plane else axonometric(_upward(space), points)
    extent = np.ptp(np.array([view.paper(x) for x in points] or [(0.0, 0.0)]), axis=0)
    ratios = [room / x for room, x in zip(ROOM, extent) if x > 0]
    return replace(space, view=replace(view, scale=min([*ratios, *_largest(space)], default=1.0)))


def _extent(space: Scene) -> np.ndarray:
    """Width and height (pixels) of the points held."""
    points = [space.pose(k - 1).point(x) for k, some in enumerate(space.held) for x in some]
    return np.ptp(np.array([space.view.paper(x) for x in points] or [(0.0, 0.0)]), axis=0)


def _largest(space: Scene) -> list[float]:
    """Dials stay small."""
    return [DIAL] if space.names and not space.model.bodies and not space.loose else []


def _scaled(space: Scene, by: float) -> Scene:
    return replace(space, view=replace(space.view, scale=space.view.scale * by))


def _upward(space: Scene) -> np.ndarray:
    """Against gravity, else the third axis."""
    g = space.numbers.vector(space.model.gravity or ()) if space.model.gravity else np.zeros(3)
    length = float(np.linalg.norm(g))
    return -g / length if length > 0 else np.eye(3)[2]


def _extremes(space: Scene) -> list[np.ndarray]:
    """What reaches beyond the points held: centres of mass, and rims of what rolls."""
    points = []
    for index, body in enumerate(space.model.bodies):
        com = space.pose(index).point(space.com(index))
        radius = gyration(space, body) if len(space.held[index + 1]) < 2 else 0.0
        points += [com + s * radius * axis for s in (-1, 1) for axis in np.eye(3)]
    for x in space.model.constraints:
        if isinstance(x, Rolling):
            pose = space.pose(space.index(x.body))
            at = pose.point(space.numbers.vector(x.centre))
            radius = abs(space.numbers.scalar(x.radius)) + abs(space.numbers.scalar(x.tube))
            points += [at + s * radius * axis for s in (-1, 1) for axis in np.eye(3)]
    for anchor in space.anchors:
        if anchor.type in LOOSE:
            points.append(space.place(anchor.spot(0)))
    return points


def shapes(space: Scene) -> list[Shape]:
    """Everything that bodies carry, back to front."""
    scale = crowding(space)
    result = tie_shapes(space, scale) + bearings(space, scale)
    result += load_shapes(space, scale) + rope_shapes(space)
    for index in range(len(space.model.bodies)):
        result += body_shapes(space, index)
    result += point_shapes(space)
    result += skates(space, scale) + joint_shapes(space, scale) + masses(space)
    return result + [Shape("dot", "point", (at,), size=2.2) for _, at in space.traced]


def crowding(space: Scene) -> float:
    """What symbols are scaled by, from the least distance between joints."""
    spots = [space.view.paper(space.place(a.spot(1))) for a in space.anchors]
    if len(spots) > 400:
        spots = spots[:400]
    least = math.inf
    for k, here in enumerate(spots):
        away = [math.dist(here, x) for x in spots[k + 1 :]]
        least = min([least, *(x for x in away if x > 1.0)])
    floor = SMALLEST if space.view.flat or len(spots) > MOST_NAMED else LEGIBLE
    return min(1.0, max(floor, least / CROWDED))


def _drawn(space: Scene, state: Configuration) -> Figure:
    body = marks(space, shapes(space))
    notes, labels, unnamed = _notes(space)
    written = [mark for note in notes for mark in note.marks]
    corner = _corners(space, [*body, *written])
    all_marks = [*body, *written, *(mark for note in corner for mark in note.marks)]
    wanted = [label for note in (*corner, *notes) for label in note.labels] + labels
    letterings, unplaced = placed(wanted, all_marks)
    return _cut(space, state, all_marks, letterings, (tuple(unplaced), unnamed))


def _notes(space: Scene) -> tuple[list[Note], list[Label], int]:
    """Frames, coordinates and inputs; names of joints and bodies as far as there is room for
    them."""
    model = space.model
    owned = [c.name for c in model.coordinates]
    shown = some(owned, MOST_NAMED)
    notes = write.body_frames(space) + write.coordinates(space, shown)
    notes += write.point_coordinates(space, shown)
    pushes = inputs(space)
    most = MOST_NAMED if space.view.flat else MOST_NAMED - len(notes)
    driven = pushes if len(pushes) <= max(most, FEW) else pushes[:: max(len(pushes) - 1, 1)]
    notes += driven
    count = sum(len(note.labels) for note in notes)
    joints, bodies = (
        [a.name for a in space.anchors if a.type != "fixed" and a.name not in owned],
        [body.name for body in model.bodies],
    )
    labels: list[Label] = []
    for wanted, naming in ((joints, write.joint_names), (bodies, write.body_names)):
        most = MOST_LABELS if space.view.flat else MOST_IN_SPACE
        room = most - count - len(labels)
        if len(wanted) <= min(room, MOST_NAMED):
            labels += naming(space, wanted)
    unnamed = len(owned) - len(shown) + len(pushes) - len(driven)
    return notes, labels, unnamed


def some(names: Sequence[str], most: int) -> list[str]:
    """All of them, or the first two and the last."""
    return list(names) if len(names) <= most else [*names[:2], names[-1]]


def _corners(space: Scene, around: Sequence[Mark]) -> list[Note]:
    """The ground's frame and gravity: at the origin where coordinates start there, else in a corner
    that is free."""
    result = []
    origin = next((a for a in space.anchors if a.type in LOOSE), None)
    if origin is not None or space.loose:
        at = write.paper(space, origin.spot(0) if origin else spot(GROUND, np.zeros(3)))
        result.append(write.triad(space, at, np.eye(3), write.AXIS, "ground"))
    elif space.model.bodies:
        at = _free_corner(around, (52.0, 52.0), "lower")
        result.append(write.triad(space, at, np.eye(3), write.AXIS, "ground"))
    if space.model.gravity:
        taken = [*around, *(mark for note in result for mark in note.marks)]
        at = _free_corner(taken, (30.0, 48.0), "upper")
        result.append(write.gravity(space, at))
    return result


def _free_corner(around: Sequence[Mark], size: Point, side: str) -> Point:
    """Where a note of that size fits: a corner of what is drawn, else beside it."""
    box, ground = bounds(around), Ground(around)
    wide, high = size
    rows = [box.bottom - 8] if side == "lower" else [box.top + 4]
    rows += [box.top + 4] if side == "lower" else [box.bottom - high]
    for y in rows:
        for x in (box.left + 8, box.right - wide):
            top = y - high if side == "lower" else y
            place = Box(x - 6, top - 6, x + wide, top + high + 6)
            if not ground.covered(place):
                return (x + (0 if side == "lower" else wide / 2), y)
    if side == "lower":
        return (box.left - wide + 4, box.bottom - 4)
    return (box.right + wide / 2, box.top + 4)


def bounds(around: Sequence[Mark]) -> Box:
    """The box of marks, their discs whole."""
    xs = [x + s * m.radius for m in around for x, _ in m.points for s in (-1, 1)] or [0.0]
    ys = [y + s * m.radius for m in around for _, y in m.points for s in (-1, 1)] or [0.0]
    return Box(min(xs), min(ys), max(xs), max(ys))


def _cut(
    space: Scene,
    state: Configuration,
    around: Sequence[Mark],
    letterings: Sequence[Lettering],
    left_out: tuple[tuple[Label, ...], int],
) -> Figure:
    """The paper cut to what is on it, with a margin."""
    boxes = [bounds(around), *(x.box for x in letterings)]
    left, top = min(x.left for x in boxes) - MARGIN, min(x.top for x in boxes) - MARGIN
    right, bottom = max(x.right for x in boxes) + MARGIN, max(x.bottom for x in boxes) + MARGIN
    moved = tuple(mark.moved(-left, -top) for mark in around)
    lettered = tuple(_moved(x, left, top) for x in letterings)
    model = space.model
    return Figure(
        f"The mechanism of {model.name}",
        described(space, state),
        right - left,
        bottom - top,
        moved,
        lettered,
        *left_out,
        state,
        bar_width(space),
    )


def _moved(x: Lettering, left: float, top: float) -> Lettering:
    box = Box(x.box.left - left, x.box.top - top, x.box.right - left, x.box.bottom - top)
    return replace(x, box=box, leader=tuple((a - left, b - top) for a, b in x.leader))


def bar_width(space: Scene) -> float:
    """Of links: thinner where joints are near each other."""
    full = 8.0 if space.view.flat else 6.0
    return max(2.0, full * crowding(space))
