"""What keeps a simulation on the constraints and on its branch, against the reference's φ, A and M:
`closure`, `slip`, `pull`, `constraint_rows` and `guards`.

Which pivots an elimination has is its own affair, so no single one of `guards` is the mechanics':
their product is, which is a determinant of the reference's rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

import casadi as ca
import numpy as np

from derive.choices.locks import LOCK
from derive.choices.orthonormal import LENGTH
from derive.formulations.evaluate import slots_of
from derive.mechanics.limits import COFACTORS
from derive.states.sampling import states
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, slope, worst
from hamel.verify.checks.evidence import Evidence
from hamel.verify.checks.identities import DIFFERENCES
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import SMALL, SOLVED, TERMS
from hamel.verify.reference.outcome import Kinematics, state_of
from hamel.verify.reference.saddle import rank_of, row_condition
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array

SEEN = 3  # states at which every coordinate is moved
SHIFT = 1e-3  # of a coordinate in the model's own units, for differences of fourth order
OWN = 10  # states at which rows are as long as the parameters of the file make them
USUAL = 8.0  # a row's usual length is a median over other states than those that are looked at


# ---- positions and velocities


def closures(e: Evidence) -> float | None:
    """ψ of the function `closure` off the constraint surface: independent φ and the lengths of
    quaternions less one."""
    if not e.graph.has("closure"):
        return None
    ours = [e.graph("closure", *row)[:, 0] for row in _astray(e)]
    wanted = [_positions(e, s, x[: len(s.q)]) for s, x in zip(e.samples, e.astray)]
    sums = Sums(TERMS, [1.0 + worst(x / e.units.x) for x in e.astray])
    return deviation(ours, wanted, unit=_position_units(e), sums=sums)


def slopes(e: Evidence) -> float | None:
    """∂ψ/∂q of the function `closure`, against differences of the reference's φ by each coordinate,
    each of a quaternion for itself."""
    if not e.graph.has("closure"):
        return None
    rows = islice(zip(e.samples, e.astray, _astray(e)), SEEN)
    return worst([_slopes_missed(e, s, x, e.graph("closure", *row)[:, 1:]) for s, x, row in rows])


def _slopes_missed(e: Evidence, s: Sample, x: Array, ours: Array) -> float:
    q, unit = x[: len(s.q)], _position_units(e)

    def along(j: int) -> Callable[[float], Array]:
        return lambda way: _positions(e, s, q + way * e.units.q * np.eye(len(q))[j]) / unit

    columns = [slope(along(j), SHIFT) for j in range(len(q))]
    wanted, doubt = (np.column_stack(part) for part in zip(*columns))
    size = 1.0 + np.abs(wanted) + doubt / DIFFERENCES
    return worst((ours * e.units.q / unit[:, None] - wanted) / size)


def _positions(e: Evidence, s: Sample, q: Array) -> Array:
    """The reference's ψ of the function's own rows."""
    phi = e.kinematics(state_of(e.reference, s.t, q, s.v, s.u, s.full)).phi
    lengths = [q[i : i + 4] @ q[i : i + 4] - 1.0 for i in e.system.quaternions]
    return np.append(phi[_closed(e)], lengths)


def _position_units(e: Evidence) -> Array:
    return np.append(e.units.positions[_closed(e)], e.units.lengths)


def _closed(e: Evidence) -> list[int]:
    """Which of the reference's φ are in ψ, by the names of their rows."""
    labels = _labels(e, "closure")
    named = labels[: len(labels) - len(e.system.quaternions)]
    return [e.system.rows[i].position for i in _rows(e, named)]


def _labels(e: Evidence, name: str) -> tuple[str, ...]:
    return e.graph.equations.function(name).result.labels


def _rows(e: Evidence, names: Sequence[str]) -> list[int]:
    """Where rows of these names stand in A."""
    known = [row.name for row in e.system.rows]
    return [known.index(name) for name in names]


def _astray(e: Evidence) -> list[tuple[float, Array, Array, Array]]:
    """(t, x, u, p) off the constraints."""
    return [(s.t, x, s.u, s.p) for s, x in zip(e.samples, e.astray)]


