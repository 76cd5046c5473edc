"""Identities along the motion: derivatives by differences of the quantities themselves, energy
balance, and projection."""

from __future__ import annotations

import numpy as np

from derive.formulations.manifold import keeps_velocities
from derive.states.closing import normalised
from hamel.verify.checks.agreement import violated
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, slope, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.kinks import step_within_piece
from hamel.verify.checks.samples import Sample, Terms
from hamel.verify.limits import SOLVED
from hamel.verify.reference.outcome import Kinematics, energies, mass, state_of
from hamel.verify.reference.saddle import condition_of, saddle, solved
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

# tolerance of what is differentiated by differences; what two step sizes disagree by counts as no
# error
DIFFERENCES = 1e-8
TWO_STEPS = 1e-15  # of a quantity, in its differences: two step sizes may by chance agree on it


def step(e: Evidence, s: Sample, vdot: Array) -> float:
    """A time in which the state changes by about 1e-3: differences of fourth order then err by
    about 1e-12."""
    rates, change = worst(s.outcome.qdot / e.units.qdot), worst(vdot / e.units.vdot)
    charge = worst(s.outcome.zdot / e.units.zdot)
    return 1e-3 * e.units.time / max(1.0, rates, change**0.5, charge)


def energy_rate(e: Evidence) -> float:
    """d(T₂ − T₀ + V)/dt of the reference's energies along (q̇, v̇) against power + λᵀ c, relative to
    the powers at work."""
    names = ("power",) if e.graph.has("power") else ()
    ours = [t.power + s.outcome.lam @ s.outcome.kinematics.c for s, t in zip(e.samples, e.terms)]
    claims = [ours, *([float(y[0]) for y in e.results(name)] for name in names)]
    return worst([_balance(e, *row) for row in zip(e.samples, e.terms, e.vdot, zip(*claims))])


def _balance(e: Evidence, s: Sample, t: Terms, vdot: Array, claims: tuple[float, ...]) -> float:
    def there(time: float) -> State:
        full = s.full_with(s.z + time * s.outcome.zdot)
        return state_of(e.reference, s.t + time, *_moved(s, vdot, time), s.u, full)

    def energy(time: float) -> Array:
        return np.array(energies(e.reference, there(time)).total)

    o = s.outcome
    span = step(e, s, vdot)
    if span == 0.0:  # v̇ is infinite
        return np.inf
    span = step_within_piece(e, there, span)
    gain, doubt = slope(energy, span)
    doubt = doubt + TWO_STEPS * (abs(t.T) + o.summed.V) / span
    flows = (
        np.abs(o.force) @ np.abs(s.v)
        + np.abs(o.constraint_force) @ np.abs(s.v)
        + np.abs(s.v) @ np.abs(t.M @ vdot)
    )
    return worst((gain - np.array(claims)) / (1e-6 * e.units.power + flows + doubt / DIFFERENCES))


def _moved(s: Sample, vdot: Array, time: float) -> tuple[Array, Array]:
    return s.q + time * s.outcome.qdot, s.v + time * vdot


def rows_rate(e: Evidence) -> float | None:
    """d(A v − c)/dt = 0 along the motion, A and c evaluated beside it: finds a wrong Ȧ v in β."""
    if not len(e.terms[0].A):
        return None
    return worst([_drift(e, s, t, vdot) for s, t, vdot in zip(e.samples, e.terms, e.vdot)])


def _drift(e: Evidence, s: Sample, t: Terms, vdot: Array) -> float:
    def there(time: float) -> State:
        return state_of(e.reference, s.t + time, *_moved(s, vdot, time), s.u, s.full)

    def violation(time: float) -> Array:
        q, v = _moved(s, vdot, time)
        here = e.terms_at(s.t + time, q, v, s.u, s.given)
        return here.A @ v - here.c

    drift, doubt = slope(violation, step_within_piece(e, there, step(e, s, vdot)))
    return worst(
        drift / (e.units.beta + np.abs(t.beta) + np.abs(t.A) @ np.abs(vdot) + doubt / DIFFERENCES)
    )


def beta_rate(e: Evidence) -> float | None:
    """d(A v − c)/dt at held v equals −β: β is the derivative of the rows and not only what the
    motion needs."""
    if not len(e.terms[0].A):
        return None
    return worst([_beta(e, s, t) for s, t in zip(e.samples, e.terms)])


