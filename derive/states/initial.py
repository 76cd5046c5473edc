"""The initial state of a model file made consistent: first q on φ = 0, then v on A v = c; and how
far each was moved."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.diagnostics import ModelError
from derive.expressions.evaluate import number
from derive.mechanics.records import System
from derive.model.records import Span
from derive.numerics import refuses_numerically
from derive.states import gimbal
from derive.states.closing import (
    Kinematics,
    angles,
    closed,
    nominal,
    normalised,
    nudges,
    shortest,
    turned,
)
from derive.states.limits import AGREES, TAKES_PART, UNWOUND
from derive.states.scales import scaled, scales
from derive.states.sparse import Sparse, stacked, unit, with_zeros
from derive.states.speeds import rows_in_own_units


@dataclass(frozen=True)
class Initial:
    """`moved`: held names that had to move, with (given, used); z are the first-order states."""

    q: np.ndarray
    v: np.ndarray
    moved: tuple[tuple[str, float, float], ...]
    z: np.ndarray

    @property
    def whole(self) -> np.ndarray:
        """(q, v, z), which the function `state` makes x of."""
        return np.concatenate([self.q, self.v, self.z])


@refuses_numerically("the initial state")
def initial_state(
    system: System,
    changes: Mapping[str, float] | None = None,
    p: np.ndarray | None = None,
    t: float = 0.0,
) -> Initial:
    """The state at time t. Held values are kept, guesses and unnamed ones move; where that has no
    solution everything may move, and is reported.

    q on φ(q, t) = 0 first, as A and N depend on it; then the v on A v = c nearest to guesses and
    held rates. Both are solved in the model's own units and given in SI. `changes` overrides values
    by name and holds them; `p` may leave out the states at its end. Raises ModelError where no
    consistent state is found.
    """
    parameters = _with_states(system, changes or {}, p)
    values, held = _start_values(system, changes or {}, parameters, t)
    own = own_units(system, t)
    given = {name: x / own.one_of(name) for name, x in values.items()}
    q, v, rates, speeds = _consistent(system, own, given, held, parameters, t)
    coordinates, velocities = (
        [x.name for x in items] for items in (system.model.coordinates, system.model.velocities)
    )
    used = dict(zip(coordinates, q)) | dict(zip(velocities, v))
    used |= {f"der({name})": rate for name, rate in zip(coordinates, rates)}
    used |= speeds
    moved = [
        n for n in given if n in held and abs(used[n] - given[n]) > AGREES * (1 + abs(given[n]))
    ]
    moves = tuple((n, values[n], float(used[n] * own.one_of(n))) for n in moved)
    sizes = [np.array([own.one_of(name) for name in names]) for names in (coordinates, velocities)]
    z = parameters[len(parameters) - system.z.numel() :]
    return Initial(q * sizes[0], v * sizes[1], moves, z)


def _with_states(system: System, changes: Mapping[str, float], p: np.ndarray | None) -> np.ndarray:
    """p with the initial states at its end: those of `changes`, else those of the file."""
    given = np.array(system.parameters) if p is None else np.asarray(p, dtype=float)
    own = given[: len(system.own_parameters)]
    names = {x.name: x.value for x in system.model.parameters}
    names |= {x.name: float(value) for x, value in zip(system.given, own)}
    states = system.model.states
    z = [changes[x.name] if x.name in changes else number(x.initial, names) for x in states]
    return np.concatenate([own, z])


@dataclass(frozen=True)
class Own:
    """The system in the model's own units, in which it is closed, and one of each coordinate,
    velocity, rate and declared quasi-velocity in SI by name; `speeds` are the rows of these."""

    system: System
    units: dict[str, float]
    parameters: np.ndarray  # one of each of p
    t: float  # of the state
    speeds: ca.Function | None  # (t, q, p) → rows, in the model's own units

    def one_of(self, name: str) -> float:
        """One of the model's own units of that quantity, in SI; 1 where the name is not known."""
        return self.units.get(name, 1.0)


def own_units(system: System, t: float) -> Own:
    """The model's own units at time t (s), and the system in them."""
    own, model = scales(system.model), system.model
    moving = (*model.coordinates, *model.velocities, *model.speeds)
    units = {x.name: own.of(x.unit) for x in moving}
    units |= {f"der({c.name})": own.of(c.unit) / own.time for c in model.coordinates}
    parameters = own.all_of(x.unit for x in system.given)
    whole = system if own.plain else scaled(system, own)
    return Own(whole, units, parameters, t / own.time, rows_in_own_units(system, own))


