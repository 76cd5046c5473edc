"""Gimbal lock: where q̇ = N v runs away, as the rates of Euler angles do where two of their axes are
parallel. It is a matter of the coordinates and not of the mechanics."""

from __future__ import annotations

import numpy as np

from derive.diagnostics import listed
from derive.mechanics.records import System
from derive.model.records import Joint
from derive.states.limits import LOCKED

INSTEAD = "take `orientation: quaternion` for this joint, or angles about other axes"


def locked(system: System, sizes: np.ndarray) -> list[str]:
    """The coordinates whose rows of N have a largest entry that is not finite or above LOCKED;
    elsewhere the largest are about one."""
    return [x.name for x, size in zip(system.model.coordinates, sizes) if size > LOCKED]


def told(names: list[str], where: str) -> str:
    """What is wrong there."""
    verb = "changes" if len(names) == 1 else "change"
    return f"{listed(names)} {verb} without bound {where}: Euler angles are in gimbal lock there"


def joint_of(system: System, name: str) -> Joint | None:
    """The joint that has the coordinate."""
    return next((x for x in system.model.joints if name in x.coordinates), None)
