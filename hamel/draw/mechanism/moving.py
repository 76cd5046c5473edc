"""A motion of the mechanism as data for a page: shapes in the frames of their bodies, and the pose
of every body at every frame.

A pose is a position and a unit quaternion, seven columns a body; each column is whole
numbers of 16 bits between its least and largest value, whose step is a hundredth of a pixel.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.mechanics.records import System
from derive.model.constraint_records import Rolling
from hamel.draw.mechanism.anchors import LOOSE
from hamel.draw.mechanism.figure import ROOM, WIDTH, bar_width, bounds, framed, shapes
from hamel.draw.mechanism.marks import marks
from hamel.draw.mechanism.poses import Bodies, pose
from hamel.draw.mechanism.records import GROUND, Box, Mark, Shape, Vector
from hamel.draw.mechanism.scene import Scene
from hamel.draw.mechanism.state import INITIAL, Configuration

MOST_FRAMES = 600
LEVELS = 65535
MARGIN = 14.0  # pixels around what moves
MOST = 320.0  # pixels beyond where it starts
SMALL = 110.0  # pixels: a mechanism is not drawn smaller at the start
BOXES = 16  # frames whose boxes are joined
FLOORS = ("floor", "grid", "hatch", "ground", "rail")
TRAVEL = 4.0  # sizes of the mechanism, beyond which the picture goes along with it
LOOKED = 60  # frames that the extent is read from
CONSTANT = 1e-12


@dataclass(frozen=True)
class Moving:
    """`data` for the page (JSON values), the marks of the first frame, the box (left, top, width,
    height in pixels), and how wide a bar is."""

    data: Mapping[str, Any]
    marks: tuple[Mark, ...]
    box: tuple[float, float, float, float]
    bar: float


def frames(count: int) -> NDArray[np.int64]:
    """Rows of a motion that are shown, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_FRAMES)).round().astype(np.int64))


def moving(system: System, t: Vector, q: Vector, p: Vector) -> Moving:
    """The motion q (a row for each time of t, in SI units)."""
    stage = staged(system, t, q, p)
    scene, parts = stage.scene, stage.parts
    data = {
        "t": [round(float(x), 9) for x in t],
        "poses": _packed(stage.poses),
        "shapes": [shape_data(scene, x) for x in parts],
        "view": view_data(scene),
        "traces": [[at.body, *at.at, name] for name, at in scene.traced],
        "follow": stage.follow,
        "box": [round(x, 1) for x in stage.box],
    }
    first = tuple(stage.marks_at(0, scene))
    return Moving(data, first, stage.box, bar_width(scene))


@dataclass(frozen=True)
class Stage:
    """The scene of a motion at a scale at which it fits: its shapes, the poses of all bodies at
    every frame, the box of the picture, and the body that it follows (−1 for none)."""

    scene: Scene
    parts: Sequence[Shape]
    poses: Vector
    follow: int
    box: tuple[float, float, float, float]

    def at(self, frame: int) -> Scene:
        """The scene at a frame."""
        return replace(self.scene, poses=tuple(pose(x) for x in self.poses[frame]))

    def marks_at(self, frame: int, scene: Scene) -> list[Mark]:
        """What is on the paper at a frame, whose scene this is."""
        x, y = self.base(frame)
        return [mark.moved(-x, -y) for mark in marks(scene, self.parts)]

    def base(self, frame: int) -> tuple[float, float]:
        """Where on the paper the body is that the picture follows."""
        if self.follow < 0:
            return 0.0, 0.0
        return self.scene.view.paper(self.poses[frame, self.follow, 9:])


