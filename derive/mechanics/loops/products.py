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
    elimination,
    falls,
    further,
    numbered,
    of_each,
    quotient,
    rates_of,
    shares,
    solved,
    velocities,
)
from derive.mechanics.loops.frames import arm, from_parent
from derive.mechanics.loops.inverse_dynamics import at_parent, motion, wrench
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import (
    COSINE,
    SINE,
    TURNED,
    Rows,
    falling,
    orientation,
    rising,
    rows_of,
)

INVERSE = 15  # 1/d
# (n, f) of a link and its change, where forward dynamics needs its entries no more
FORCES, CHANGES = OMEGA, 16
# (ω, α, a, δω, δv) of a link's parent, v̇ and s of its own, likewise
PARENT, RATE, SOLUTION = OMEGA, 17, 18


@dataclass(frozen=True)
class Along:
    """Coordinates, velocities and inputs of the link at hand, and their changes; of each as many as
    a link has at most."""

    q: ca.SX
    v: ca.SX
    u: ca.SX
    dq: ca.SX
    dv: ca.SX
    du: ca.SX


@dataclass(frozen=True)
class Weights:
    """Coordinates, velocities and inputs of the link at hand, and the weights of q̇ and v̇."""

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
    visit, pivots = elimination(joint, row, received)
    inverses = {further(INVERSE, k): quotient(1.0, d) for k, d in enumerate(pivots)}
    return Visit(visit.kept | inverses, visit.handed)


