"""Rolling without slip: at the contact P the material point of the body stands still on the plane.

φ = n · (P − origin), then rows k · v_P for k = n, t₁, t₂ (n and t₁ in a plane). With d = −(n −
(n·e) e)/|…| the steepest way down in a disk with axis e, P lies from the centre at
    r d (thin disk),   r d − tube n (torus),   −r n (sphere, and any circle in a plane).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from derive.model.constraint_records import Rolling
from derive.model.records import GROUND
from hamel.verify.reference.closures import NORMAL, triad
from hamel.verify.reference.layout import Layout, Rows, centripetal, point_velocity
from hamel.verify.reference.states import Frame, State
from hamel.verify.reference.surfaces import surface_at
from hamel.verify.reference.vectors import Array, cross


@dataclass(frozen=True)
class Contact:
    """From the centre to P, the directions of the rows, and the rates of both."""

    reach: Array
    reach_rate: Array
    directions: Array
    turning: Array


def rolling_rows(rolling: Rolling, plane: str, place: Layout, state: State) -> Rows:
    """k · (v_P − v_P of the plane's body) = 0, differentiated: with s the arm to P in that body,

    k · (a_C + α × reach − a_O − α_O × s) = −k · (ω × d(reach)/dt − ω_O × ds/dt) − k̇ · (v_P − …).
    """
    frame, carrier = state.frames[rolling.body], state.frames[rolling.carrier]
    n = carrier.point(state.vector(rolling.normal))
    n = n / np.linalg.norm(n)
    centre = frame.point(state.vector(rolling.centre))
    below = carrier.point(state.vector(rolling.origin))
    if rolling.surface is None:
        contact = _contact(rolling, plane, state, n)
    else:
        foot = _foot(rolling, state)
        n, below = foot.normal, foot.point - carrier.origin
        contact = _on_surface(rolling, plane, state, foot)
    arm = centre + contact.reach
    base = frame.origin + arm - carrier.origin
    base_rate = frame.speed(centre) + contact.reach_rate - carrier.velocity
    k = contact.directions
    coefficients = np.zeros((len(k), place.size))
    coefficients[:, place.twist(rolling.body)] = k @ point_velocity(arm)
    if rolling.carrier != GROUND:
        coefficients[:, place.twist(rolling.carrier)] -= k @ point_velocity(base)
    swing = centripetal(frame, centre) + cross(frame.omega, contact.reach_rate)
    swing = swing - cross(carrier.omega, base_rate)
    gamma = -k @ swing - contact.turning @ (frame.speed(arm) - carrier.speed(base))
    height = n @ (base - below)
    return Rows(coefficients, gamma, np.zeros(len(gamma)), np.array([height]))


@dataclass(frozen=True)
class Foot:
    """The point of a surface that is nearest to a sphere's centre, the normal there and its
    rate, along the ground's axes."""

    point: Array
    normal: Array
    rate: Array


def _foot(rolling: Rolling, state: State) -> Foot:
    """P + μ ∇f(P) = C, f(P) = 0 by Newton's method until nothing changes. With the centre's
    velocity in the carrier's frame (1 + μ H) Ṗ + ∇f μ̇ = Ċ, ∇f · Ṗ = 0, and n turns with H Ṗ."""
    assert rolling.surface is not None
    frame, carrier = state.frames[rolling.body], state.frames[rolling.carrier]
    arm = frame.point(state.vector(rolling.centre))
    gap = frame.origin + arm - carrier.origin
    back = carrier.rotation.T
    centre = back @ gap
    speed = back @ (frame.speed(arm) - carrier.speed(gap))
    at = surface_at(rolling.surface, state)
    point, mu = centre, 0.0
    for _ in range(50):
        f, g, H = at(point)
        matrix = np.block([[np.eye(3) + mu * H, g[:, None]], [g[None, :], np.zeros((1, 1))]])
        step = np.linalg.solve(matrix, -np.append(point + mu * g - centre, f))
        point, mu = point + step[:3], mu + step[3]
        if np.linalg.norm(step[:3]) < 1e-15 * (1.0 + np.linalg.norm(point)):
            break
    f, g, H = at(point)
    matrix = np.block([[np.eye(3) + mu * H, g[:, None]], [g[None, :], np.zeros((1, 1))]])
    moving = np.linalg.solve(matrix, np.append(speed, 0.0))[:3]
    n, rate = _unit(g, H @ moving)
    normal = carrier.rotation @ n
    turned = carrier.rotation @ rate + cross(carrier.omega, normal)
    return Foot(carrier.origin + carrier.point(point), normal, turned)


def _on_surface(rolling: Rolling, plane: str, state: State, foot: Foot) -> Contact:
    """Straight below the centre; forward is at right angles to the carrier's y, in a plane to its
    normal."""
    carrier, n = state.frames[rolling.carrier], foot.normal
    radius = state.value(rolling.radius)
    across = NORMAL[plane] if plane else carrier.rotation[:, 1]
    across_rate = cross(carrier.omega, across)
    t1, t1_rate = _unit(cross(across, n), cross(across_rate, n) + cross(across, foot.rate))
    directions, turning = [n, t1], [foot.rate, t1_rate]
    if not plane:
        directions.append(cross(n, t1))
        turning.append(cross(foot.rate, t1) + cross(n, t1_rate))
    return Contact(-radius * n, -radius * foot.rate, np.array(directions), np.array(turning))


def _contact(rolling: Rolling, plane: str, state: State, n: Array) -> Contact:
    frame, carrier = state.frames[rolling.body], state.frames[rolling.carrier]
    radius = state.value(rolling.radius)
    if plane:
        return _round(carrier, radius, n, np.array([n, cross(NORMAL[plane], n)]))
    if rolling.shape == "sphere":
        own = state.vector(rolling.normal)
        across = (carrier.rotation @ triad(own / np.linalg.norm(own))).T[:2]
        return _round(carrier, radius, n, np.array([n, *across]))
    tube = {"disk": 0.0, "torus": state.value(rolling.tube)}[rolling.shape]
    e = frame.point(state.vector(rolling.axis))
    rates = (cross(frame.omega, e), cross(carrier.omega, n))
    return _edge((e, n), rates, radius, tube)


def _round(carrier: Frame, radius: float, n: Array, directions: Array) -> Contact:
    """Straight below the centre: all turns with the plane."""
    turning = np.array([cross(carrier.omega, k) for k in directions])
    return Contact(-radius * n, -radius * cross(carrier.omega, n), directions, turning)


def _edge(
    axes: tuple[Array, Array], rates: tuple[Array, Array], radius: float, tube: float
) -> Contact:
    """The lowest point of a circle about e, thickened by `tube`; t₁ = e × n/|…| forward, t₂ = n ×
    t₁."""
    (e, n), (e_rate, n_rate) = axes, rates
    slope = n_rate @ e + n @ e_rate
    d, d_rate = _unit(-(n - (n @ e) * e), -(n_rate - slope * e - (n @ e) * e_rate))
    t1, t1_rate = _unit(cross(e, n), cross(e_rate, n) + cross(e, n_rate))
    directions = np.array([n, t1, cross(n, t1)])
    turning = np.array([n_rate, t1_rate, cross(n_rate, t1) + cross(n, t1_rate)])
    return Contact(radius * d - tube * n, radius * d_rate - tube * n_rate, directions, turning)


def _unit(x: Array, x_rate: Array) -> tuple[Array, Array]:
    """x/|x| and its time derivative."""
    size = np.linalg.norm(x)
    unit = x / size
    return unit, (x_rate - unit * (unit @ x_rate)) / size
