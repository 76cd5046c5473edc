"""Does the derivation say what the independent reference says, term by term and in the end?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from derive.expressions.tree import Call
from derive.formulations.evaluate import Evaluator
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, sizes, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.samples import Sample, Terms
from hamel.verify.limits import (
    CANCELLING,
    ENERGIES,
    FLOOR,
    MOST_EXCUSED,
    OWN_ENERGIES,
    ROUNDING,
    SMALL,
    SOLVED,
    TERMS,
)
from hamel.verify.reference.outcome import Kinematics, Outcome, state_of
from hamel.verify.reference.outputs import events, nearest_turn, outputs
from hamel.verify.reference.saddle import RANK, rank_of, saddle, solved
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array


def admissible(e: Evidence) -> float:
    """|φ| against the size of the positions and |A v − c| against |A| |v|: the reference's own word
    on the states."""
    return worst([violated(e, s.outcome.kinematics, s.q, s.v) for s in e.samples])


def violated(e: Evidence, k: Kinematics, q: Array, v: Array) -> float:
    """By how much φ and A v = c are missed, in the model's own units or relative to what is
    summed."""
    position = worst(k.phi / e.units.positions) / (1.0 + worst(q / e.units.q))
    return max(position, worst(k.violation(v) / (e.units.rows + np.abs(k.A) @ np.abs(v))))


def rates(e: Evidence) -> float:
    """q̇, N, and the first half of ẋ."""
    sums, unit = e.of_speeds(TERMS), e.units.qdot
    matrices = deviation(
        [t.N for t in e.terms], [s.outcome.kinematics.N for s in e.samples], unit=e.units.N
    )
    wanted = [s.outcome.qdot for s in e.samples]
    terms = deviation([t.qdot for t in e.terms], wanted, unit=unit, sums=sums)
    own = [state.rates for state in e.own]
    ours = [xdot[: len(rates)] for xdot, rates in zip(e.results("dynamics"), own)]
    return max(matrices, terms, deviation(ours, own, unit=unit, sums=sums))


def states(e: Evidence) -> float | None:
    """ż, of the system and as the last part of ẋ at the choice's own velocities."""
    if not e.system.model.states:
        return None
    wanted, unit = [s.outcome.zdot for s in e.samples], e.units.zdot
    terms = deviation([t.zdot for t in e.terms], wanted, unit=unit)
    last = e.graph.equations.speeds.stop
    ours = [xdot[last:] for xdot in e.results("dynamics")]
    own = [outcome.zdot for outcome in e.outcomes]
    return max(terms, deviation(ours, own, e.conditions, unit=unit))


def mass(e: Evidence) -> float:
    """|M − M_ref|ᵢⱼ against √(Mᵢᵢ Mⱼⱼ), so that light parts count as much as heavy ones."""
    errors = mass_errors(e, [t.M for t in e.terms], TERMS)
    if e.graph.has("mass"):
        errors += mass_errors(e, e.results("mass"), TERMS)
    return worst(errors)


def mass_errors(e: Evidence, got: Sequence[Array], tolerance: float) -> list[float]:
    """Per state. Where a part has no inertia about its joint, what it is compared with is the sum
    that cancels."""
    given = zip(got, e.samples, e.of_masses(tolerance))
    return [mass_error(M / e.units.M, s.outcome.M / e.units.M, least) for M, s, least in given]


def mass_error(got: Array, wanted: Array, least: Array) -> float:
    """The largest difference of the entries of M relative to √(Mᵢᵢ Mⱼⱼ), which no entry of a
    positive definite matrix exceeds; `least` are floors for entries that are left of sums that
    cancel."""
    root = np.sqrt(np.abs(np.diag(wanted)))
    return worst((got - wanted) / np.maximum(np.maximum(np.outer(root, root), least), 1e-300))


def bias(e: Evidence) -> float:
    """h: velocity products, gravity and the model's own potential; also the function `bias`."""
    sums, unit = e.of_forces(CANCELLING), e.units.force
    wanted = [s.outcome.h for s in e.samples]
    error = deviation([t.h for t in e.terms], wanted, unit=unit, sums=sums)
    if not e.graph.has("bias"):
        return error
    own = [outcome.h for outcome in e.outcomes]
    return max(error, deviation(e.results("bias"), own, unit=unit, sums=sums))


