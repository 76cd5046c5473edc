"""Functions over the quasi-velocities against the reference's M, h and Q, projected on the partial
velocities that `velocity` has: v is linear in w, so differences of it are exact."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from codegen.reals import FLOAT64
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import Sums, deviation, sizes, slope, worst
from hamel.verify.checks.evidence import Evidence, roundoff
from hamel.verify.checks.identities import DIFFERENCES, step
from hamel.verify.checks.kinks import step_within_piece
from hamel.verify.checks.samples import Sample
from hamel.verify.limits import SOLVED
from hamel.verify.reference.outcome import evaluate, mass, state_of, still_forces
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array


def partial_velocities(e: Evidence) -> list[Array]:
    """S at every state, column by column from the function `velocity`."""
    return [partial_velocities_at(e, k) for k in range(len(e.samples))]


def partial_velocities_at(e: Evidence, k: int) -> Array:
    """The same at one state."""
    s = e.samples[k]
    return _partial(e, s, s.t, s.q)


def _partial(e: Evidence, s: Sample, t: float, q: Array) -> Array:
    """v at w = one of each speed, less v at w = 0."""
    units = e.units.w
    still = e.graph("velocity", t, np.concatenate([q, np.zeros(len(units)), s.z]), s.u, s.p)
    columns = [
        (e.graph("velocity", t, np.concatenate([q, unit, s.z]), s.u, s.p) - still) / size
        for unit, size in zip(np.diag(units), units)
    ]
    return np.column_stack([np.zeros((len(still), 0)), *columns])


def partial(e: Evidence) -> float | None:
    """The function `partial_velocities`, and A S = 0 with the reference's A."""
    if not e.graph.has("partial_velocities"):
        return None
    unit = np.outer(e.units.v, 1.0 / e.units.w)
    ours = [np.reshape(S, unit.shape) for S in e.results("partial_velocities")]
    size = [1.0 + worst(S / unit) for S in ours]
    error = deviation(ours, partial_velocities(e), e.conditions, unit=unit, sums=Sums(SOLVED, size))
    along = [s.outcome.kinematics.A / e.units.A @ (S / unit) for s, S in zip(e.samples, ours)]
    rows = [worst(x) / length / k for x, length, k in zip(along, size, e.conditions)]
    return max(error, worst(rows))


def masses(e: Evidence) -> float | None:
    """Sᵀ M S with the reference's M."""
    if not e.graph.has("mass_w"):
        return None
    wanted = [S.T @ s.outcome.M @ S for s, S in zip(e.samples, partial_velocities(e))]
    unit = e.units.energy * np.outer(1.0 / e.units.w, 1.0 / e.units.w)
    sums = Sums(SOLVED, [1.0 + worst(x / unit) for x in wanted])
    return deviation(e.results("mass_w"), wanted, e.conditions, unit=unit, sums=sums)


def biases(e: Evidence) -> float | None:
    """Sᵀ (M σ + h − Q(u = 0)) with the reference's M, h, Q and σ = v̇ − S ẇ."""
    if not e.graph.has("bias_w"):
        return None
    wanted = [_over_w(e, k, _idle) for k in range(len(e.samples))]
    return _forces(e, "bias_w", wanted)


def weights(e: Evidence) -> float | None:
    """Sᵀ h with the reference's h at rest."""
    if not e.graph.has("gravity_w"):
        return None
    S = partial_velocities(e)
    return _forces(e, "gravity_w", [each.T @ _still(e, s) for s, each in zip(e.samples, S)])


def input_maps(e: Evidence) -> float | None:
    """Sᵀ ∂Q/∂u: the reference's Q is linear in u, so its differences are exact."""
    if not e.graph.has("input_map"):
        return None
    wanted, units = _input_maps(e), _input_units(e)
    unit = np.outer(e.units.power / e.units.w, 1.0 / units)
    sums = Sums(SOLVED, [1.0 + worst(x / unit) for x in wanted])
    return deviation(e.results("input_map"), wanted, e.conditions, unit=unit, sums=sums)