def slipping(e: Evidence) -> float | None:
    """The function `slip`, [A v − c, A] of independent rows, off the constraints."""
    if not e.graph.has("slip"):
        return None
    ours, rows = [e.graph("slip", *row) for row in _astray(e)], _rows(e, _labels(e, "slip"))
    states = _states_astray(e)
    wanted = [_with_violation(e.kinematics(state), state.v, rows) for state in states]
    unit = np.column_stack([e.units.rows, e.units.A])[rows]
    largest = [1.0 + worst(x / e.units.x) for x in e.astray]
    speeds = [np.abs(state.v / e.units.v).sum() for state in states]
    sums = Sums(TERMS, [a + b + a * b for a, b in zip(largest, speeds)])
    return deviation(ours, wanted, unit=unit, sums=sums)


def _with_violation(k: Kinematics, v: Array, rows: list[int]) -> Array:
    return np.column_stack([k.violation(v), k.A])[rows]


def _states_astray(e: Evidence) -> list[State]:
    """Off the constraints, at the choice's own velocities there."""
    rows = zip(e.samples, e.astray, _astray(e))
    return [_state(e, s, x, e.graph("velocity", *row)) for s, x, row in rows]


def _state(e: Evidence, s: Sample, x: Array, v: Array) -> State:
    return state_of(e.reference, s.t, x[: len(s.q)], v, s.u, s.full)


def pulling(e: Evidence) -> float | None:
    """The function `pull` is N Δ with A Δ = −φ and B Δ = 0: A, φ and N of the reference, and B as
    the function `state` has it."""
    if not e.graph.has("pull"):
        return None
    rows = zip(e.samples, e.astray, _astray(e), _states_astray(e))
    return worst(
        [_unpulled(e, s, x, e.graph("pull", *row), e.kinematics(at)) for s, x, row, at in rows]
    )


def _unpulled(e: Evidence, s: Sample, x: Array, pull: Array, k: Kinematics) -> float:
    """What is left of pull − N Δ, φ + A Δ and B Δ, Δ the nearest."""
    B, met = _speed_rows(e, s, x), _met(e)
    wanted, N = pull / e.units.q, k.N * e.units.v / e.units.q[:, None]
    delta = np.linalg.lstsq(N, wanted, rcond=None)[0]
    tied = np.vstack([k.A[met], B]) * e.units.v
    left = tied @ delta + np.append(_gaps(e, k, met), np.zeros(len(B)))
    reach = np.abs(tied).sum(axis=1) * worst(delta)
    error = max(worst(left / reach), worst(N @ delta - wanted) / (SMALL + worst(wanted)))
    return error / _condition(e, k, B) ** 2


def _met(e: Evidence) -> list[int]:
    """The kept rows; where they do not hold all that close, the latter."""
    kept, closing = _kept(e), list(e.graph.equations.closing)
    return kept if set(closing) <= set(kept) else closing


def _gaps(e: Evidence, k: Kinematics, rows: list[int]) -> Array:
    """φ of each row, zero of one that has none."""
    places = [e.system.rows[i].position for i in rows]
    return np.array([k.phi[place] if place >= 0 else 0.0 for place in places])


def _condition(e: Evidence, k: Kinematics, B: Array) -> float:
    return row_condition(np.vstack([k.A[_kept(e)], B]) * e.units.v)


def _speed_rows(e: Evidence, s: Sample, x: Array) -> Array:
    """B, nw × nv: w is linear in v, so differences of it are exact."""
    q, speeds = x[: len(s.q)], e.graph.equations.speeds

    def w(v: Array) -> Array:
        return e.graph("state", s.t, np.concatenate([q, v, s.z]), s.u, s.p)[speeds]

    still = w(np.zeros(len(s.v)))
    columns = [(w(unit) - still) / size for unit, size in zip(np.diag(e.units.v), e.units.v)]
    return np.column_stack(columns)


# ---- rows and pivots


