"""Verification of long trees, and of mechanisms of many loops: the module against the reference's
balance of forces, O(n).

In loops v̇ is what keeps the closures at the ẇ of the module; then what is left of M v̇ + h − Q has
to be a force along them, Aᵀ λ. Both are solved for without a matrix over the whole mechanism.

What the usual suite looks at besides, matrices over all pairs of velocities and every function
written out, is not formed for them.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from codegen.reals import real_of
from derive.formulations.evaluate import function_of
from derive.formulations.manifold import speed_rows
from derive.formulations.records import Equations, Function
from derive.formulations.requests import request_of
from derive.mechanics.limits import LONG
from derive.model.records import Model
from derive.states import sampling
from hamel.verify.checks.evidence import all_parameters
from hamel.verify.limits import FLOOR
from hamel.verify.records import CheckResult, Verification
from hamel.verify.reference.balance import Balance, balance, powers
from hamel.verify.reference.loads import uses_reactions
from hamel.verify.reference.outcome import Reference, energies, reference, state_of
from hamel.verify.reference.outputs import events, nearest_turn, outputs
from hamel.verify.reference.states import State
from hamel.verify.reference.ties import (
    Sparse,
    Tie,
    accelerations,
    are_ties,
    carried_back,
    forces,
    rows_over_velocities,
    ties,
    violation,
)
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
# What follows from w by A v = c over a row of a thousand loops, and how far these are closed
KEPT = 1e-9
OFF = 0.1  # off the constraints
# … and so near that what is closed is not far: a correction may be longer in some coordinates
NEAR, FARTHEST = 1e-4, 100.0
BLOCKS = 8
ROUNDINGS, DRAWS = 4.0, 3  # of arguments, as far as operations on them are roundings, too
TINY = 1e-300  # where nothing acts


Row = tuple[float, Array, Array, Array]  # t, x, u, p: what the module is called with


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


def is_long(equations: Equations, module: ModuleType) -> bool:
    """Whether the model is so long that its module is verified by this suite, which knows all
    functions that it has."""
    known = {name for name, *_ in _checks(equations)}
    further = {x.name for x in (*equations.functions, *equations.requests)} - known
    whole = hasattr(module, "dynamics")  # which others are held against
    return of_long_model(equations) and whole and not any(hasattr(module, x) for x in further)


def of_long_model(equations: Equations) -> bool:
    """Whether nothing but functions on request may need more than O(n)."""
    system = equations.system
    own = system.model
    plain = own.kinetic is None and own.potential is None and not own.states
    return (system.long or _of_long_loops(equations)) and plain and not equations.charts


def _of_long_loops(equations: Equations) -> bool:
    """Of many links in loops, whose quasi-velocities are some of the velocities."""
    system = equations.system
    many = bool(system.rows) and len(system.links) >= LONG
    model = system.model
    ideal = not uses_reactions((model.loads, model.outputs, model.events))
    return many and are_ties(model) and ideal and own_velocities(equations) is not None


def own_velocities(equations: Equations) -> tuple[int, ...] | None:
    """Which of v are w = B v; None where w are other combinations."""
    B = speed_rows(equations)
    rows, columns = B.sparsity().get_triplet()
    single = sorted(rows) == list(range(B.size1())) and B.is_constant()
    if not single or not all(float(x) == 1.0 for x in ca.vertsplit(ca.DM(B.nz[:]))):
        return None
    return tuple(j for _, j in sorted(zip(rows, columns)))


def _checks(equations: Equations) -> tuple[Entry, ...]:
    """In loops velocities follow from each other, and are the same up to rounding alone."""
    if not equations.system.rows:
        return CHECKS
    solved = ((a, b, max(least, KEPT), about, error) for a, b, least, about, error in CHECKS)
    return (*solved, *OF_LOOPS)


def long_verification(
    model: Model, equations: Equations, module: ModuleType, states: int, seed: int = 0
) -> Verification:
    """Every function of the module at random states, held against the reference."""
    ref = reference(model)
    places = drawn(ref, equations, max(FEWEST, states), seed)
    loose = real_of(module.defaults.dtype.name).coarseness
    found = tuple(_results(_checks(equations), module, places, loose))
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


def _rows(equations: Equations, count: int, seed: int) -> list[tuple[float, Array, Array, Array]]:
    """t, (q, v), u and p."""
    found = sampling.states(equations.system, count, seed, parameters=VARIED)
    whole = np.concatenate([found.q, found.v], axis=1)
    return list(zip(found.t.tolist(), whole, found.u, found.p))


def _place(ref: Reference, equations: Equations, row: Row) -> Place:
    t, whole, u, p = row
    nq = len(equations.system.model.coordinates)
    q, v = np.split(whole, [nq])
    own = own_velocities(equations) or ()
    x = np.concatenate([q, v[list(own)]]) if equations.system.rows else whole
    seen = state_of(ref, t, q, v, u, all_parameters(equations.system, p))
    return Place(ref, equations, t, x, u, p, seen, own, bool(equations.system.rows))


def _results(
    checks: Sequence[Entry], module: ModuleType, places: Sequence[Place], loose: float
) -> Iterator[CheckResult]:
    for function, name, tolerance, about, error in checks:
        if not hasattr(module, function):
            continue
        errors = [error(place.ref, module, place) for place in places]
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


def _project(ref: Reference, module: ModuleType, place: Place) -> float:
    """What is left of φ at what `project` makes of a state off the constraints; w stays."""
    nq, rng = len(place.state.q), np.random.default_rng(9)
    q = place.state.q + NEAR * rng.uniform(-1.0, 1.0, nq)
    found = _called(module.project, place.t, np.concatenate([q, place.x[nq:]]), *place.row[2:])
    if found.shape != place.x.shape or not np.isfinite(found).all():
        return math.inf
    own = place.state
    there = state_of(ref, place.t, found[:nq], own.v, own.u, own.p)
    off = _largest(violation(there, ties(ref.model, there)).phi)
    far = _largest(found[:nq] - q) > FARTHEST * NEAR
    return math.inf if far else max(off, _relative(found[nq:], place.x[nq:]))


def _mass(ref: Reference, module: ModuleType, place: Place) -> float:
    """M y of a random y, against the reference's balance."""
    nv = len(place.state.v)
    M, y = _called(module.mass, *place.row), np.random.default_rng(10).normal(size=nv)
    if M.shape != (nv * nv,):
        return math.inf
    there, still = (balance(ref, place.state, x) for x in (y, np.zeros(nv)))
    size = there.size + still.size
    return _largest((M.reshape(nv, nv) @ y - (there.left - still.left)) / _sizes(place, size))