def _beta(e: Evidence, s: Sample, t: Terms) -> float:
    def there(time: float) -> State:
        return state_of(e.reference, s.t + time, s.q + time * t.qdot, s.v, s.u, s.full)

    def violation(time: float) -> Array:
        here = e.terms_at(s.t + time, s.q + time * t.qdot, s.v, s.u, s.given)
        return here.A @ s.v - here.c

    span = step_within_piece(e, there, step(e, s, s.v / e.units.time))
    rate, doubt = slope(violation, span)
    return worst((rate + t.beta) / (e.units.beta + np.abs(t.beta) + doubt / DIFFERENCES))


def positions_rate(e: Evidence) -> float | None:
    """dφ/dt = (A v − c) of the holonomic rows, at velocities that need not be admissible."""
    if not len(e.terms[0].phi):
        return None
    rng = np.random.default_rng(1)
    return worst([_gap_rate(e, s, e.units.v * rng.normal(size=len(s.v))) for s in e.samples])


def _gap_rate(e: Evidence, s: Sample, v: Array) -> float:
    here = e.terms_at(s.t, s.q, v, s.u, s.given)
    holonomic = [row for row, about in enumerate(e.system.rows) if about.position >= 0]
    order = [e.system.rows[row].position for row in holonomic]

    def there(time: float) -> State:
        return state_of(e.reference, s.t + time, s.q + time * here.qdot, v, s.u, s.full)

    def gap(time: float) -> Array:
        return e.terms_at(s.t + time, s.q + time * here.qdot, v, s.u, s.given).phi

    span = 1e-3 * e.units.time / max(1.0, worst(here.qdot / e.units.qdot))
    rate, doubt = (x[order] for x in slope(gap, step_within_piece(e, there, span)))
    wanted = (here.A @ v - here.c)[holonomic]
    return worst(
        (rate - wanted)
        / (e.units.rows[holonomic] + np.abs(here.A[holonomic]) @ np.abs(v) + doubt / DIFFERENCES)
    )


def projection(e: Evidence) -> float | None:
    """`project` from a disturbed state: φ and A v − c of the reference vanish again."""
    if not e.graph.has("project"):
        return None
    rng = np.random.default_rng(2)
    return worst(
        [
            _projected(e, s, x + 1e-3 * e.units.x * rng.uniform(-1, 1, len(x)))
            for s, x in zip(e.samples, e.x)
        ]
    )


def _projected(e: Evidence, s: Sample, x: Array) -> float:
    x = e.graph.iterated("project", s.t, x, s.u, s.p)
    there = state_of(
        e.reference, s.t, x[: len(s.q)], e.graph("velocity", s.t, x, s.u, s.p), s.u, s.full
    )
    lengths = [np.linalg.norm(x[i : i + 4]) - 1.0 for i in e.system.quaternions]
    return max(worst(lengths), violated(e, e.kinematics(there), there.q, there.v))


def projected_already(e: Evidence) -> float | None:
    """`project` leaves an admissible state where it is, its velocities included."""
    if not e.graph.has("project"):
        return None
    there = [e.graph.iterated("project", s.t, x, s.u, s.p) for s, x in zip(e.samples, e.x)]
    sums = Sums(SOLVED, [1.0 + worst(x / e.units.x) for x in e.x])
    return deviation(there, e.x, e.conditions, unit=e.units.x, sums=sums)


def newton_step(e: Evidence) -> float | None:
    """One step of `project` is q − N δ with unit quaternions, δ = W Aᵀ (A W Aᵀ)⁻¹ φ of least length
    in the metric W⁻¹; of turns that are locked φ as the whole turn has it.

    The metric is M, or 1 where M is singular.
    """
    if not e.graph.has("project"):
        return None
    return min(_newton(e, by_mass) for by_mass in (True, False))


