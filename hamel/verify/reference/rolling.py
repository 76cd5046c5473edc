"""Rolling without slip: at the contact P the material point of the body stands still on the plane.

φ = n · (P − origin), then rows k · v_P for k = n, t₁, t₂ (n and t₁ in a plane). With d = −(n −
(n·e) e)/|…| the steepest way down in a disk with axis e, P lies from the centre at
    r d (thin disk),   r d − tube n (torus),   −r n (sphere, and any circle in a plane).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from derive.model.constraint_records import Rolling
from hamel.verify.reference.closures import NORMAL, triad
from hamel.verify.reference.layout import Layout, Rows, centripetal, point_velocity
from hamel.verify.reference.states import Frame, State
from hamel.verify.reference.vectors import Array, cross


@dataclass(frozen=True)
class Contact:
    """From the centre to P, the directions of the rows, and the rates of both."""

    reach: Array
    reach_rate: Array
    directions: Array
    turning: Array


def rolling_rows(rolling: Rolling, plane: str, place: Layout, state: State) -> Rows:
    """k · v_P = 0, hence k · (a_C + α × reach) = −k · (ω × d(reach)/dt) − k̇ · v_P."""
    frame, n = state.frames[rolling.body], state.vector(rolling.normal)
    n = n / np.linalg.norm(n)
    contact = _contact(rolling, plane, state, frame, n)
    centre = frame.point(state.vector(rolling.centre))
    arm = centre + contact.reach
    coefficients = np.zeros((len(contact.directions), place.size))
    coefficients[:, place.twist(rolling.body)] = contact.directions @ point_velocity(arm)
    swing = centripetal(frame, centre) + cross(frame.omega, contact.reach_rate)
    gamma = -contact.directions @ swing - contact.turning @ frame.speed(arm)
    height = n @ (frame.origin + arm - state.vector(rolling.origin))
    return Rows(coefficients, gamma, np.zeros(len(gamma)), np.array([height]))


def _contact(rolling: Rolling, plane: str, state: State, frame: Frame, n: Array) -> Contact:
    radius = state.value(rolling.radius)
    if plane:
        return _round(frame, radius, n, np.array([n, cross(NORMAL[plane], n)]))
    if rolling.shape == "sphere":
        return _round(frame, radius, n, np.array([n, *triad(n).T[:2]]))
    tube = {"disk": 0.0, "torus": state.value(rolling.tube)}[rolling.shape]
    return _edge(frame, frame.point(state.vector(rolling.axis)), n, radius, tube)


def _round(frame: Frame, radius: float, n: Array, directions: Array) -> Contact:
    """Straight below the centre; while the contact moves through the body, centre to P does not
    turn, so in a_C + α × reach + ω × d(reach)/dt the last term is zero.
    """
    return Contact(-radius * n, np.zeros(3), directions, np.zeros_like(directions))


def _edge(frame: Frame, e: Array, n: Array, radius: float, tube: float) -> Contact:
    """The lowest point of a circle about e, thickened by `tube`; t₁ = e × n/|…| forward, t₂ = n ×
    t₁."""
    e_rate = cross(frame.omega, e)
    d, d_rate = _unit(-(n - (n @ e) * e), (n @ e_rate) * e + (n @ e) * e_rate)
    t1, t1_rate = _unit(cross(e, n), cross(e_rate, n))
    directions = np.array([n, t1, cross(n, t1)])
    turning = np.array([np.zeros(3), t1_rate, cross(n, t1_rate)])
    return Contact(radius * d - tube * n, radius * d_rate, directions, turning)


def _unit(x: Array, x_rate: Array) -> tuple[Array, Array]:
    """x/|x| and its time derivative."""
    size = np.linalg.norm(x)
    unit = x / size
    return unit, (x_rate - unit * (unit @ x_rate)) / size
