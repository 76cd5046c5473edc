"""Checks of mechanisms of many loops: what their closures and the forces along them add to those of
trees. Nothing is formed over the whole mechanism.
"""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np

from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations, Function
from derive.formulations.requests import request_of
from hamel.verify.long_trees import (
    BALANCED,
    SUMMED,
    TINY,
    Entry,
    Place,
    called,
    held_against,
    largest,
    relative,
    unbalanced,
)
from hamel.verify.reference.balance import balance
from hamel.verify.reference.outcome import Reference, state_of
from hamel.verify.reference.ties import ties, violation

# What follows from w by A v = c over a row of a thousand loops, and how far these are closed
KEPT = 1e-9
OFF = 0.1  # off the constraints
# … and so near that what is closed is not far: a correction may be longer in some coordinates
NEAR, FARTHEST = 1e-4, 100.0


def _admissible(ref: Reference, module: ModuleType, place: Place) -> float:
    """Of the states themselves."""
    found = violation(place.state, place.ties)
    rates = found.rate / np.maximum(found.size, np.max(found.size, initial=TINY))
    return max(largest(rates), largest(found.phi))


def _reactions(ref: Reference, module: ModuleType, place: Place) -> float:
    lam = called(module.reactions, *place.row)
    wdot = called(module.dynamics, *place.row)[len(place.state.q) :]
    if lam.shape != (len(place.A),) or not np.isfinite(lam).all() or len(wdot) != len(place.own):
        return math.inf
    return unbalanced(place, balance(ref, place.state, place.accelerations(wdot)), lam)


def _constraints(ref: Reference, module: ModuleType, place: Place) -> float:
    """φ off the constraints, where it is not zero; A v − c is zero there, too."""
    q = place.state.q + OFF * np.random.default_rng(8).uniform(-1.0, 1.0, len(place.state.q))
    x = np.concatenate([q, place.x[len(q) :]])
    own = place.state
    there = state_of(ref, place.t, q, own.v, own.u, own.p)
    phi = violation(there, ties(ref.model, there)).phi
    found = called(module.constraints, place.t, x, place.u, place.p)
    if len(found) < len(phi):
        return math.inf
    return relative(found[: len(phi)], phi)


def _project(ref: Reference, module: ModuleType, place: Place) -> float:
    """What is left of φ at what `project` makes of a state off the constraints; w stays."""
    nq, rng = len(place.state.q), np.random.default_rng(9)
    q = place.state.q + NEAR * rng.uniform(-1.0, 1.0, nq)
    found = called(module.project, place.t, np.concatenate([q, place.x[nq:]]), *place.row[2:])
    if found.shape != place.x.shape or not np.isfinite(found).all():
        return math.inf
    own = place.state
    there = state_of(ref, place.t, found[:nq], own.v, own.u, own.p)
    off = largest(violation(there, ties(ref.model, there)).phi)
    far = largest(found[:nq] - q) > FARTHEST * NEAR
    return math.inf if far else max(off, relative(found[nq:], place.x[nq:]))


def _mass(ref: Reference, module: ModuleType, place: Place) -> float:
    """M y of a random y, against the reference's balance."""
    nv = len(place.state.v)
    M, y = called(module.mass, *place.row), np.random.default_rng(10).normal(size=nv)
    if M.shape != (nv * nv,):
        return math.inf
    there, still = (balance(ref, place.state, x) for x in (y, np.zeros(nv)))
    size = there.size + still.size
    return largest((M.reshape(nv, nv) @ y - (there.left - still.left)) / held_against(place, size))


def _guards(ref: Reference, module: ModuleType, place: Place) -> float:
    """As derived, and far from refusing a regular state."""
    function = function_of(place.equations, made(place.equations, "guards"))
    wanted = function(*place.row).full().ravel()
    found = called(module.guards, *place.row)
    sizes = np.maximum(1.0, np.abs(wanted))
    refuses = found.shape != wanted.shape or np.any(np.abs(found) < 1.0)
    return math.inf if refuses else largest((found - wanted) / sizes)


def _constraint_rows(ref: Reference, module: ModuleType, place: Place) -> float:
    """Entries of the reference's A, each row over a power of two."""
    pattern = made(place.equations, "constraint_rows").result.pattern
    found = called(module.constraint_rows, *place.row)
    if pattern is None or pattern.shape[0] != len(place.A) or len(found) != len(pattern.rows):
        return math.inf
    wanted = np.array([place.A[i].get(j, 0.0) for i, j in zip(pattern.rows, pattern.columns)])
    lengths = [
        np.sqrt(np.bincount(pattern.rows, weights=x**2, minlength=len(place.A)))
        for x in (found, wanted)
    ]
    ratio = 2.0 ** np.round(np.log2(lengths[0] / lengths[1]))[list(pattern.rows)]
    whole = sum(map(len, place.A)) <= len(found)  # none of the reference's is left out
    return relative(found, ratio * wanted) if whole else math.inf


def made(equations: Equations, name: str) -> Function:
    """A function on request."""
    request = request_of(equations, name)
    assert request is not None
    return request.function


OF_LOOPS: tuple[Entry, ...] = (
    ("dynamics", "admissible", KEPT, "φ and A v − c at the states looked at", _admissible),
    ("reactions", "reactions", BALANCED, "M v̇ + h − Q against Aᵀ λ", _reactions),
    ("constraints", "constraints", SUMMED, "φ off the constraints", _constraints),
    ("project", "project", SUMMED, "φ at what is closed, w kept", _project),
    ("mass", "mass", BALANCED, "M times a vector, against the balance of forces", _mass),
    ("guards", "guards", KEPT, "pivots as derived, none near where it is refused", _guards),
    ("constraint_rows", "rows", SUMMED, "A, each row over its usual length", _constraint_rows),
)
