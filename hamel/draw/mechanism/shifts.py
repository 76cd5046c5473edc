"""Where on its axis the symbol of a joint in space stands.

A hinge may be drawn anywhere along its axis. One whose bodies both lie on one side of its point is
drawn beside them (the head of a bicycle, whose point is on the road); of several in one point (a
wrist) the first and the last move apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hamel.draw.mechanism.anchors import LOOSE, Anchor
from hamel.draw.mechanism.records import GROUND, Pose, Vector

ASIDE = 0.12  # of the size: how far both bodies must be on one side
APART = 0.075  # of the size, between joints of one point
ALONG = 0.5  # cosine: an axis that goes along a body
SAME = 1e-6


def shifted(
    anchors: Sequence[Anchor], poses: Sequence[Pose], coms: Sequence[Vector]
) -> list[Anchor]:
    """With their shifts."""
    points = _points(anchors, coms)
    size = _size(points, poses)
    beside = [_beside(anchor, points, size) for anchor in anchors]
    return _apart(beside, poses, points, size)


def _points(anchors: Sequence[Anchor], coms: Sequence[Vector]) -> dict[int, list[Vector]]:
    """What there is of each body, in its frame."""
    points: dict[int, list[Vector]] = {k: [com] for k, com in enumerate(coms)}
    for anchor in anchors:
        if anchor.type not in LOOSE:
            for body, at in zip(anchor.bodies, anchor.points):
                points.setdefault(body, []).append(at)
    return points


def _size(points: dict[int, list[Vector]], poses: Sequence[Pose]) -> float:
    places = [
        x if body == GROUND else poses[body].point(x) for body, some in points.items() for x in some
    ]
    return float(np.max(np.ptp(np.array(places), axis=0), initial=0.0)) if places else 0.0


def _beside(anchor: Anchor, points: dict[int, list[Vector]], size: float) -> Anchor:
    """Moved beside what its bodies are, where all of that is on one side."""
    if anchor.type != "revolute" or GROUND in anchor.bodies or not size > 0:
        return anchor
    reaches: list[float] = []
    for body, at, axis in zip(anchor.bodies, anchor.points, anchor.axes):
        others = [x for x in points[body] if float(np.linalg.norm(x - at)) > SAME * size]
        if not others:
            return anchor
        reaches = [float((x - at) @ axis) for x in others] + reaches
    near = min(reaches, key=abs)
    same = all(reach * near > 0 for reach in reaches) and abs(near) > ASIDE * size
    child = [float((x - anchor.points[1]) @ anchor.axes[1]) for x in points[anchor.bodies[1]]]
    return replace(anchor, shift=sum(child) / max(len(child) - 1, 1)) if same else anchor


def _apart(
    anchors: Sequence[Anchor],
    poses: Sequence[Pose],
    points: dict[int, list[Vector]],
    size: float,
) -> list[Anchor]:
    """Hinges of one point: the first towards what carries it, the last towards what it carries."""
    result = list(anchors)
    hinges = [k for k, x in enumerate(anchors) if x.type == "revolute"]
    places = {k: poses[anchors[k].bodies[1]].point(anchors[k].at(1)) for k in hinges}
    for group in _groups(hinges, places, SAME * size):
        if len(group) < 2:
            continue
        for k, side in ((group[0], 0), (group[-1], 1)):
            sign = _towards(anchors[k], side, points)
            result[k] = replace(anchors[k], shift=anchors[k].shift + sign * APART * size)
    return result


def _groups(hinges: Sequence[int], places: dict[int, Vector], near: float) -> list[list[int]]:
    groups: list[list[int]] = []
    for k in hinges:
        for group in groups:
            if float(np.linalg.norm(places[k] - places[group[0]])) <= near:
                group.append(k)
                break
        else:
            groups.append([k])
    return groups


def _towards(anchor: Anchor, side: int, points: dict[int, list[Vector]]) -> float:
    """1 or −1 along the axis, to the farthest point of one of the bodies; 0 where that is aside."""
    at, axis = anchor.points[side], anchor.axes[side]
    others = [x - at for x in points[anchor.bodies[side]]]
    far = max(others, key=lambda x: float(np.linalg.norm(x)))
    length = float(np.linalg.norm(far))
    cosine = float(far @ axis) / length if length > 0 else 0.0
    return float(np.sign(cosine)) if abs(cosine) > ALONG else 0.0
