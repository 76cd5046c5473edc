"""Acceleration rows in maximal coordinates z = (v, twist of each body): joints, closures, wheels,
rods and user expressions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from derive.diagnostics import AssumptionError
from derive.model.constraint_records import (
    Distance,
    Holonomic,
    Nonholonomic,
    NoSlip,
    OnSurface,
    Rolling,
)
from derive.model.records import Closure, Constraint, Model
from hamel.verify.reference.closures import closure_rows
from hamel.verify.reference.jets import Jet, length, point, stays
from hamel.verify.reference.layout import Layout, Rows, centripetal, layout, point_velocity
from hamel.verify.reference.rolling import rolling_rows
from hamel.verify.reference.states import Seat, State
from hamel.verify.reference.vectors import Array, cross, skew


def joint_blocks(seat: Seat, state: State) -> tuple[Array, Array, Array]:
    """X_c, X_p, γ of six rows X_c ẋ_c − X_p ẋ_p − E H v̇ = γ over the twists: the child moves as
    the parent, plus its own motion.

    α_c − α_p − (E Hω) v̇ = ω_p × ω_rel + E Ḣω v; a_c + α_c × s + … − (a_p + α_p × d) − (E Hv) v̇ =
    ω_p × (ω_p × d + v_rel) + ω_c × v_rel + E Ḣv v, s and d the two arms.
    """
    parent, child = state.frames[seat.joint.parent], state.frames[seat.joint.child]
    swing = cross(parent.omega, cross(parent.omega, seat.arm_parent) + seat.velocity) + cross(
        child.omega, seat.velocity
    )
    gamma = np.concatenate(
        [cross(parent.omega, seat.omega), swing - centripetal(child, seat.arm_child)]
    )
    return _transport(seat.arm_child), _transport(seat.arm_parent), gamma + seat.bias


def _transport(arm: Array) -> Array:
    """6 × 6: twist at the body's origin → twist at `arm`."""
    moved = np.eye(6)
    moved[3:, :3] = -skew(arm)
    return moved


def no_slip_row(wheel: NoSlip, place: Layout, state: State) -> Rows:
    """d · v_P = 0 with d fixed in the body: d · (a + α × r) = −d · ω × (ω × r) − (ω × d) · v_P."""
    frame = state.frames[wheel.body]
    arm, direction = (
        frame.point(state.vector(wheel.point)),
        frame.point(state.vector(wheel.direction)),
    )
    coefficients = np.zeros((1, place.size))
    coefficients[:, place.twist(wheel.body)] = direction @ point_velocity(arm)
    gamma = -direction @ centripetal(frame, arm) - cross(frame.omega, direction) @ frame.speed(arm)
    return Rows(coefficients, np.array([gamma]), np.zeros(1), np.zeros(0))


def distance_row(rod: Distance, place: Layout, state: State) -> Rows:
    """φ = |p₂ − p₁| − length; its λ is the force along the rod, positive where it pushes the points
    apart."""
    ends = [point(place, state, body, state.vector(at)) for body, at in zip(rod.bodies, rod.points)]
    gap = length(ends[1] - ends[0])
    return stays(
        [Jet(gap.value - state.value(rod.length), gap.rate, gap.over, gap.rest)], place.size
    )


RowsOf = Callable[[State], Rows]


def constraint_rows(
    model: Model, by_formula: Callable[[Holonomic | Nonholonomic | OnSurface], RowsOf]
) -> tuple[RowsOf, ...]:
    """Of each closure, then of each constraint, in the model's order; `by_formula` differentiates
    what is given as a formula."""
    place = layout(model)

    def rows_of(item: Closure | Constraint) -> RowsOf:
        if isinstance(item, Holonomic | Nonholonomic | OnSurface):
            return by_formula(item)
        return lambda state: _physical_rows(item, model, place, state)

    return tuple(rows_of(item) for item in (*model.closures, *model.constraints))


def _physical_rows(item: object, model: Model, place: Layout, state: State) -> Rows:
    match item:
        case Closure():
            return closure_rows(item, model.plane, place, state)
        case NoSlip():
            return no_slip_row(item, place, state)
        case Rolling():
            return rolling_rows(item, model.plane, place, state)
        case Distance():
            return distance_row(item, place, state)
    raise AssumptionError(
        f"verify cannot derive the constraint '{getattr(item, 'name', item)}' again: its reference "
        f"does not know {type(item).__name__}",
        "it takes a derivation of its own in hamel/verify/reference/rows.py",
    )


def nonideal_force(model: Model, state: State) -> Array:
    """Nᵀ C of the constraints' own generalised forces C per coordinate, nv."""
    force = np.zeros(len(model.coordinates))
    for item in model.constraints:
        if isinstance(item, Holonomic | Nonholonomic) and item.nonideal:
            force = force + state.vector(item.nonideal)
    return state.along_velocities(force)