def applied(e: Evidence) -> float:
    """Q: loads, inputs and nonideal forces."""
    wanted, sums = [s.outcome.Q for s in e.samples], e.of_forces(CANCELLING)
    return deviation([t.Q for t in e.terms], wanted, unit=e.units.force, sums=sums)


def power(e: Evidence) -> float:
    """Of all forces without a potential, and ∂(V − T)/∂t; the function `power` adds λᵀ c and is
    held to the energy balance."""
    wanted = [np.array([s.outcome.power]) for s in e.samples]
    ours = [np.array([t.power]) for t in e.terms]
    return deviation(ours, wanted, unit=e.units.power, sums=e.of_powers(CANCELLING))


def positions(e: Evidence) -> float:
    """φ off the constraint surface, where it is not zero."""
    ours = [e.terms_at(d.t, d.q, d.v, s.u, s.given).phi for d, s in zip(e.disturbed, e.samples)]
    sums = e.of_positions(TERMS, e.disturbed)
    wanted = [e.kinematics(d).phi for d in e.disturbed]
    return deviation(ours, wanted, unit=e.units.positions, sums=sums)


def violation(e: Evidence) -> float | None:
    """The function `constraints`, φ above the lengths of quaternions above A v − c, on and off the
    constraint surface, at the choice's own velocities and at others: a column of A does not show
    where its velocity is zero at every admissible state."""
    if not e.graph.has("constraints"):
        return None
    rows = zip(e.samples, e.x, e.disturbed, e.astray)
    return worst([worst(_violation_errors(e, *row)) for row in rows])


def _violation_errors(e: Evidence, s: Sample, x: Array, beside: State, astray: Array) -> Array:
    own, other = x[len(s.q) :], astray[len(s.q) :]
    places = [(s.q, own), (beside.q, own), (beside.q, other)]
    return np.array([_violation_error(e, s, q, w) for q, w in places])


def _violation_error(e: Evidence, s: Sample, q: Array, w: Array) -> float:
    moved = np.concatenate([q, w])
    there = state_of(e.reference, s.t, q, e.graph("velocity", s.t, moved, s.u, s.p), s.u, s.full)
    k = e.kinematics(there)
    lengths = np.array([q[i : i + 4] @ q[i : i + 4] - 1.0 for i in e.system.quaternions])
    wanted = np.concatenate([k.phi, lengths, k.violation(there.v)])
    size = np.concatenate(
        [
            np.maximum(1e-2 * e.units.positions + np.abs(k.phi), _reach(e, there)),
            1e-2 + np.abs(lengths),
            np.maximum(e.units.rows + np.abs(k.A) @ np.abs(there.v), _products(e, k.A, there.v)),
        ]
    )
    return worst((e.graph("constraints", s.t, moved, s.u, s.p) - wanted) / size)


def _products(e: Evidence, A: Array, v: Array) -> float:
    """What an error in A v is at least held against: ROUNDING of |A| |v| over all rows and
    columns."""
    return ROUNDING / TERMS * worst(A * e.units.v) * float(np.abs(v / e.units.v).sum())


def _reach(e: Evidence, there: State) -> float:
    """The same of φ: the way from where the coordinates are zero, and from the ground's origin to
    the bodies."""
    largest = float(np.max(e.units.positions, initial=0.0))
    far = worst(np.array([frame.origin for frame in there.frames.values()]))
    return ROUNDING / TERMS * max(largest * (1.0 + worst(there.q / e.units.q)), far)


def velocities(e: Evidence) -> float:
    """A and c, so that λ means the same on both sides."""
    rows = [s.outcome.kinematics for s in e.samples]
    # rows are sums of lengths, as φ is; what vanishes on the constraint surface leaves rounding
    lengths = e.of_positions(TERMS, e.samples)
    ours_A, wanted_A = [t.A for t in e.terms], [k.A for k in rows]
    directions = deviation(ours_A, wanted_A, unit=e.units.A, sums=lengths)
    ours, wanted = [t.c for t in e.terms], [k.c for k in rows]
    return max(directions, deviation(ours, wanted, unit=e.units.rows, sums=e.of_speeds(TERMS)))


