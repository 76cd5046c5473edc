"""Forward dynamics of a tree as loops over its links: one formula for each kind of joint, what
differs from link to link in tables. The size of the code does not grow with the mechanism.

Frames: z on the joint axis, origin on it; x of a link is perpendicular to the axis of the link that
follows, so that the placement of a link in its parent is Rx(α) Rz(θ) after the offset p, and
Rz(γ) Rx(α) Rz(θ) for the further children of a link with several. With e = z, ω the angular
velocity, a the classical acceleration of the origin minus gravity, all in the link's frame:

    base to tip   ω = Rᵀ ω_λ + e v,   b = ω_λ × (ω_λ × p)
    tip to base   ψ = M̂ e,  d = eᵀ ψ,  φ = τ − eᵀ η,  M̂_λ += Xᵀ (M̂ − ψ ψᵀ/d) X,
                  η_λ += Xᵀ (M̂ᵃ c + η + ψ φ/d)
    base to tip   μ = X (α_λ, a_λ) + c,   v̇ = φ/d − ψᵀ/d μ,   (α, a) = μ + e v̇

with M̂, η the articulated inertia and bias wrench and c the velocity products. Sources: Featherstone
1983; Saha 1999; frames after Khalil, Kleinfinger 1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    dot,
    is_one,
    is_zero,
    matrix_sum,
    minus,
    plus,
    sum_of,
    times,
)
from derive.mechanics.articulated import Articulated
from derive.mechanics.links import symmetric

ZERO: Vector = [0.0, 0.0, 0.0]
# Where the values of a link stand that later sweeps read.
SINE, COSINE, OMEGA, BIAS, PSI, PHI = 0, 1, 2, 5, 8, 14
KEPT = 15
UPPER = [(i, j) for i in range(3) for j in range(i, 3)]
WHOLE = [(i, j) for i in range(3) for j in range(3)]


@dataclass(frozen=True)
class Joint:
    """What a visit reads of a link of one kind: symbols, and floats where all links of the kind
    have the same number."""

    slides: bool
    q: Scalar
    v: Scalar
    tau: Scalar
    rotor: Scalar
    offset: Scalar  # of the angle; of a sliding joint sine and cosine of it instead
    sine: Scalar
    cosine: Scalar
    alpha: tuple[Scalar, Scalar]  # sine, cosine
    gamma: tuple[Scalar, Scalar]
    place: Vector
    mass: Scalar
    moment: Vector
    tensor: Matrix


@dataclass(frozen=True)
class Visit:
    """What a sweep does at one link: entries of the link's row that it keeps, what it hands on
    along the tree, and v̇ where it finds it."""

    kept: dict[int, Scalar]
    handed: Vector
    result: Scalar | None = None


@dataclass(frozen=True)
class Sweep:
    """A loop over the links. What a link receives is what its parent handed on where the sweep is
    `rising`, else the sum of what its children did; `start` is what the ground hands on. Of the
    entries that are handed on by structure, those that are zero at every link are left out."""

    title: str
    rising: bool
    received: ca.SX
    start: Vector
    visits: tuple[Visit, ...]  # by kind


@dataclass(frozen=True)
class Kind:
    """Links that share a formula. `constants` are symbols for the columns of the `table`; `inputs`
    for entries of u, which differ from link to link."""

    about: str
    constants: ca.SX
    inputs: ca.SX
    table: tuple[tuple[Scalar, ...], ...]


@dataclass(frozen=True)
class Recursion:
    """Forward dynamics of a tree. By link, parents before children and a child directly after its
    parent where it can be: parent (−1 the ground), kind, row of the kind's table, coordinate,
    velocity, entries of u. `q`, `v` and `row` stand for those of the link at hand; the row begins
    with sine and cosine of the angle."""

    parents: tuple[int, ...]
    kinds_of: tuple[int, ...]
    rows_of: tuple[int, ...]
    coordinates: tuple[int, ...]
    velocities: tuple[int, ...]
    inputs_of: tuple[tuple[int, ...], ...]
    kinds: tuple[Kind, ...]
    angles: tuple[
        Scalar | None, ...
    ]  # by kind, where its links turn: sine and cosine go before all
    sweeps: tuple[Sweep, ...]
    t: ca.SX
    q: ca.SX
    v: ca.SX
    row: ca.SX
    p: ca.SX


@dataclass
class Rows:
    """The values of a link, as later sweeps see them: symbols, or numbers where that is known."""

    symbols: ca.SX = field(default_factory=lambda: ca.SX.sym("r", KEPT))
    values: dict[int, Scalar] = field(default_factory=dict[int, Scalar])

    def __getitem__(self, place: int) -> Scalar:
        return self.values[place]

    def vector(self, place: int, size: int = 3) -> Vector:
        """Entries that stand side by side."""
        return [self.values[place + k] for k in range(size)]

    def keep(self, kept: dict[int, Scalar]) -> dict[int, Scalar]:
        """Numbers are known later, the rest is stored: what is left to store."""
        stored = {k: x for k, x in kept.items() if not _is_number(x)}
        self.values |= {k: self.symbols[k] if k in stored else x for k, x in kept.items()}
        return stored


Step = Callable[[Joint, Rows, Vector], Visit]


def sweeps(joints: Sequence[Joint], gravity: Vector) -> tuple[tuple[Sweep, ...], ca.SX]:
    """The three loops for these kinds, and the symbols of a link's row. `gravity` is in the axes of
    the ground frame that the first link was placed in."""
    rows = [Rows() for _ in joints]
    symbols = rows[0].symbols
    rows = [Rows(symbols) for _ in joints]
    falls: Vector = [*ZERO, *(-x if not is_zero(x) else 0.0 for x in gravity)]
    for joint, row in zip(joints, rows):
        turned = (joint.sine, joint.cosine) if joint.slides else (symbols[SINE], symbols[COSINE])
        row.values |= dict(zip((SINE, COSINE), turned))
    visits = (
        _rising("velocities, from base to tip", joints, rows, _velocities, list(ZERO)),
        _falling("articulated inertias, from tip to base", joints, rows, _elimination, 27),
        _rising("accelerations, from base to tip", joints, rows, _accelerations, falls),
    )
    return visits, symbols


def _rising(
    title: str, joints: Sequence[Joint], rows: Sequence[Rows], step: Step, start: Vector
) -> Sweep:
    """Entries are zero everywhere where the ground's are and no link makes them otherwise."""
    alive = {k for k, x in enumerate(start) if not is_zero(x)}
    return _settled(title, True, joints, rows, step, start, alive)


