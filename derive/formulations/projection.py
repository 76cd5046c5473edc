"""`constraints` and `project`: how far a state is from the constraints, and the nearest state on
them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import HamelError
from derive.expressions.counting import alternatives
from derive.expressions.scalars import Vector
from derive.formulations.limits import (
    BORDERED,
    CLOSED,
    FEW_ROWS,
    MANY,
    MOST_STEPS,
    PER_RADIAN,
    REPEATED,
    USUAL,
)
from derive.formulations.motion import Motion, at_motion, guards_of, labels_of_state
from derive.formulations.multipliers import least_change
from derive.formulations.records import Function, Iteration, Result
from derive.mechanics.elimination.gauss import held_tree, is_of_links, velocities_alone
from derive.mechanics.inverse.dynamics import joint_forces_of_motion
from derive.mechanics.records import System
from derive.mechanics.recursions.motion import row_number
from derive.mechanics.recursions.tree import twists
from derive.numerics import NONZERO
from derive.states.closing import Kinematics, nominal
from derive.states.initial import initial_state


def positions(system: System) -> int:
    """How many of the leading rows of `constraints` are about positions: φ, then the lengths of
    quaternions. The rest are velocities, A v − c."""
    return system.phi.numel() + len(system.quaternions)


def constraint_violation(system: System, motion: Motion) -> Function | None:
    """φ, |q|² − 1 of quaternions, A v − c: zero at admissible states. In quasi-velocities the last
    part is zero up to rounding, which makes it a check of S and R."""
    if not system.rows and not system.quaternions:
        return None
    velocity = _row_velocities(system)
    coordinates = system.model.coordinates
    labels = (
        *(f"phi {row.name}" for row in system.rows if row.position >= 0),
        *(f"length {coordinates[i].owner}" for i in system.quaternions),
        *(f"velocity {row.name}" for row in system.rows),
    )
    value = ca.vertcat(system.phi, _lengths(system), at_motion(system, motion, velocity))
    about = "constraint violation: φ(q, t), " + (
        "|q|² − 1 of each quaternion, then A v − c row by row"
        if system.quaternions
        else "then A v − c row by row"
    )
    return Function(
        "constraints",
        about,
        Result("violation", value, labels, ()),
        guards=guards_of(motion, velocity, system),
    )


def _row_velocities(system: System) -> ca.SX:
    """A v − c; of many velocities from the links' twists, where that takes fewer operations."""
    by_matrix = ca.mtimes(system.A, system.v) - system.c
    if system.v.numel() < MANY:
        return by_matrix
    v: Vector = [*ca.vertsplit(system.v)]
    numbers = twists(system.links, v)
    rows = [row_number(row, numbers, v) for ways in system.blocks for row in ways[0]]
    found = [by_matrix, ca.vertcat(*rows) - system.c]
    counts = alternatives(found)
    return found[counts.index(min(counts))]


