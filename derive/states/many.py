"""Consistent initial states of many motions at once, each with its own parameters and held values.

The same problem as in initial.py, and the same answers to rounding: positions by Gauss–Newton on
φ = 0 with held coordinates kept where they can be, then the velocities on A v = c nearest to the
guesses and held rates.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import ModelError
from derive.expressions import tree
from derive.expressions.evaluate import casadi_functions, value
from derive.mechanics.records import System
from derive.numerics import NONZERO
from derive.states.closing import normalised
from derive.states.initial import own_units
from derive.states.limits import AGREES, CLOSED, EVEN, LEAP, NEWTON, REPEATS

EXACT = 1e-14  # |A v − c| against 1 + |v| that needs no correction
ROUGHLY = 1e-6  # the same, of a step that another one follows
BLOCK = 64  # states that CasADi is given at a time
SOLVED = 1e-13  # relative residual up to which the normal equations have solved A x = b


@dataclass(frozen=True)
class Starts:
    """q (k, nq), v (k, nv) and first-order states z (k, nz) in SI. `closed`: rows that satisfy the
    constraints; `moved`: those
    where a held value had to give way."""

    q: np.ndarray
    v: np.ndarray
    z: np.ndarray
    closed: np.ndarray
    moved: np.ndarray


@dataclass(frozen=True)
class Starter:
    """Initial states of a system at time t, where the values of `names` are held and differ from
    motion to motion; all else is as the model file says. It can be pickled: CasADi's functions are
    its only memory of the model. Numbers are in the model's own units but where SI is said."""

    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    velocities: tuple[str, ...]
    quaternions: tuple[int, ...]
    initial: tuple[str, ...]  # what the file gives, held or guessed
    held: frozenset[str]
    t: float  # s
    own_t: float
    units: Mapping[str, float]  # one of each in SI
    parameters: np.ndarray  # one of each of p in SI
    formulas: ca.Function  # (t, p) → the values of `initial`, in SI
    varied: bool  # whether these depend on p
    positions: ca.Function | None  # (t, q, p) → φ, ∂φ/∂q; None where there is no φ
    rows: ca.Function  # (t, q, p) → A, c
    rates: ca.Function | None  # (t, q, p) → N; None where it is one
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
        here, t = p / self.parameters, np.full(k, self.own_t)
        q, closed = self._positions(t, given, here)
        v, agrees = self._velocities(t, given, q, here)
        moved = self._moved(given, q, v, self._rates(t, q, v, here))
        sizes = np.array([self.one_of(name) for name in self.coordinates])
        speeds = np.array([self.one_of(name) for name in self.velocities])
        return Starts(q * sizes, v * speeds, self._charged(values, p), closed & agrees, moved)

    def one_of(self, name: str) -> float:
        """One of the model's own units of that quantity, in SI; 1 where the name is not known."""
        return self.units.get(name, 1.0)

    # ---- steps

    def _charged(self, values: Mapping[str, np.ndarray], p: np.ndarray) -> np.ndarray:
        """The first-order states: those that are held, else what the file says."""
        z = np.zeros((len(p), 0)) if self.charges is None else self.charges(p.T).full().T
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
        """Guesses move; where that does not do, everything may."""
        names = self.coordinates
        zero = np.zeros(len(p))
        start = np.stack([np.broadcast_to(given.get(name, zero), len(p)) for name in names], axis=1)
        start = normalised(self, start)
        free = np.array([name not in self.held for name in names], dtype=float)
        if self.positions is None:
            return start, np.isfinite(start.sum(axis=1))
        q, done = closed_many(self.positions, t, start, p, free)
        if not done.all():
            rest = ~done
            q[rest], done[rest] = closed_many(
                self.positions, t[rest], start[rest], p[rest], np.ones(len(names))
            )
        return normalised(self, q), done

    def _velocities(
        self,
        t: np.ndarray,
        given: Mapping[str, np.ndarray],
        q: np.ndarray,
        p: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """v nearest the guesses with A v = c and the held rates; where they contradict each other
        A v = c wins."""
        zero, k = np.zeros(len(p)), len(p)
        guesses = [np.broadcast_to(given.get(name, zero), k) for name in self.velocities]
        guess = np.stack(guesses, axis=1)
        A, c = Matrices(self.rows)(t, q, p)
        c = c[:, :, 0]
        rows, values = self._held_rows(t, given, q, p)
        both = np.concatenate([A, rows], axis=1)
        wanted = np.concatenate([c, values], axis=1)
        v = guess + least_many(both, wanted - _applied(both, guess))
        left = c - _applied(A, v)
        size = EXACT * (1.0 + np.max(np.abs(v), axis=1, initial=0.0))
        again = ~(np.max(np.abs(left), axis=1, initial=0.0) <= size)
        if again.any():
            v[again] += least_many(A[again], left[again])
        off = np.max(np.abs(_applied(A, v) - c), axis=1, initial=0.0)
        size = 1.0 + np.max(np.abs(v), axis=1, initial=0.0)
        return v, np.isfinite(v).all(axis=1) & (off <= AGREES * size)

    def _held_rows(
        self,
        t: np.ndarray,
        given: Mapping[str, np.ndarray],
        q: np.ndarray,
        p: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rows that give the held rates: N's for der(q), unit rows for generalized velocities."""
        velocities = self.velocities
        rates = [f"der({name})" for name in self.coordinates]
        k, nv = len(p), len(velocities)
        names = [name for name in given if name in self.held and name in {*rates, *velocities}]
        by_rates = np.broadcast_to(np.eye(nv), (k, nv, nv))
        if self.rates is not None and any(name in rates for name in names):
            by_rates = Matrices(self.rates)(t, q, p)[0]
        rows = np.zeros((k, len(names), nv))
        for i, name in enumerate(names):
            if name in rates:
                rows[:, i] = by_rates[:, rates.index(name)]
            else:
                rows[:, i, velocities.index(name)] = 1.0
        values = [np.broadcast_to(given[name], k) for name in names]
        return rows, np.stack(values, axis=1) if names else np.zeros((k, 0))

    def _rates(self, t: np.ndarray, q: np.ndarray, v: np.ndarray, p: np.ndarray) -> np.ndarray:
        return v if self.rates is None else _applied(Matrices(self.rates)(t, q, p)[0], v)

    def _moved(
        self,
        given: Mapping[str, np.ndarray],
        q: np.ndarray,
        v: np.ndarray,
        rates: np.ndarray,
    ) -> np.ndarray:
        used = {name: q[:, i] for i, name in enumerate(self.coordinates)}
        used |= {name: v[:, i] for i, name in enumerate(self.velocities)}
        used |= {f"der({name})": rates[:, i] for i, name in enumerate(self.coordinates)}
        changed = np.zeros(len(q), dtype=bool)
        for name, result in given.items():
            if name in self.held:
                changed |= ~(np.abs(used[name] - result) <= AGREES * (1 + np.abs(result)))
        return changed


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
    slopes = ca.jacobian(s.phi, s.q)
    formulas = _formulas(system)
    return Starter(
        names=tuple(names),
        coordinates=tuple(c.name for c in model.coordinates),
        velocities=tuple(x.name for x in model.velocities),
        quaternions=system.quaternions,
        initial=tuple(x.name for x in model.initial),
        held=frozenset((*(x.name for x in model.initial if x.held), *names)),
        t=t,
        own_t=own.t,
        units=own.units,
        parameters=own.parameters[: len(system.own_parameters)],
        formulas=formulas,
        varied=formulas.jac_sparsity(0, 1).nnz() > 0,
        positions=ca.Function("phi", place, [ca.densify(s.phi), ca.densify(slopes)])
        if s.phi.numel()
        else None,
        rows=ca.Function("rows", place, [ca.densify(s.A), ca.densify(s.c)]),
        rates=None if unmoved else ca.Function("rates", place, [ca.densify(s.N)]),
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


class Matrices:
    """A function of (t, q, p) with dense results, at many states.

    BLOCK states at a time and without CasADi's matrices in between, whose making takes longer than
    the numbers: a column of theirs is a row of ours in memory.
    """

    def __init__(self, function: ca.Function) -> None:
        self.buffer, self.evaluate = function.map(BLOCK).buffer()
        places = range(function.n_out())
        self.shapes = [(function.size2_out(i), function.size1_out(i)) for i in places]

    def __call__(self, t: np.ndarray, q: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
        """The results at k states, k × rows × columns each."""
        given = [_whole_blocks(x) for x in (t.reshape(len(t), 1), q, p)]
        results = [np.zeros((len(given[0]), *shape)) for shape in self.shapes]
        for first in range(0, len(given[0]), BLOCK):
            block = slice(first, first + BLOCK)
            for i, x in enumerate(given):
                self.buffer.set_arg(i, x[block].data)
            for i, x in enumerate(results):
                self.buffer.set_res(i, x[block].data)
            self.evaluate()
        return [x[: len(t)].transpose(0, 2, 1) for x in results]


def _whole_blocks(rows: np.ndarray) -> np.ndarray:
    """The rows, and zeros until BLOCK divides their number."""
    count = len(rows)
    whole = np.zeros((count + -count % BLOCK, rows.shape[1]))
    whole[:count] = rows
    return whole


def closed_many(
    positions: ca.Function, t: np.ndarray, start: np.ndarray, p: np.ndarray, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """q (k, nq) moved onto φ = 0 as `closed` does for one, each row judged in its own unit; and
    which have come there."""
    q, done = start.copy(), np.zeros(len(start), dtype=bool)
    alive = np.arange(len(start))
    matrices = Matrices(positions)
    for _ in range(NEWTON):
        phi, J = matrices(t[alive], q[alive], p[alive])
        phi = phi[:, :, 0]
        finite = np.isfinite(phi).all(axis=1) & np.isfinite(J).all(axis=(1, 2))
        scale = 1.0 + np.max(np.abs(q[alive]), axis=1, initial=0.0)
        near = finite & (np.abs(phi) <= CLOSED * _sizes(J, q[alive])).all(axis=1)
        done[alive[near]] = True
        going = finite & ~near
        if not going.any():
            break
        alive, scale = alive[going], scale[going]
        step = -free * least_many(J[going] * free, phi[going], ROUGHLY)
        largest = np.max(np.abs(step), axis=1, initial=0.0)
        q[alive] += step * np.minimum(1.0, LEAP * scale / (NONZERO + largest))[:, None]
    return q, done


def _sizes(J: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Σ |∂φ/∂q| (1 + |q|) of each row of each motion."""
    sizes = _applied(np.abs(J), 1.0 + np.abs(q))
    largest = np.max(sizes, axis=1, keepdims=True, initial=0.0)
    return np.where(largest > 0.0, np.maximum(sizes, EVEN * largest), 1.0)


def _applied(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.asarray((A @ x[:, :, None])[:, :, 0])


def least_many(A: np.ndarray, b: np.ndarray, within: float = SOLVED) -> np.ndarray:
    """The shortest x with A x = b of each motion, or nearest to it where rows repeat others: by the
    normal equations A Aᵀ y = b, refined where they are not solved `within` that part, and by the
    singular values where that does not do.
    """
    k, m, n = A.shape
    if not m or not k:
        return np.zeros((k, n))
    x, solved = _by_squares(A, b, within)
    if not solved.all():
        rest = ~solved & np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        x[~solved] = np.nan
        if rest.any():
            x[rest] = _applied(np.linalg.pinv(A[rest], rcond=REPEATS), b[rest])
    return x


def _by_squares(A: np.ndarray, b: np.ndarray, within: float) -> tuple[np.ndarray, np.ndarray]:
    lengths = np.linalg.norm(A, axis=2, keepdims=True)
    unit = A / np.where(lengths > 0, lengths, 1.0)
    side = b / np.where(lengths > 0, lengths, 1.0)[:, :, 0]
    squares = unit @ unit.transpose(0, 2, 1)
    try:
        inverse = np.linalg.inv(squares)
    except np.linalg.LinAlgError:
        return np.zeros((len(A), A.shape[2])), np.zeros(len(A), dtype=bool)
    turned = unit.transpose(0, 2, 1)
    x = _applied(turned, _applied(inverse, side))
    if within <= SOLVED:
        x = x + _applied(turned, _applied(inverse, side - _applied(unit, x)))
    off = np.max(np.abs(side - _applied(unit, x)), axis=1)
    size = np.max(np.abs(side), axis=1) + np.max(np.abs(x), axis=1)
    # inverse of squares: the condition is that of A, squared
    sound = np.max(np.abs(inverse), axis=(1, 2)) < 1e10
    return x, sound & (off <= within * size)


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
