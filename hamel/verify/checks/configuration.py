"""Moving about in the configuration space: q̇, q ⊕ d, q₁ ⊖ q₀ and unit quaternions, each against
the reference's own N."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from derive.states.sampling import normalised
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.limits import SOLVED, TERMS
from hamel.verify.reference.vectors import Array, turned_quaternion


def coordinate_rates(e: Evidence) -> float | None:
    """The function `qdot`."""
    wanted, sums = [s.outcome.qdot for s in e.samples], e.of_speeds(TERMS)
    return _against(e, "qdot", wanted, e.units.qdot, sums)


def displaced(e: Evidence) -> float | None:
    """The function `integrate` at d = v times a unit of time."""
    there = [_moved(e, s.q, s.outcome.kinematics.N, e.units.time * s.v) for s in e.samples]
    sizes = [1.0 + worst(s.q / e.units.q) for s in e.samples] + e.speeds
    return _against(e, "integrate", there, e.units.q, Sums(TERMS, sizes))


def between(e: Evidence) -> float | None:
    """The function `difference`: q₀ ⊕ (q₁ ⊖ q₀) is q₁, for quaternions up to sign, and no turn is
    longer than half a one."""
    if not e.graph.has("difference"):
        return None
    places = e.arguments_of("difference")
    nq = len(e.samples[0].q)
    steps = [e.graph("difference", s.t, x, s.u, s.p) for s, x in zip(e.samples, places)]
    reached = [_moved(e, s.q, s.outcome.kinematics.N, d) for s, d in zip(e.samples, steps)]
    ends = [x[nq:] for x in places]
    signed = [_signed(e, x, like) for x, like in zip(reached, ends)]
    sums = Sums(SOLVED, [1.0 + worst(x / e.units.q) for x in ends])
    error = deviation(signed, ends, e.conditions, unit=e.units.q, sums=sums)
    return max(_longest(e, steps), error)


def lengths(e: Evidence) -> float | None:
    """The function `normalise`."""
    return _against(
        e, "normalise", [normalised(e.system, x) for x in e.arguments_of("normalise")], e.units.q
    )


def _against(
    e: Evidence, name: str, wanted: Sequence[Array], unit: Array, sums: Sums | None = None
) -> float | None:
    if not e.graph.has(name):
        return None
    ours = [e.graph(name, s.t, x, s.u, s.p) for s, x in zip(e.samples, e.arguments_of(name))]
    return deviation(ours, wanted, e.conditions, unit=unit, sums=sums)


def _moved(e: Evidence, q: Array, N: Array, d: Array) -> Array:
    """q + N d; quaternions by the part of d that turns them."""
    result = q + N @ d
    for start in e.system.quaternions:
        own = slice(start, start + 4)
        turn = d[np.abs(N[own]).any(axis=0)]
        result[own] = turned_quaternion(q[own], turn)
    return result


def _signed(e: Evidence, q: Array, like: Array) -> Array:
    """Each quaternion of q with the sign that brings it nearer to the other."""
    result = q.copy()
    for start in e.system.quaternions:
        own = slice(start, start + 4)
        result[own] *= -1.0 if q[own] @ like[own] < 0.0 else 1.0
    return result


def _longest(e: Evidence, steps: Sequence[Array]) -> float:
    """By how much the longest turn exceeds π."""
    result = [0.0]
    for s, d in zip(e.samples, steps):
        for start in e.system.quaternions:
            turn = d[np.abs(s.outcome.kinematics.N[start : start + 4]).any(axis=0)]
            result.append(float(np.linalg.norm(turn)) - np.pi)
    return max(result)


CHECKS = (
    Check("qdot", TERMS, "reference: N v", coordinate_rates),
    Check(
        "integrate", TERMS, "q + N d, quaternions times exp(d/2), with the reference's N", displaced
    ),
    Check(
        "difference",
        SOLVED,
        "the reference's q₀ ⊕ d comes out at q₁, the shorter way round; per condition number",
        between,
    ),
    Check("normalise", 1e-12, "quaternions divided by their length", lengths),
)