def projection(system: System, motion: Motion) -> Function | None:
    """One Newton step onto φ = 0, nearest in the metric of M (or of 1 where M is singular): δ =
    −M⁻¹ Aᵀ (A M⁻¹ Aᵀ)⁻¹ φ; quaternions are brought to length one.

    By Gauss's principle δ is what v̇ is at rest without forces where A v̇ = −φ: S y + R (−φ) with
    Sᵀ M S y = −Sᵀ M R (−φ). For many velocities it is found so, if R and S are regular everywhere.

    Where bodies are kept from turning the turn itself is undone and not the sine that φ is of it,
    which vanishes half a turn away, too.

    Rows that were dropped take no part in the step, but have to be met by what the others lead to:
    with other parameters they need not repeat them, and the loop does not close.
    """
    closing = list(motion.closing)
    if not closing and not system.quaternions and not (motion.projects_velocity and motion.kept):
        return None
    q = system.q + _position_step(system, motion) if closing else system.q
    sizes = _sizes(system) if closing else []
    positions = [system.rows[i].position for i in closing]
    turned = _turned(system, positions)
    repeating = [k for k in range(system.phi.numel()) if closing and k not in positions]
    violation = [
        (system.assembly[k] if sizes[k] == 1.0 else system.assembly[k] / sizes[k]) / turned
        for k in (*positions, *repeating)
    ]
    violation[len(positions) :] = [REPEATED * x for x in violation[len(positions) :]]
    w = motion.w
    if motion.projects_velocity and motion.kept:
        w, rest = _velocity_step(system, motion)
        violation += rest
    violation += ca.vertsplit(_lengths(system)) if system.quaternions else []
    about = "nearest consistent state: q on φ = 0" + (
        ", v on A v = c" if motion.projects_velocity else ", w kept"
    )
    about += ", z kept" if system.model.states else ""
    closed = ca.vertcat(_with_unit_quaternions(system, q), w, system.z)
    step = Result("x", closed, labels_of_state(system, motion), ())
    return Function(
        "project",
        about,
        step,
        iteration=Iteration(CLOSED, MOST_STEPS),
        residual=_largest(violation),
    )


def _lengths(system: System) -> ca.SX:
    """|q|² − 1 of each quaternion."""
    # squares: no root, and regular at every quaternion but zero
    lengths = [ca.sumsqr(system.q[i : i + 4]) - 1 for i in system.quaternions]
    return ca.vertcat(*lengths) if lengths else ca.SX(0, 1)


def _turned(system: System, positions: list[int]) -> ca.SX:
    """How much of φ is rounding where angles have turned many times: each power of ten costs a
    digit. 1 up to 1,000 rad."""
    angles = [system.q[i] for i, c in enumerate(system.model.coordinates) if c.unit == "rad"]
    closed = ca.vertcat(*[system.phi[k] for k in positions])
    symbols = {symbol.element_hash() for symbol in ca.symvar(closed)} if positions else set[int]()
    involved = [angle for angle in angles if angle.element_hash() in symbols]
    return ca.fmax(1, PER_RADIAN * _largest(involved)) if involved else ca.SX(1)


def _sizes(system: System) -> list[float]:
    """How large the terms of each φ are at the initial state, as powers of ten; 1 where that is
    not far from one.

    A length of a megametre squared cannot be closed to 1e-13, and one of a micrometre would be
    closed too early.
    """
    q, p = _closed(system), np.array(system.parameters)
    J = Kinematics(system).closing_rows(np.zeros(1), q[None], p[None])[1].finite()
    lengths = [abs(x) for c, x in zip(system.model.coordinates, q) if c.unit == "m"]
    longest = max(lengths, default=0.0) or 1.0
    reach = [longest if v.unit == "m/s" else 1.0 for v in system.model.velocities]
    sizes: NDArray[np.float64] = abs(J) @ np.array(reach)
    powers = np.round(np.log10(np.maximum(sizes, NONZERO)))
    return [1.0 if abs(k) <= USUAL or k < -200 else float(f"1e{int(k)}") for k in powers]


def _closed(system: System) -> NDArray[np.float64]:
    """The initial state's q: at values that are not closed yet, rows may have no slope. Where there
    is no such state, the values as they are."""
    try:
        return initial_state(system).q
    except HamelError:
        return nominal(system)


def _with_unit_quaternions(system: System, q: ca.SX) -> ca.SX:
    entries = [q[i] for i in range(q.numel())]
    for start in system.quaternions:
        length = ca.sqrt(ca.sumsqr(q[start : start + 4]))
        entries[start : start + 4] = [x / length for x in entries[start : start + 4]]
    return ca.vertcat(*entries)


