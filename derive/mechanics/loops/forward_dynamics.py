"""Forward dynamics: v̇ by three loops. With e = z, ω the angular velocity, a the classical
acceleration of the origin minus gravity, all in the link's frame:

    base to tip   ω = Rᵀ ω_λ + e v,   b = ω_λ × (ω_λ × p)
    tip to base   ψ = M̂ e,  d = eᵀ ψ,  φ = τ − eᵀ η,  M̂_λ += Xᵀ (M̂ − ψ ψᵀ/d) X,
                  η_λ += Xᵀ (M̂ᵃ c + η + ψ φ/d)
    base to tip   μ = X (α_λ, a_λ) + c,   v̇ = φ/d − ψᵀ/d μ,   (α, a) = μ + e v̇

with M̂, η the articulated inertia and bias wrench and c the velocity products. Sources: Featherstone
1983; Saha 1999.
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    dot,
    is_zero,
    matrix_sum,
    minus,
    plus,
    sum_of,
    times,
)
from derive.mechanics.articulated import Articulated
from derive.mechanics.links import symmetric
from derive.mechanics.loops.frames import arm, from_parent, to_parent, turned_matrix, turns
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import Rows, falling, rising, rows_of

ZERO: Vector = [0.0, 0.0, 0.0]
# Where the values of a link stand that later sweeps read.
OMEGA, BIAS, PSI, PHI = 2, 5, 8, 14
UPPER = [(i, j) for i in range(3) for j in range(i, 3)]
WHOLE = [(i, j) for i in range(3) for j in range(3)]


def forward_dynamics(joints: Sequence[Joint], gravity: Vector) -> tuple[tuple[Sweep, ...], Rows]:
    """The three loops for these kinds, and a row, whose symbols all kinds share. `gravity` is in
    the axes of the ground frame that the first link was placed in."""
    rows = rows_of(joints)
    visits = (
        rising("velocities, from base to tip", joints, rows, velocities, list(ZERO)),
        falling("articulated inertias, from tip to base", joints, rows, _elimination, 27),
        rising("accelerations, from base to tip", joints, rows, _accelerations, falls(gravity)),
    )
    return visits, rows[0]


def falls(gravity: Vector) -> Vector:
    """(α, a) of the ground: gravity turned round."""
    return [*ZERO, *(-x if not is_zero(x) else 0.0 for x in gravity)]


def velocities(joint: Joint, row: Rows, received: Vector) -> Visit:
    """ω and b."""
    omega = from_parent(joint, row, received)
    if not joint.slides:
        omega = [*omega[:2], plus(omega[2], joint.v)]
    bias = cross(received, cross(received, arm(joint, row)))
    values = {OMEGA + k: x for k, x in enumerate(omega)} | {BIAS + k: x for k, x in enumerate(bias)}
    return Visit(values, omega)


def velocity_products(joint: Joint, row: Rows) -> tuple[Vector, Vector]:
    """The part of c that is in the link's frame: of α and of a."""
    omega = row.vector(OMEGA)
    across = [dot([omega[1]], [joint.v]), -dot([omega[0]], [joint.v]), 0.0]
    if joint.slides:
        return list(ZERO), [times(2.0, x) if not is_zero(x) else 0.0 for x in across]
    return across, list(ZERO)


def _elimination(joint: Joint, row: Rows, received: Vector) -> Visit:
    return elimination(joint, row, received)[0]


def elimination(joint: Joint, row: Rows, received: Vector) -> tuple[Visit, Scalar]:
    """What is handed down, with ψ/d and φ/d kept; and d."""
    body, n, f = _articulated(joint, row, received)
    psi, d = _felt(joint, body)
    plain = is_zero(joint.rotor)
    along = axis_of(joint)
    wrench = [*n, *f]
    phi = minus(joint.tau, wrench[along])
    share: Vector = [0.0 if is_zero(x) else x / d for x in psi]
    if plain:
        share[along] = 1.0
    pushed = phi / d
    left = _without(body, psi, share, along if plain else -1)
    wrench = sum_of(wrench, [dot([x], [pushed]) for x in psi])
    if plain:
        wrench[along] = joint.tau
    c = velocity_products(joint, row)
    wrench = sum_of(wrench, _applied(left, *c))
    values = {PSI + k: x for k, x in enumerate(share)} | {PHI: pushed}
    return Visit(values, _handed_down(joint, row, left, wrench)), d


def _articulated(joint: Joint, row: Rows, received: Vector) -> tuple[Articulated, Vector, Vector]:
    """What hangs on the link, with the link itself: inertia and bias wrench."""
    x, y, z = joint.moment
    across: Matrix = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    mass = [[joint.mass if i == j else 0.0 for j in range(3)] for i in range(3)]
    omega = row.vector(OMEGA)
    spin = [dot(line, omega) for line in joint.tensor]
    n = sum_of(received[21:24], cross(omega, spin))
    f = sum_of(received[24:27], cross(omega, cross(omega, joint.moment)))
    body = Articulated(
        matrix_sum(_square(received[:6]), joint.tensor),
        matrix_sum(_whole(received[6:15]), across),
        matrix_sum(_square(received[15:21]), mass),
    )
    return body, n, f