def rows_as_they_are(e: Evidence) -> float | None:
    """The function `constraint_rows`: entries of A, each row over a power of two that is the same
    everywhere and about its length; independent rows, as many as there are; and none of the
    reference's entries is left out."""
    if not e.graph.has("constraint_rows"):
        return None
    rows = _kept(e)
    if len(rows) != np.median([s.outcome.rank for s in e.samples]):
        return np.inf
    wanted = np.array([s.outcome.kinematics.A[rows] for s in e.samples])
    ours = np.array([_filled(e, values) for values in e.results("constraint_rows")])
    lengths = [np.median(np.linalg.norm(x, axis=2), axis=0) for x in (ours, wanted)]
    powers = 2.0 ** np.round(np.log2(lengths[0] / lengths[1]))
    usual = _about_one(lengths[0]) or _about_one(_own_lengths(e))
    dependent = any(rank_of(A) < s.outcome.rank for A, s in zip(wanted, e.samples))
    sums = Sums(TERMS, [1.0 + worst(s.q / e.units.q) for s in e.samples])
    unit = powers[:, None] * e.units.A[rows]
    error = deviation([*ours], [*(powers[:, None] * wanted)], unit=unit, sums=sums)
    return error if usual and not dependent else np.inf


def _about_one(lengths: Array) -> bool:
    return bool(1.0 / USUAL < np.min(lengths) <= np.max(lengths) < USUAL)


def _own_lengths(e: Evidence) -> Array:
    """Of each row with the parameters of the file: others may take a mechanism that is all but
    stretched to where its rows are a thousand times as long."""
    found = states(e.system, OWN)
    further = np.zeros(e.x[0].size - found.q.shape[1])
    own = found.p[:, : e.system.own_p.numel()]
    rows = [
        _filled(e, e.graph("constraint_rows", t, np.append(q, further), u, p))
        for t, q, u, p in zip(found.t, found.q, found.u, own)
    ]
    return np.median(np.linalg.norm(rows, axis=2), axis=0) if rows else np.zeros(1)


def _filled(e: Evidence, values: Array) -> Array:
    """The rows with their zeros."""
    pattern = e.graph.equations.function("constraint_rows").result.pattern
    assert pattern is not None
    result = np.zeros(pattern.shape)
    result[list(pattern.rows), list(pattern.columns)] = np.ravel(values)
    return result


def _kept(e: Evidence) -> list[int]:
    """The rows of A that stand for all."""
    return list(e.graph.equations.kept)


def guarded(e: Evidence) -> float | None:
    """The function `guards`: what the motion divides by over its tolerance, and of each row of the
    reference's A what is left of it beside those before it."""
    if not e.graph.has("guards"):
        return None
    rows = zip(e.samples, e.results("guards"), _margins(e))
    errors = [_misguarded(e, s, np.ravel(values), own) for s, values, own in rows]
    return worst(errors)


def _misguarded(e: Evidence, s: Sample, values: Array, own: Array) -> float:
    left = _lengths_left(s.outcome.kinematics.A[_kept(e)])[: len(values) - len(own)]
    wanted = np.append(own, left)
    if wanted.shape != values.shape:
        return np.inf
    size = np.append(np.abs(own), e.units.rows[_kept(e)][: len(left)] + left)
    return worst((values - wanted) / np.where(size > 0.0, size, 1.0))


def _lengths_left(A: Array) -> Array:
    """|R₁₁|, |R₂₂| … of Aᵀ = Q R, by Householder's reflections."""
    return np.abs(np.diag(np.linalg.qr(A.T, mode="r")))


def _margins(e: Evidence) -> list[Array]:
    """Value over tolerance of every guard of `dynamics` at every state."""
    function = e.graph.equations.function("dynamics")
    ratios = ca.vertcat(ca.SX(0, 1), *(g.value / g.tolerance for g in function.guards))
    at = ca.Function("margins", slots_of(e.graph.equations, function), [ca.densify(ratios)])
    return [np.ravel(np.array(at(s.t, x, s.u, s.p))) for s, x in zip(e.samples, e.x)]