def inputs(e: Evidence) -> float | None:
    """`inverse_dynamics_u`: the least u with B_w u = M_w ẇ + b_w, all of the reference, for any
    ẇ."""
    name = "inverse_dynamics_u"
    if not e.graph.has(name):
        return None
    errors: list[float] = []
    maps, S, units = _input_maps(e), partial_velocities(e), _input_units(e)
    for k, (s, x) in enumerate(zip(e.samples, e.arguments_of(name))):
        wdot = x[len(e.x[k]) :]
        needed = S[k].T @ s.outcome.M @ S[k] @ wdot + _over_w(e, k, _idle)
        scaled = maps[k] / (e.units.power / e.units.w)[:, None]
        wanted = np.linalg.pinv(scaled) @ (needed / (e.units.power / e.units.w))
        ours = e.graph(name, s.t, x, s.u, s.p)
        growth = e.conditions[k] * np.linalg.cond(scaled * units) ** 2
        size = 1.0 + worst(wanted / units)
        errors.append(worst((ours - wanted) / units) / size / growth)
    return worst(errors)


def products(e: Evidence) -> float | None:
    """C w: the velocity products Sᵀ (M σ + h − h₀) of the reference."""
    if not e.graph.has("coriolis_w"):
        return None
    speeds = [x[e.graph.equations.speeds] for x in e.x]
    ours = [C @ w for C, w in zip(_coriolis(e), speeds)]
    doubts = [bound @ np.abs(w) for bound, w in zip(_rounding(e), speeds)]
    wanted = [_over_w(e, k, _still) for k in range(len(e.samples))]
    return _force_error(e, ours, wanted, np.array(doubts))


def antisymmetric(e: Evidence) -> float | None:
    """Ṁ_w = C + Cᵀ, per condition number: Sᵀ M S with the reference's M, differentiated along the
    motion. S bends the more, the smaller a pivot is."""
    if not e.graph.has("coriolis_w"):
        return None
    rows = zip(e.samples, e.velocities, _coriolis(e), _rounding(e), e.conditions)
    return worst([_skew(e, s, v, C, rounding) / c for s, v, C, rounding, c in rows])


def _coriolis(e: Evidence) -> list[Array]:
    """nw × nw, also where there is one quasi-velocity."""
    n = len(e.units.w)
    return [np.reshape(C, (n, n)) for C in e.results("coriolis_w")]


def _rounding(e: Evidence) -> list[Array]:
    """The running error bound of C: Ṡ loses twice the digits that S does where a pivot is small."""
    name, n = "coriolis_w", len(e.units.w)
    return [np.reshape(x, (n, n)) for x in roundoff(e.graph, name, e.rows_of(name), FLOAT64)]


def _skew(e: Evidence, s: Sample, v: Array, C: Array, rounding: Array) -> float:
    rate = state_of(e.reference, s.t, s.q, v, s.u, s.full).rates

    def moved(time: float) -> State:
        return state_of(e.reference, s.t, s.q + time * rate, v, s.u, s.full)

    def inertia(time: float) -> Array:
        there = moved(time)
        S = _partial(e, s, s.t, there.q)
        return S.T @ mass(e.reference, there, e.kinematics(there)) @ S

    span = step_within_piece(e, moved, step(e, s, s.v / e.units.time))
    change, doubt = slope(inertia, span)
    unit = e.units.energy * np.outer(1.0 / e.units.w, 1.0 / e.units.w) / e.units.time
    size = unit + np.abs(change) + np.max(np.abs(C / unit), initial=0.0) * unit
    doubt = doubt + rounding + rounding.T
    return worst((change - C - C.T) / (size + doubt / DIFFERENCES))


Rest = Callable[[Evidence, Sample], Array]


def _idle(e: Evidence, s: Sample) -> Array:
    """Q where nothing drives."""
    idle = state_of(e.reference, s.t, s.q, s.v, np.zeros_like(s.u), s.full)
    return evaluate(e.reference, idle).Q


