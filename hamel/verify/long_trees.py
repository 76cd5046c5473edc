"""Checks of long trees, and of what mechanisms of many loops have in common with them: each
function of a module at a random state, against the reference's balance of forces, O(n).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np

from derive.formulations.records import Equations
from hamel.verify.limits import FLOOR
from hamel.verify.reference.balance import Balance, balance, powers
from hamel.verify.reference.outcome import Reference, energies, state_of
from hamel.verify.reference.outputs import events, nearest_turn, outputs
from hamel.verify.reference.states import State
from hamel.verify.reference.ties import (
    Sparse,
    Tie,
    accelerations,
    carried_back,
    forces,
    rows_over_velocities,
    ties,
)
from hamel.verify.reference.vectors import Array

SAME = 1e-13  # what only copies, and other ways to call the same loops
# Relative to the sizes of what is summed at a joint. Two recursions over 10,000 links differ there
# by 1e-12 (measured); an error in one link's constants shows as the part it has in its own joint.
BALANCED = 1e-9
SUMMED = 1e-9  # energies and powers, relative to them or to one of their unit
# Central differences over STEP lose ten of sixteen digits.
STEP, CHANGED = 1e-5, 1e-6
BLOCKS = 8
TINY = 1e-300  # where nothing acts

Row = tuple[float, Array, Array, Array]  # t, x, u, p: what the module is called with
Call = Callable[..., Any]


@dataclass(frozen=True)
class Place:
    """A random state, as the module takes it and as the reference sees it."""

    ref: Reference
    equations: Equations
    t: float
    x: Array
    u: Array
    p: Array
    state: State
    own: tuple[int, ...]  # which of v are w
    tied: bool

    @property
    def whole(self) -> Array:
        """(q, v), of which the module's x may have a part alone."""
        return np.concatenate([self.state.q, self.state.v])

    @cached_property
    def ties(self) -> list[Tie]:
        """Closures and rods here."""
        return ties(self.ref.model, self.state)

    @cached_property
    def A(self) -> list[Sparse]:
        """Their rows over v."""
        return rows_over_velocities(self.state, self.ties)

    def accelerations(self, wdot: Array) -> Array:
        """v̇ at ẇ: no numbers where the closures cannot be kept."""
        if not self.tied:
            return wdot
        given = dict(zip(self.own, wdot.tolist()))
        vdot, left = accelerations(self.state, self.ties, self.A, given)
        return vdot if left <= BALANCED else np.full(len(vdot), np.nan)

    @property
    def row(self) -> Row:
        """What the module is called with."""
        return self.t, self.x, self.u, self.p


def _rates(ref: Reference, module: ModuleType, place: Place) -> float:
    return relative(called(module.dynamics, *place.row)[: len(place.state.q)], place.state.rates)


def _motion(ref: Reference, module: ModuleType, place: Place) -> float:
    wdot = called(module.dynamics, *place.row)[len(place.state.q) :]
    if len(wdot) != len(place.x) - len(place.state.q) or not np.isfinite(wdot).all():
        return math.inf
    found = balance(ref, place.state, place.accelerations(wdot))
    if not place.tied:
        return largest(found.left / held_against(place, found.size))
    return unbalanced(place, found, forces(place.A, found))


def _inverse(ref: Reference, module: ModuleType, place: Place) -> float:
    vdot, own = _given("inverse_dynamics", place), place.state
    forces = called(module.inverse_dynamics, *row_of("inverse_dynamics", place))
    if forces.shape != vdot.shape:
        return math.inf
    idle = state_of(ref, place.t, own.q, own.v, np.zeros_like(place.u), own.p)
    found = balance(ref, idle, vdot)
    return largest((forces - found.left) / held_against(place, found.size))


def _bias(ref: Reference, module: ModuleType, place: Place) -> float:
    h = called(module.bias, *place.row)
    still = np.zeros(len(place.state.v))
    if h.shape != still.shape:
        return math.inf
    found = balance(ref, place.state, still, driven=False)
    return largest((h - found.left) / held_against(place, found.size))