def _falling(
    title: str, joints: Sequence[Joint], rows: Sequence[Rows], step: Step, size: int
) -> Sweep:
    return _settled(title, False, joints, rows, step, [0.0] * size, set())


def _settled(
    title: str,
    rising: bool,
    joints: Sequence[Joint],
    rows: Sequence[Rows],
    step: Step,
    start: Vector,
    alive: set[int],
) -> Sweep:
    symbols = ca.SX.sym("e", len(start))
    while True:
        received: Vector = [symbols[k] if k in alive else 0.0 for k in range(len(start))]
        visits = [step(joint, row, received) for joint, row in zip(joints, rows)]
        more = {k for visit in visits for k, x in enumerate(visit.handed) if not is_zero(x)}
        if more <= alive:
            break
        alive |= more
    order = sorted(alive)
    stores = [row.keep(visit.kept) for row, visit in zip(rows, visits)]
    return Sweep(
        title,
        rising,
        symbols[order],
        [start[k] for k in order],
        tuple(
            replace(visit, kept=stored, handed=[visit.handed[k] for k in order])
            for visit, stored in zip(visits, stores)
        ),
    )


def _is_number(x: Scalar) -> bool:
    return not isinstance(x, ca.SX) or x.is_constant()


# ---- frames


def _turned(x: Vector, axis: int, s: Scalar, c: Scalar) -> Vector:
    """By a turn about a principal axis with that sine and cosine."""
    if is_zero(s) and is_one(c):
        return x
    i, j = (axis + 1) % 3, (axis + 2) % 3
    result = list(x)
    result[i] = minus(dot([c], [x[i]]), dot([s], [x[j]]))
    result[j] = plus(dot([s], [x[i]]), dot([c], [x[j]]))
    return result


def _turned_matrix(M: Matrix, axis: int, s: Scalar, c: Scalar) -> Matrix:
    """R M Rᵀ. With k = s (M₁₁ − M₂₂) + c (M₁₂ + M₂₁) in the plane that turns: M₁₁ − s k, M₂₂ + s k,
    c k − M₂₁, c k − M₁₂."""
    if is_zero(s) and is_one(c):
        return M
    i, j, z = (axis + 1) % 3, (axis + 2) % 3, axis
    k = plus(dot([s], [minus(M[i][i], M[j][j])]), dot([c], [plus(M[i][j], M[j][i])]))
    result = [list(row) for row in M]
    sk, ck = dot([s], [k]), dot([c], [k])
    result[i][i], result[j][j] = minus(M[i][i], sk), plus(M[j][j], sk)
    result[i][j], result[j][i] = minus(ck, M[j][i]), minus(ck, M[i][j])
    result[i][z], result[j][z] = _pair(M[i][z], M[j][z], s, c)
    result[z][i], result[z][j] = _pair(M[z][i], M[z][j], s, c)
    return result


