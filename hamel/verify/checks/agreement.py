"""Does the derivation say what the independent reference says, term by term and in the end?"""

from __future__ import annotations

import numpy as np

from hamel.verify.checks.rung import Rung
from hamel.verify.compare import deviation, sizes, worst
from hamel.verify.evidence import Evidence, Graph, Sample, Terms
from hamel.verify.outputs import nearest_turn, outputs
from hamel.verify.reference import kinematics, state_of
from hamel.verify.saddle import saddle, solved
from hamel.verify.vectors import Array


def admissible(e: Evidence) -> float:
    """|φ| against the size of the positions and |A v − c| against |A| |v|: the reference's own word on the states."""
    return worst([_violation(s) for s in e.samples])


def _violation(s: Sample) -> float:
    k = s.outcome.kinematics
    position = worst(k.phi) / (1.0 + worst(s.q))
    velocity = np.abs(k.violation(s.v)) / (1.0 + np.abs(k.A) @ np.abs(s.v))
    return max(position, worst(velocity))


def rates(e: Evidence) -> float:
    return deviation([t.qdot for t in e.terms], [s.outcome.qdot for s in e.samples])


def mass(e: Evidence) -> float:
    """|M − M_ref|ᵢⱼ against √(Mᵢᵢ Mⱼⱼ), so that light parts count as much as heavy ones."""
    return worst([_mass_error(t.M, s.outcome.M) for t, s in zip(e.terms, e.samples)])


def _mass_error(got: Array, wanted: Array) -> float:
    root = np.sqrt(np.abs(np.diag(wanted)))
    size = np.maximum(np.outer(root, root), 1e-12 * np.max(np.abs(wanted), initial=1e-300))
    return worst((got - wanted) / size)


def force(e: Evidence) -> float:
    """Q − h: velocity products, gravity, loads, inputs and nonideal forces together."""
    return deviation([t.Q - t.h for t in e.terms], [s.outcome.force for s in e.samples])


def positions(e: Evidence) -> float:
    """φ off the constraint surface, where it is not zero."""
    rng, got, wanted = np.random.default_rng(0), [], []
    for s in e.samples:
        q = s.q + 0.1 * rng.uniform(-1, 1, len(s.q))
        got.append(e.terms_at(s.t, q, s.v, s.u, s.p).phi)
        wanted.append(kinematics(e.reference, state_of(e.reference, s.t, q, s.v, s.u, s.full)).phi)
    return deviation(got, wanted)


def velocities(e: Evidence) -> float:
    """A and c, so that λ means the same on both sides."""
    rows = [s.outcome.kinematics for s in e.samples]
    directions = deviation([t.A for t in e.terms], [k.A for k in rows])
    return max(directions, deviation([t.c for t in e.terms], [k.c for k in rows]))


def accelerations(e: Evidence) -> float:
    """β against the size of what it is the sum of."""
    wanted = np.array([s.outcome.kinematics.beta for s in e.samples])
    got = np.array([t.beta for t in e.terms])
    return worst((got - wanted) / sizes(wanted)) if got.shape == wanted.shape else float("inf")


def energies(e: Evidence) -> float:
    got = [np.array([t.T, t.V]) for t in e.terms]
    return deviation(got, [np.array([s.outcome.T, s.outcome.V]) for s in e.samples])


def motion(e: Evidence) -> float:
    """The choice's v̇, per condition number of the augmented system."""
    return deviation(e.vdot, [s.outcome.vdot for s in e.samples], e.conditions)


def multipliers(e: Evidence) -> float | None:
    """λ, or Aᵀ λ where the rows are redundant and λ is not unique."""
    if not e.graph.has("reactions"):
        return None
    found = e.results("reactions")
    if e.redundant:
        forces = [t.A.T @ lam for t, lam in zip(e.terms, found)]
        return deviation(forces, [s.outcome.constraint_force for s in e.samples], e.conditions)
    return deviation(found, [s.outcome.lam for s in e.samples], e.conditions)


def augmented(e: Evidence) -> float:
    """v̇ against [M Aᵀ; A 0] [v̇; −λ] = [Q − h; β] of the System's own terms."""
    return deviation(e.vdot, [_augmented(t)[: len(t.M)] for t in e.terms], e.conditions)


def _augmented(t: Terms) -> Array:
    redundant = len(t.A) > 0 and np.linalg.matrix_rank(t.A, tol=1e-9) < len(t.A)
    return solved(saddle(t.M, t.A), np.concatenate([t.Q - t.h, t.beta]), redundant)[0]


def choices(e: Evidence) -> float | None:
    """v̇ of the model's other choices: the motion does not depend on how it is written."""
    if not e.others:
        return None
    return worst([_between(e, other) for other in e.others])


def _between(e: Evidence, other: Graph) -> float:
    relax = [a * b for a, b in zip(e.conditions, e.conditions_of(other))]
    return deviation(e.accelerations_of(other), e.vdot, relax)


def results(e: Evidence) -> float | None:
    """Points, velocities and angles of bodies and formulas; angles up to whole turns."""
    if not e.graph.has("outputs"):
        return None
    got, model = e.results("outputs"), e.reference.model
    wanted = [nearest_turn(model, outputs(model, s.state), y) for s, y in zip(e.samples, got)]
    return deviation(got, wanted)


RUNGS = (
    Rung("states admissible", 1e-9, "reference: φ = 0 and A v = c, relative; Newton stops at 1e-12", admissible),
    Rung("q̇ = N v", 1e-12, "reference: rates of the coordinates", rates),
    Rung("M", 1e-11, "reference: Jᵀ K J of the maximal coordinates, entries against √(Mᵢᵢ Mⱼⱼ)", mass),
    Rung("Q − h", 1e-9, "reference: forces less velocity products; sums that may cancel", force),
    Rung("φ", 1e-11, "reference: positions off the constraint surface", positions),
    Rung("A, c", 1e-11, "reference: constraint rows", velocities),
    Rung("β", 1e-9, "reference: A v̇ = β; sums that may cancel", accelerations),
    Rung("T, V", 1e-10, "reference: energies; V may cancel", energies),
    Rung("v̇", 1e-10, "reference: Newton–Euler in maximal coordinates, per condition number", motion),
    Rung("λ", 1e-10, "reference: multipliers (Aᵀ λ when rows are redundant), per condition number", multipliers),
    Rung("v̇ augmented", 1e-10, "the system's own terms solved with multipliers, per condition number", augmented),
    Rung("v̇ of other choices", 1e-10, "the other quasi-velocities of the model, per condition number", choices),
    Rung("outputs", 1e-10, "reference: positions, velocities, angles and formulas", results),
)