def _guards(ref: Reference, module: ModuleType, place: Place) -> float:
    """As derived, and far from refusing a regular state."""
    function = function_of(place.equations, made(place.equations, "guards"))
    wanted = function(*place.row).full().ravel()
    found = _called(module.guards, *place.row)
    sizes = np.maximum(1.0, np.abs(wanted))
    refuses = found.shape != wanted.shape or np.any(np.abs(found) < 1.0)
    return math.inf if refuses else _largest((found - wanted) / sizes)


def _constraint_rows(ref: Reference, module: ModuleType, place: Place) -> float:
    """Entries of the reference's A, each row over a power of two."""
    pattern = made(place.equations, "constraint_rows").result.pattern
    found = _called(module.constraint_rows, *place.row)
    if pattern is None or pattern.shape[0] != len(place.A) or len(found) != len(pattern.rows):
        return math.inf
    wanted = np.array([place.A[i].get(j, 0.0) for i, j in zip(pattern.rows, pattern.columns)])
    lengths = [
        np.sqrt(np.bincount(pattern.rows, weights=x**2, minlength=len(place.A)))
        for x in (found, wanted)
    ]
    ratio = 2.0 ** np.round(np.log2(lengths[0] / lengths[1]))[list(pattern.rows)]
    whole = sum(map(len, place.A)) <= len(found)  # none of the reference's is left out
    return _relative(found, ratio * wanted) if whole else math.inf


def made(equations: Equations, name: str) -> Function:
    """A function on request."""
    request = request_of(equations, name)
    assert request is not None
    return request.function


def _rates(ref: Reference, module: ModuleType, place: Place) -> float:
    return _relative(_called(module.dynamics, *place.row)[: len(place.state.q)], place.state.rates)


def _motion(ref: Reference, module: ModuleType, place: Place) -> float:
    wdot = _called(module.dynamics, *place.row)[len(place.state.q) :]
    if len(wdot) != len(place.x) - len(place.state.q) or not np.isfinite(wdot).all():
        return math.inf
    found = balance(ref, place.state, place.accelerations(wdot))
    if not place.tied:
        return _largest(found.left / _sizes(place, found.size))
    return _unbalanced(place, found, forces(place.A, found))


