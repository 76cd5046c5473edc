"""Acceleration rows in maximal coordinates z = (v, twist of each body): joints, closures, wheels and user expressions.

A row says coefficients · ż = gamma, coefficients · z = c, and its multiplier acts on the system as coefficientsᵀ λ.
A twist is (angular velocity, velocity of the body's origin) in the ground frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from derive.expressions import tree
from derive.model.records import GROUND, Closure, Constraint, Holonomic, Model, Nonholonomic, NoSlip, Rolling
from hamel.verify.states import Frame, Seat, State
from hamel.verify.vectors import UNIT, Array, cross, skew


@dataclass(frozen=True)
class Rows:
    """k rows over z (nz): coefficients k × nz, gamma k, c k, phi (the holonomic ones, in order)."""

    coefficients: Array
    gamma: Array
    c: Array
    phi: Array


@dataclass(frozen=True)
class ConstraintRow:
    """One row over v from a formula: coefficients (nv) · v̇ = gamma, A v = c; phi for a holonomic row, else None."""

    coefficients: Array
    gamma: float
    c: float
    phi: float | None


@dataclass(frozen=True)
class Layout:
    """Where things stand in z: the velocities first, then six per body."""

    nv: int
    bodies: tuple[str, ...]

    @property
    def size(self) -> int:
        return self.nv + 6 * len(self.bodies)

    def twist(self, body: str) -> slice:
        start = self.nv + 6 * self.bodies.index(body)
        return slice(start, start + 6)


def layout(model: Model) -> Layout:
    return Layout(len(model.velocities), tuple(body.name for body in model.bodies))


def stacked(parts: Sequence[Rows], size: int) -> Rows:
    """All rows below each other."""
    return Rows(
        np.vstack([np.zeros((0, size)), *(part.coefficients for part in parts)]),
        np.concatenate([np.zeros(0), *(part.gamma for part in parts)]),
        np.concatenate([np.zeros(0), *(part.c for part in parts)]),
        np.concatenate([np.zeros(0), *(part.phi for part in parts)]),
    )


def point_velocity(arm: Array) -> Array:
    """3 × 6: twist of a body → velocity of its point at `arm` (ground axes) from the origin."""
    return np.hstack([-skew(arm), np.eye(3)])


def centripetal(frame: Frame, arm: Array) -> Array:
    """ω × (ω × arm): acceleration of the point less origin acceleration and α × arm."""
    return cross(frame.omega, cross(frame.omega, arm))


def joint_rows(seat: Seat, place: Layout, state: State) -> Rows:
    """Six rows: the child moves as the parent plus the joint's own motion.

    α_c − α_p − (E Hω) v̇ = ω_p × ω_rel;
    a_c + α_c × s + … − (a_p + α_p × d) − (E Hv) v̇ = ω_p × (ω_p × d + v_rel) + ω_c × v_rel, s and d the two arms.
    """
    parent, child = state.frames[seat.joint.parent], state.frames[seat.joint.child]
    coefficients = np.zeros((6, place.size))
    coefficients[:, seat.columns] = -seat.twists
    coefficients[:, place.twist(seat.joint.child)] = _transport(seat.arm_child)
    if seat.joint.parent != GROUND:
        coefficients[:, place.twist(seat.joint.parent)] = -_transport(seat.arm_parent)
    swing = cross(parent.omega, cross(parent.omega, seat.arm_parent) + seat.velocity) + cross(child.omega, seat.velocity)
    gamma = np.concatenate([cross(parent.omega, seat.omega), swing - centripetal(child, seat.arm_child)])
    return Rows(coefficients, gamma, np.zeros(6), np.zeros(0))


def _transport(arm: Array) -> Array:
    """6 × 6: twist at the body's origin → twist at `arm`."""
    return np.vstack([np.hstack([np.eye(3), np.zeros((3, 3))]), point_velocity(arm)])


def closure_rows(closure: Closure, model: Model, place: Layout, state: State) -> Rows:
    """Planar pin: the two in-plane components of p₂ − p₁ vanish; λ is the force on bodies[1] along the ground axes."""
    if closure.type != "revolute" or not model.plane:
        raise NotImplementedError(f"the reference knows planar revolute closures only, not {closure.type!r} in space")
    plane = np.array([UNIT[letter] for letter in model.plane])
    frames = [state.frames[body] for body in closure.bodies]
    arms = [frame.point(state.vector(p.position)) for frame, p in zip(frames, closure.placements)]
    coefficients = np.zeros((2, place.size))
    for body, sign, arm in zip(closure.bodies, (-1.0, 1.0), arms):
        if body != GROUND:
            coefficients[:, place.twist(body)] += sign * plane @ point_velocity(arm)
    gap = frames[1].origin + arms[1] - frames[0].origin - arms[0]
    pull = centripetal(frames[0], arms[0]) - centripetal(frames[1], arms[1])
    return Rows(coefficients, plane @ pull, np.zeros(2), plane @ gap)