def _square(upper: Sequence[Scalar]) -> Matrix:
    of = dict(zip(UPPER, upper))
    return symmetric(lambda i, j: of[i, j])


def _whole(entries: Sequence[Scalar]) -> Matrix:
    return [list(entries[3 * i : 3 * i + 3]) for i in range(3)]


def _felt(joint: Joint, body: Articulated) -> tuple[Vector, Scalar]:
    """ψ = M̂ e and d = eᵀ ψ, with a rotor."""
    if joint.slides:
        psi = [*(line[2] for line in body.C), *(line[2] for line in body.K)]
        return psi, plus(psi[5], joint.rotor)
    psi = [*(line[2] for line in body.J), *body.C[2]]
    return psi, plus(psi[2], joint.rotor)


def _without(body: Articulated, psi: Vector, share: Vector, along: int) -> Articulated:
    """M̂ − ψ ψᵀ/d, exactly zero along an axis without a rotor."""

    def entry(i: int, j: int, value: Scalar) -> Scalar:
        return 0.0 if along in (i, j) else minus(value, dot([psi[i]], [share[j]]))

    return Articulated(
        symmetric(lambda i, j: entry(i, j, body.J[i][j])),
        [[entry(i, j + 3, body.C[i][j]) for j in range(3)] for i in range(3)],
        symmetric(lambda i, j: entry(i + 3, j + 3, body.K[i][j])),
    )


def _applied(body: Articulated, alpha: Vector, a: Vector) -> Vector:
    n = [dot([*x, *y], [*alpha, *a]) for x, y in zip(body.J, body.C)]
    below = [[body.C[j][i] for j in range(3)] for i in range(3)]
    return n + [dot([*x, *y], [*alpha, *a]) for x, y in zip(below, body.K)]


def _handed_down(joint: Joint, row: Rows, body: Articulated, wrench: Vector) -> Vector:
    """Turned into the parent's axes, with M̂ᵃ b, then shifted to its origin: C' = C + [p]× K,
    J' = J + [p]× Cᵀ − C' [p]×, n' = n + p × f."""
    n, f = (to_parent(joint, row, x) for x in (wrench[:3], wrench[3:]))
    turned = [_turned_about(joint, row, M) for M in (body.J, body.C, body.K)]
    bias, p = row.vector(BIAS), arm(joint, row)
    n = sum_of(n, [dot(line, bias) for line in turned[1]])
    f = sum_of(f, [dot(line, bias) for line in turned[2]])
    seen = _shifted(Articulated(*turned), p)
    n = sum_of(n, cross(p, f))
    return [*(seen.J[i][j] for i, j in UPPER), *(seen.C[i][j] for i, j in WHOLE),
            *(seen.K[i][j] for i, j in UPPER), *n, *f]  # fmt: skip


def _turned_about(joint: Joint, row: Rows, matrix: Matrix) -> Matrix:
    for axis, s, c in turns(joint, row):
        matrix = turned_matrix(matrix, axis, s, c)
    return matrix


def _shifted(body: Articulated, p: Vector) -> Articulated:
    columns = [[body.K[i][j] for i in range(3)] for j in range(3)]
    over = [cross(p, column) for column in columns]  # columns of [p]× K
    coupled = [[plus(body.C[i][j], over[j][i]) for j in range(3)] for i in range(3)]
    left = [cross(p, line) for line in body.C]  # columns of [p]× Cᵀ
    right = [cross(line, p) for line in coupled]  # rows of C' [p]×
    turning = symmetric(lambda i, j: minus(plus(body.J[i][j], left[j][i]), right[i][j]))
    return Articulated(turning, coupled, body.K)


def _accelerations(joint: Joint, row: Rows, received: Vector) -> Visit:
    mu, rate = solved(joint, row, acceleration(joint, row, received), row[PHI])
    return Visit({}, mu, {"coordinate": joint.v, "velocity": rate})


def acceleration(joint: Joint, row: Rows, received: Vector) -> Vector:
    """μ = X (α_λ, a_λ) + c."""
    alpha, a = received[:3], received[3:]
    a = sum_of(sum_of(a, row.vector(BIAS)), cross(alpha, arm(joint, row)))
    c = velocity_products(joint, row)
    return [
        *sum_of(from_parent(joint, row, alpha), c[0]),
        *sum_of(from_parent(joint, row, a), c[1]),
    ]


def solved(joint: Joint, row: Rows, mu: Vector, pushed: Scalar) -> tuple[Vector, Scalar]:
    """μ + e x and x = φ/d − ψᵀ/d μ, the joint's entry of the solution."""
    x = minus(pushed, dot(row.vector(PSI, 6), mu))
    along = axis_of(joint)
    return [plus(e, x) if k == along else e for k, e in enumerate(mu)], x


def axis_of(joint: Joint) -> int:
    """Of six entries, angular first, the one along the joint."""
    return 5 if joint.slides else 2
