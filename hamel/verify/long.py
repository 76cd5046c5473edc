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
from collections.abc import Callable, Collection, Iterator, Sequence
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np

from codegen.reals import real_of
from derive.formulations.manifold import speed_rows
from derive.formulations.records import Equations
from derive.mechanics.limits import LONG
from derive.model.records import Model
from derive.states import sampling
from hamel.verify.checks.samples import all_parameters
from hamel.verify.long_loops import KEPT, OF_LOOPS
from hamel.verify.long_quaternions import OF_QUATERNIONS
from hamel.verify.long_trees import (
    CHECKS,
    SAME,
    Call,
    Entry,
    Place,
    Row,
    called,
    few,
    largest,
    relative,
    row_of,
)
from hamel.verify.records import CheckResult, Verification
from hamel.verify.reference.loads import uses_reactions
from hamel.verify.reference.outcome import Reference, reference, state_of
from hamel.verify.reference.ties import are_ties
from hamel.verify.reference.vectors import Array

VARIED = 0.02  # of parameters that are arguments: any mechanism stays one
FEWEST = 2  # states
MANY = 5  # states of a batch: lanes that are full, and some left
# Roundings of arguments, and how often they are drawn: near a small pivot few draws show too little
ROUNDINGS, DRAWS = 4.0, 16
APART = 4.0  # times what these show that two libraries' results may be apart (measured: 1.8)


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
        return (*CHECKS, *OF_QUATERNIONS)
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
            errors = [_difference(module, call, place, loose) for place in places]
            yield _result(name, errors, SAME * loose, about)


def _result(name: str, errors: Sequence[float], tolerance: float, about: str) -> CheckResult:
    value = max((math.inf if math.isnan(x) else x for x in errors), default=math.inf)
    return CheckResult(name, value, tolerance, value <= tolerance, about)


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


def _difference(module: ModuleType, call: Any, place: Place, loose: float) -> float:
    """Of what sines of another library, or another order of operations, may change as well no
    more than SAME counts: hundreds of links one behind the other enlarge a rounding."""
    found, wanted = called(call, *place.row), called(module.dynamics, *place.row)
    error = relative(found, wanted)
    if error <= SAME * loose or not math.isfinite(error):
        return error
    size = max(1.0, float(np.max(np.abs(wanted), initial=0.0)))
    unavoidable = APART * rounding(module.dynamics, place.row, math.ulp(1.0) * loose) / size
    return error / max(1.0, unavoidable / (SAME * loose))


BACKENDS: tuple[tuple[str, str, Callable[[ModuleType], Any]], ...] = (
    ("batch = one by one", "the batch call of dynamics", _batch),
    ("ctypes = module", "dynamics through the ctypes fallback", _part("_library")),
    ("NumPy = module", "dynamics of the NumPy text", _part("_numpy")),
)


# ---- what is shipped

Shipped = list[tuple[Row, Array]]


def shipped_rows(
    equations: Equations, module: ModuleType, seed: int, count: int, names: Collection[str]
) -> Iterator[tuple[str, Shipped]]:
    """Function of these names → arguments of few digits, and the module's own results there. One
    that the reference does not find right is left out, and there it will be missed."""
    ref = reference(equations.system.model)
    drawn_rows = _rows(equations, count, seed)
    rows = [(float(f"{t:.8g}"), few(x), few(u), few(p)) for t, x, u, p in drawn_rows]
    places = [_place(ref, equations, row) for row in rows]
    for name in dict.fromkeys(name for name, *_ in _checks(equations) if name in names):
        call = getattr(module, name)
        checks = [
            (tolerance, error) for own, _, tolerance, _, error in _checks(equations) if own == name
        ]
        yield (
            name,
            [
                (row_of(name, place), called(call, *row_of(name, place)))
                for place in places
                if all(error(ref, module, place) <= tolerance for tolerance, error in checks)
            ],
        )


def rounding(call: Call, row: Row, epsilon: float) -> float:
    """The largest change of an entry of the result where all arguments are off by a few roundings:
    no less does another order of operations make. Nothing is written out for it."""
    t, *others = row
    value, rng = called(call, *row), np.random.default_rng(7)
    changes = [0.0]
    for _ in range(DRAWS):
        off = [
            x * (1.0 + ROUNDINGS * epsilon * rng.uniform(-1.0, 1.0, np.shape(x))) for x in others
        ]
        moved = called(call, t, *off)
        changes.append(largest(moved - value) if moved.shape == value.shape else math.inf)
    return max(changes)