def no_slip_row(wheel: NoSlip, place: Layout, state: State) -> Rows:
    """d · v_P = 0 with d fixed in the body: d · (a + α × r) = −d · ω × (ω × r) − (ω × d) · v_P."""
    frame = state.frames[wheel.body]
    arm, direction = frame.point(state.vector(wheel.point)), frame.point(state.vector(wheel.direction))
    coefficients = np.zeros((1, place.size))
    coefficients[:, place.twist(wheel.body)] = direction @ point_velocity(arm)
    gamma = -direction @ centripetal(frame, arm) - cross(frame.omega, direction) @ frame.speed(arm)
    return Rows(coefficients, np.array([gamma]), np.zeros(1), np.zeros(0))


def rolling_rows(rolling: Rolling, place: Layout, state: State) -> Rows:
    """Thin disk on a plane: n · (P − origin) = 0, then no velocity of the material point at P along t₁ = e × n and t₂ = n × t₁.

    P = centre + r d with d = −(n − (n·e) e)/|…|; rows k · v_P, hence k · (a_C + α × r d) = −k · (ω × r ḋ) − k̇ · v_P.
    """
    frame = state.frames[rolling.body]
    n, e = state.vector(rolling.normal), frame.point(state.vector(rolling.axis))
    n, radius = n / np.linalg.norm(n), state.value(rolling.radius)
    e_rate = cross(frame.omega, e)
    d, d_rate = _unit(-(n - (n @ e) * e), (n @ e_rate) * e + (n @ e) * e_rate)
    t1, t1_rate = _unit(cross(e, n), cross(e_rate, n))
    directions = np.array([n, t1, cross(n, t1)])
    turning = np.array([np.zeros(3), t1_rate, cross(n, t1_rate)])
    centre = frame.point(state.vector(rolling.centre))
    arm = centre + radius * d
    coefficients = np.zeros((3, place.size))
    coefficients[:, place.twist(rolling.body)] = directions @ point_velocity(arm)
    swing = centripetal(frame, centre) + cross(frame.omega, radius * d_rate)
    gamma = -directions @ swing - turning @ frame.speed(arm)
    height = n @ (frame.origin + arm - state.vector(rolling.origin))
    return Rows(coefficients, gamma, np.zeros(3), np.array([height]))


def _unit(x: Array, x_rate: Array) -> tuple[Array, Array]:
    """x/|x| and its time derivative."""
    length = np.linalg.norm(x)
    unit = x / length
    return unit, (x_rate - unit * (unit @ x_rate)) / length


RowsOf = Callable[[State], Rows]


def constraint_rows(
    model: Model, expression_row: Callable[[Holonomic | Nonholonomic], Callable[[State], ConstraintRow]]
) -> RowsOf:
    """All constraint rows in the model's order, closures first; `expression_row` differentiates what is given as a formula."""
    place = layout(model)

    def rows_of(item: Closure | Constraint) -> RowsOf:
        if isinstance(item, Holonomic | Nonholonomic):
            return _embedded(expression_row(item), place)
        return lambda state: _physical_rows(item, model, place, state)

    parts = [rows_of(item) for item in (*model.closures, *model.constraints)]
    return lambda state: stacked([part(state) for part in parts], place.size)


def _physical_rows(item: object, model: Model, place: Layout, state: State) -> Rows:
    match item:
        case Closure():
            return closure_rows(item, model, place, state)
        case NoSlip():
            return no_slip_row(item, place, state)
        case Rolling(shape="disk"):
            return rolling_rows(item, place, state)
    raise NotImplementedError(f"the reference does not know constraints such as {item}")


def _embedded(row: Callable[[State], ConstraintRow], place: Layout) -> RowsOf:
    """A row over v as a row over z."""

    def rows(state: State) -> Rows:
        r = row(state)
        coefficients = np.concatenate([r.coefficients, np.zeros(place.size - place.nv)])[None, :]
        phi = np.zeros(0) if r.phi is None else np.array([r.phi])
        return Rows(coefficients, np.array([r.gamma]), np.array([r.c]), phi)

    return rows


def nonideal_force(model: Model, state: State) -> Array:
    """Nᵀ C of the constraints' own generalised forces C per coordinate, nv."""
    entries: list[tuple[tree.Expression, ...]] = [
        item.nonideal for item in model.constraints if isinstance(item, Holonomic | Nonholonomic) and item.nonideal
    ]
    return state.N.T @ sum((state.vector(entry) for entry in entries), np.zeros(len(model.coordinates)))
