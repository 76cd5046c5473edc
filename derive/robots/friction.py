"""Dry friction of joints: how wide its jump at rest is made, so that a computed motion can follow.

Coulomb friction F sign(v) becomes F tanh(v / s). At rest it then damps by F / s, and a joint with
the inertia I comes to rest with the time constant I s / F: with the same s for every joint a light
finger would be a thousand times as stiff as the arm that carries it. So s is at least the speed
that the friction takes from the joint's own inertia within a millisecond: that of what it carries,
and of the joints that mimic it with what those carry.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import counted
from derive.robots.couplings import groups
from derive.robots.limits import REST, SMOOTHING
from derive.robots.numbers import written
from derive.robots.robot import GROUND, ONE_RATE, Body, Joint, Robot

Array = NDArray[np.float64]


def smooth(robot: Robot) -> None:
    """Give each rubbing joint the width s of its friction, and say how it is read."""
    rubbing = [joint for joint in robot.joints if joint.coulomb]
    if not rubbing:
        return
    inertias = _inertias(robot)
    for joint in rubbing:
        joint.smoothing = _width(joint, inertias.get(joint.name, 0.0))
    widths = sorted({joint.smoothing for joint in rubbing})
    several = f"{written(widths[0])} to {written(widths[-1])}"
    width = written(widths[0]) if len(widths) == 1 else several
    how = f"as coulomb*tanh(v/s) with s = {width}, which creeps where dry friction sticks"
    robot.assumed.append(f"Coulomb friction of {counted(len(rubbing), 'joint')} is read {how}")


def _width(joint: Joint, inertia: float) -> float:
    """In rad/s or m/s, two digits; no narrower than SMOOTHING."""
    taken = abs(joint.coulomb) * REST / inertia if inertia > 0.0 else 0.0
    return max(SMOOTHING, float(f"{taken:.2g}"))


def _inertias(robot: Robot) -> dict[str, float]:
    """Joint → twice the kinetic energy at its unit speed, of all that moves with it while every
    other joint rests: kg along its axis, kg m² about it."""
    still = _Still(robot)
    result: dict[str, float] = {}
    for group in groups(robot):
        energy = still.energy(group)
        result |= {name: energy / ratio**2 for name, ratio in group.items()}
    return result


class _Still:
    """The robot with every joint at zero, in the ground's frame: the screw of each joint, angular
    before linear, and the inertia (6 × 6, about the origin) of each body with all that it
    carries."""

    def __init__(self, robot: Robot) -> None:
        order = _innermost_first(robot)
        self._carrying = {joint.child: joint for joint in order}
        self._joints = {joint.name: joint for joint in order}
        poses: dict[str, tuple[Array, Array]] = {GROUND: (np.eye(3), np.zeros(3))}
        self._screws: dict[str, Array] = {}
        for joint in order:
            turn, at = poses[joint.parent]
            turn, at = turn @ np.array(joint.turn()), at + turn @ np.array(joint.at)
            self._screws[joint.name] = _screw(joint, turn, at)
            turn = turn @ np.array(joint.rotation_child).T
            poses[joint.child] = (turn, at - turn @ np.array(joint.at_child))
        bodies = [body for body in robot.bodies if body.name in poses]
        self._carried = {body.name: _about_origin(body, *poses[body.name]) for body in bodies}
        for joint in reversed(order):
            if joint.parent != GROUND:
                self._carried[joint.parent] = (
                    self._carried[joint.parent] + self._carried[joint.child]
                )

    def energy(self, group: Mapping[str, float]) -> float:
        """Twice the kinetic energy at the speeds of a group: Σ rᵢ rⱼ sᵢᵀ I sⱼ with the inertia of
        what both joints carry; and that of the rotors."""
        total = 0.0
        for name, ratio in group.items():
            joint = self._joints[name]
            momentum = ratio * self._carried[joint.child] @ self._screws[name]
            total += ratio * float(self._screws[name] @ momentum) + ratio**2 * joint.armature
            if len(group) > 1:
                above = [other for other in self._above(joint) if other in group]
                total += 2.0 * sum(group[x] * float(self._screws[x] @ momentum) for x in above)
        return total

    def _above(self, joint: Joint) -> list[str]:
        """The joints that carry it."""
        names: list[str] = []
        while joint.parent != GROUND:
            joint = self._carrying[joint.parent]
            names.append(joint.name)
        return names


def _screw(joint: Joint, turn: Array, at: Array) -> Array:
    """The twist of the child at unit speed; zero of a joint that has no single speed."""
    if joint.type not in ONE_RATE:
        return np.zeros(6)
    axis = turn @ np.array(joint.axis or (0.0, 0.0, 1.0))
    slides = joint.type == "prismatic"
    return np.concatenate([np.zeros(3), axis] if slides else [axis, np.cross(at, axis)])


def _about_origin(body: Body, turn: Array, at: Array) -> Array:
    """Of the body alone: ½ [ω v] I [ω v] is its kinetic energy, v the velocity at the origin."""
    xx, yy, zz, xy, xz, yz = body.inertia or (0.0,) * 6
    com = at + turn @ np.array(body.com)
    tensor = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    moment = body.mass * np.cross(np.eye(3), com)  # m c × …
    steiner = body.mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.block([[tensor + steiner, moment], [moment.T, body.mass * np.eye(3)]])


def _innermost_first(robot: Robot) -> list[Joint]:
    outgoing: dict[str, list[Joint]] = {}
    for joint in robot.joints:
        outgoing.setdefault(joint.parent, []).append(joint)
    waiting = list(outgoing.get(GROUND, []))
    order: list[Joint] = []
    while waiting:
        joint = waiting.pop()
        order.append(joint)
        waiting += outgoing.get(joint.child, [])
    return order