def accelerations(e: Evidence) -> float:
    """β against its own size or, where it cancels, against 1e-3 of the products |A| |v| |v| that it
    is the sum of, and what rounding leaves of them over all columns."""
    unit = e.units
    wanted = np.array([s.outcome.kinematics.beta for s in e.samples]) / unit.beta
    ours = np.array([t.beta for t in e.terms]) / unit.beta
    summed = (
        np.array(
            [np.abs(s.outcome.kinematics.A) @ np.abs(s.v) * worst(s.v / unit.v) for s in e.samples]
        )
        / unit.rows
    )
    if ours.shape != wanted.shape:
        return float("inf")
    least = np.maximum(1e-3 * summed, e.of_rows(CANCELLING).floors[:, None])
    return worst((ours - wanted) / np.maximum(sizes(wanted), least))


def independent(e: Evidence) -> float:
    """How many independent rows: in A here and there, and as what the choice takes off the
    generalized velocities (the median)."""
    wanted = [s.outcome.rank for s in e.samples]
    rows = worst([ours - rank for ours, rank in zip(e.ranks, wanted)])
    equations = e.graph.equations
    if equations.generalized_velocities:
        return rows
    return max(rows, abs(len(e.samples[0].v) - len(equations.w) - float(np.median(wanted))))


def energies(e: Evidence) -> float:
    """T, V and what the motion balances, of the system."""
    own = [np.array([t.T, t.V, t.energy]) for t in e.terms]
    return _energies(e, own, [s.outcome for s in e.samples], ENERGIES)


def energy(e: Evidence) -> float | None:
    """The function `energy`: T, V and Jacobi's integral, or what stands for it, T + V."""
    if not e.graph.has("energy"):
        return None
    own = [y if len(y) > 2 else np.append(y, y.sum()) for y in e.results("energy")]
    return _energies(e, own, e.outcomes, OWN_ENERGIES)


def _energies(
    e: Evidence, got: Sequence[Array], outcomes: Sequence[Outcome], tolerance: float
) -> float:
    """Each against its own size: where one is a thousand times the other, it would hide what is
    wrong there. A sum that cancels is held against its parts."""
    wanted = [np.array([o.T, o.V, o.energy]) for o in outcomes]
    unit, sums = e.units.energy, e.of_energies(tolerance)
    single = [deviation(_only(got, k), _only(wanted, k), unit=unit, sums=sums) for k in (0, 1)]
    sizes = [abs(o.T) + abs(o.V) + abs(o.energy) for o in outcomes]
    parts = np.maximum(SMALL * unit + np.array(sizes), unit * sums.floors)
    totals = np.array(_only(got, 2)) - np.array(_only(wanted, 2))
    return worst([*single, worst(totals[:, 0] / parts)])


def _only(rows: Sequence[Array], k: int) -> list[Array]:
    return [row[k : k + 1] for row in rows]


def motion(e: Evidence) -> float:
    """The choice's v̇, per condition number of the augmented system."""
    return acceleration_error(e, [s.outcome.vdot for s in e.samples], e.conditions)


def acceleration_error(
    e: Evidence, wanted: Sequence[Array], relax: Sequence[float] | Array
) -> float:
    """The choice's v̇ against another one, per condition number: it excuses roundings and no
    digits."""
    sums = e.of_each_acceleration(SOLVED)
    excused = np.minimum(np.asarray(relax), MOST_EXCUSED)
    return deviation(e.vdot, wanted, excused, e.small, e.units.vdot, sums)


