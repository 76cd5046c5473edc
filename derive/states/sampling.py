"""Random admissible states: φ(q, t) = 0, A v = c, at random t, u, p, on the branch the model starts
from.

Where coordinates are tied together, many walkers leave the initial configuration at once, each its
own way: steps along the kernel of the rows, every one brought back onto φ = 0 by Gauss–Newton. They
turn round before positions where A loses rank, so that they neither change branch nor stop where a
branch meets another (a parallelogram laid flat). Rows that repeat others do so at every consistent
configuration: the rank is read at closed ones, by the gap between singular values.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic, HamelError, ModelError
from derive.mechanics.records import System
from derive.model.constraint_records import Holonomic
from derive.numerics import NONZERO, refuses_numerically
from derive.states import gimbal
from derive.states.closing import Kinematics, closed, nominal, normalised
from derive.states.initial import initial_state, span_of_row
from derive.states.limits import (
    BEYOND,
    CLOSED,
    CONTRADICTION,
    FAR,
    LATER,
    LEAP,
    LEFT_OVER,
    LOOSE,
    NEAR,
    NEWTON,
    NOTHING_LEFT,
    PROBES,
    SPARE,
    STARTS,
    STEPS,
    TRIALS,
    VANISHED,
)
from derive.states.scales import scaled, scales
from derive.states.sparse import lengths_over_states, squares
from derive.states.views import DenseView, SparseView, View


@dataclass(frozen=True)
class States:
    """Arrays with one row per state."""

    t: np.ndarray  # (k,)
    q: np.ndarray  # (k, nq)
    v: np.ndarray
    u: np.ndarray
    p: np.ndarray


def no_states(system: System) -> HamelError:
    """What is told of a system of which no admissible state is found: where its initial state
    cannot be made consistent, now or later, which row is off."""
    later = LATER if depends_on_time(system) else ()
    try:
        for t in (0.0, *later):
            initial_state(system, t=t)
    except ModelError as error:
        return error
    message = "no configuration near the initial values satisfies the constraints"
    if not system.rows:
        message = (
            "at no configuration near the initial values are masses and rates of the "
            "coordinates finite"
        )
    return AssumptionError(Diagnostic(file=system.model.file, message=message))


@refuses_numerically("random admissible states")
def states(
    system: System,
    count: int,
    seed: int = 0,
    spread: float = 1.0,
    parameters: float = 0.0,
    solver: Kinematics | None = None,
) -> States:
    """`count` admissible states around the model's initial values; fewer where the constraints
    cannot be met.

    Angles vary by up to spread·π, lengths by spread·(½ + |value|/2) of the model's own unit of
    length, and rates are of the order of its own; parameters vary by the relative amount
    `parameters`, as far as the mechanism can be closed with them and keeps its rank. States near
    which A loses rank are left out.
    """
    own = scales(system.model)
    if own.plain:
        return _states(system, count, seed, spread, parameters, solver)
    result = _states(scaled(system, own), count, seed, spread, parameters, None)
    model = system.model
    units = (
        model.coordinates,
        model.velocities,
        model.inputs,
        system.given,
    )
    columns = zip((result.q, result.v, result.u, result.p), units)
    return States(
        own.time * result.t,
        *(values * own.all_of(x.unit for x in items) for values, items in columns),
    )


def _states(
    system: System,
    count: int,
    seed: int,
    spread: float,
    parameters: float,
    solver: Kinematics | None,
) -> States:
    """In the units of the system."""
    rng, solver = np.random.default_rng(seed), solver or Kinematics(system)
    many = count + count // 5 + SPARE
    t, p = _times(system, rng, many), _parameters(system, rng, many, parameters)
    q = _scattered(system, rng, many, spread)
    if system.phi.numel():
        result = _walked(solver, rng, t, p, spread)
        if result is None or not len(result[0]):
            return _nothing(system)
        t, q, p = result
    v, regular = _velocities(solver, rng, t, q, p)
    u = rng.normal(size=(len(t), system.u.numel()))
    regular &= _steady(solver, t, q, p)
    if not system.definite:
        regular &= _determined(solver, t, q, p)
    return States(*[x[regular][:count] for x in (t, q, v, u, p)])


def _nothing(system: System) -> States:
    return States(
        np.zeros(0), *[np.zeros((0, x.numel())) for x in (system.q, system.v, system.u, system.p)]
    )


def _times(system: System, rng: np.random.Generator, many: int) -> np.ndarray:
    return rng.uniform(0.0, 2.0, many) if depends_on_time(system) else np.zeros(many)


def depends_on_time(system: System) -> bool:
    """Whether time stands in anything that the motion is made of."""
    # gravity and inertias do not change: of a long tree time is in the loads alone
    forces = (system.h_extra, system.Q) if system.long else (system.h, system.Q, system.V)
    everything = (system.phi, system.c, ca.vec(system.A), *forces, system.qdot)
    return bool(ca.depends_on(ca.vertcat(*everything), system.t))


def _parameters(system: System, rng: np.random.Generator, many: int, vary: float) -> np.ndarray:
    """The first are the file's own. First-order states, at the end, differ everywhere."""
    usual = np.array(system.parameters, dtype=float)
    varied = usual * (1 + vary * rng.uniform(-1, 1, (many, len(usual))))
    # one state at least with the mechanism as the file has it
    varied[:1] = usual
    if count := system.z.numel():
        around = 0.5 + np.abs(usual[-count:]) / 2
        varied[:, -count:] = usual[-count:] + around * rng.uniform(-1, 1, (many, count))
    return varied