def _changes(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: (ω, α, a) of the parent, and their changes at held v̇."""
    before, changes = received[:9], received[9:]
    mu = acceleration(joint, row, before[3:])
    moved, rate = solved(joint, row, mu, of_each(joint, row, PHI))
    own = [*row.vector(OMEGA), *moved]
    given, held, at = ca.SX.sym("b", 9), ca.SX.sym("a", len(rate)), ca.SX.sym("m", 9)
    of = motion(joint, row, _split(given), _split(held))
    by = ca.vertcat(given, _moving(joint, row), *joint.v)
    dq, dv = _own(joint, along.dq, along.dv)
    seeds = [*changes, *_moves(joint, row, dq), *dv]
    changes = _with(_product(of, by, seeds), ca.vertcat(given, held), [*before, *rate])
    felt = _with(_product(wrench(joint, _split(at)), at, changes), at, own)
    kept = dict(enumerate(wrench(joint, own), FORCES)) | dict(enumerate(felt, CHANGES))
    return Visit(kept, [*own, *changes])


def _forces(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: wrenches, their changes, and the bias wrench of M⁻¹ with the changes as forces."""
    total = sum_of(received[:6], row.vector(FORCES, 6))
    changed = sum_of(received[6:12], row.vector(CHANGES, 6))
    bias = received[12:]
    dq, dv = _own(joint, along.dq, along.dv)
    acting = _product(
        joint.tau,
        ca.vertcat(*joint.q, *joint.v, along.u),
        [*dq, *dv, *ca.vertsplit(along.du)],
    )
    forces = [minus(x, changed[k]) for x, k in zip(acting, joint.axes)]
    pushed, bias = _eliminated(joint, shares(joint, row), forces, bias)
    given = ca.SX.sym("n", 6)
    of = at_parent(joint, row, _split(given))
    by = ca.vertcat(given, _moving(joint, row))
    seeds = [*changed, *_moves(joint, row, dq)]
    change = _with(_product(of, by, seeds), given, total)
    handed = [*at_parent(joint, row, total), *change, *at_parent(joint, row, bias)]
    inverses = of_each(joint, row, INVERSE)
    kept = {further(PHI, k): times(x, y) for k, (x, y) in enumerate(zip(pushed, inverses))}
    return Visit(kept, handed)


def _eliminated(
    joint: Joint, of: Sequence[Vector], forces: Vector, bias: Vector
) -> tuple[Vector, Vector]:
    """φ = τ − eᵀ η, and η + ψ φ/d, one velocity after the other; `of` are ψ/d."""
    pushed: Vector = []
    for k, along in enumerate(joint.axes):
        phi = minus(forces[k], bias[along])
        bias = sum_of(bias, [dot([x], [phi]) for x in of[k]])
        if is_zero(joint.rotor[k]):
            bias[along] = forces[k]
        pushed.append(phi)
    return pushed, bias


def _solution(along: Along, joint: Joint, row: Rows, received: Vector) -> Visit:
    twist = _twist(joint, row, received)
    moved, rates = solved(joint, row, twist, of_each(joint, row, PHI))
    by = ca.vertcat(_moving(joint, row), *joint.v)
    dq, dv = _own(joint, along.dq, along.dv)
    changes = _product(rates_of(joint, row), by, [*_moves(joint, row, dq), *dv])
    return Visit({}, moved, numbered("coordinate", changes) | numbered("velocity", rates))


def _twist(joint: Joint, row: Rows, received: Vector) -> Vector:
    """A twist of the parent at the link's own origin, in its axes."""
    angular, linear = received[:3], received[3:]
    linear = sum_of(linear, cross(angular, arm(joint)))
    return [*from_parent(joint, row, angular), *from_parent(joint, row, linear)]


# ---- from the left


def _weighted(weights: Weights, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Beside the elimination the bias wrench of M⁻¹ with the weights as forces."""
    visit, pivots = elimination(joint, row, received[:27])
    count = len(joint.axes)
    of = [[visit.kept[further(PSI, k) + i] for i in range(6)] for k in range(count)]
    _, y_v = _own(joint, weights.y_q, weights.y_v)
    pushed, bias = _eliminated(joint, of, y_v, received[27:])
    each = enumerate(zip(pushed, pivots))
    solutions = {further(INVERSE, k): quotient(x, d) for k, (x, d) in each}
    return Visit(visit.kept | solutions, [*visit.handed, *at_parent(joint, row, bias)])


def _virtual(joint: Joint, row: Rows, received: Vector) -> Visit:
    """v̇ and s, with the motion that s is of; what the parent hands on is kept."""
    mu = acceleration(joint, row, received[3:9])
    moved, rates = solved(joint, row, mu, of_each(joint, row, PHI))
    twist = _twist(joint, row, received[9:])
    virtual, s = solved(joint, row, twist, of_each(joint, row, INVERSE))
    kept = dict(enumerate(received, PARENT))
    kept |= {further(RATE, k): x for k, x in enumerate(rates)}
    kept |= {further(SOLUTION, k): x for k, x in enumerate(s)}
    return Visit(kept, [*row.vector(OMEGA), *moved, *virtual])


def _slopes(weights: Weights, joint: Joint, row: Rows, received: Vector) -> Visit:
    """Received: the slopes of what hangs on the link by (ω, α, a, δω, δv) of the link."""
    count = len(joint.axes)
    before, rates = row.vector(PARENT, 15), of_each(joint, row, RATE)
    s = of_each(joint, row, SOLUTION)
    given, held, virtual = ca.SX.sym("b", 15), ca.SX.sym("a", count), ca.SX.sym("s", count)
    parent = _split(given)
    turned = _twist(joint, row, parent[9:])
    for along, x in zip(joint.axes, _split(virtual)):
        turned[along] = plus(turned[along], x)
    of = [*motion(joint, row, parent[:9], _split(held)), *turned]
    taken, at_hand = ca.vertcat(given, held, virtual), [*before, *rates, *s]
    own = _with(of, taken, at_hand)
    at = ca.SX.sym("m", 15)
    entries = _split(at)
    power = dot(entries[9:], wrench(joint, entries[:9]))
    felt = sum_of(received, _with(_product([power], at, [1.0], left=True), at, own))
    by = ca.vertcat(given, _moving(joint, row), *joint.v)
    back = _with(_product(of, by, felt, left=True), taken, at_hand)
    moving, v = back[15:-count], back[-count:]
    y_q, _ = _own(joint, weights.y_q, weights.y_v)
    u = ca.vertsplit(weights.u)
    forces = _product(joint.tau, ca.vertcat(*joint.q, *joint.v, *u), s, left=True)
    rated = _product(
        rates_of(joint, row), ca.vertcat(_moving(joint, row), *joint.v), y_q, left=True
    )
    many = len(joint.q)
    slopes = (_by_coordinates(joint, row, x) for x in (rated[:-count], moving))
    by_q = [minus(plus(x, y), z) for x, y, z in zip(forces[:many], *slopes)]
    by_v = [minus(plus(x, y), z) for x, y, z in zip(forces[many:], rated[-count:], v)]
    by_u: dict[str, Scalar] = {}
    for k, force in enumerate(forces[many + count :]):
        if ca.depends_on(ca.SX(ca.vertcat(*joint.tau)), u[k]):
            by_u[f"slope{k}"] = force
    return Visit({}, back[:15], numbered("coordinate", by_q) | numbered("velocity", by_v) | by_u)


# ---- both


def _own(joint: Joint, of_q: ca.SX, of_v: ca.SX) -> tuple[Vector, Vector]:
    """Of what there is of each coordinate and velocity, those that the joint has."""
    return _split(of_q)[: len(joint.q)], _split(of_v)[: len(joint.v)]


def _moving(joint: Joint, row: Rows) -> ca.SX:
    """What coordinates stand in: sine and cosine of the angle, or an orientation, and
    themselves."""
    turned = row.symbols[TURNED : TURNED + 9] if joint.turned is not None else ca.SX(0, 1)
    return ca.vertcat(row.symbols[SINE], row.symbols[COSINE], turned, *joint.q)


def _moves(joint: Joint, row: Rows, dq: Vector) -> Vector:
    """The changes of these along those of the coordinates."""
    by = ca.vertcat(*joint.q)
    if joint.turned is not None:
        return [0.0, 0.0, *_product([*orientation(joint).values()], by, dq), *dq]
    if joint.angle is None:
        return [0.0, 0.0, *dq]
    (angle,) = _product([joint.angle], by, dq)
    return [times(row[COSINE], angle), minus(0.0, times(row[SINE], angle)), *dq]


def _by_coordinates(joint: Joint, row: Rows, slopes: Vector) -> Vector:
    """Slopes by these as slopes by the coordinates."""
    by = ca.vertcat(*joint.q)
    sine, cosine = slopes[:2]
    q = slopes[-len(joint.q) :]
    through: Vector = []
    if joint.turned is not None:
        through = _product([*orientation(joint).values()], by, slopes[2:11], left=True)
    elif joint.angle is not None:
        angle = minus(times(row[COSINE], sine), times(row[SINE], cosine))
        through = _product([joint.angle], by, [angle], left=True)
    return sum_of(q, through) if through else q


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