def _pair(x: Scalar, y: Scalar, s: Scalar, c: Scalar) -> tuple[Scalar, Scalar]:
    return minus(dot([c], [x]), dot([s], [y])), plus(dot([s], [x]), dot([c], [y]))


def _turns(joint: Joint, row: Rows) -> list[tuple[int, Scalar, Scalar]]:
    """(axis, sine, cosine), in the order in which a child's values are turned into its parent."""
    return [(2, row[SINE], row[COSINE]), (0, *joint.alpha), (2, *joint.gamma)]


def _to_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    for axis, s, c in _turns(joint, row):
        x = _turned(x, axis, s, c)
    return x


def _from_parent(joint: Joint, row: Rows, x: Vector) -> Vector:
    for axis, s, c in reversed(_turns(joint, row)):
        x = _turned(x, axis, -s, c)
    return x


def _arm(joint: Joint, row: Rows) -> Vector:
    """The link's origin in its parent's frame."""
    if not joint.slides:
        return joint.place
    return sum_of(joint.place, _to_parent(joint, row, [0.0, 0.0, joint.q]))


# ---- the sweeps


def _velocities(joint: Joint, row: Rows, received: Vector) -> Visit:
    omega = _from_parent(joint, row, received)
    if not joint.slides:
        omega = [*omega[:2], plus(omega[2], joint.v)]
    bias = cross(received, cross(received, _arm(joint, row)))
    values = {OMEGA + k: x for k, x in enumerate(omega)} | {BIAS + k: x for k, x in enumerate(bias)}
    return Visit(values, omega)


def _products(joint: Joint, row: Rows) -> tuple[Vector, Vector]:
    """The part of c that is in the link's frame: of α and of a."""
    omega = row.vector(OMEGA)
    across = [dot([omega[1]], [joint.v]), -dot([omega[0]], [joint.v]), 0.0]
    if joint.slides:
        return list(ZERO), [times(2.0, x) if not is_zero(x) else 0.0 for x in across]
    return across, list(ZERO)


def _elimination(joint: Joint, row: Rows, received: Vector) -> Visit:
    body, n, f = _articulated(joint, row, received)
    psi, d = _felt(joint, body)
    plain = is_zero(joint.rotor)
    along = 5 if joint.slides else 2
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
    c = _products(joint, row)
    wrench = sum_of(wrench, _applied(left, *c))
    values = {PSI + k: x for k, x in enumerate(share)} | {PHI: pushed}
    return Visit(values, _handed_down(joint, row, left, wrench))


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
    n, f = (_to_parent(joint, row, x) for x in (wrench[:3], wrench[3:]))
    turned = [_turned_about(joint, row, M) for M in (body.J, body.C, body.K)]
    bias, arm = row.vector(BIAS), _arm(joint, row)
    n = sum_of(n, [dot(line, bias) for line in turned[1]])
    f = sum_of(f, [dot(line, bias) for line in turned[2]])
    seen = _shifted(Articulated(*turned), arm)
    n = sum_of(n, cross(arm, f))
    return [*(seen.J[i][j] for i, j in UPPER), *(seen.C[i][j] for i, j in WHOLE),
            *(seen.K[i][j] for i, j in UPPER), *n, *f]  # fmt: skip


def _turned_about(joint: Joint, row: Rows, matrix: Matrix) -> Matrix:
    for axis, s, c in _turns(joint, row):
        matrix = _turned_matrix(matrix, axis, s, c)
    return matrix


def _shifted(body: Articulated, arm: Vector) -> Articulated:
    columns = [[body.K[i][j] for i in range(3)] for j in range(3)]
    over = [cross(arm, column) for column in columns]  # columns of [p]× K
    coupled = [[plus(body.C[i][j], over[j][i]) for j in range(3)] for i in range(3)]
    left = [cross(arm, line) for line in body.C]  # columns of [p]× Cᵀ
    right = [cross(line, arm) for line in coupled]  # rows of C' [p]×
    turning = symmetric(lambda i, j: minus(plus(body.J[i][j], left[j][i]), right[i][j]))
    return Articulated(turning, coupled, body.K)


def _accelerations(joint: Joint, row: Rows, received: Vector) -> Visit:
    alpha, a = received[:3], received[3:]
    a = sum_of(sum_of(a, row.vector(BIAS)), cross(alpha, _arm(joint, row)))
    c = _products(joint, row)
    mu = [
        *sum_of(_from_parent(joint, row, alpha), c[0]),
        *sum_of(_from_parent(joint, row, a), c[1]),
    ]
    rate = minus(row[PHI], dot(row.vector(PSI, 6), mu))
    along = 5 if joint.slides else 2
    mu[along] = plus(mu[along], rate)
    return Visit({}, mu, rate)