def _along(ref: Reference, module: ModuleType, place: Place) -> float:
    """What is left of the equations of motion at v̇ + ε dv̇, by central differences along
    (dx, du): nothing, where dv̇ is right."""
    nq, nv = len(place.state.q), len(place.state.v)
    changes = _given("dynamics_forward", place)
    found = called(module.dynamics_forward, *row_of("dynamics_forward", place))
    vdot = called(module.dynamics, *place.row)[nq:]
    if found.shape != (nq + nv,) or not np.isfinite(found).all() or vdot.shape != (nv,):
        return math.inf
    states = [_moved(ref, place, side * changes) for side in (STEP, -STEP)]
    ahead, behind = (
        balance(ref, state, vdot + side * found[nq:]) for state, side in zip(states, (STEP, -STEP))
    )
    slope = (ahead.left - behind.left) / (2.0 * STEP)
    size = ahead.size + balance(ref, place.state, found[nq:]).size
    rates = relative(found[:nq], (states[0].rates - states[1].rates) / (2.0 * STEP))
    return max(rates, largest(slope / np.maximum(size, TINY)))


def _moved(ref: Reference, place: Place, changes: Array) -> State:
    nq, nv = len(place.state.q), len(place.state.v)
    dq, dv, du = np.split(changes, [nq, nq + nv])
    own = place.state
    return state_of(ref, place.t, own.q + dq, own.v + dv, place.u + du, own.p)


def _weighted(ref: Reference, module: ModuleType, place: Place) -> float:
    """yᵀ times the change of ẋ along (dx, du), by central differences of `dynamics`, against the
    weighted slopes times (dx, du); by blocks of links, so that the sizes are those of a few."""
    nx, nu = len(place.x), len(place.u)
    y, rng = _given("dynamics_adjoint", place), np.random.default_rng(6)
    slopes = called(module.dynamics_adjoint, *row_of("dynamics_adjoint", place))
    if slopes.shape != (nx + nu,):
        return math.inf
    errors = [0.0]
    for block in np.array_split(rng.permutation(nx + nu), BLOCKS):
        d = np.zeros(nx + nu)
        d[block] = rng.normal(size=len(block))
        ahead, behind = (
            called(
                module.dynamics, place.t, place.x + side * d[:nx], place.u + side * d[nx:], place.p
            )
            for side in (STEP, -STEP)
        )
        if ahead.shape != (nx,) or behind.shape != (nx,):
            return math.inf
        change = (ahead - behind) / (2.0 * STEP)
        size = np.abs(y) @ np.abs(change) + np.abs(slopes) @ np.abs(d)
        errors.append(float(abs(y @ change - slopes @ d) / max(size, TINY)))
    return largest(np.array(errors))


def _velocity(ref: Reference, module: ModuleType, place: Place) -> float:
    return relative(called(module.velocity, *place.row), place.state.v)


def _state_of(ref: Reference, module: ModuleType, place: Place) -> float:
    return relative(called(module.state, *row_of("state", place)), place.x)


def _power(ref: Reference, module: ModuleType, place: Place) -> float:
    return relative(called(module.power, *place.row), np.array([powers(ref, place.state)]))


def _energy(ref: Reference, module: ModuleType, place: Place) -> float:
    wanted = np.array(energies(ref, place.state)[:2])
    return relative(called(module.energy, *place.row)[:2], wanted)


def _outputs(ref: Reference, module: ModuleType, place: Place) -> float:
    found = called(module.outputs, *place.row)
    wanted = outputs(ref.model, place.state, np.zeros(0), _moving(ref, module, place))
    if found.shape != wanted.shape:
        return math.inf
    return relative(found, nearest_turn(ref.model, wanted, found))


def _moving(ref: Reference, module: ModuleType, place: Place) -> Array:
    """v̇ of the module, which its balance is checked by; none where no output needs it."""
    if not ref.model.accelerations:
        return np.zeros(len(place.state.v))
    rates = called(module.dynamics, *place.row)[len(place.state.q) :]
    whole = len(rates) == len(place.x) - len(place.state.q)
    return place.accelerations(rates) if whole else np.full(len(place.state.v), np.nan)