def _scattered(system: System, rng: np.random.Generator, many: int, spread: float) -> np.ndarray:
    centre = nominal(system)
    width = np.array(
        [np.pi if c.unit == "rad" else _length(x) for c, x in zip(system.model.coordinates, centre)]
    )
    return normalised(system, centre + spread * width * rng.uniform(-1, 1, (many, len(centre))))


def _length(value: float) -> float:
    return 0.5 + abs(value) / 2


@dataclass(frozen=True)
class Walk:
    """What all walkers share; `width` is what one unit of a walk means to each generalized
    velocity."""

    solver: Kinematics
    width: np.ndarray  # (nv,)
    lengths: np.ndarray  # (m,)
    rank: int = 1
    floor: float = 0.0  # strength below which a walker turns round

    def view(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> View:
        """φ and its derivative along v, freed of units: rows over their usual length, columns times
        the width of their velocity, so that singular values can be compared."""
        if self.solver.many_rows:
            phi, rows = self.solver.closing_rows(t, q, p)
            even = rows.finite().scaled(1 / self.lengths, self.width)
            return SparseView(phi / self.lengths, even, squares(rows.pattern))
        phi, slopes = self.solver.closing(t, q, p)
        J = np.ascontiguousarray(np.nan_to_num(slopes) * self.width / self.lengths[:, None])
        return DenseView(phi / self.lengths, J)

    def moved(self, t: np.ndarray, q: np.ndarray, p: np.ndarray, along: np.ndarray) -> np.ndarray:
        """q + N · along, no coordinate by more than a leap."""
        most = np.max(np.abs(along), axis=1, initial=NONZERO)[:, None]
        return self.solver.carried(t, q, p, along * np.minimum(1.0, LEAP / most) * self.width)

    def corrected(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, View]:
        """One Gauss–Newton step, and the view it was taken from."""
        view = self.view(t, q, p)
        step = view.solved(np.where(np.isfinite(view.phi), view.phi, 0.0), self.rank)
        return self.moved(t, q, p, -step), view

    def closed(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q on φ = 0 (k, nq), and which of them got there (k,): one more step is taken once all
        are, for the rank to be clear."""
        done = np.zeros(len(t), dtype=bool)
        for _ in range(NEWTON):
            moved, view = self.corrected(t, q, p)
            arrived = view.off <= CLOSED * (1.0 + np.max(np.abs(q), axis=1, initial=0.0))
            q = np.where(np.isfinite(view.off)[:, None], moved, q)
            if np.all(done := arrived):
                break
        return q, done

    def step(
        self, t: np.ndarray, q: np.ndarray, p: np.ndarray, along: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, View]:
        """The next configuration along a tangent, whether it can be trusted, and a view from next
        to it."""
        there, _ = self.corrected(t, self.moved(t, q, p, along), p)
        there, view = self.corrected(t, there, p)
        moved = np.max(np.abs(there - q), axis=1, initial=0.0)
        return (
            there,
            (view.off <= LOOSE) & (moved <= FAR * max(1.0, float(np.max(self.width)))),
            view,
        )

    def tangent(self, view: View, wish: np.ndarray) -> np.ndarray:
        """The wish without what the rows forbid, (1 − J⁺J) wish, its largest entry one; zero where
        nothing is left."""
        left = wish - view.solved(view.along(wish), self.rank)
        size = np.max(np.abs(left), axis=1, initial=0.0)[:, None]
        return np.where(size > NOTHING_LEFT, left / np.maximum(size, NONZERO), 0.0)


def _walked(
    solver: Kinematics, rng: np.random.Generator, t: np.ndarray, p: np.ndarray, spread: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Closed configurations, each at the end of a walk; None where there is nowhere to start
    from."""
    usual = np.array(solver.system.parameters, dtype=float)
    start = _start(solver, rng, usual)
    if start is None:
        return None
    walk = _learnt(solver, rng, start, usual)
    q, p = _with_parameters(walk, start, usual, p)
    time, q = _on_foot(walk, rng, t, q, p, spread)
    q, done = walk.closed(time, q, p)
    t, q, p = time[done], q[done], p[done]
    if len(t) and not solver.many_rows:
        _check_slopes(solver, t[:PROBES], q[:PROBES], p[:PROBES])
    return t, q, p


def _check_slopes(solver: Kinematics, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> None:
    """Refuses formulas whose slope vanishes wherever they do, such as (y - x)^2: Newton's steps
    come ever nearer and never arrive, so what they leave says how far the root is. Some of these
    lengths beyond it the slope is another one; that of y - x is the same."""
    model = solver.system.model
    formulas = {x.name: x for x in model.constraints if isinstance(x, Holonomic)}
    rows = [row for row in solver.system.rows if row.name in formulas and row.position >= 0]
    if not rows:
        return
    phi, slopes = solver.closing(t, q, p)
    for row in rows:
        left, slope = phi[:, row.position], slopes[:, row.position]
        length = np.linalg.norm(slope, axis=1)
        step = BEYOND * left / np.maximum(length, NONZERO) ** 2
        beyond = solver.carried(t, q, p, step[:, None] * slope)
        there = np.linalg.norm(solver.closing(t, beyond, p)[1][:, row.position], axis=1)
        least = VANISHED * there
        if (length <= least).all() and (length < least).any():  # of 0*x both are zero
            raise AssumptionError(
                model.diagnostic(
                    formulas[row.name].span,
                    f"the slope of {row.name} vanishes wherever {row.name} is zero: it has no "
                    "reaction there",
                    "a formula without that power, such as y - x and not its square",
                )
            )


def _start(solver: Kinematics, rng: np.random.Generator, p: np.ndarray) -> np.ndarray | None:
    """The initial configuration: guesses move, else everything may; else the nearest of some random
    starts that closes."""
    system = solver.system
    held = {x.name for x in system.model.initial if x.held}
    free = np.array([c.name not in held for c in system.model.coordinates])
    centre = nominal(system)
    for choice in (free, np.ones(len(centre), dtype=bool)):
        start = closed(solver, 0.0, centre, p, choice)
        if start is not None:
            return normalised(system, start)
    starts = [closed(solver, 0.0, q, p) for q in _scattered(system, rng, STARTS, 1.0)]
    closest = sorted(
        (q for q in starts if q is not None), key=lambda q: float(np.max(np.abs(q - centre)))
    )
    return normalised(system, closest[0]) if closest else None


def _learnt(solver: Kinematics, rng: np.random.Generator, start: np.ndarray, p: np.ndarray) -> Walk:
    """The rank and the usual strength of the rows, from short steps away from the start: it may be
    singular itself."""
    system = solver.system
    many = np.tile(p, (PROBES, 1))
    t, around = np.zeros(PROBES), _scattered(system, rng, PROBES, 1.0)
    largest = max(
        [_length(x) for c, x in zip(system.model.coordinates, start) if c.unit != "rad"],
        default=1.0,
    )
    width = [1.0 if x.unit == "rad/s" else 2 * largest / np.pi for x in system.model.velocities]
    lengths = _usual_lengths(solver, t, around, many, np.array(width))
    walk = Walk(solver, np.array(width), lengths)
    home = np.tile(start, (PROBES, 1))
    rank = max(1, int(np.max(walk.view(t, home, many).ranks)))
    most = min(len(lengths), len(width))
    apart = max(1, (most - rank) // TRIALS)  # of many rows not every rank is tried
    for trial in (*range(rank, most, apart), most):
        walk = Walk(solver, walk.width, walk.lengths, trial)
        wish = 0.1 * walk.tangent(walk.view(t, home, many), rng.normal(size=(PROBES, len(width))))
        q, done = walk.closed(t, walk.moved(t, home, many, wish), many)
        seen = walk.view(t[done], q[done], many[done])
        if 2 * np.sum(done) >= PROBES and np.max(seen.ranks) <= trial:
            strength = float(np.median(seen.strength(trial)))
            return Walk(solver, walk.width, walk.lengths, trial, NEAR * strength)
    return Walk(solver, walk.width, walk.lengths, rank)


def _usual_lengths(
    solver: Kinematics, t: np.ndarray, q: np.ndarray, p: np.ndarray, width: np.ndarray
) -> np.ndarray:
    """Of the rows of φ along v, columns times the widths."""
    if solver.many_rows:
        J = solver.closing_rows(t, q, p)[1].finite()
        return lengths_over_states(J.scaled(np.ones(J.shape[1]), width))
    return row_lengths(np.nan_to_num(solver.closing(t, q, p)[1]) * width)


def row_lengths(matrices: np.ndarray) -> np.ndarray:
    """The largest length of each row over the matrices (k, rows, columns); 1 for a row of zeros, or
    of what rounding has left of them."""
    lengths = np.max(np.linalg.norm(matrices, axis=2), axis=0)
    least = LEFT_OVER * float(np.max(lengths, initial=0.0))
    return np.where(lengths > least, lengths, 1.0)


def _with_parameters(
    walk: Walk, start: np.ndarray, usual: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The start closed with other parameters; where that fails, or is another mechanism by its
    rank, the usual ones stay."""
    home = np.tile(start, (len(p), 1))
    if np.array_equal(p, np.tile(usual, (len(p), 1))):
        return home, p
    q, done = walk.closed(np.zeros(len(p)), home, p)
    same = done & (walk.view(np.zeros(len(p)), q, p).ranks <= walk.rank)
    if 2 * np.sum(same) < len(p):
        same[:] = False
    return np.where(same[:, None], q, home), np.where(same[:, None], p, usual)


def _on_foot(
    walk: Walk,
    rng: np.random.Generator,
    until: np.ndarray,
    q: np.ndarray,
    p: np.ndarray,
    spread: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Every walker takes its steps; one that goes astray halves them, one that nears a singular
    position turns round."""
    k, nv = len(q), len(walk.width)
    t = np.zeros(k)
    length = spread * np.pi * rng.uniform(0.15, 1.0, (k, 1)) / STEPS
    pace, heading = np.ones((k, 1)), rng.normal(size=(k, nv))
    view = walk.view(t, q, p)
    for _ in range(STEPS):
        heading = walk.tangent(view, heading)
        later = t + pace[:, 0] * until / STEPS
        there, trusted, seen = walk.step(later, q, p, pace * length * heading)
        nearer = (seen.strength(walk.rank) < walk.floor) & (
            seen.strength(walk.rank) < view.strength(walk.rank)
        )
        good = trusted & ~nearer
        q, t = np.where(good[:, None], there, q), np.where(good, later, t)
        view = seen.chosen(good, view)
        pace = np.where(trusted[:, None], pace, pace / 2)
        heading = np.where(good[:, None], heading, -heading) + 0.3 * rng.normal(size=(k, nv))
    return t, q


def _velocities(
    solver: Kinematics, rng: np.random.Generator, t: np.ndarray, q: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Random v on A v = c, and which states are regular: A has the rank it has elsewhere, and does
    not all but lose it."""
    v = rng.normal(size=(len(t), solver.system.v.numel()))
    if not solver.system.rows or not v.size:
        return v, np.ones(len(t), dtype=bool)
    view = _rates(solver, t, q, p)
    c = view.phi
    rank = int(np.max(view.ranks))
    if rank == 0:
        return v, np.ones(len(t), dtype=bool)
    for _ in range(view.rounds):
        v = v - view.solved(view.along(v) - c, rank)
    strength = view.strength(rank)
    regular = strength > NEAR / 5 * float(np.median(strength))
    _refuse_contradictions(solver.system, (view.along(v) - c)[regular], v[regular])
    return v, regular


def _rates(solver: Kinematics, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> View:
    """c and A of A v = c, rows divided by their largest lengths."""
    if solver.many_rows:
        A, sides = solver.velocity_rows(t, q, p)
        lengths = lengths_over_states(A)
        return SparseView(sides / lengths, A.scaled(1 / lengths), squares(A.pattern))
    rows, sides = solver.rows(t, q, p)
    lengths = row_lengths(rows)
    return DenseView(sides / lengths, np.ascontiguousarray(rows / lengths[:, None]))


def _refuse_contradictions(system: System, left: np.ndarray, v: np.ndarray) -> None:
    """Raises AssumptionError where A v = c has no solution at most states: left sides that depend,
    right ones that do not."""
    if not len(left):
        return
    off = np.median(np.abs(left) / (1.0 + np.max(np.abs(v), axis=1, initial=0.0))[:, None], axis=0)
    if np.max(off, initial=0.0) > CONTRADICTION:
        names = [row.name for row, size in zip(system.rows, off) if size > CONTRADICTION]
        message = (
            f"no velocities satisfy all constraints, whatever the position: {' and '.join(names)} "
            "cannot be met together"
        )
        advice = "one of them alone, or right-hand sides that go together"
        span = span_of_row(system, names[0])
        raise AssumptionError(system.model.diagnostic(span, message, advice))


def _steady(solver: Kinematics, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Which states are not near a position where q̇ = N v runs away, as Euler angles do in gimbal
    lock."""
    rates = solver.rates(t, q, p)
    if rates is None or not rates.entries.size:
        return np.ones(len(t), dtype=bool)
    sizes = rates.largest()
    _refuse_gimbal_lock(solver.system, sizes)
    size = np.max(sizes, axis=1)
    return np.isfinite(size) & (size <= float(np.median(size)) / NEAR)


def _refuse_gimbal_lock(system: System, sizes: np.ndarray) -> None:
    """Raises AssumptionError where q̇ = N v runs away at most states: no motion can start there."""
    runaway = gimbal.locked(system, np.median(sizes, axis=0))
    if runaway:
        where = "wherever the constraints hold"
        raise AssumptionError(gimbal.told(runaway, where), hint=gimbal.INSTEAD)


def _determined(solver: Kinematics, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Which states are not near one where massless directions come free of the rows: [M; A] all but
    loses rank there."""
    M = solver.values(solver.system.M, t, q, p)
    both = np.concatenate([M, solver.rows(t, q, p)[0]], axis=1)
    finite = np.all(np.isfinite(both), axis=(1, 2))
    both = np.where(finite[:, None, None], both, 0.0)
    sizes = np.max(np.linalg.norm(both, axis=2), axis=0)
    values = np.linalg.svd(both / np.where(sizes > 0, sizes, 1.0)[:, None], compute_uv=False)
    least = values[:, -1] if values.size else np.ones(len(t))
    return finite & (least >= NEAR * float(np.median(least[finite] if finite.any() else least)))