def _unbalanced(place: Place, found: Balance, lam: Array) -> float:
    """What the forces along the closures leave."""
    held = carried_back(place.A, lam, len(found.left))
    sizes = [{j: abs(x) for j, x in row.items()} for row in place.A]
    size = found.size + carried_back(sizes, np.abs(lam), len(found.left))
    return _largest((found.left - held) / _sizes(place, size))


def _sizes(place: Place, size: Array) -> Array:
    """What errors at joints are held against. In loops joints are near to the ground, and one that
    feels hardly anything just here is held against the others."""
    least = FLOOR * np.max(size, initial=0.0) if place.tied else 0.0
    return np.maximum(size, max(least, TINY))


def _reactions(ref: Reference, module: ModuleType, place: Place) -> float:
    lam = _called(module.reactions, *place.row)
    wdot = _called(module.dynamics, *place.row)[len(place.state.q) :]
    if lam.shape != (len(place.A),) or not np.isfinite(lam).all() or len(wdot) != len(place.own):
        return math.inf
    return _unbalanced(place, balance(ref, place.state, place.accelerations(wdot)), lam)


def _admissible(ref: Reference, module: ModuleType, place: Place) -> float:
    """Of the states themselves."""
    found = violation(place.state, place.ties)
    rates = found.rate / np.maximum(found.size, np.max(found.size, initial=TINY))
    return max(_largest(rates), _largest(found.phi))


def _constraints(ref: Reference, module: ModuleType, place: Place) -> float:
    """φ off the constraints, where it is not zero; A v − c is zero there, too."""
    q = place.state.q + OFF * np.random.default_rng(8).uniform(-1.0, 1.0, len(place.state.q))
    x = np.concatenate([q, place.x[len(q) :]])
    own = place.state
    there = state_of(ref, place.t, q, own.v, own.u, own.p)
    phi = violation(there, ties(ref.model, there)).phi
    found = _called(module.constraints, place.t, x, place.u, place.p)
    if len(found) < len(phi):
        return math.inf
    return _relative(found[: len(phi)], phi)


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
    whole = function in ("inverse_dynamics", "state")
    x = np.concatenate([place.whole if whole else place.x, _given(function, place)])
    return place.t, x, place.u, place.p


def _inverse(ref: Reference, module: ModuleType, place: Place) -> float:
    vdot, own = _given("inverse_dynamics", place), place.state
    forces = _called(module.inverse_dynamics, *_row("inverse_dynamics", place))
    if forces.shape != vdot.shape:
        return math.inf
    idle = state_of(ref, place.t, own.q, own.v, np.zeros_like(place.u), own.p)
    found = balance(ref, idle, vdot)
    return _largest((forces - found.left) / _sizes(place, found.size))


def _bias(ref: Reference, module: ModuleType, place: Place) -> float:
    h = _called(module.bias, *place.row)
    still = np.zeros(len(place.state.v))
    if h.shape != still.shape:
        return math.inf
    found = balance(ref, place.state, still, driven=False)
    return _largest((h - found.left) / _sizes(place, found.size))


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
    return _relative(_called(module.state, *_row("state", place)), place.x)


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


OF_LOOPS: tuple[Entry, ...] = (
    ("dynamics", "admissible", KEPT, "φ and A v − c at the states looked at", _admissible),
    ("reactions", "reactions", BALANCED, "M v̇ + h − Q against Aᵀ λ", _reactions),
    ("constraints", "constraints", SUMMED, "φ off the constraints", _constraints),
    ("project", "project", SUMMED, "φ at what is closed, w kept", _project),
    ("mass", "mass", BALANCED, "M times a vector, against the balance of forces", _mass),
    ("guards", "guards", KEPT, "pivots as derived, none near where it is refused", _guards),
    ("constraint_rows", "rows", SUMMED, "A, each row over its usual length", _constraint_rows),
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
    for name in dict.fromkeys(name for name, *_ in _checks(equations) if hasattr(module, name)):
        call = getattr(module, name)
        checks = [
            (tolerance, error) for own, _, tolerance, _, error in _checks(equations) if own == name
        ]
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