def _events(ref: Reference, module: ModuleType, place: Place) -> float:
    wanted = events(ref.model, place.state, np.zeros(0), _moving(ref, module, place))
    return relative(called(module.events, *place.row), wanted)


# ---- what the module is called with, and what its results are held against


def _given(function: str, place: Place) -> Array:
    """What the function takes behind the state: v̇, changes of state and inputs, weights of ẋ."""
    nx, nu = len(place.x), len(place.u)
    sizes = {
        "inverse_dynamics": len(place.state.v),
        "dynamics_forward": nx + nu,
        "dynamics_adjoint": nx,
    }
    return few(np.random.default_rng(4).normal(size=sizes.get(function, 0)))


def row_of(function: str, place: Place) -> Row:
    """What the function is called with."""
    whole = function in ("inverse_dynamics", "state")
    x = np.concatenate([place.whole if whole else place.x, _given(function, place)])
    return place.t, x, place.u, place.p


def unbalanced(place: Place, found: Balance, lam: Array) -> float:
    """What the forces along the closures leave."""
    held = carried_back(place.A, lam, len(found.left))
    sizes = [{j: abs(x) for j, x in row.items()} for row in place.A]
    size = found.size + carried_back(sizes, np.abs(lam), len(found.left))
    return largest((found.left - held) / held_against(place, size))


def held_against(place: Place, size: Array) -> Array:
    """What errors at joints are held against. In loops joints are near to the ground, and one that
    feels hardly anything just here is held against the others."""
    least = FLOOR * np.max(size, initial=0.0) if place.tied else 0.0
    return np.maximum(size, max(least, TINY))


def called(call: Call, *row: Any) -> Array:
    """A flat result; not a number where the module refuses the state."""
    try:
        return np.ravel(call(*row))
    except FloatingPointError:
        return np.full(1, np.nan)


def relative(found: Array, wanted: Array) -> float:
    """The largest difference, over the largest that is wanted or over one."""
    if found.shape != wanted.shape:
        return math.inf
    return largest((found - wanted) / np.maximum(1.0, np.max(np.abs(wanted), initial=0.0)))


def largest(x: Array) -> float:
    """The largest size of an entry; infinite where one is no number."""
    return float(np.max(np.abs(x), initial=0.0)) if np.isfinite(x).all() else math.inf


def few(values: Array) -> Array:
    """To eight digits, each by itself: longer ones differ between machines."""
    return np.array([float(f"{value:.8g}") for value in values])


Error = Callable[[Reference, ModuleType, Place], float]
# function, what is checked of it, tolerance, what it is held against
Entry = tuple[str, str, float, str, Error]
CHECKS: tuple[Entry, ...] = (
    ("dynamics", "rates", SAME, "q̇ of dynamics against N v", _rates),
    (
        "dynamics",
        "balance",
        BALANCED,
        "M v̇ + h − Q by Newton–Euler in the ground's axes at v̇ of dynamics, against the sizes of "
        "what is summed at each joint",
        _motion,
    ),
    ("inverse_dynamics", "forces", BALANCED, "the same at any v̇, with no inputs", _inverse),
    ("bias", "bias", BALANCED, "the same at v̇ = 0, with no forces applied", _bias),
    (
        "dynamics_forward",
        "along",
        CHANGED,
        "the balance along (dx, du), by differences of the reference",
        _along,
    ),
    (
        "dynamics_adjoint",
        "adjoint",
        CHANGED,
        "yᵀ times differences of dynamics, against the product times (dx, du)",
        _weighted,
    ),
    ("velocity", "velocity", SAME, "v", _velocity),
    ("state", "state", SAME, "x of (q, v)", _state_of),
    ("power", "power", SUMMED, "of the forces without a potential", _power),
    ("energy", "energy", SUMMED, "T and V", _energy),
    ("outputs", "outputs", SUMMED, "points, velocities and angles", _outputs),
    ("events", "events", SUMMED, "what changes its sign at events", _events),
)