def multipliers(e: Evidence) -> float | None:
    """λ; where rows are redundant and it is not unique, Aᵀ λ, and where all rows are kept also λ
    against the least one.

    Where it is zero it is held against the largest force in the balance.
    """
    if not e.graph.has("reactions"):
        return None
    own, of_row = (
        e.units,
        np.array([np.maximum(np.max(np.abs(t.A / e.units.A), axis=1), 1e-300) for t in e.terms]),
    )
    ours, wanted = np.array(e.results("reactions")), np.array([s.outcome.lam for s in e.samples])
    balance = [worst(_summed(t, vdot) / own.force) for t, vdot in zip(e.terms, e.vdot)]
    largest = np.maximum(balance, FLOOR * e.forces)[:, None]
    if not e.redundant:
        return _unbalanced(e, ours / own.lam, wanted / own.lam, largest / of_row)
    forces = np.array([s.outcome.constraint_force for s in e.samples])
    done = np.array([t.A.T @ lam for t, lam in zip(e.terms, ours)])
    error = _unbalanced(e, done / own.force, forces / own.force, largest)
    if e.reference.model.redundant == "drop":
        return error
    least = np.array(
        [np.linalg.pinv(t.A.T, rcond=RANK) @ force for t, force in zip(e.terms, forces)]
    )
    return max(
        error,
        _unbalanced(e, ours / own.lam, least / own.lam, np.minimum(largest / of_row, largest)),
    )


def _unbalanced(e: Evidence, found: Array, wanted: Array, largest: Array) -> float:
    return worst(
        (found - wanted)
        / np.maximum(sizes(wanted), FLOOR * largest)
        / np.array(e.conditions)[:, None]
    )


def _summed(t: Terms, vdot: Array) -> Array:
    """The sizes of what is in balance with the constraints."""
    return np.abs(t.M) @ np.abs(vdot) + np.abs(t.h) + np.abs(t.Q)


def augmented(e: Evidence) -> float:
    """v̇ against [M Aᵀ; A 0] [v̇; −λ] = [Q − h; β] of the System's own terms."""
    return acceleration_error(e, [_augmented(t)[: len(t.M)] for t in e.terms], e.conditions)


def _augmented(t: Terms) -> Array:
    redundant = rank_of(t.A) < len(t.A)
    return solved(saddle(t.M, t.A), np.concatenate([t.Q - t.h, t.beta]), redundant)[0]


def balance(e: Evidence) -> float | None:
    """M v̇ + h = Q + Aᵀ λ row by row, against the sizes of what is summed: no condition number
    excuses a wrong λ here.

    v̇ = S ẇ + σ is known to n·2⁻⁵² cond [A; B] of the largest force at best: where [A; B] is nearly
    singular S ẇ and σ nearly cancel; and light bodies told by heavy ones to what is left of them in
    Sᵀ M S. What is summed in a row counts as at least that.

    Where nothing pulls at all, what is summed is roundoff, and is not compared with itself: no more
    than what is left of velocity products, each of the size of T, that cancel.
    """
    if not e.graph.has("reactions"):
        return None
    given = zip(e.terms, e.vdot, e.results("reactions"), e.forces, e.growths(e.graph))
    return worst(
        [
            worst(_imbalance(t, a, lam, e.units.force, size, growth))
            for t, a, lam, size, growth in given
        ]
    )


def _imbalance(
    t: Terms, vdot: Array, lam: Array, unit: Array, forces: float, growth: float
) -> Array:
    summed = (_summed(t, vdot) + np.abs(t.A.T) @ np.abs(lam)) / unit
    left = (t.M @ vdot + t.h - t.Q - t.A.T @ lam) / unit
    largest = max(SMALL, summed.max(initial=0.0))
    known = ROUNDING / SOLVED * max(forces, len(vdot) * growth * largest)
    return left / np.maximum(summed, max(1e-6 * largest, known))


def choices(e: Evidence) -> float | None:
    """v̇ of the model's other choices: the motion does not depend on how it is written."""
    if not e.others:
        return None
    return worst([_between(e, other) for other in e.others])


def _between(e: Evidence, other: Evaluator) -> float:
    relax = [a + b for a, b in zip(e.conditions, e.conditions_of(other))]
    return acceleration_error(e, e.accelerations_of(other), relax)


