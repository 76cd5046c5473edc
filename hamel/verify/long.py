"""Verification of long trees: the module against the reference's balance of forces, O(n).

What the usual suite looks at besides, matrices over all pairs of velocities and every function
written out, is not formed for them.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from codegen.reals import real_of
from derive.formulations.records import Equations
from derive.model.records import Model
from derive.states import sampling
from hamel.verify.checks.evidence import all_parameters
from hamel.verify.records import CheckResult, Verification
from hamel.verify.reference.balance import balance, powers
from hamel.verify.reference.outcome import Reference, energies, reference, state_of
from hamel.verify.reference.outputs import events, nearest_turn, outputs
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

VARIED = 0.02  # of parameters that are arguments: any mechanism stays one
FEWEST = 2  # states
MANY = 5  # states of a batch: lanes that are full, and some left
SAME = 1e-13  # what only copies, and other ways to call the same loops
# Relative to the sizes of what is summed at a joint. Two recursions over 10,000 links differ there
# by 1e-12 (measured); an error in one link's constants shows as the part it has in its own joint.
BALANCED = 1e-9
SUMMED = 1e-9  # energies and powers, relative to them or to one of their unit
# Central differences over STEP lose ten of sixteen digits.
STEP, CHANGED = 1e-5, 1e-6
BLOCKS = 8
ROUNDINGS, DRAWS = 4.0, 3  # of arguments, as far as operations on them are roundings, too
TINY = 1e-300  # where nothing acts


Row = tuple[float, Array, Array, Array]  # t, x, u, p: what the module is called with


@dataclass(frozen=True)
class Place:
    """A random state, as the module takes it and as the reference sees it."""

    t: float
    x: Array
    u: Array
    p: Array
    state: State

    @property
    def row(self) -> Row:
        """What the module is called with."""
        return self.t, self.x, self.u, self.p


def is_long(equations: Equations, module: ModuleType) -> bool:
    """Whether the model is a tree so long that its module is verified by this suite, which knows
    all functions that it has."""
    known = {name for name, *_ in CHECKS}
    further = {x.name for x in (*equations.functions, *equations.requests)} - known
    whole = hasattr(module, "dynamics")  # which others are held against
    return of_long_tree(equations) and whole and not any(hasattr(module, x) for x in further)


def of_long_tree(equations: Equations) -> bool:
    """Whether nothing but functions on request may need more than O(n)."""
    system = equations.system
    own = system.model
    plain = own.kinetic is None and own.potential is None and not own.states
    return system.long and plain and not equations.charts


def long_verification(
    model: Model, equations: Equations, module: ModuleType, states: int, seed: int = 0
) -> Verification:
    """Every function of the module at random states, held against the reference."""
    ref = reference(model)
    places = drawn(ref, equations, max(FEWEST, states), seed)
    loose = real_of(module.defaults.dtype.name).coarseness
    found = tuple(_results(ref, module, places, loose))
    columns = zip(*(np.concatenate([[s.t], s.x, s.u, s.p]) for s in places))
    names = ["t", *(name for a in equations.arguments if a.name != "t" for name in a.labels)]
    return Verification(
        model.name,
        equations.choice,
        all(check.passed for check in found),
        found,
        len(places),
        seed,
        region=tuple((n, float(min(c)), float(max(c))) for n, c in zip(names, columns)),
        varied=equations.arguments[3].labels,
    )


def drawn(ref: Reference, equations: Equations, count: int, seed: int) -> list[Place]:
    """Random states; a tree has no others."""
    return [_place(ref, equations, row) for row in _rows(equations, count, seed)]


def _rows(equations: Equations, count: int, seed: int) -> list[Row]:
    found = sampling.states(equations.system, count, seed, parameters=VARIED)
    x = np.concatenate([found.q, found.v], axis=1)
    return list(zip(found.t.tolist(), x, found.u, found.p))


def _place(ref: Reference, equations: Equations, row: Row) -> Place:
    t, x, u, p = row
    q, v = np.split(x, [len(equations.system.model.coordinates)])
    return Place(*row, state_of(ref, t, q, v, u, all_parameters(equations.system, p)))


def _results(
    ref: Reference, module: ModuleType, places: Sequence[Place], loose: float
) -> Iterator[CheckResult]:
    for function, name, tolerance, about, error in CHECKS:
        if not hasattr(module, function):
            continue
        errors = [error(ref, module, place) for place in places]
        yield _result(name, [float(x) for x in errors if x is not None], tolerance * loose, about)
    for name, about, backend in BACKENDS:
        call = backend(module)
        if call is not None:
            errors = [_difference(module, call, place) for place in places]
            yield _result(name, errors, SAME * loose, about)


def _result(name: str, errors: Sequence[float], tolerance: float, about: str) -> CheckResult:
    value = max((math.inf if math.isnan(x) else x for x in errors), default=math.inf)
    return CheckResult(name, value, tolerance, value <= tolerance, about)


# ---- against the reference


Call = Callable[..., Any]


def _called(call: Call, *row: Any) -> Array:
    """A flat result; not a number where the module refuses the state."""
    try:
        return np.ravel(call(*row))
    except FloatingPointError:
        return np.full(1, np.nan)


def _rates(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(_called(module.dynamics, *place.row)[: len(place.state.q)], place.state.rates)


def _motion(ref: Reference, module: ModuleType, place: Place) -> float:
    vdot = _called(module.dynamics, *place.row)[len(place.state.q) :]
    if len(vdot) != len(place.state.v) or not np.isfinite(vdot).all():
        return math.inf
    found = balance(ref, place.state, vdot)
    return _largest(found.left / np.maximum(found.size, TINY))


def _given(function: str, place: Place) -> Array:
    """What the function takes behind the state: v̇, changes of state and inputs, weights of ẋ."""
    nx, nu = len(place.x), len(place.u)
    sizes = {
        "inverse_dynamics": len(place.state.v),
        "dynamics_forward": nx + nu,
        "dynamics_adjoint": nx,
    }
    return _few(np.random.default_rng(4).normal(size=sizes.get(function, 0)))


def _row(function: str, place: Place) -> Row:
    """What the function is called with."""
    x = np.concatenate([place.x, _given(function, place)])
    return place.t, x, place.u, place.p


def _inverse(ref: Reference, module: ModuleType, place: Place) -> float:
    vdot, own = _given("inverse_dynamics", place), place.state
    forces = _called(module.inverse_dynamics, *_row("inverse_dynamics", place))
    if forces.shape != vdot.shape:
        return math.inf
    idle = state_of(ref, place.t, own.q, own.v, np.zeros_like(place.u), own.p)
    found = balance(ref, idle, vdot)
    return _largest((forces - found.left) / np.maximum(found.size, TINY))


def _bias(ref: Reference, module: ModuleType, place: Place) -> float:
    h = _called(module.bias, *place.row)
    still = np.zeros(len(place.state.v))
    if h.shape != still.shape:
        return math.inf
    found = balance(ref, place.state, still, driven=False)
    return _largest((h - found.left) / np.maximum(found.size, TINY))


def _along(ref: Reference, module: ModuleType, place: Place) -> float:
    """What is left of the equations of motion at v̇ + ε dv̇, by central differences along
    (dx, du): nothing, where dv̇ is right."""
    nq, nv = len(place.state.q), len(place.state.v)
    changes = _given("dynamics_forward", place)
    found = _called(module.dynamics_forward, *_row("dynamics_forward", place))
    vdot = _called(module.dynamics, *place.row)[nq:]
    if found.shape != (nq + nv,) or not np.isfinite(found).all() or vdot.shape != (nv,):
        return math.inf
    ahead, behind = (
        balance(ref, _moved(ref, place, side * changes), vdot + side * found[nq:])
        for side in (STEP, -STEP)
    )
    slope = (ahead.left - behind.left) / (2.0 * STEP)
    size = ahead.size + balance(ref, place.state, found[nq:]).size
    rates = _relative(found[:nq], changes[nq : nq + nv])
    return max(rates, _largest(slope / np.maximum(size, TINY)))


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
    slopes = _called(module.dynamics_adjoint, *_row("dynamics_adjoint", place))
    if slopes.shape != (nx + nu,):
        return math.inf
    errors = [0.0]
    for block in np.array_split(rng.permutation(nx + nu), BLOCKS):
        d = np.zeros(nx + nu)
        d[block] = rng.normal(size=len(block))
        ahead, behind = (
            _called(
                module.dynamics, place.t, place.x + side * d[:nx], place.u + side * d[nx:], place.p
            )
            for side in (STEP, -STEP)
        )
        if ahead.shape != (nx,) or behind.shape != (nx,):
            return math.inf
        change = (ahead - behind) / (2.0 * STEP)
        size = np.abs(y) @ np.abs(change) + np.abs(slopes) @ np.abs(d)
        errors.append(float(abs(y @ change - slopes @ d) / max(size, TINY)))
    return _largest(np.array(errors))


def _velocity(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(_called(module.velocity, *place.row), place.state.v)


def _state_of(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(_called(module.state, *place.row), place.x)


def _power(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(_called(module.power, *place.row), np.array([powers(ref, place.state)]))


def _energy(ref: Reference, module: ModuleType, place: Place) -> float:
    wanted = np.array(energies(ref, place.state)[:2])
    return _relative(_called(module.energy, *place.row)[:2], wanted)


def _outputs(ref: Reference, module: ModuleType, place: Place) -> float:
    found = _called(module.outputs, *place.row)
    wanted = outputs(ref.model, place.state, np.zeros(0))
    if found.shape != wanted.shape:
        return math.inf
    return _relative(found, nearest_turn(ref.model, wanted, found))


def _events(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(
        _called(module.events, *place.row), events(ref.model, place.state, np.zeros(0))
    )


def _relative(found: Array, wanted: Array) -> float:
    if found.shape != wanted.shape:
        return math.inf
    return _largest((found - wanted) / np.maximum(1.0, np.max(np.abs(wanted), initial=0.0)))


def _largest(x: Array) -> float:
    return float(np.max(np.abs(x), initial=0.0)) if np.isfinite(x).all() else math.inf


Error = Callable[[Reference, ModuleType, Place], float]
# function, what is checked of it, tolerance, what it is held against
CHECKS: tuple[tuple[str, str, float, str, Error], ...] = (
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


# ---- other ways to call it


def _part(name: str) -> Callable[[ModuleType], Any]:
    def call(module: ModuleType) -> Any:
        try:
            return getattr(importlib.import_module(f"{module.__name__}.{name}"), "dynamics", None)
        except (ImportError, OSError):
            return None  # what was not generated or compiled cannot be wrong

    return call


def _batch(module: ModuleType) -> Any:
    dynamics = getattr(module, "dynamics", None)
    if dynamics is None:
        return None

    def last(t: float, x: Array, u: Array, p: Array) -> Array:
        return dynamics(np.full(MANY, t), *(np.tile(y, (MANY, 1)) for y in (x, u, p)))[-1]

    return last


def _difference(module: ModuleType, call: Any, place: Place) -> float:
    return _relative(_called(call, *place.row), _called(module.dynamics, *place.row))


BACKENDS: tuple[tuple[str, str, Callable[[ModuleType], Any]], ...] = (
    ("batch = one by one", "the batch call of dynamics", _batch),
    ("ctypes = module", "dynamics through the ctypes fallback", _part("_library")),
    ("NumPy = module", "dynamics of the NumPy text", _part("_numpy")),
)


# ---- what is shipped

Shipped = list[tuple[Row, Array]]


def shipped_rows(
    equations: Equations, module: ModuleType, seed: int, count: int
) -> Iterator[tuple[str, Shipped]]:
    """Function → arguments of few digits, and the module's own results there. One that the
    reference does not find right is left out, and there it will be missed."""
    ref = reference(equations.system.model)
    drawn_rows = _rows(equations, count, seed)
    rows = [(float(f"{t:.8g}"), _few(x), _few(u), _few(p)) for t, x, u, p in drawn_rows]
    places = [_place(ref, equations, row) for row in rows]
    for name in dict.fromkeys(name for name, *_ in CHECKS if hasattr(module, name)):
        call = getattr(module, name)
        checks = [(tolerance, error) for own, _, tolerance, _, error in CHECKS if own == name]
        yield (
            name,
            [
                (_row(name, place), _called(call, *_row(name, place)))
                for place in places
                if all(error(ref, module, place) <= tolerance for tolerance, error in checks)
            ],
        )


def rounding(call: Call, row: Row, epsilon: float) -> float:
    """The largest change of an entry of the result where all arguments are off by a few roundings:
    no less does another order of operations make. Nothing is written out for it."""
    t, *others = row
    value, rng = _called(call, *row), np.random.default_rng(7)
    changes = [0.0]
    for _ in range(DRAWS):
        off = [
            x * (1.0 + ROUNDINGS * epsilon * rng.uniform(-1.0, 1.0, np.shape(x))) for x in others
        ]
        moved = _called(call, t, *off)
        changes.append(_largest(moved - value) if moved.shape == value.shape else math.inf)
    return max(changes)


def _few(values: Array) -> Array:
    """To eight digits, each by itself: longer ones differ between machines."""
    return np.array([float(f"{value:.8g}") for value in values])