def _consistent(
    system: System, own: Own, given: dict[str, float], held: set[str], p: np.ndarray, t: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, float]]:
    """q, v, q̇ and the declared quasi-velocities in the model's own units."""
    solver, here = Kinematics(own.system), p / own.parameters
    # positions before velocities: A and N of A v = c depend on q
    q = _closed(own, solver, _start(own.system, given), held, here)
    if q is None:
        values = {name: x * own.one_of(name) for name, x in given.items()}
        raise _off(system, p, _start(system, values), t)
    rows = _speeds(own, given, q, here)
    if _is_free(own.system, solver) and not rows:
        v = np.array([given.get(x.name, 0.0) for x in system.model.velocities])
        return q, v, v, {}
    v = _velocities(own, solver, given, held, q, here, rows)
    speeds = {name: float(row @ v) for name, row in rows.items()}
    return q, v, solver.velocity_terms(own.t, q, here)[2] @ v, speeds


def _speeds(
    own: Own, given: dict[str, float], q: np.ndarray, p: np.ndarray
) -> dict[str, np.ndarray]:
    """The rows of declared quasi-velocities, where one is given."""
    names = [x.name for x in own.system.model.speeds]
    if own.speeds is None or not {*names} & {*given}:
        return {}
    rows = own.speeds(own.t, q, p[: own.system.own_p.numel()]).full()
    return dict(zip(names, rows))


def _is_free(system: System, solver: Kinematics) -> bool:
    """Whether nothing ties the velocities, which are the rates of the coordinates by name: then no
    matrix with an entry for each pair of them is needed."""
    names = (f"der({c.name})" for c in system.model.coordinates)
    same = all(v.name == name for v, name in zip(system.model.velocities, names))
    return not system.rows and same and solver.plain


def _start_values(
    system: System, changes: Mapping[str, float], p: np.ndarray, t: float
) -> tuple[dict[str, float], set[str]]:
    names = {x.name: x.value for x in system.model.parameters} | {"t": t}
    names |= dict(zip([x.name for x in system.given], map(float, p)))
    states = {x.name for x in system.model.states}
    changes = {name: value for name, value in changes.items() if name not in states}
    given = {x.name: number(x.value, names) for x in system.model.initial} | changes
    return given, {x.name for x in system.model.initial if x.held} | set(changes)


def _start(system: System, given: dict[str, float]) -> np.ndarray:
    start = nominal(system)
    for i, c in enumerate(system.model.coordinates):
        start[i] = given.get(c.name, start[i])
    return normalised(system, start)