def _newton(e: Evidence, by_mass: bool) -> float:
    ours, wanted, conditions = [], [], []
    closing = list(
        e.graph.equations.closing
    )  # of redundant rows those that are closed: off the constraints the others disagree
    phi = [e.system.rows[i].position for i in closing]
    for s, x in zip(e.samples, e.astray):
        there = state_of(e.reference, s.t, x[: len(s.q)], s.v, s.u, s.full)
        k = e.kinematics(there)
        metric, unit = _metric(e, there, k, by_mass)
        matrix = saddle(metric, k.A[closing])
        step, _ = solved(
            matrix, np.concatenate([np.zeros(len(s.v)), -k.excess[phi]]), redundant=False
        )
        ours.append(e.graph("project", s.t, x, s.u, s.p)[: len(s.q)] - x[: len(s.q)])
        wanted.append(normalised(e.system, x[: len(s.q)] + k.N @ step[: len(s.v)]) - x[: len(s.q)])
        conditions.append(condition_of(saddle(metric / unit, k.A[closing] / e.units.A[closing])))
    sums = Sums(SOLVED, [1.0 + worst(x[: len(e.units.q)] / e.units.q) for x in e.astray])
    relax = np.maximum(conditions, e.conditions)
    return deviation(ours, wanted, relax, unit=e.units.q, sums=sums)


def _metric(e: Evidence, there: State, k: Kinematics, by_mass: bool) -> tuple[Array, Array | float]:
    """M or the unit matrix, with its units: what a step of `project` is least in."""
    if by_mass:
        return mass(e.reference, there, k), e.units.M
    return np.eye(k.A.shape[1]), 1.0


def velocity_step(e: Evidence) -> float | None:
    """One step of `project` takes v to v − W Aᵀ (A W Aᵀ)⁻¹ (A v − c), which is least in the metric
    W⁻¹, M or 1; in quasi-velocities, where A v = c holds anyway, it leaves w.

    None where rows repeat others: off the constraints it is not known which are to hold.
    """
    if not e.graph.has("project"):
        return None
    equations = e.graph.equations
    steps = [e.graph("project", s.t, x, s.u, s.p) for s, x in zip(e.samples, e.astray)]
    if not keeps_velocities(equations):
        w = equations.speeds
        return deviation([x[w] for x in steps], [x[w] for x in e.astray], unit=e.units.x[w])
    if any(rank < len(e.system.rows) for rank in e.ranks):
        return None
    return min(_velocity_step(e, steps, by_mass) for by_mass in (True, False))


def _velocity_step(e: Evidence, steps: list[Array], by_mass: bool) -> float:
    ours, wanted, conditions = [], [], []
    for s, x, moved in zip(e.samples, e.astray, steps):
        q = x[: len(s.q)]
        v = e.graph("velocity", s.t, x, s.u, s.p)
        there = state_of(e.reference, s.t, q, v, s.u, s.full)
        k = e.kinematics(there)
        metric, unit = _metric(e, there, k, by_mass)
        right = np.concatenate([np.zeros(len(v)), k.c - k.A @ v])
        least, _ = solved(saddle(metric, k.A), right, redundant=False)
        after = np.concatenate([q, moved[len(q) :]])
        ours.append(e.graph("velocity", s.t, after, s.u, s.p))
        wanted.append(v + least[: len(v)])
        conditions.append(condition_of(saddle(metric / unit, k.A / e.units.A)))
    return deviation(ours, wanted, np.maximum(conditions, e.conditions), unit=e.units.v)


CHECKS = (
    Check(
        "d(T₂ − T₀ + V)/dt",
        DIFFERENCES,
        "power balance with the reference's energies; differences of fourth order",
        energy_rate,
    ),
    Check(
        "d(A v − c)/dt = 0", DIFFERENCES, "along the motion; differences of fourth order", rows_rate
    ),
    Check(
        "β = −Ȧ v + ċ",
        DIFFERENCES,
        "rows differentiated at held v; differences of fourth order",
        beta_rate,
    ),
    Check(
        "φ̇ = A v − c",
        DIFFERENCES,
        "positions differentiated along any velocity; differences of fourth order",
        positions_rate,
    ),
    Check(
        "project, one step",
        SOLVED,
        "Newton step of least length in the metric of M (or 1), per condition number",
        newton_step,
    ),
    Check(
        "project, velocities of one step",
        SOLVED,
        "v of least change in the metric of M (or 1) on A v = c, or w kept, per condition number",
        velocity_step,
    ),
    Check(
        "project, nothing to do",
        SOLVED,
        "an admissible state stays where it is, per condition number",
        projected_already,
    ),
    Check(
        "project",
        SOLVED,
        "φ = 0 and A v = c after a disturbance of 1e-3, by the reference's rows",
        projection,
    ),
)
