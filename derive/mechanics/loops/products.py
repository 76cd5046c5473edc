"""Derivatives of forward dynamics times a vector, from the right and from the left, as loops.

v̇ solves M v̇ + h = τ, so with inverse dynamics taken at that v̇

    dv̇ = M⁻¹ (dτ − d(M v̇ + h)),      (∂v̇/∂z)ᵀ y = (∂/∂z) sᵀ (τ − (M v̇ + h)),   M s = y.

M⁻¹ is applied by what forward dynamics has eliminated: two loops. Sources: Carpentier, Mansard
2018; Griewank, Walther 2008, chapter 3 (products from the left: what a link hands to its children
comes back as a sum over them).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import cross, dot, is_zero, minus, plus, sum_of, times
from derive.mechanics.loops.forward_dynamics import (
    OMEGA,
    PHI,
    PSI,
    ZERO,
    acceleration,
    axis_of,
    elimination,
    falls,
    solved,
    velocities,
)
from derive.mechanics.loops.frames import arm, from_parent
from derive.mechanics.loops.inverse_dynamics import at_parent, motion, wrench
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import COSINE, SINE, Rows, falling, rising, rows_of

INVERSE = 15  # 1/d
# (n, f) of a link and its change, where forward dynamics needs its entries no more
FORCES, CHANGES = OMEGA, 16
# (ω, α, a, δω, δv) of a link's parent, v̇ and s of its own, likewise
PARENT, RATE, SOLUTION = OMEGA, 17, 18


@dataclass(frozen=True)
class Along:
    """Coordinate, velocity and inputs of the link at hand, and their changes; of the inputs as many
    as a link has at most."""

    q: ca.SX
    v: ca.SX
    u: ca.SX
    dq: ca.SX
    dv: ca.SX
    du: ca.SX


@dataclass(frozen=True)
class Weights:
    """Coordinate, velocity and inputs of the link at hand, and the weights of q̇ and v̇."""

    q: ca.SX
    v: ca.SX
    u: ca.SX
    y_q: ca.SX
    y_v: ca.SX


def forward_product(
    joints: Sequence[Joint], gravity: Vector, along: Along
) -> tuple[tuple[Sweep, ...], Rows]:
    """The change of (q̇, v̇) along that of (q, v, u): five loops."""
    rows = rows_of(joints)
    start = [*ZERO, *falls(gravity), *ZERO, *ZERO, *ZERO]
    sweeps = (
        rising("velocities, from base to tip", joints, rows, velocities, list(ZERO)),
        falling("articulated inertias, from tip to base", joints, rows, _elimination, 27),
        rising(
            "accelerations and changes, from base to tip",
            joints, rows, partial(_changes, along), start,
        ),
        falling("changes of wrenches, from tip to base", joints, rows, partial(_forces, along), 18),
        rising(
            "changes of accelerations, from base to tip",
            joints, rows, partial(_solution, along), [0.0] * 6,
        ),
    )  # fmt: skip
    return sweeps, rows[0]


def adjoint_product(
    joints: Sequence[Joint], gravity: Vector, weights: Weights
) -> tuple[tuple[Sweep, ...], Rows]:
    """The weighted sum of the slopes of (q̇, v̇) by (q, v, u): four loops."""
    rows = rows_of(joints)
    start = [*ZERO, *falls(gravity), *ZERO, *ZERO]
    sweeps = (
        rising("velocities, from base to tip", joints, rows, velocities, list(ZERO)),
        falling(
            "articulated inertias and weights, from tip to base",
            joints, rows, partial(_weighted, weights), 33,
        ),
        rising("accelerations and weights, from base to tip", joints, rows, _virtual, start),
        falling("slopes, from tip to base", joints, rows, partial(_slopes, weights), 15),
    )  # fmt: skip
    return sweeps, rows[0]


# ---- from the right


def _elimination(joint: Joint, row: Rows, received: Vector) -> Visit:
    visit, d = elimination(joint, row, received)
    return Visit(visit.kept | {INVERSE: 1.0 / d}, visit.handed)


def _changes(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: (ω, α, a) of the parent, and their changes at held v̇."""
    before, changes = received[:9], received[9:]
    mu = acceleration(joint, row, before[3:])
    moved, rate = solved(joint, row, mu, row[PHI])
    own = [*row.vector(OMEGA), *moved]
    given, held, at = ca.SX.sym("b", 9), ca.SX.sym("a"), ca.SX.sym("m", 9)
    of = motion(joint, row, _split(given), held)
    by = ca.vertcat(given, _moving(row, along.q), along.v)
    seeds = [*changes, *_moves(joint, row, along.dq), along.dv]
    changes = _with(_product(of, by, seeds), ca.vertcat(given, held), [*before, rate])
    felt = _with(_product(wrench(joint, _split(at)), at, changes), at, own)
    kept = dict(enumerate(wrench(joint, own), FORCES)) | dict(enumerate(felt, CHANGES))
    return Visit(kept, [*own, *changes])


