"""Dry friction of joints: how wide its jump at rest is made, so that a computed motion can follow.

Coulomb friction F sign(v) becomes F tanh(v / s). At rest it then damps by F / s, and a joint with
the inertia I comes to rest with the time constant I s / F: with the same s for every joint a light
finger would be a thousand times as stiff as the arm that carries it. So s is at least the speed
that the friction takes from the joint's own inertia within a millisecond.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from derive.robots.limits import REST, SMOOTHING
from derive.robots.numbers import written
from derive.robots.robot import Body, Joint, Robot, counted

Array = NDArray[np.float64]


def smooth(robot: Robot) -> None:
    """Give each rubbing joint the width s of its friction, and say how it is read."""
    rubbing = [joint for joint in robot.joints if joint.coulomb]
    if not rubbing:
        return
    pieces = _carried(robot)
    for joint in rubbing:
        joint.smoothing = _width(joint, pieces[joint.child])
    widths = sorted({joint.smoothing for joint in rubbing})
    several = f"{written(widths[0])} to {written(widths[-1])}"
    width = written(widths[0]) if len(widths) == 1 else several
    how = f"as coulomb*tanh(v/s) with s = {width}, which creeps where dry friction sticks"
    robot.assumed.append(f"Coulomb friction of {counted(len(rubbing), 'joint')} is read {how}")


def _width(joint: Joint, piece: _Piece) -> float:
    """In rad/s or m/s, two digits; no narrower than SMOOTHING."""
    inertia = _own(joint, piece) + joint.armature
    taken = abs(joint.coulomb) * REST / inertia if inertia > 0.0 else 0.0
    return max(SMOOTHING, float(f"{taken:.2g}"))


@dataclass
class _Piece:
    """Mass, first moment and tensor about the origin of a body's frame, of all that it carries with
    every joint at zero."""

    mass: float
    moment: Array
    tensor: Array


def _own(joint: Joint, piece: _Piece) -> float:
    """The inertia that the joint moves by itself: kg along its axis, kg m² about it."""
    if joint.type == "prismatic":
        return piece.mass
    axis = np.array(joint.rotation_child) @ np.array(joint.axis or (0.0, 0.0, 1.0))
    across = np.cross(axis, joint.at_child)
    through_origin = float(axis @ piece.tensor @ axis)
    shift = -2.0 * float(np.cross(axis, piece.moment) @ across) + piece.mass * across @ across
    return through_origin + float(shift)


def _carried(robot: Robot) -> Mapping[str, _Piece]:
    """Body → everything from it outwards, as one rigid piece."""
    pieces = {body.name: _alone(body) for body in robot.bodies}
    for joint in _outermost_first(robot):
        if joint.parent in pieces:
            _add(pieces[joint.parent], pieces[joint.child], joint)
    return pieces


def _alone(body: Body) -> _Piece:
    xx, yy, zz, xy, xz, yz = body.inertia or (0.0,) * 6
    com = np.array(body.com)
    about_centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    steiner = body.mass * (com @ com * np.eye(3) - np.outer(com, com))
    return _Piece(body.mass, body.mass * com, about_centre + steiner)


def _add(parent: _Piece, child: _Piece, joint: Joint) -> None:
    """Take the child's piece into the parent's: r' = R r + p."""
    R = np.array(joint.turn()) @ np.array(joint.rotation_child).T
    p = np.array(joint.at) - R @ np.array(joint.at_child)
    turned = R @ child.moment
    mixed = np.outer(p, turned) + np.outer(turned, p)
    square = 2.0 * (p @ turned) + child.mass * (p @ p)
    steiner = square * np.eye(3) - mixed - child.mass * np.outer(p, p)
    parent.tensor = parent.tensor + R @ child.tensor @ R.T + steiner
    parent.moment = parent.moment + turned + child.mass * p
    parent.mass += child.mass


def _outermost_first(robot: Robot) -> list[Joint]:
    outgoing: dict[str, list[Joint]] = {}
    for joint in robot.joints:
        outgoing.setdefault(joint.parent, []).append(joint)
    children = {joint.child for joint in robot.joints}
    waiting = [joint for joint in robot.joints if joint.parent not in children]
    order: list[Joint] = []
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += outgoing.get(joint.child, [])
    return order[::-1]