def staged(system: System, t: Vector, q: Vector, p: Vector) -> Stage:
    """The stage of the motion q (a row for each time of t, in SI units)."""
    names = [c.name for c in system.model.coordinates]
    spans = {
        name: (float(low), float(high))
        for name, low, high in zip(names, q.min(axis=0), q.max(axis=0))
    }
    start = framed(system, Configuration(q[0], p, INITIAL), spans)
    bodies = Bodies(system, start.loose, start.dials)
    poses = bodies.many(t, q, p)
    scene, follow = _fitted(start, poses)
    parts, box = _drawn(scene, poses, follow)
    if max(box[2:]) > WIDTH:  # bars go beyond what is held
        by = WIDTH / max(box[2:])
        scene = replace(scene, view=replace(scene.view, scale=by * scene.view.scale))
        parts, box = _drawn(scene, poses, follow)
    return Stage(scene, parts, poses, follow, box)


def _drawn(
    scene: Scene, poses: Vector, follow: int
) -> tuple[list[Shape], tuple[float, float, float, float]]:
    """The shapes, and the box of the picture."""
    still = not _changing(scene.system)
    parts = [x for x in shapes(scene) if x.style != "curve" or still]
    return parts, _box(scene, parts, poses, follow)


def _changing(system: System) -> bool:
    """Whether constraints change by themselves: their curves are those of one time."""
    return bool(ca.depends_on(system.phi, system.t)) if system.phi.numel() else False


def _fitted(scene: Scene, poses: Vector) -> tuple[Scene, int]:
    """The scene at a scale at which the motion fits, and which body the picture follows (−1 for
    none)."""
    some = _sample(poses, LOOKED)
    paths = _paths(scene, some)
    flat = np.array([scene.view.paper(x) for x in paths.reshape(-1, 3)])
    whole = flat.reshape(*paths.shape[:2], 2)
    extent, own = np.ptp(flat, axis=0), np.max(np.ptp(whole, axis=1), axis=0)
    first = float(np.max(np.ptp(whole[0], axis=0)))
    free = any(anchor.type in LOOSE for anchor in scene.anchors)
    travels = free and float(np.max(extent)) > TRAVEL * max(float(np.max(own)), 1e-9)
    if travels:
        base = np.array([scene.view.paper(x) for x in some[:, 0, 9:]])
        extent = np.ptp((whole - base[:, None, :]).reshape(-1, 2), axis=0)
    ratios = [room / x for room, x in zip(ROOM, extent) if x > 0]
    by = max(min(ratios, default=1.0), SMALL / first if first > 0 else 0.0)
    view = replace(scene.view, scale=scene.view.scale * by)
    return replace(scene, view=view, reach=_reach(scene, some)), 0 if travels else GROUND


