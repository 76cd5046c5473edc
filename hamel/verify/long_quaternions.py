"""Checks of long trees whose coordinates are not the integrals of their velocities: q̇, q ⊕ d,
q₁ ⊖ q₀ and the lengths of quaternions, each joint by itself."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import numpy as np

from derive.states.sampling import normalised
from hamel.verify.long_trees import (
    SAME,
    SUMMED,
    Entry,
    Place,
    called,
    few,
    relative,
)
from hamel.verify.reference.outcome import Reference, state_of
from hamel.verify.reference.vectors import Array, turned_quaternion

FAR = 0.4  # a displacement, in the units of v
LONGER = 0.1  # of a quaternion whose length is not one


def _rates(ref: Reference, module: ModuleType, place: Place) -> float:
    return relative(called(module.qdot, *place.row), place.state.rates)


def _displaced(ref: Reference, module: ModuleType, place: Place) -> float:
    d = _displacement(place)
    found = _called(module, "integrate", place, np.concatenate([place.state.q, d]))
    return relative(found, _moved(ref, place, d))


def _between(ref: Reference, module: ModuleType, place: Place) -> float:
    """q₀ ⊕ (q₁ ⊖ q₀) is q₁."""
    end = few(_moved(ref, place, _displacement(place)))
    found = _called(module, "difference", place, np.concatenate([place.state.q, end]))
    if found.shape != place.state.v.shape:
        return np.inf
    reached = _moved(ref, place, found)
    return relative(_normalised(place, reached), _normalised(place, end))


def _lengths(ref: Reference, module: ModuleType, place: Place) -> float:
    q = _stretched(place)
    return relative(_called(module, "normalise", place, q), _normalised(place, q))


def _constraints(ref: Reference, module: ModuleType, place: Place) -> float:
    """|q|² − 1 where it is not zero."""
    q = _stretched(place)
    found = called(module.constraints, *_with(place, q))
    return relative(found, np.array([q[own] @ q[own] - 1.0 for own in _quaternions(place)]))


def _project(ref: Reference, module: ModuleType, place: Place) -> float:
    q = _stretched(place)
    wanted = np.concatenate([_normalised(place, q), place.x[len(q) :]])
    return relative(called(module.project, *_with(place, q)), wanted)


def _called(module: ModuleType, name: str, place: Place, x: Array) -> Array:
    return called(getattr(module, name), place.t, x, place.u, place.p)


def _with(place: Place, q: Array) -> tuple[float, Array, Array, Array]:
    return place.t, np.concatenate([q, place.x[len(q) :]]), place.u, place.p


def _displacement(place: Place) -> Array:
    return few(FAR * np.random.default_rng(9).uniform(-1.0, 1.0, len(place.state.v)))


def _quaternions(place: Place) -> Iterator[slice]:
    return (slice(start, start + 4) for start in place.equations.system.quaternions)


def _stretched(place: Place) -> Array:
    """q with quaternions of another length."""
    q = place.state.q.copy()
    for k, own in enumerate(_quaternions(place)):
        q[own] *= 1.0 + LONGER * np.sin(k + 1.0)
    return q


def _normalised(place: Place, q: Array) -> Array:
    return normalised(place.equations.system, q)


def _moved(ref: Reference, place: Place, d: Array) -> Array:
    """q + N d; quaternions by the part of d that turns them."""
    own = place.state
    result = own.q + state_of(ref, place.t, own.q, d, own.u, own.p).rates
    starts = set(place.equations.system.quaternions)
    for rows, columns, entries in own.blocks:
        for start in starts & {*range(rows.start, rows.stop)}:
            mine = slice(start, start + 4)
            part = entries[start - rows.start : start - rows.start + 4]
            turn = d[columns][np.abs(part).any(axis=0)]
            result[mine] = turned_quaternion(own.q[mine], turn)
    return result


OF_QUATERNIONS: tuple[Entry, ...] = (
    ("qdot", "qdot", SAME, "N v", _rates),
    ("integrate", "integrate", SUMMED, "q + N d, quaternions times exp(d/2)", _displaced),
    ("difference", "difference", SUMMED, "q₀ ⊕ d comes out at q₁", _between),
    ("normalise", "normalise", SUMMED, "quaternions divided by their length", _lengths),
    ("constraints", "constraints", SUMMED, "|q|² − 1 of stretched quaternions", _constraints),
    ("project", "project", SUMMED, "these divided by their length", _project),
)
