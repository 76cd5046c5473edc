"""Inverse dynamics against the reference, and as the inverse of the dynamics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import FLOOR, SMALL, SOLVED, TERMS
from hamel.verify.reference.outcome import evaluate, state_of
from hamel.verify.reference.vectors import Array


def any_motion(e: Evidence) -> float | None:
    """τ = M a + h − Q(u = 0) of the reference, at accelerations a that need not be possible."""
    if not e.graph.has("inverse_dynamics"):
        return None
    return worst(
        [
            _error(e, k, a, s.outcome.M @ a + s.outcome.h - idle, TERMS)
            for k, (s, a, idle) in enumerate(_requests(e))
        ]
    )


def _requests(e: Evidence) -> Iterator[tuple[Sample, Array, Array]]:
    rng = np.random.default_rng(3)
    return ((s, e.units.vdot * rng.normal(size=len(s.v)), _idle(e, s)) for s in e.samples)


def _idle(e: Evidence, s: Sample) -> Array:
    """The reference's Q where nothing drives."""
    return evaluate(e.reference, state_of(e.reference, s.t, s.q, s.v, np.zeros_like(s.u), s.full)).Q


def own_motion(e: Evidence) -> float | None:
    """dynamics ∘ inverse_dynamics = 1: the choice's own v̇ asks for the forces it came from, Q(u) −
    Q(0) + Aᵀ λ."""
    if not e.graph.has("inverse_dynamics"):
        return None
    driven = (s.outcome.Q - _idle(e, s) + s.outcome.constraint_force for s in e.samples)
    errors = [_error(e, k, a, f, SOLVED) for k, (a, f) in enumerate(zip(e.vdot, driven))]
    return worst([error / condition for error, condition in zip(errors, e.conditions)])


def _error(e: Evidence, k: int, a: Array, wanted: Array, tolerance: float) -> float:
    """Against the sizes of what is summed, |M| |a| + |h| + |Q| and the forces themselves."""
    s, o = e.samples[k], e.samples[k].outcome
    ours = e.graph("inverse_dynamics", s.t, np.concatenate([s.whole, a]), s.u, s.p)
    size = (np.abs(o.M) @ np.abs(a) + np.abs(o.h) + np.abs(o.Q) + np.abs(wanted)) / e.units.force
    least = SMALL + FLOOR * size.max(initial=0.0)
    least = max(least, float(e.of_forces(tolerance).floors[k]))
    return worst((ours - wanted) / e.units.force / np.maximum(size, least))


CHECKS = (
    Check("inverse dynamics", TERMS, "reference: M v̇ + h − Q at u = 0, for any v̇", any_motion),
    Check(
        "dynamics ∘ inverse",
        SOLVED,
        "the forces of the choice's own v̇ are those it came from, per condition number",
        own_motion,
    ),
)