def _sample(poses: Vector, count: int) -> Vector:
    """Some of the frames."""
    return poses[:: max(1, len(poses) // count)]


def _box(
    scene: Scene, parts: Sequence[Shape], poses: Vector, follow: int
) -> tuple[float, float, float, float]:
    """Left, top, width and height (pixels) of what is drawn on the way, floors left aside; no more
    than fits around the start."""
    moved = [x for x in parts if x.style not in FLOORS]
    boxes = []
    for row in _sample(poses, BOXES):
        here = replace(scene, poses=tuple(pose(x) for x in row))
        box = bounds(marks(here, moved))
        x, y = here.view.paper(row[follow][9:]) if follow >= 0 else (0.0, 0.0)
        boxes.append(Box(box.left - x, box.top - y, box.right - x, box.bottom - y))
    first = boxes[0]
    left = max(min(x.left for x in boxes), first.left - MOST) - MARGIN
    top = max(min(x.top for x in boxes), first.top - MOST) - MARGIN
    right = min(max(x.right for x in boxes), first.right + MOST) + MARGIN
    bottom = min(max(x.bottom for x in boxes), first.bottom + MOST) + MARGIN
    return left, top, right - left, bottom - top


def _paths(scene: Scene, poses: Vector) -> Vector:
    """Points that bodies hold, and rims of what rolls, at each frame: frames × points × 3."""
    bodies = [(k - 1, x) for k, some in enumerate(scene.held) for x in some]
    bodies += [(k, scene.com(k)) for k in range(len(scene.model.bodies))]
    for x in scene.model.constraints:
        if isinstance(x, Rolling):
            index, at = scene.index(x.body), scene.numbers.vector(x.centre)
            radius = abs(scene.numbers.scalar(x.radius)) + abs(scene.numbers.scalar(x.tube))
            bodies += [(index, at + s * radius * axis) for s in (-1, 1) for axis in np.eye(3)]
    rows = [
        [x if body == GROUND else pose(row[body]).point(x) for body, x in bodies] for row in poses
    ]
    return np.array(rows if bodies else [[np.zeros(3)]])


def _reach(scene: Scene, poses: Vector) -> tuple[Vector, ...]:
    """Where a motion takes what rolls."""
    rolling = {scene.index(x.body) for x in scene.model.constraints if isinstance(x, Rolling)}
    return tuple(row[index][9:] for row in poses for index in sorted(rolling) if index != GROUND)


def view_data(scene: Scene) -> dict[str, Any]:
    """The parallel projection."""
    view = scene.view
    vectors = {"right": view.right, "up": view.up, "toward": view.toward}
    numbers = {name: [round(float(x), 9) for x in vector] for name, vector in vectors.items()}
    return numbers | {"scale": float(f"{view.scale:.9g}"), "flat": view.flat}


def shape_data(scene: Scene, shape: Shape) -> dict[str, Any]:
    """One shape. Keys are short: there may be thousands."""
    step = scene.view.pixel / 20
    digits = max(0, int(np.ceil(-np.log10(step)))) if step < 1 else 0
    carriers = [at.body for at in shape.spots]
    one = len(set(carriers)) == 1
    data: dict[str, Any] = {
        "k": shape.kind,
        "s": shape.style,
        "b": carriers[0] if one else carriers,
        "p": [round(x, digits) for at in shape.spots for x in at.at],
    }
    if shape.closed:
        data["c"] = 1
    if shape.size:
        data["z"] = round(shape.size, 2)
    if shape.faces:
        data["f"] = [list(face) for face in shape.faces]
    return data


def _packed(poses: Vector) -> list[list[Any]]:
    """[least, step, base64 of whole numbers] of each column; [value] where nothing changes."""
    columns: list[list[Any]] = []
    for body in range(poses.shape[1]):
        rotations = poses[:, body, :9].reshape(-1, 3, 3)
        turned = _continuous(np.array([quaternion(R) for R in rotations]))
        columns += [_column(x) for x in (*poses[:, body, 9:].T, *turned.T)]
    return columns


def _column(values: Sequence[float] | Vector) -> list[Any]:
    values = np.asarray(values)
    low, high = float(values.min()), float(values.max())
    if not high - low > CONSTANT * max(1.0, abs(low), abs(high)):
        return [float(f"{low:.9g}")]
    step = float(f"{(high - low) / LEVELS:.9g}")
    levels = np.clip(np.round((values - low) / step), 0, LEVELS).astype("<u2")
    return [float(f"{low:.9g}"), step, base64.b64encode(levels.tobytes()).decode("ascii")]


def quaternion(R: Vector) -> Vector:
    """(w, x, y, z) of a rotation, from its largest entry (Shepperd 1978)."""
    trace = float(np.trace(R))
    squares = np.array([trace, *np.diag(R)])
    k = int(np.argmax(squares))
    if k == 0:
        parts = [1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        parts = [R[m, j] - R[j, m], 0.0, 0.0, 0.0]
        parts[1 + i] = 1 + 2 * R[i, i] - trace
        parts[1 + j], parts[1 + m] = R[j, i] + R[i, j], R[m, i] + R[i, m]
    whole = np.array(parts)
    return whole / float(np.linalg.norm(whole))


def _continuous(turned: Vector) -> Vector:
    """Signs so that neighbours are near each other: q and −q are one rotation."""
    flips = np.sign(np.sum(turned[1:] * turned[:-1], axis=1))
    signs = np.concatenate([[1.0], np.cumprod(np.where(flips < 0, -1.0, 1.0))])
    return turned * signs[:, None]