def results(e: Evidence) -> float | None:
    """Points, velocities and angles of bodies and formulas; angles up to whole turns."""
    if not e.graph.has("outputs"):
        return None
    ours, model = e.results("outputs"), e.reference.model
    wanted = [
        nearest_turn(model, outputs(model, own, lam, o.vdot), y)
        for own, o, y, lam in zip(e.own, e.outcomes, ours, _reactions(e))
    ]
    uses_multipliers = any(
        isinstance(x.expression, Call) and x.expression.function == "reaction"
        for x in model.outputs
    )
    labels = e.graph.equations.function("outputs").result.units
    relax = e.conditions if uses_multipliers or model.accelerations else None
    largest = [1.0 + worst(s.q / e.units.q) for s in e.samples] + e.speeds
    largest = largest + e.forces if uses_multipliers else largest
    # as λ and v̇ are, they are known to what rounding leaves of the sums that they come from
    if model.accelerations:
        largest = largest + np.asarray(e.of_accelerations(SOLVED).sizes)
    sums = Sums(SOLVED, largest)
    return deviation(ours, wanted, relax, unit=e.units.own.all_of(labels), sums=sums)


def happenings(e: Evidence) -> float | None:
    """The functions whose changes of sign are events."""
    if not e.graph.has("events"):
        return None
    ours, model = e.results("events"), e.reference.model
    states = zip(e.own, _reactions(e), e.outcomes)
    wanted = [events(model, own, lam, o.vdot) for own, lam, o in states]
    largest = [1.0 + worst(s.q / e.units.q) + worst(g) for s, g in zip(e.samples, wanted)]
    return deviation(ours, wanted, e.conditions, sums=Sums(SOLVED, largest))


def _reactions(e: Evidence) -> Sequence[Array]:
    """λ of the reference; where it is not unique, the choice's own, which the check of λ judges by
    what it does."""
    return e.results("reactions") if e.redundant else [outcome.lam for outcome in e.outcomes]


CHECKS = (
    Check(
        "states admissible",
        1e-9,
        "reference: φ = 0 and A v = c, relative; Newton stops at 1e-12",
        admissible,
    ),
    Check("q̇ = N v", TERMS, "reference: rates of the coordinates, in the system and in ẋ", rates),
    Check("ż", CANCELLING, "reference: rates of first-order states", states),
    Check(
        "M", TERMS, "reference: Jᵀ K J of the maximal coordinates, entries against √(Mᵢᵢ Mⱼⱼ)", mass
    ),
    Check(
        "h",
        CANCELLING,
        "reference: velocity products, gravity, potential; sums that may cancel",
        bias,
    ),
    Check(
        "Q", CANCELLING, "reference: loads, inputs, nonideal forces; sums that may cancel", applied
    ),
    Check("φ", TERMS, "reference: positions off the constraint surface", positions),
    Check("constraints", TERMS, "reference: φ and A v − c off the constraint surface", violation),
    Check("A, c", TERMS, "reference: constraint rows", velocities),
    Check(
        "rank A",
        0.0,
        "reference: number of independent rows, and of the quasi-velocities they leave",
        independent,
    ),
    Check("β", CANCELLING, "reference: A v̇ = β; sums that may cancel", accelerations),
    Check("T, V", ENERGIES, "reference: energies, and T₂ − T₀ + V; V may cancel", energies),
    Check("energy", OWN_ENERGIES, "reference: energies at the choice's own velocities", energy),
    Check("power", CANCELLING, "reference: force times velocity; sums that may cancel", power),
    Check(
        "v̇",
        SOLVED,
        "reference: Newton–Euler in maximal coordinates, per condition number",
        motion,
    ),
    Check(
        "λ",
        SOLVED,
        "reference: multipliers (Aᵀ λ when rows are redundant), per condition number",
        multipliers,
    ),
    Check(
        "M v̇ + h = Q + Aᵀ λ",
        SOLVED,
        "the choice's v̇ and λ in the system's own terms, against what is summed",
        balance,
    ),
    Check(
        "v̇ augmented",
        SOLVED,
        "the system's own terms solved with multipliers, per condition number",
        augmented,
    ),
    Check(
        "v̇ of other choices",
        SOLVED,
        "the other quasi-velocities of the model, per sum of condition numbers",
        choices,
    ),
    Check("outputs", SOLVED, "reference: positions, velocities, angles and formulas", results),
    Check("events", SOLVED, "reference: formulas of the motion and of outputs", happenings),
)