def pivots(e: Evidence) -> float | None:
    """The product of all that the motion divides by, at states of one and the same mechanism, is
    det [A; B] or det(A M⁻¹ Aᵀ) of the reference but for a factor. Of larger blocks, that are solved
    by reflections, it is the sign alone. What rates of coordinates alone are divided by is no part
    of it.

    Not where rows repeat others, and not of an orthonormal choice: it divides by lengths of
    directions of its own, of which mechanics says nothing.
    """
    guards = e.graph.equations.function("dynamics").guards
    watched = [i for i, guard in enumerate(guards) if not guard.name.startswith(LOCK)]
    own = any(guard.name.startswith(LENGTH) for guard in guards)
    repeated = len(_kept(e)) < len(e.system.rows)
    if not e.graph.has("guards") or not watched or own or repeated:
        return None
    signs, sizes, growth = np.array([_ratio(e, s, watched) for s in e.unvaried]).T
    if any(guard.name.count(", ") >= COFACTORS for guard in guards):
        sizes = np.zeros_like(sizes)
    ratios = signs * np.exp(sizes - np.median(sizes))
    return worst((ratios * np.sign(np.median(signs)) - 1) / growth)


def _ratio(e: Evidence, s: Sample, watched: list[int]) -> tuple[float, float, float]:
    """The product over the determinant, by its sign and the logarithm of its size, for of many
    loops either is too large or too small for a number; and how much roundoff may grow in them."""
    x = e.graph("state", s.t, s.whole, s.u, s.p)
    values = np.ravel(e.graph("guards", s.t, x, s.u, s.p))[watched]
    matrix = _divided_by(e, s, x)
    sign, size = np.linalg.slogdet(matrix)
    with np.errstate(divide="ignore"):  # a pivot that is zero shows in the size
        product = float(np.sum(np.log(np.abs(values))))
    return float(np.prod(np.sign(values)) * sign), product - float(size), row_condition(matrix)


def _are_momenta(e: Evidence) -> bool:
    choice = e.graph.equations.choice
    kinds = {known.name: known.kind for known in e.system.model.choices}
    return kinds.get(choice, choice) == "mass_orthogonal"


def _divided_by(e: Evidence, s: Sample, x: Array) -> Array:
    """[A; B]; in generalized velocities A M⁻¹ Aᵀ, M with Aᵀ W A where the equations add that.

    Momenta B = Nᵀ M are made of a partition, whose pivots are those of [A; B'] with B' N = 1: as S
    is N (Nᵀ M N)⁻¹, B' is Sᵀ M S B but for combinations of A.
    """
    A = s.outcome.kinematics.A * e.units.v
    M = s.outcome.M * np.outer(e.units.v, e.units.v)
    if not e.graph.equations.generalized_velocities:
        B = _speed_rows(e, s, x) * e.units.v
        Y = np.vstack([A, B])
        if not _are_momenta(e):
            return Y
        S = np.linalg.inv(Y)[:, len(A) :]
        return np.vstack([A, S.T @ M @ S @ B])
    if "W" in e.graph.named:
        M = M + A.T @ np.array(e.graph.named["W"](s.t, x, s.u, s.p)) @ A
    return A @ np.linalg.solve(M, A.T)


CHECKS = (
    Check(
        "closure", TERMS, "reference: φ and lengths of quaternions, off the constraints", closures
    ),
    Check(
        "∂ψ/∂q",
        DIFFERENCES,
        "the reference's φ differentiated by each coordinate; differences of fourth order",
        slopes,
    ),
    Check("slip", TERMS, "reference: A v − c and A, off the constraints", slipping),
    Check("pull", SOLVED, "reference: N Δ, A Δ = −φ, B Δ = 0, per squared condition", pulling),
    Check("rows of A", TERMS, "reference: A, each row over a power of two", rows_as_they_are),
    Check(
        "guards",
        SOLVED,
        "pivots of the motion over their tolerances; reference: what is left of each row of A",
        guarded,
    ),
    Check(
        "product of pivots",
        SOLVED,
        "reference: det [A; B] or det A M⁻¹ Aᵀ but for one factor, per condition number",
        pivots,
    ),
)
