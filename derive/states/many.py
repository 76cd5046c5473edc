"""Consistent initial states of many motions at once, each with its own parameters and held values.

The same problem as in initial.py, and the same answers to rounding: positions by Gauss–Newton on
φ = 0 with held coordinates kept where they can be, then the velocities on A v = c nearest to the
guesses and held rates.

Motions are along the last axis of all arrays but those of Starter's face: thousands of small
matrices are worked on entry by entry, each for all motions, in a fifth of the time that LAPACK
takes for one after the other; and what comes out for a motion does not depend on its neighbours.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import ModelError
from derive.expressions import tree
from derive.expressions.columns import columns_of
from derive.expressions.evaluate import casadi_functions, value
from derive.mechanics.records import System
from derive.numerics import NONZERO
from derive.states.closing import angles, normalised, nudges, turned
from derive.states.initial import own_units
from derive.states.limits import AGREES, CLOSED, EVEN, LEAP, NEWTON, REPEATS, ROUNDED, UNWOUND

EXACT = 1e-14  # |A v − c| against 1 + |v| that needs no correction
ROUGHLY = 1e-6  # the same, of a step that another one follows
LEAST = 1e-10  # pivots of rows of length one: with smaller ones squares have lost too many digits
SOLVED = 1e-13  # relative residual up to which the normal equations have solved A x = b


@dataclass(frozen=True)
class Starts:
    """q (k, nq), v (k, nv) and first-order states z (k, nz) in SI. `closed`: rows that satisfy the
    constraints; `moves`: of each held value that had to give way somewhere what was given and what
    is used, (2, k) in SI, where it had to, else nothing."""

    q: np.ndarray
    v: np.ndarray
    z: np.ndarray
    closed: np.ndarray
    moves: Mapping[str, np.ndarray]

    @property
    def moved(self) -> np.ndarray:
        """Rows where a held value had to give way."""
        parts = [np.isfinite(used) for _, used in self.moves.values()]
        return np.any([np.zeros(len(self.closed), dtype=bool), *parts], axis=0)


@dataclass(frozen=True)
class Starter:
    """Initial states of a system at time t, where the values of `names` are held and differ from
    motion to motion; all else is as the model file says. It can be pickled: CasADi's functions are
    its only memory of the model. Numbers are in the model's own units but where SI is said."""

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    quaternions: tuple[int, ...]
    angles: np.ndarray  # which coordinates are angles: 1, else 0
    initial: tuple[str, ...]  # what the file gives, held or guessed
    held: frozenset[str]
    t: float  # s
    own_t: float
    units: Mapping[str, float]  # one of each in SI
    parameters: np.ndarray  # one of each of p in SI
    formulas: ca.Function  # (t, p) → the values of `initial`, in SI
    varied: bool  # whether these depend on p
    positions: ca.Function | None  # (t, q, p) → φ, ∂φ/∂q; None where there is no φ
    start: ca.Function | None  # (t, q, p) → φ as it is, which a start must have
    rows: ca.Function  # (t, q, p) → A, c
    rates: ca.Function | None  # (t, q, p) → N; None where it is one
    speeds: tuple[str, ...] = ()  # declared quasi-velocities, and (t, q, p) → their rows
    speed_rows: ca.Function | None = None
    states: tuple[str, ...] = ()
    charges: ca.Function | None = None  # p → initial values of the states, in SI

    def __call__(self, values: Mapping[str, np.ndarray], p: np.ndarray) -> Starts:
        """The states of k motions: `values` (k,) by name in SI, parameters p (k, np)."""
        k = len(p)
        given = self._given(p)
        given |= {
            n: np.broadcast_to(each, k) / self.one_of(n)
            for n, each in values.items()
            if n not in self.states
        }
        here, t = (p / self.parameters).T, np.full((1, k), self.own_t)
        q, closed = self._positions(t, given, here)
        rows = self._rows(t, q, here, given)
        v, agrees = self._velocities(t, given, q, here, rows)
        moves = self._moves(given, q, v, rows)
        sizes = np.array([self.one_of(name) for name in self.coordinates])
        speeds = np.array([self.one_of(name) for name in self.velocities])
        return Starts(q.T * sizes, v.T * speeds, self._charged(values, p), closed & agrees, moves)

    def one_of(self, name: str) -> float:
        """One of the model's own units of that quantity, in SI; 1 where the name is not known."""
        return self.units.get(name, 1.0)

    # ---- steps

    def _charged(self, values: Mapping[str, np.ndarray], p: np.ndarray) -> np.ndarray:
        """The first-order states: those that are held, else what the file says."""
        z = np.zeros((len(p), 0)) if self.charges is None else self.charges(p.T).full().T
        z = np.array(np.broadcast_to(z, (len(p), z.shape[1])))  # one row where nothing is in p
        for k, name in enumerate(self.states):
            if name in values:
                z[:, k] = values[name]
        return z

    def _given(self, p: np.ndarray) -> dict[str, np.ndarray]:
        if not self.initial:
            return {}
        motions = p if self.varied else p[:1]  # numbers are the same for all
        values = self.formulas(np.full((1, len(motions)), self.t), motions.T).full()
        return {name: row / self.one_of(name) for name, row in zip(self.initial, values)}

    def _positions(
        self,
        t: np.ndarray,
        given: Mapping[str, np.ndarray],
        p: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Guesses move, from beside them or from afar where they have to; else everything may."""
        names, zero = self.coordinates, np.zeros(p.shape[1])
        start = self._normalised(np.stack([zero + given.get(name, 0.0) for name in names]))
        free = np.array([name not in self.held for name in names], dtype=float)
        if self.positions is None:
            return start, _finite(start)
        q, done = start.copy(), np.zeros(start.shape[1], dtype=bool)

        def met(
            rest: np.ndarray, move: np.ndarray, choice: np.ndarray
        ) -> tuple[np.ndarray, np.ndarray]:
            return self._met(t[:, rest], start[:, rest], p[:, rest], move, choice)

        def beside(choice: np.ndarray) -> None:
            for nudge in nudges(len(names)):
                rest = ~done
                if nudge.any() and rest.any():
                    rest &= self._able(t, start, p)
                if rest.any():
                    q[:, rest], done[rest] = met(rest, nudge, choice)

        if free.any() and not free.all():
            beside(free)
            rest = ~done
            if rest.any():
                rest &= self._able(t, start, p)
            found, nearest = q[:, rest], np.full(int(rest.sum()), np.inf)
            for move in turned(free * self.angles) if rest.any() else ():
                other, closed = met(rest, move, free)
                far = np.where(closed, _largest(other - start[:, rest]), np.inf)
                better = far < nearest
                found[:, better], nearest[better] = other[:, better], far[better]
            q[:, rest], done[rest] = found, np.isfinite(nearest)
        beside(np.ones(len(names)))
        return self._normalised(q), done

    def _met(
        self, t: np.ndarray, start: np.ndarray, p: np.ndarray, move: np.ndarray, choice: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions that are met from a start that is moved so, and which are; without the whole
        turns that angles took on the way, where the constraints do not count them."""
        assert self.positions is not None
        at = self._normalised(start + (move * choice)[:, None])
        q, done = closed_many(self.positions, t, at, p, choice)
        q = self._normalised(q)
        turns = np.round((q - start) / (2.0 * np.pi)) * self.angles[:, None] * done
        for i in np.flatnonzero(turns.any(axis=1)):
            some = turns[i] != 0.0
            back = q[:, some]
            back[i] -= 2.0 * np.pi * turns[i, some]
            again, met = closed_many(self.positions, t[:, some], back, p[:, some], choice)
            met &= _largest(again - back) <= UNWOUND
            q[:, some] = np.where(met, again, q[:, some])
        return q, done

    def _able(self, t: np.ndarray, start: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Whether φ has a value at the start of each motion: else none beside it is tried."""
        assert self.start is not None
        return _finite(columns_of(self.start)(t, start, p)[0])

    def _normalised(self, q: np.ndarray) -> np.ndarray:
        return normalised(self, q.T).T if self.quaternions else q

    def _velocities(
        self,
        t: np.ndarray,
        given: Mapping[str, np.ndarray],
        q: np.ndarray,
        p: np.ndarray,
        known: Mapping[str, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """v nearest the guesses with A v = c and the held rates; where they contradict each other
        A v = c wins. Guessed rates that are no generalized velocities say what v is guessed."""
        k = p.shape[1]
        guess = np.stack([np.zeros(k) + given.get(name, 0.0) for name in self.velocities])
        A, c = columns_of(self.rows)(t, q, p)
        c = c[:, 0]
        names = [name for name in given if name in known]
        rows, values = self._chosen(known, given, [n for n in names if n in self.held], k)
        guessed = self._chosen(known, given, [n for n in names if n not in self.held], k)
        guess = guess + least_many(guessed[0], guessed[1] - _applied(guessed[0], guess))
        both, wanted = np.concatenate([A, rows]), np.concatenate([c, values])
        v = guess + least_many(both, wanted - _applied(both, guess))
        left = c - _applied(A, v)
        again = ~(_largest(left) <= EXACT * (1.0 + _largest(v)))
        if again.any():
            v[:, again] += least_many(A[..., again], left[:, again])
        off = _largest(_applied(A, v) - c)
        return v, _finite(v) & (off <= AGREES * (1.0 + _largest(v)))

    def _rows(
        self, t: np.ndarray, q: np.ndarray, p: np.ndarray, given: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """The rows (nv, k) of what is given of velocities: N's for der(q), unit rows for
        generalized velocities, those of declared quasi-velocities."""
        nv, k = len(self.velocities), p.shape[1]
        unit = np.broadcast_to(np.eye(nv)[:, :, None], (nv, nv, k))
        rates = [f"der({name})" for name in self.coordinates]
        by_rates, speeds = unit, np.zeros((len(self.speeds), nv, k))
        if self.rates is not None and not given.keys().isdisjoint(rates):
            by_rates = columns_of(self.rates)(t, q, p)[0]
        if self.speed_rows is not None and not given.keys().isdisjoint(self.speeds):
            speeds = columns_of(self.speed_rows)(t, q, p)[0]
        tables = ((rates, by_rates), (self.velocities, unit), (self.speeds, speeds))
        known = {n: row for names, table in tables for n, row in zip(names, table)}
        return {name: row for name, row in known.items() if name in given}

    def _chosen(
        self,
        rows: Mapping[str, np.ndarray],
        given: Mapping[str, np.ndarray],
        names: list[str],
        k: int,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The rows of some names, and what they are to give, of k motions."""
        if not names:
            return np.zeros((0, len(self.velocities), k)), np.zeros((0, k))
        values = [np.broadcast_to(given[name], k) for name in names]
        return np.stack([rows[name] for name in names]), np.stack(values)

    def _moves(
        self,
        given: Mapping[str, np.ndarray],
        q: np.ndarray,
        v: np.ndarray,
        rows: Mapping[str, np.ndarray],
    ) -> dict[str, np.ndarray]:
        used = dict(zip(self.coordinates, q))
        used |= {name: _sum(row * v, v.shape[1:]) for name, row in rows.items()}
        moves: dict[str, np.ndarray] = {}
        for name in filter(self.held.__contains__, given):
            pair = np.stack(np.broadcast_arrays(given[name], used[name]))
            kept = np.abs(pair[1] - pair[0]) <= AGREES * (1 + np.abs(pair[0]))
            if not kept.all():
                moves[name] = np.where(kept, np.nan, pair * self.one_of(name))
        return moves


def starter(system: System, names: Collection[str], t: float = 0.0) -> Starter:
    """For held values of `names` at time t (s). Raises ModelError for a name that is none of an
    initial value."""
    model, own = system.model, own_units(system, t)
    states = tuple(x.name for x in model.states)
    strange = [name for name in names if name not in own.units and name not in states]
    if strange:
        raise ModelError(f"'{strange[0]}' is no initial value of {model.name}")
    s = own.system
    place = [s.t, s.q, s.own_p]
    unmoved = s.N.is_square() and bool((s.N - ca.SX.eye(s.N.size1())).is_zero())
    slopes = ca.jacobian(s.assembly, s.q)
    formulas = _formulas(system)
    return Starter(
        names=tuple(names),
        coordinates=tuple(c.name for c in model.coordinates),
        velocities=tuple(x.name for x in model.velocities),
        quaternions=system.quaternions,
        angles=angles(system).astype(float),
        initial=tuple(x.name for x in model.initial),
        held=frozenset((*(x.name for x in model.initial if x.held), *names)),
        t=t,
        own_t=own.t,
        units=own.units,
        parameters=own.parameters[: len(system.own_parameters)],
        formulas=formulas,
        varied=formulas.jac_sparsity(0, 1).nnz() > 0,
        positions=ca.Function("phi", place, [ca.densify(s.assembly), ca.densify(slopes)])
        if s.phi.numel()
        else None,
        start=ca.Function("start", place, [ca.densify(s.phi)]) if s.phi.numel() else None,
        rows=ca.Function("rows", place, [ca.densify(s.A), ca.densify(s.c)]),
        rates=None if unmoved else ca.Function("rates", place, [ca.densify(s.N)]),
        speeds=tuple(x.name for x in model.speeds),
        speed_rows=own.speeds,
        states=states,
        charges=_charges(system) if states else None,
    )


def _charges(system: System) -> ca.Function:
    """p → the initial values of first-order states, in SI."""
    names, functions = system.symbols.names, system.symbols.functions
    charges = [ca.SX(value(x.initial, names, {}, functions)) for x in system.model.states]
    return ca.Function("charges", [system.own_p], [ca.densify(ca.vertcat(*charges))])


def _formulas(system: System) -> ca.Function:
    """(t, p) → the initial values that the file gives, in SI."""
    names = {**system.symbols.names, "t": system.t}
    formulas = [value(x.value, names, {}, system.symbols.functions) for x in system.model.initial]
    column = ca.vertcat(*map(ca.SX, formulas)) if formulas else ca.SX(0, 1)
    return ca.Function("initial", [system.t, system.own_p], [ca.densify(column)])


def closed_many(
    positions: ca.Function, t: np.ndarray, start: np.ndarray, p: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """q (nq, k) moved onto φ = 0 as `closed` does for one, each row judged in its own unit; and
    which have come there."""
    q, done = start.copy(), np.zeros(start.shape[1], dtype=bool)
    alive = np.flatnonzero(~done)
    for _ in range(NEWTON):
        phi, slopes = columns_of(positions)(t[:, alive], q[:, alive], p[:, alive])
        phi = phi[:, 0]
        finite = _finite(phi) & _finite(slopes)
        scale = 1.0 + _largest(q[:, alive])
        allowed = np.maximum(CLOSED * _sizes(slopes, q[:, alive]), ROUNDED * scale)
        near = finite & (np.abs(phi) <= allowed).all(axis=0)
        done[alive[near]] = True
        going = finite & ~near
        if not going.any():
            break
        if not going.all():
            alive, phi, slopes = alive[going], phi[:, going], slopes[..., going]
            scale = scale[going]
        step = -free[:, None] * least_many(slopes * free[:, None], phi, ROUGHLY)
        q[:, alive] += step * np.minimum(1.0, LEAP * scale / (NONZERO + _largest(step)))
    return q, done


def _sizes(J: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Σ |∂φ/∂q| (1 + |q|) of each row of each motion."""
    sizes = _applied(np.abs(J), 1.0 + np.abs(q))
    largest = _largest(sizes)
    return np.where(largest > 0.0, np.maximum(sizes, EVEN * largest), 1.0)


def _largest(x: np.ndarray) -> np.ndarray:
    """Magnitude of each motion."""
    magnitude: np.ndarray = np.abs(x).max(axis=0, initial=0.0)
    return magnitude


def _finite(x: np.ndarray) -> np.ndarray:
    """Whether all of a motion is."""
    return np.all(np.isfinite(x).reshape(-1, x.shape[-1]), axis=0)


def _sum(rows: Iterable[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """One after the other, so that no motion's bits depend on how many there are."""
    total = np.zeros(shape)
    for row in rows:
        total += row
    return total


def _applied(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    m, n, k = A.shape
    return _sum((A[:, j] * x[j] for j in range(n)), (m, k))


def _applied_transpose(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    m, n, k = A.shape
    return _sum((A[i] * y[i] for i in range(m)), (n, k))


def least_many(A: np.ndarray, b: np.ndarray, within: float = SOLVED) -> np.ndarray:
    """The shortest x (n, k) with A x = b of each motion, A (m, n, k) and b (m, k), or nearest to it
    where rows repeat others: by the normal equations A Aᵀ y = b, refined where they are not solved
    `within` that part, and by the singular values where that does not do.
    """
    m, n, k = A.shape
    if not m or not k:
        return np.zeros((n, k))
    with np.errstate(all="ignore"):
        x, solved = _by_squares(A, b, within)
    if not solved.all():
        rest = ~solved & _finite(A) & _finite(b)
        x[:, ~solved] = np.nan
        if rest.any():
            inverse = np.linalg.pinv(A[..., rest].transpose(2, 0, 1), rcond=REPEATS)
            x[:, rest] = _applied(inverse.transpose(1, 2, 0), b[:, rest])
    return x


def _by_squares(A: np.ndarray, b: np.ndarray, within: float) -> tuple[np.ndarray, np.ndarray]:
    """x, and where it can be trusted."""
    m, n, k = A.shape
    lengths = np.sqrt(_sum((A[:, j] * A[:, j] for j in range(n)), (m, k)))
    lengths = np.where(lengths > 0, lengths, 1.0)
    unit, side = A / lengths[:, None], b / lengths
    factors = _factors(unit)
    x = _applied_transpose(unit, _solution(factors, side))
    if within <= SOLVED:
        x += _applied_transpose(unit, _solution(factors, side - _applied(unit, x)))
    off = _largest(side - _applied(unit, x))
    least = factors.diagonal().min(axis=1)
    # pivots are those of the squares: the condition is that of A, squared
    return x, (least > LEAST) & (off <= within * (_largest(side) + _largest(x)))


def _factors(A: np.ndarray) -> np.ndarray:
    """A Aᵀ = L D Lᵀ of each motion: D on the diagonal, L below."""
    m, n, k = A.shape
    left = np.zeros((m, m, k))
    for i in range(m):
        left[i:, i] = _sum((A[i:, j] * A[i, j] for j in range(n)), (m - i, k))
    for i in range(m):
        column = left[i + 1 :, i].copy()
        left[i + 1 :, i] /= left[i, i]
        for j in range(i + 1, m):
            left[j:, j] -= column[j - i - 1 :] * left[j, i]
    return left


def _solution(factors: np.ndarray, b: np.ndarray) -> np.ndarray:
    """y with L D Lᵀ y = b."""
    y, m = b.copy(), len(b)
    for i in range(m):
        y[i + 1 :] -= factors[i + 1 :, i] * y[i]
    for i in reversed(range(m)):
        y[i] = y[i] / factors[i, i] - _sum(
            (factors[j, i] * y[j] for j in range(i + 1, m)), y[i].shape
        )
    return y


def least_of_bodies(system: System) -> ca.Function:
    """p → the masses and moments of inertia of all bodies that are formulas of parameters: none
    may be negative."""
    names, inertias = system.symbols.names, list[ca.SX]()
    unknown = {*(c.name for c in system.model.coordinates), "t"}
    for body in system.model.bodies:
        for formula in (body.mass, *body.inertia[:3]):
            nodes = list(tree.walk(formula))
            if any(
                isinstance(n, tree.Rate) or (isinstance(n, tree.Name) and n.name in unknown)
                for n in nodes
            ):
                continue
            inertias.append(ca.SX(value(formula, names, {}, casadi_functions())))
    column = ca.vertcat(*inertias) if inertias else ca.SX.ones(1)
    return ca.Function("bodies", [system.own_p], [ca.densify(column)])