def _still(e: Evidence, s: Sample) -> Array:
    """h at rest."""
    return still_forces(e.reference, s.state)


def _over_w(e: Evidence, k: int, rest: Rest) -> Array:
    """Sᵀ (M σ + h − rest)."""
    s, x, S = e.samples[k], e.x[k], partial_velocities_at(e, k)
    wdot = e.graph("dynamics", s.t, x, s.u, s.p)[e.graph.equations.speeds]
    sigma = s.outcome.vdot - S @ wdot
    return S.T @ (s.outcome.M @ sigma + s.outcome.h - rest(e, s))


def _forces(e: Evidence, name: str, wanted: Sequence[Array]) -> float | None:
    return _force_error(e, e.results(name), wanted) if e.graph.has(name) else None


def _force_error(
    e: Evidence, got: Sequence[Array], wanted: Sequence[Array], doubts: Array | float = 0.0
) -> float:
    """Forces over w, per condition number: against all that is summed; `doubts` of the entries are
    no error."""
    unit = e.units.power / e.units.w
    sums = Sums(SOLVED, [_sizes_of_sums(e, k, unit) for k in range(len(e.samples))])
    left, right = np.array(got) / unit, np.array(wanted) / unit
    size = np.maximum(sizes(right), sums.floors[:, None]) + doubts / unit / SOLVED
    return worst((left - right) / size / np.array(e.conditions)[:, None])


def _sizes_of_sums(e: Evidence, k: int, unit: Array) -> float:
    """The largest entry of |S|ᵀ (|M| (|v̇| + |S| |ẇ|) + forces), in its unit: near a singular
    position S is large, and what it multiplies cancels."""
    s, x, S = e.samples[k], e.x[k], np.abs(partial_velocities_at(e, k))
    wdot = np.abs(e.graph("dynamics", s.t, x, s.u, s.p)[e.graph.equations.speeds])
    rates = np.abs(s.outcome.vdot) + S @ wdot
    forces = np.abs(s.outcome.M) @ rates + e.forces[k] * e.units.force
    return worst(S.T @ forces / unit)


def _input_maps(e: Evidence) -> list[Array]:
    return [
        np.column_stack([np.zeros((len(e.units.w), 0)), *(S.T @ x for x in _columns(e, s))])
        for s, S in zip(e.samples, partial_velocities(e))
    ]


def _columns(e: Evidence, s: Sample) -> Iterator[Array]:
    units = _input_units(e)
    idle = _idle(e, s)
    for unit, size in zip(np.diag(units), units):
        pushed = state_of(e.reference, s.t, s.q, s.v, unit, s.full)
        yield (evaluate(e.reference, pushed).Q - idle) / size


def _input_units(e: Evidence) -> Array:
    return e.units.own.all_of(x.unit for x in e.reference.model.inputs)


CHECKS = (
    Check("S", SOLVED, "differences of v(w), and A S = 0; per condition number", partial),
    Check("Sᵀ M S", SOLVED, "reference: M between partial velocities, per condition", masses),
    Check("bias over w", SOLVED, "reference: Sᵀ (M σ + h − Q), per condition number", biases),
    Check("gravity over w", SOLVED, "reference: Sᵀ h at rest, per condition number", weights),
    Check("input map", SOLVED, "reference: Sᵀ ∂Q/∂u, per condition number", input_maps),
    Check(
        "inputs for ẇ",
        SOLVED,
        "reference: the least u of B_w u = M_w ẇ + b_w, per squared condition number",
        inputs,
    ),
    Check("C w", SOLVED, "reference: Sᵀ (M σ + h − h₀), per condition number", products),
    Check(
        "Ṁ_w = C + Cᵀ",
        DIFFERENCES,
        "the reference's Sᵀ M S differentiated along the motion; differences of fourth order",
        antisymmetric,
    ),
)
