"""Identities between matrices that hold whatever the model is."""

from __future__ import annotations

import numpy as np

from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import deviation, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import ROUNDED, TERMS, UNDONE
from hamel.verify.reference.outcome import energies, state_of
from hamel.verify.reference.saddle import least_eigenvalue
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array


def symmetric(e: Evidence) -> float:
    """The largest |M − Mᵀ| relative to the largest entry of M, in the model's own units."""
    own = [t.M / e.units.M for t in e.terms]
    return worst([worst(M - M.T) / max(worst(M), 1e-300) for M in own])


def semidefinite(e: Evidence) -> float | None:
    """How far the smallest eigenvalue of M, scaled to a unit diagonal, is below zero. A diagonal
    entry that cancels counts as what rounding may leave of it. Of no meaning where the file has an
    inertia that no body can have."""
    if not e.possible:
        return None
    given = zip(e.terms, e.samples)
    return worst([max(0.0, -least_eigenvalue(t.M, s.outcome.least_inertia)) for t, s in given])


def kinetic(e: Evidence) -> float | None:
    """T = ½ vᵀ M v, where the reference says that T is a quadratic form at all: T(2 v) = 4 T(v)."""
    if not _quadratic(e):
        return None
    ours = [np.array([0.5 * s.v @ t.M @ s.v]) for s, t in zip(e.samples, e.terms)]
    wanted, sums = [np.array([t.T]) for t in e.terms], e.of_energies(TERMS)
    return deviation(ours, wanted, unit=e.units.energy, sums=sums)


def _quadratic(e: Evidence) -> bool:
    for s in e.samples[:3]:
        twice = state_of(e.reference, s.t, s.q, 2.0 * s.v, s.u, s.full)
        T = energies(e.reference, twice).T
        if abs(T - 4.0 * s.outcome.T) > 1e-9 * (e.units.energy + abs(T)):
            return False
    return True


def inverse(e: Evidence, left: str, right: str) -> float | None:
    """left · right against the identity (A R, B S) or zero (A S, B R), relative to |left| |right|,
    per condition of Y, and beyond what roundoff makes of the right one."""
    first, second = e.named(left), e.named(right)
    if first is None or second is None:
        return None
    v, identity = e.units.v, (left, right) in (("A", "R"), ("B", "S"))
    columns = v[:, None]
    given = zip(first, second, e.rounded(right), e.conditions)
    return worst(
        [
            _product_error(a * v, b / columns, moved / columns, identity) / condition
            for a, b, moved, condition in given
        ]
    )


def _product_error(left: Array, right: Array, moved: Array, identity: bool) -> float:
    """With the rows on the left of length one, whatever they are told in; `moved` is the roundoff
    of the right one."""
    wanted = np.eye(len(left)) if identity else np.zeros((len(left), right.shape[1]))
    lengths = _lengths(left, 1)
    across = lengths.T if identity else 1.0 / _lengths(right, 0)
    left, right, moved = left / lengths, right * across, moved * across
    size = 1.0 + np.linalg.norm(left, axis=1, keepdims=True) * np.linalg.norm(
        right, axis=0, keepdims=True
    )
    excess = np.abs(left @ right - wanted) - ROUNDED * (np.abs(left) @ moved)
    return worst(np.maximum(excess, 0.0) / size)


def _lengths(matrix: Array, axis: int) -> Array:
    lengths = np.linalg.norm(matrix, axis=axis, keepdims=True)
    return np.where(lengths > 0.0, lengths, 1.0)


def roundtrip(e: Evidence) -> float:
    """(q, v) → x → (q, v); and x = (q, B v) off the constraints as well, where B is shown: no
    condition number excuses that."""
    forth = [_forth(e, s, at) for s, d in zip(e.samples, e.disturbed) for at in (s.state, d)]
    wanted, sums = [s.v for s in e.samples], e.of_speeds(UNDONE)
    back = deviation(e.velocities, wanted, e.conditions, unit=e.units.v, sums=sums)
    return max(worst(forth), back)


def _forth(e: Evidence, s: Sample, at: State) -> float:
    x = e.graph("state", s.t, np.concatenate([at.q, at.v, s.z]), s.u, s.p)
    q, w = x[: len(at.q)], x[e.graph.equations.speeds]
    states = x[e.graph.equations.speeds.stop :] - s.z
    moved = max(worst((q - at.q) / (e.units.q + np.abs(at.q))), worst(states / e.units.z))
    if "B" not in e.graph.named:
        return moved
    B = np.array(e.graph.named["B"](s.t, x, s.u, s.p))
    return max(moved, worst((w - B @ at.v) / (e.units.w + np.abs(B) @ np.abs(at.v))))


def _product_check(left: str, right: str) -> Check:
    name = f"{left} {right} = {int((left, right) in (('A', 'R'), ('B', 'S')))}"
    return Check(
        name,
        UNDONE,
        "block inverse of Y = [A; B], per condition number",
        lambda e: inverse(e, left, right),
    )


CHECKS = (
    Check("M symmetric", 1e-13, "M = Mᵀ", symmetric),
    Check("M semidefinite", UNDONE, "no negative eigenvalue", semidefinite),
    Check("T = ½ vᵀ M v", TERMS, "kinetic energy is the mass matrix's quadratic form", kinetic),
    *(_product_check(left, right) for left in "AB" for right in "SR"),
    Check(
        "x ↔ (q, v)",
        UNDONE,
        "state and velocity undo each other on A v = c, per condition number",
        roundtrip,
    ),
)
