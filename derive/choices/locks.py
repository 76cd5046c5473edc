"""Guards against gimbal lock, where q̇ = N v is divided by nothing: a matter of the coordinates,
whatever the quasi-velocities are."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from derive.choices.limits import SINGULAR
from derive.choices.records import Guard
from derive.joints import joint_type
from derive.mechanics.records import System
from derive.model.records import Joint

LOCK = "gimbal lock"  # names of such guards begin so


def locks(system: System) -> tuple[Guard, ...]:
    """One for each joint with Euler angles: what its rates are divided by, one at most."""
    return tuple(guard for _, guard in _locks(system))


def locks_of(system: System, B: ca.SX) -> tuple[Guard, ...]:
    """Of the joints whose angles w = B v speaks of. Where w are rates of angles v does not follow
    from them in gimbal lock, and B grows without bound: no pivot of it vanishes."""
    names = system.symbols.names
    return tuple(
        guard
        for joint, guard in _locks(system)
        if ca.depends_on(B, ca.vertcat(*(names[x] for x in joint.coordinates)))
    )


def _locks(system: System) -> Iterator[tuple[Joint, Guard]]:
    names = system.symbols.names
    for joint in system.model.joints:
        lock = joint_type(joint.type, joint.orientation).lock
        if lock is not None:
            value = ca.SX(lock([names[x] for x in joint.coordinates]))
            yield joint, Guard(f"{LOCK} of {joint.name}", value, SINGULAR)