def _closed(
    own: Own, solver: Kinematics, start: np.ndarray, held: set[str], p: np.ndarray
) -> np.ndarray | None:
    """Guesses move, from beside them or from afar where they have to; else everything may. A start
    at which φ has no value stays as it is: a disk that lies flat touches nowhere."""
    system = own.system
    free = np.array([c.name not in held for c in system.model.coordinates])

    @functools.cache
    def has_value() -> bool:
        return bool(np.isfinite(_positions(system, own.t, start, p)).all())

    def met(choice: np.ndarray, moves: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
        for move in moves:
            if move.any() and not has_value():
                return
            at = normalised(system, start + move * choice)
            q = closed(solver, own.t, at, p, choice, by_row=True)
            if q is not None:
                yield _unwound(own, solver, normalised(system, q), start, p, choice)

    beside, every = nudges(len(start)), np.ones(len(start), dtype=bool)
    if not free.any() or free.all():
        return next(met(every, beside), None)
    found = next(met(free, beside), None)
    if found is None and not solver.many_rows:
        afar = list(met(free, turned(free & angles(system))))
        found = min(afar, key=lambda q: float(np.abs(q - start).max()), default=None)
    return next(met(every, beside), None) if found is None else found


def _unwound(
    own: Own,
    solver: Kinematics,
    q: np.ndarray,
    start: np.ndarray,
    p: np.ndarray,
    choice: np.ndarray,
) -> np.ndarray:
    """Angles that went whole turns on the way are brought back, where the constraints do not count
    turns; rounding was judged by larger angles."""
    turns = np.round((q - start) / (2.0 * np.pi)) * angles(own.system)
    for i in np.flatnonzero(turns):
        back = q.copy()
        back[i] -= 2.0 * np.pi * turns[i]
        at = closed(solver, own.t, back, p, choice, by_row=True)
        q = q if at is None or np.abs(at - back).max() > UNWOUND else at
    return q


def _positions(system: System, t: float, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """φ."""
    phi = ca.Function("phi", [system.t, system.q, system.p], [ca.densify(system.phi)])
    values: np.ndarray = phi(t, q, p).full().ravel()
    return values


def _slopes(system: System, t: float, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """∂φ/∂q."""
    slopes = ca.densify(ca.jacobian(system.phi, system.q))
    values: np.ndarray = ca.Function("slopes", [system.t, system.q, system.p], [slopes])(
        t, q, p
    ).full()
    return values


def _off(system: System, p: np.ndarray, start: np.ndarray, t: float) -> ModelError:
    off, slopes = _positions(system, t, start, p), _slopes(system, t, start, p)
    when = f" at t = {t:.3g} s" if t else ""
    steep = ~np.isfinite(slopes).all(axis=1)
    if np.isfinite(off).all() and steep.any():
        row = _row_of_position(system, int(np.argmax(steep)))
        return _problem(
            system,
            f"constraint row {row} has no finite slope at the initial values",
            "initial values, or values under `guess:`, beside them",
            row,
        )
    apart = _apart(slopes, off)
    if len(apart) > 1:
        rows = [_row_of_position(system, entry) for entry in apart]
        return _problem(
            system,
            f"no configuration near the initial values satisfies the constraints{when}: "
            f"{', '.join(rows[:-1])} and {rows[-1]} contradict each other",
            "constraints that can be met together, or other initial values",
            rows[-1],
            at_row=True,
        )
    worst = int(np.argmax(np.where(np.isnan(off), np.inf, np.abs(off))))
    row = _row_of_position(system, worst)
    how = f"is off by {off[worst]:.3g}" if np.isfinite(off[worst]) else "has no value there"
    return _problem(
        system,
        f"no configuration near the initial values satisfies the constraints{when} ({row} {how})",
        "initial values, or values under `guess:`, nearer to one; or lengths and constraints that "
        "can be met together",
        row,
    )


def _apart(slopes: np.ndarray, off: np.ndarray) -> list[int]:
    """Entries of φ that depend on each other and contradict each other: what is left of φ where all
    steps along the slopes, each row of length one, are taken."""
    lengths = np.linalg.norm(slopes, axis=1)
    if not (np.isfinite(lengths).all() and np.isfinite(off).all()):
        return []
    sloped = np.flatnonzero(lengths > 0.0)
    J, phi = slopes[sloped] / lengths[sloped, None], off[sloped] / lengths[sloped]
    left = np.abs(phi - J @ shortest(J, phi))
    largest = float(np.max(left, initial=0.0))
    if largest <= AGREES * float(np.max(np.abs(phi), initial=0.0)):
        return []
    return [int(sloped[i]) for i in np.flatnonzero(left > TAKES_PART * largest)]


def _row_of_position(system: System, entry: int) -> str:
    """The name of the row whose position is that entry of φ."""
    return next(row.name for row in system.rows if row.position == entry)


def _velocities(
    own: Own,
    solver: Kinematics,
    given: dict[str, float],
    held: set[str],
    q: np.ndarray,
    p: np.ndarray,
    speeds: dict[str, np.ndarray],
) -> np.ndarray:
    """v nearest the guesses with A v = c and the held rates; where they contradict each other A v =
    c wins. Guessed rates that are no generalized velocities say what v is guessed."""
    system = own.system
    A, c, N = solver.velocity_terms(own.t, q, p)
    if not all(np.isfinite(_entries(value)).all() for value in (A, c)):
        what = "the constraints' rates are not finite at the initial position"
        raise _problem(system, what, "another position")
    finite = np.isfinite(_entries(N)).all()
    if not finite or _is_locked_rate(own, solver, given, q, p):
        raise _in_gimbal_lock(own, solver, q, p)
    known = _known(system, N, speeds)
    names = [name for name in given if name in known.places]
    rows, values = _chosen(known, given, [name for name in names if name in held])
    guess = np.array([given.get(x.name, 0.0) for x in system.model.velocities])
    guessed = _chosen(known, given, [name for name in names if name not in held])
    guess = guess + shortest(guessed[0], guessed[1] - guessed[0] @ guess)
    both = _stacked(A, rows)
    wanted = guess + shortest(both, np.concatenate([c, values]) - both @ guess)
    v: np.ndarray = wanted + shortest(A, c - A @ wanted)
    residual = float(np.max(np.abs(A @ v - c), initial=0.0))
    if residual > AGREES * (1 + float(np.max(np.abs(v), initial=0.0))):
        off = np.abs(A @ v - c)
        names = [row.name for row, x in zip(system.rows, off) if x > residual / 2.0]
        raise _problem(
            system,
            "no velocities satisfy the constraints at the initial position: "
            f"{' and '.join(names[:4])} are off by {residual:.3g}",
            "constraints that ask for speeds which go together, or another position",
            names[0],
        )
    return v


@dataclass(frozen=True)
class Known:
    """What velocities are called: the row of each name."""

    rows: np.ndarray | Sparse
    places: dict[str, int]


def _known(system: System, N: np.ndarray | Sparse, speeds: Mapping[str, np.ndarray]) -> Known:
    """N's rows for der(q), unit rows for generalized velocities, those of declared speeds."""
    model, n = system.model, len(system.model.velocities)
    names = [*(f"der({c.name})" for c in model.coordinates), *(x.name for x in model.velocities)]
    places = {name: i for i, name in enumerate((*names, *speeds))}
    plain = _stacked(N, unit(n) if isinstance(N, Sparse) else np.eye(n))
    return Known(_stacked(plain, np.array(list(speeds.values())).reshape(len(speeds), n)), places)


def _stacked(above: np.ndarray | Sparse, below: np.ndarray | Sparse) -> np.ndarray | Sparse:
    if isinstance(above, Sparse):
        return stacked(above, below if isinstance(below, Sparse) else with_zeros(below))
    return np.vstack([above, below.full()[0] if isinstance(below, Sparse) else below])


def _entries(matrix: np.ndarray | Sparse) -> np.ndarray:
    return matrix.entries if isinstance(matrix, Sparse) else matrix


def _chosen(
    known: Known, given: Mapping[str, float], names: list[str]
) -> tuple[np.ndarray | Sparse, np.ndarray]:
    """The rows of some names, and what they are to give."""
    places = [known.places[name] for name in names]
    values = np.array([given[name] for name in names])
    if isinstance(known.rows, Sparse):
        return known.rows.of_rows(places), values
    return known.rows[places], values


def _locked(own: Own, solver: Kinematics, q: np.ndarray, p: np.ndarray) -> list[str]:
    rates = solver.rates(np.array([own.t]), q[np.newaxis], p[np.newaxis])
    return [] if rates is None else gimbal.locked(own.system, rates.largest()[0])


def _is_locked_rate(
    own: Own, solver: Kinematics, given: dict[str, float], q: np.ndarray, p: np.ndarray
) -> bool:
    """Whether a rate is asked for of an Euler angle that is in gimbal lock, but for rounding."""
    turning = [x for x in own.system.model.joints if len(x.orientation) == 3]
    asked = {name for x in turning for name in x.coordinates if f"der({name})" in given}
    return bool(asked) and not asked.isdisjoint(_locked(own, solver, q, p))


def _in_gimbal_lock(own: Own, solver: Kinematics, q: np.ndarray, p: np.ndarray) -> ModelError:
    """At the joint whose Euler angles they are."""
    model = own.system.model
    names = _locked(own, solver, q, p)
    joint = gimbal.joint_of(own.system, names[0]) if names else None
    what = gimbal.told(names, "at the initial position")
    place = joint.span if joint else Span(0, 0)
    found = model.diagnostic(place, what, "another initial position")
    return ModelError(replace(found, hint=gimbal.INSTEAD))


def _problem(
    system: System, message: str, advice: str, row: str = "", at_row: bool = False
) -> ModelError:
    """At the initial values; where there are none, or where it is `at_row`, at the constraint of
    the row."""
    model = system.model
    spans = [x.span for x in model.initial[:1] if not at_row]
    span = spans[0] if spans else span_of_row(system, row)
    return ModelError(model.diagnostic(span, message, advice))


def span_of_row(system: System, row: str) -> Span:
    """Where the constraint or closure stands that a row is of."""
    owner, model = row.split(".")[0], system.model
    known = (x.span for x in (*model.constraints, *model.closures) if x.name == owner)
    return next(known, Span(0, 0))