def _forces(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: wrenches, their changes, and the bias wrench of M⁻¹ with the changes as forces."""
    total = sum_of(received[:6], row.vector(FORCES, 6))
    changed = sum_of(received[6:12], row.vector(CHANGES, 6))
    bias = received[12:]
    tau = ca.SX(joint.tau)
    (acting,) = _product(
        [tau],
        ca.vertcat(along.q, along.v, along.u),
        [along.dq, along.dv, *ca.vertsplit(along.du)],
    )
    force = minus(acting, changed[axis_of(joint)])
    pushed, bias = _eliminated(joint, row.vector(PSI, 6), force, bias)
    given = ca.SX.sym("n", 6)
    of = at_parent(joint, row, _split(given))
    by = ca.vertcat(given, _moving(row, along.q))
    seeds = [*changed, *_moves(joint, row, along.dq)]
    change = _with(_product(of, by, seeds), given, total)
    handed = [*at_parent(joint, row, total), *change, *at_parent(joint, row, bias)]
    return Visit({PHI: times(pushed, row[INVERSE])}, handed)


def _eliminated(joint: Joint, share: Vector, force: Scalar, bias: Vector) -> tuple[Scalar, Vector]:
    """φ = τ − eᵀ η, and η + ψ φ/d; `share` is ψ/d."""
    along = axis_of(joint)
    phi = minus(force, bias[along])
    after = sum_of(bias, [dot([x], [phi]) for x in share])
    if is_zero(joint.rotor):
        after[along] = force
    return phi, after


def _solution(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    moved, rate = solved(joint, row, _twist(joint, row, received), row[PHI])
    return Visit({}, moved, {"coordinate": along.dv, "velocity": rate})


def _twist(joint: Joint, row: Rows, received: Vector) -> Vector:
    """A twist of the parent at the link's own origin, in its axes."""
    angular, linear = received[:3], received[3:]
    linear = sum_of(linear, cross(angular, arm(joint, row)))
    return [*from_parent(joint, row, angular), *from_parent(joint, row, linear)]


# ---- from the left


def _weighted(weights: Weights, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Beside the elimination the bias wrench of M⁻¹ with the weights as forces."""
    visit, d = elimination(joint, row, received[:27])
    share = [visit.kept[PSI + k] for k in range(6)]
    pushed, bias = _eliminated(joint, share, weights.y_v, received[27:])
    kept = visit.kept | {INVERSE: pushed / d}
    return Visit(kept, [*visit.handed, *at_parent(joint, row, bias)])


def _virtual(joint: Joint, row: Rows, received: Vector) -> Visit:
    """v̇ and s, with the motion that s is of; what the parent hands on is kept."""
    mu = acceleration(joint, row, received[3:9])
    moved, rate = solved(joint, row, mu, row[PHI])
    virtual, s = solved(joint, row, _twist(joint, row, received[9:]), row[INVERSE])
    kept = dict(enumerate(received, PARENT)) | {RATE: rate, SOLUTION: s}
    return Visit(kept, [*row.vector(OMEGA), *moved, *virtual])


def _slopes(weights: Weights, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: the slopes of what hangs on the link by (ω, α, a, δω, δv) of the link."""
    before, rate, s = row.vector(PARENT, 15), row[RATE], row[SOLUTION]
    given, held = ca.SX.sym("b", 15), ca.SX.sym("a", 2)
    parent = _split(given)
    turned = _twist(joint, row, parent[9:])
    along = axis_of(joint)
    turned[along] = plus(turned[along], held[1])
    of = [*motion(joint, row, parent[:9], held[0]), *turned]
    own = _with(of, ca.vertcat(given, held), [*before, rate, s])
    at = ca.SX.sym("m", 15)
    entries = _split(at)
    power = dot(entries[9:], wrench(joint, entries[:9]))
    felt = sum_of(received, _with(_product([power], at, [1.0], left=True), at, own))
    by = ca.vertcat(given, _moving(row, weights.q), weights.v)
    back = _with(_product(of, by, felt, left=True), ca.vertcat(given, held), [*before, rate, s])
    sine, cosine, q, v = back[15:]
    forces = _product([joint.tau], ca.vertcat(weights.q, weights.v, weights.u), [s], left=True)
    if not joint.slides:
        q = plus(q, minus(times(row[COSINE], sine), times(row[SINE], cosine)))
    results: dict[str, Scalar] = {
        "coordinate": minus(forces[0], q),
        "velocity": minus(plus(forces[1], weights.y_q), v),
    }
    for k, force in enumerate(forces[2:]):
        if ca.depends_on(ca.SX(joint.tau), weights.u[k]):
            results[f"slope{k}"] = force
    return Visit({}, back[:15], results)


# ---- both


def _moving(row: Rows, q: ca.SX) -> ca.SX:
    """What a coordinate stands in: sine and cosine of the angle, and itself."""
    return ca.vertcat(row.symbols[SINE], row.symbols[COSINE], q)


def _moves(joint: Joint, row: Rows, dq: Scalar) -> Vector:
    """The changes of these along that of the coordinate."""
    if joint.slides:
        return [0.0, 0.0, dq]
    return [times(row[COSINE], dq), minus(0.0, times(row[SINE], dq)), dq]


def _product(values: Vector, by: ca.SX, seeds: Vector, left: bool = False) -> Vector:
    """Slopes of the values by these symbols, times the seeds from the right or from the left."""
    column = ca.SX(ca.vertcat(*values))
    return _entries(ca.jtimes(column, by, ca.SX(ca.vertcat(*seeds)), left))


def _with(values: Vector, symbols: ca.SX, taken: Vector) -> Vector:
    """The values with these in the place of the symbols."""
    column = ca.SX(ca.vertcat(*values))
    return _entries(ca.substitute(column, symbols, ca.SX(ca.vertcat(*taken))))


def _split(symbols: ca.SX) -> Vector:
    return [*ca.vertsplit(symbols)]


def _entries(column: ca.SX) -> Vector:
    return [float(x) if x.is_constant() else x for x in ca.vertsplit(ca.densify(column))]
