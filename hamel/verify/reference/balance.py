"""Inverse dynamics of a tree in numbers: what is left of M v̇ + h − Q at a given v̇.

Twist rates from the base to the tips, wrenches of single bodies from the tips to the base: time and
memory grow with the number of bodies, and no matrix has an entry for two of them. Accelerations
that leave nothing are the right ones, for M is regular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from derive.model.records import GROUND
from hamel.verify.reference.loads import applied, body_inertia
from hamel.verify.reference.outcome import Reference, rotors
from hamel.verify.reference.rows import joint_blocks
from hamel.verify.reference.states import STILL, Seat, State
from hamel.verify.reference.vectors import Array


@dataclass(frozen=True)
class Balance:
    """M v̇ + h − Q (nv), and the sizes of what it is summed of."""

    left: Array
    size: Array


@dataclass
class _Carried:
    """Wrenches (moment about the body's origin, force) of a body with all that it carries."""

    wrench: Array
    size: Array


def balance(ref: Reference, s: State, vdot: Array, driven: bool = True) -> Balance:
    """What is left of the equations of motion of a tree at these accelerations; where it is not
    `driven` no forces but weights. A tree has neither closures nor constraints, and its kinetic
    energy is that of bodies and rotors."""
    place = ref.place
    forces = applied(ref.model, place, s)
    loads = forces.total if driven else forces.weight
    carried = _wrenches(ref, s, twist_rates(s, vdot), loads)
    spinning = rotors(ref, s) * vdot
    left, size = spinning - loads[: place.nv], np.abs(spinning) + np.abs(loads[: place.nv])
    for seat in reversed(s.seats):
        own = carried[seat.joint.child]
        there, size_there = _both_at_joint(seat, own)
        left[seat.columns] += seat.twists.T @ there
        size[seat.columns] += np.abs(seat.twists).T @ size_there
        if seat.joint.parent != GROUND:
            below = carried[seat.joint.parent]
            below.wrench += moved(there, seat.arm_parent)
            below.size += _moved_size(size_there, seat.arm_parent)
    return Balance(left, size)


def twist_rates(s: State, vdot: Array) -> dict[str, Array]:
    """(α, acceleration of the origin) of every body."""
    rates: dict[str, Array] = {GROUND: np.zeros(6)}
    for seat in s.seats:
        of_child, of_parent, gamma = joint_blocks(seat, s)
        moved = of_parent @ rates[seat.joint.parent] + seat.twists @ vdot[seat.columns] + gamma
        # the other way round the arm: no equations are solved
        back = 2.0 * np.eye(6) - of_child
        rates[seat.joint.child] = back @ moved
    return rates


def _wrenches(
    ref: Reference, s: State, rates: dict[str, Array], loads: Array
) -> dict[str, _Carried]:
    """Of every body alone: its inertia, less what acts on it."""
    result: dict[str, _Carried] = {}
    for body in ref.model.bodies:
        own, gyroscopic = body_inertia(body, s)
        rate, acting = rates.get(body.name, np.zeros(6)), loads[ref.place.twist(body.name)]
        size = np.abs(own) @ np.abs(rate) + np.abs(gyroscopic) + np.abs(acting)
        result[body.name] = _Carried(own @ rate + gyroscopic - acting, size)
    return result


def _both_at_joint(seat: Seat, own: _Carried) -> tuple[Array, Array]:
    """At the joint frame, `arm_child` away from the origin."""
    return at_joint(seat, own.wrench), _moved_size(own.size, seat.arm_child)


def at_joint(seat: Seat, wrench: Array) -> Array:
    """A wrench about the child's origin, about the joint frame."""
    return moved(wrench, -seat.arm_child)


def moved(wrench: Array, arm: Array) -> Array:
    """A wrench about the end of `arm`, seen from its start."""
    x, y, z = arm
    n, f = wrench[:3], wrench[3:]
    across = np.array([y * f[2] - z * f[1], z * f[0] - x * f[2], x * f[1] - y * f[0]])
    return np.concatenate([n + across, f])


def _moved_size(size: Array, arm: Array) -> Array:
    x, y, z = np.abs(arm)
    n, f = size[:3], size[3:]
    across = np.array([y * f[2] + z * f[1], z * f[0] + x * f[2], x * f[1] + y * f[0]])
    return np.concatenate([n + across, f])


def powers(ref: Reference, s: State) -> float:
    """Of the forces without a potential, W."""
    forces = applied(ref.model, ref.place, s).other
    frames = [s.frames.get(body.name, STILL) for body in ref.model.bodies]
    twists = [part for frame in frames for part in (frame.omega, frame.velocity)]
    return float(forces @ np.concatenate([s.v, *twists]))