def _position_step(system: System, motion: Motion) -> ca.SX:
    closing = list(motion.closing)
    # holonomic rows of A are φ_q N: a step over v that meets A δ = −φ, and q moves by N δ
    change: Vector = [-system.excess[system.rows[i].position] for i in closing]
    A, step = system.A[closing, :], _at_rest(system, motion)
    found = [x for x in (step, *_by_loops(motion, change)) if x is not None]
    found += _by_recursion(system, A, change)
    if not found or (step is None and system.v.numel() <= BORDERED):
        found.append(_by_bordered_matrix(system, A, change))
    return ca.substitute(system.qdot, system.v, _cheapest(found))


def _by_loops(motion: Motion, change: Vector) -> Iterator[ca.SX]:
    """Loop by loop, where no pivot of the choice is in the way."""
    of = motion.minimal
    if of is not None and of.nearest is not None and motion.kept == motion.closing:
        yield ca.vertcat(*of.nearest(change))


def _least_step(system: System, A: ca.SX, change: Vector) -> ca.SX:
    """By the bordered matrix, or by the recursion."""
    bordered = _by_bordered_matrix(system, A, change)
    return _cheapest([bordered, *_by_recursion(system, A, change)])


def _by_bordered_matrix(system: System, A: ca.SX, change: Vector) -> ca.SX:
    return ca.vertcat(*least_change(_metric(system), A, change))


def _by_recursion(system: System, A: ca.SX, change: Vector) -> Iterator[ca.SX]:
    """Gauss's principle and the recursion, of a long tree where few rows tie several velocities."""
    nv, tying = system.v.numel(), len(change) - len(velocities_alone(A))
    if nv >= MANY and tying <= FEW_ROWS * nv and system.definite and is_of_links(system):
        tree = held_tree(system, A, ca.vertcat(*change))
        yield tree.motion(-_inertial(system, tree.sigma))[0]


def _cheapest(found: Sequence[ca.SX]) -> ca.SX:
    counts = alternatives(found) if len(found) > 1 else [0]
    return found[counts.index(min(counts))]


def _inertial(system: System, vdot: ca.SX) -> ca.SX:
    """M v̇ by Newton–Euler, at rest and without gravity."""
    still: Vector = [0.0] * vdot.numel()
    moved: Vector = [*ca.vertsplit(ca.densify(vdot))]
    forces = joint_forces_of_motion(system.layouts, still, moved, [0.0, 0.0, 0.0])
    return ca.vertcat(*forces) + ca.mtimes(system.M_extra, vdot)


def _at_rest(system: System, motion: Motion) -> ca.SX | None:
    """δ by Gauss's principle; None where it does not pay."""
    of, nv = motion.minimal, system.v.numel()
    if of is None or of.solve is None or nv < MANY or not system.definite or not system.links:
        return None
    shift = of.shift
    if shift is None:
        return None
    force: Vector = [*ca.vertsplit(ca.densify(-ca.mtimes(of.S.T, _inertial(system, shift))))]
    y = of.solve(force)
    return shift + (ca.mtimes(of.S, ca.vertcat(*y)) if y else 0)


def _velocity_step(system: System, motion: Motion) -> tuple[ca.SX, list[ca.SX]]:
    """w + B δ with the least δ, in the metric of M, that brings A v to c: linear, so one step does
    it."""
    rows = list(motion.kept)
    violation = ca.mtimes(system.A[rows, :], system.v) - system.c[rows, :]
    violation = at_motion(system, motion, violation)
    entries = [violation[i] for i in range(len(rows))]
    step = _least_step(system, system.A[rows, :], [-x for x in entries])
    return motion.w + ca.mtimes(motion.B, step), entries


def _metric(system: System) -> ca.SX:
    """The matrix in which a projection is nearest: M where it is positive definite for certain (no
    massless direction shows at the nominal values), else 1.

    In the metric of M the correction is the one that takes least kinetic energy, and it does not
    depend on the units of the coordinates.
    """
    return system.M if system.definite and system.written else ca.SX.eye(system.v.numel())


def _largest(entries: list[ca.SX]) -> ca.SX:
    result = ca.SX(0)
    for x in entries:
        result = ca.fmax(result, ca.fabs(x))
    return result
