"""Joints in a row whose axes depend on each other: moved together they leave still what they carry,
so that no inertia out there determines how fast they move."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from derive.choices.pivots import sampled
from derive.choices.survey import Survey
from derive.formulations.limits import DEPENDENT
from derive.mechanics.records import Link
from derive.model.records import Joint

Twist = tuple[np.ndarray, np.ndarray]  # (ω, v) in a link's frame, at its origin


def dependent_joints(survey: Survey, motion: np.ndarray) -> tuple[list[Joint], str]:
    """The joints which the velocities `motion` move while the body behind them stays still, and its
    name; none where there are none. `motion` is one at the first sampled state."""
    links = survey.system.links
    twists = _twists(survey, motion)
    largest = max((_size(twist) for twist in twists), default=0.0)
    for link, twist in zip(links, twists):
        row = _row(links, link)
        moved = [one for one in row if np.any(np.abs(motion[list(one.columns)]) > DEPENDENT)]
        if len(moved) > 1 and link is moved[0] and _size(twist) <= DEPENDENT * largest:
            return _joints(survey, moved[::-1]), link.name
    return [], ""


def _row(links: Sequence[Link], link: Link) -> list[Link]:
    """The link and those that carry it, inwards."""
    row = [link]
    while row[-1].parent >= 0:
        row.append(links[row[-1].parent])
    return row


def _joints(survey: Survey, moved: Sequence[Link]) -> list[Joint]:
    model = survey.system.model
    owners = dict.fromkeys(model.velocities[j].owner for link in moved for j in link.columns)
    return [joint for name in owners for joint in model.joints if joint.name == name]


def _twists(survey: Survey, motion: np.ndarray) -> list[Twist]:
    """Of every link, with the velocities `motion` at the first sampled state."""
    result: list[Twist] = []
    for link in survey.system.links:
        R, a, b = (_numbers(survey, x) for x in (link.R, [link.a], [link.b]))
        omega, v = result[link.parent] if link.parent >= 0 else (np.zeros(3), np.zeros(3))
        omega, v = R.T @ omega, R.T @ (v + np.cross(omega, a[0]))
        for column, axis in zip(link.columns, link.motion):
            relative = motion[column] * _numbers(survey, [axis])[0]
            omega, v = omega + relative[:3], v + relative[3:]
        result.append((omega, v - np.cross(omega, b[0])))
    return result


def _numbers(survey: Survey, rows: Sequence[Sequence[float | ca.SX]]) -> np.ndarray:
    """Of scalars over (t, q, p), at the first sampled state."""
    return sampled(survey, ca.vertcat(*(ca.horzcat(*row) for row in rows)))[0]


def _size(twist: Twist) -> float:
    return float(max(np.max(np.abs(part)) for part in twist))
