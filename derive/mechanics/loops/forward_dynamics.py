"""Forward dynamics: v̇ by three loops. With e = z, ω the angular velocity, a the classical
acceleration of the origin minus gravity, all in the link's frame:

    base to tip   ω = Rᵀ ω_λ + e v,   b = ω_λ × (ω_λ × p)
    tip to base   ψ = M̂ e,  d = eᵀ ψ,  φ = τ − eᵀ η,  M̂_λ += Xᵀ (M̂ − ψ ψᵀ/d) X,
                  η_λ += Xᵀ (M̂ᵃ c + η + ψ φ/d)
    base to tip   μ = X (α_λ, a_λ) + c,   v̇ = φ/d − ψᵀ/d μ,   (α, a) = μ + e v̇

with M̂, η the articulated inertia and bias wrench and c the velocity products. A joint of several
velocities is one such elimination after the other in the same frame, and c is theirs together.
Sources: Featherstone 1983; Saha 1999.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

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
from derive.mechanics.links import symmetric
from derive.mechanics.loops.frames import (
    along_shifts,
    arm,
    from_parent,
    to_parent,
    turned_matrix,
    turns,
)
from derive.mechanics.loops.poses import have_pushes, less_push, of_ground, pose, push
from derive.mechanics.loops.records import Joint, Sweep, Visit
from derive.mechanics.loops.sweeps import Rows, falling, orientation, rising, rows_of
from derive.mechanics.recursions.articulated import Articulated

ZERO: Vector = [0.0, 0.0, 0.0]
# Where the values of a link stand that later sweeps read; those of further velocities of a joint
# stand behind all others.
OMEGA, BIAS, PSI, PHI = 2, 5, 8, 14
FURTHER, EACH = 24, 11
UPPER = [(i, j) for i in range(3) for j in range(i, 3)]
WHOLE = [(i, j) for i in range(3) for j in range(3)]


def forward_dynamics(
    joints: Sequence[Joint], gravity: Vector, ground: Matrix
) -> tuple[tuple[Sweep, ...], Rows]:
    """The three loops for these kinds, and a row, whose symbols all kinds share. `gravity` is in
    the axes of the ground frame that the first link was placed in, which are the columns of
    `ground`."""
    rows = rows_of(joints)
    pushed = have_pushes(joints)
    first = (
        rising("poses, from base to tip", joints, rows, _poses, [*ZERO, *of_ground(ground)])
        if pushed
        else rising("velocities, from base to tip", joints, rows, velocities, list(ZERO))
    )
    eliminated = _pushed_elimination if pushed else _elimination
    visits = (
        first,
        falling("articulated inertias, from tip to base", joints, rows, eliminated, 27),
        rising("accelerations, from base to tip", joints, rows, _accelerations, falls(gravity)),
    )
    return visits, rows[0]


def falls(gravity: Vector) -> Vector:
    """(α, a) of the ground: gravity turned round."""
    return [*ZERO, *(-x if not is_zero(x) else 0.0 for x in gravity)]


def velocities(joint: Joint, row: Rows, received: Vector) -> Visit:
    """ω and b, and the orientation where it is no single angle."""
    omega = sum_of(from_parent(joint, row, received), relative(joint)[:3])
    bias = cross(received, cross(received, arm(joint)))
    values = {OMEGA + k: x for k, x in enumerate(omega)} | {BIAS + k: x for k, x in enumerate(bias)}
    return Visit(values | orientation(joint), omega)


def _poses(joint: Joint, row: Rows, received: Vector) -> Visit:
    """The same, with where the link is, and what acts on it there."""
    omega = received[:3]
    visit = velocities(joint, row, omega)
    at = pose(joint, row, omega, received[3:], relative(joint)[3:])
    return Visit(visit.kept | push(joint, visit.handed, at), [*visit.handed, *at])


def relative(joint: Joint) -> Vector:
    """The twist of the link against its parent, in its frame, angular first."""
    of = dict(zip(joint.axes, joint.v))
    return [of.get(k, 0.0) for k in range(6)]


def rates_of(joint: Joint, row: Rows) -> Vector:
    """q̇: where coordinates shift the link, its velocity along them."""
    shifted = along_shifts(joint, row, relative(joint)[3:])
    each = zip(joint.shifts, joint.rates)
    return [shifted[axis] if axis >= 0 else rate for axis, rate in each]


def velocity_products(omega: Vector, moved: Vector) -> tuple[Vector, Vector]:
    """The part of c that is in the link's frame, for its twist (ω_r, v_r) against the parent: of α
    ω × ω_r, of a (2 ω − ω_r) × v_r."""
    turning, linear = moved[:3], moved[3:]
    if all(map(is_zero, turning)):
        return list(ZERO), [_twice(x) for x in cross(omega, linear)]
    if all(map(is_zero, linear)):
        return cross(omega, turning), list(ZERO)
    both = [minus(_twice(x), y) for x, y in zip(omega, turning)]
    return cross(omega, turning), cross(both, linear)


def _twice(x: Scalar) -> Scalar:
    return 0.0 if is_zero(x) else times(2.0, x)


def _elimination(joint: Joint, row: Rows, received: Vector) -> Visit:
    return elimination(joint, row, received)[0]


def _pushed_elimination(joint: Joint, row: Rows, received: Vector) -> Visit:
    """Where something acts on links by themselves."""
    without = less_push(row, received[21:27])
    return elimination(joint, row, [*received[:21], *without])[0]


def elimination(joint: Joint, row: Rows, received: Vector) -> tuple[Visit, Vector]:
    """What is handed down, with ψ/d and φ/d of each velocity kept; and each d."""
    body, n, f = _articulated(joint, row, received)
    wrench = [*n, *f]
    kept: dict[int, Scalar] = {}
    pivots: Vector = []
    for k, along in enumerate(joint.axes):
        psi, d = _felt(along, joint.rotor[k], body)
        plain = is_zero(joint.rotor[k])
        phi = minus(joint.tau[k], wrench[along])
        share: Vector = [quotient(x, d) for x in psi]
        if plain:
            share[along] = 1.0
        pushed = quotient(phi, d)
        body = _without(body, psi, share, along if plain else -1)
        wrench = sum_of(wrench, [dot([x], [pushed]) for x in psi])
        if plain:
            wrench[along] = joint.tau[k]
        kept |= dict(enumerate(share, further(PSI, k))) | {further(PHI, k): pushed}
        pivots.append(d)
    c = velocity_products(row.vector(OMEGA), relative(joint))
    wrench = sum_of(wrench, _applied(body, *c))
    return Visit(kept, _handed_down(joint, row, body, wrench)), pivots


def quotient(x: Scalar, d: Scalar) -> Scalar:
    """x/d. A link without a mass has d = 0 until what hangs on it is known."""
    return 0.0 if is_zero(x) else ca.SX(x) / d


def further(place: int, k: int) -> int:
    """Where that stands for velocity k of a joint."""
    return place if k == 0 else FURTHER + EACH * (k - 1) + place - PSI


def shares(joint: Joint, row: Rows) -> list[Vector]:
    """ψ/d of each velocity."""
    return [row.vector(further(PSI, k), 6) for k in range(len(joint.axes))]


def of_each(joint: Joint, row: Rows, place: int) -> Vector:
    """What stands there, of each velocity."""
    return [row[further(place, k)] for k in range(len(joint.axes))]


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


def _felt(along: int, rotor: Scalar, body: Articulated) -> tuple[Vector, Scalar]:
    """ψ = M̂ e and d = eᵀ ψ, with a rotor."""
    if along < 3:
        psi = [*(line[along] for line in body.J), *body.C[along]]
    else:
        psi = [*(line[along - 3] for line in body.C), *(line[along - 3] for line in body.K)]
    return psi, plus(psi[along], rotor)


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
    J, C, K = (_turned_about(joint, row, M) for M in (body.J, body.C, body.K))
    turned = [symmetric(lambda i, j: J[i][j]), C, symmetric(lambda i, j: K[i][j])]
    bias, p = row.vector(BIAS), arm(joint)
    n = sum_of(n, [dot(line, bias) for line in turned[1]])
    f = sum_of(f, [dot(line, bias) for line in turned[2]])
    seen = _shifted(Articulated(*turned), p)
    n = sum_of(n, cross(p, f))
    return [*(seen.J[i][j] for i, j in UPPER), *(seen.C[i][j] for i, j in WHOLE),
            *(seen.K[i][j] for i, j in UPPER), *n, *f]  # fmt: skip


def _turned_about(joint: Joint, row: Rows, matrix: Matrix) -> Matrix:
    for turn in turns(joint, row):
        matrix = turned_matrix(matrix, turn)
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
    mu, rates = solved(joint, row, acceleration(joint, row, received), of_each(joint, row, PHI))
    return Visit({}, mu, numbered("coordinate", rates_of(joint, row)) | numbered("velocity", rates))


def numbered(name: str, values: Sequence[Scalar]) -> dict[str, Scalar]:
    """Results of a joint: those of its first coordinate or velocity bear the name itself."""
    return {numbered_name(name, k): x for k, x in enumerate(values)}


def numbered_name(name: str, k: int) -> str:
    """Of what is read or given for coordinate or velocity k of a joint."""
    return f"{name}{k}" if k else name


def acceleration(joint: Joint, row: Rows, received: Vector) -> Vector:
    """μ = X (α_λ, a_λ) + c."""
    alpha, a = received[:3], received[3:]
    a = sum_of(sum_of(a, row.vector(BIAS)), cross(alpha, arm(joint)))
    c = velocity_products(row.vector(OMEGA), relative(joint))
    return [
        *sum_of(from_parent(joint, row, alpha), c[0]),
        *sum_of(from_parent(joint, row, a), c[1]),
    ]


def solved(joint: Joint, row: Rows, mu: Vector, pushed: Vector) -> tuple[Vector, Vector]:
    """μ + e x and x = φ/d − ψᵀ/d μ, the joint's entries of the solution: what was eliminated last
    comes first."""
    found: dict[int, Scalar] = {}
    for k, along in reversed([*enumerate(joint.axes)]):
        found[k] = minus(pushed[k], dot(row.vector(further(PSI, k), 6), mu))
        mu = [plus(e, found[k]) if i == along else e for i, e in enumerate(mu)]
    return mu, [found[k] for k in range(len(joint.axes))]
