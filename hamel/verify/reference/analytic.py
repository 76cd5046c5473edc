"""The analytic half of a model by SymPy: Lagrange's equations and the derivatives of constraint
expressions.

Symbols: t, q, r (= q̇), v, u, p. Joints turn rates into generalized velocities: q̇ = N v, q̈ = N v̇
+ Ṅ v.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from derive.expressions import tree
from derive.expressions.tables import Table
from derive.model.constraint_records import Holonomic, Nonholonomic, OnSurface
from derive.model.records import Model
from hamel.verify.reference.formulas import evaluated, lookup, symbolic
from hamel.verify.reference.jets import Jet, direction, dot, point
from hamel.verify.reference.layout import Layout, Rows
from hamel.verify.reference.loads import Lagrange
from hamel.verify.reference.measures import measured
from hamel.verify.reference.rows import RowsOf
from hamel.verify.reference.states import State
from hamel.verify.reference.tables import numeric
from hamel.verify.reference.tables import symbolic as symbolic_tables
from hamel.verify.reference.vectors import Array, skew

POSITIONS = ("position", "orientation", "angle", "length")  # measures that are no velocities
SYMBOLIC = symbolic()


@dataclass(frozen=True)
class Symbols:
    """Plain real symbols per group, and the table that formulas are read with; `m` are the measures
    of the motion and `mr` their rates, which formulas use like coordinates."""

    model: Model
    t: sympy.Symbol
    q: tuple[sympy.Symbol, ...]
    r: tuple[sympy.Symbol, ...]
    v: tuple[sympy.Symbol, ...]
    u: tuple[sympy.Symbol, ...]
    p: tuple[sympy.Symbol, ...]
    m: tuple[sympy.Symbol, ...]
    mr: tuple[sympy.Symbol, ...]
    names: dict[str, Any]
    rates: dict[str, Any]
    tables: tuple[Table, ...]

    @cached_property
    def functions(self) -> dict[str, Callable[..., Any]]:
        """Those of formulas, tables too."""
        return {**SYMBOLIC, **symbolic_tables(self.tables)}

    def read(self, expression: tree.Expression) -> Any:
        """A formula of the file as a SymPy expression; its names and the rates der(q) become
        symbols."""
        return sympy.sympify(evaluated(expression, lookup(self.names, self.rates), self.functions))

    def along(self, expression: Any) -> Any:
        """Σ ∂e/∂q q̇ + Σ ∂e/∂m ṁ + ∂e/∂t: the time derivative less its part in the
        accelerations."""
        moving = zip((*self.q, *self._positions(self.m)), (*self.r, *self._positions(self.mr)))
        return sum(
            (sympy.diff(expression, x) * r for x, r in moving), sympy.diff(expression, self.t)
        )

    def _positions(self, symbols: tuple[sympy.Symbol, ...]) -> list[sympy.Symbol]:
        """Of the measures those that are positions; the rate of a velocity is an acceleration."""
        measures = self.model.measures
        return [x for x, measure in zip(symbols, measures) if measure.quantity in POSITIONS]

    def velocities(self) -> list[sympy.Symbol]:
        """The measures that are velocities."""
        positions = set(self._positions(self.m))
        return [x for x in self.m if x not in positions]

    def function(self, entries: list[Any]) -> Callable[[State], Array]:
        """The entries at a state, as one flat array (SymPy's code with shared subexpressions)."""
        arguments = [self.t, self.q, self.r, self.v, self.u, self.p, self.m, self.mr]
        at = sympy.lambdify(
            arguments,
            [_without_impulses(sympy.sympify(entry)) for entry in entries],
            modules=[numeric(self.tables), "numpy"],
            cse=True,
        )

        def evaluate(s: State) -> Array:
            known = measured(self.model, s).values()
            m, mr = [x.value for x in known], [x.rate for x in known]
            return np.array(at(s.t, s.q, s.rates, s.v, s.u, s.p, m, mr), dtype=float)

        return evaluate


def _without_impulses(entry: Any) -> Any:
    """The slope of a step (sign, one side of a kink) is zero beside it, which is what counts."""
    return entry.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))


def symbols(model: Model) -> Symbols:
    """Symbols for every name of the model; definitions are put in, each in terms of the earlier
    ones."""

    def column(letter: str, count: int) -> tuple[sympy.Symbol, ...]:
        return tuple(sympy.Symbol(f"{letter}{i}", real=True) for i in range(count))

    q, r, v = (
        column("q", len(model.coordinates)),
        column("r", len(model.coordinates)),
        column("v", len(model.velocities)),
    )
    u, p, t = (
        column("u", len(model.inputs)),
        column("p", len(model.parameters) + len(model.states)),
        sympy.Symbol("t", real=True),
    )
    groups = (
        (model.coordinates, q),
        (model.velocities, v),
        (model.inputs, u),
        ((*model.parameters, *model.states), p),
    )
    m, mr = column("m", len(model.measures)), column("mr", len(model.measures))
    names = {"t": t, "pi": sympy.pi} | {
        item.name: x for items, xs in (*groups, (model.measures, m)) for item, x in zip(items, xs)
    }
    rates: dict[str, Any] = {c.name: x for c, x in zip(model.coordinates, r)}
    result = Symbols(model, t, q, r, v, u, p, m, mr, names, rates, model.tables)
    for name, expression in model.definitions:
        names[name] = result.read(expression)
    return result


def rows(item: Holonomic | Nonholonomic | OnSurface, s: Symbols, place: Layout) -> RowsOf:
    """The row of a constraint given as a formula."""
    match item:
        case Holonomic():
            return holonomic_row(item.expression, s, place)
        case Nonholonomic():
            return nonholonomic_row(item.expression, s, place)
        case OnSurface():
            return surface_row(item, s, place)


def holonomic_row(expression: tree.Expression, s: Symbols, place: Layout) -> RowsOf:
    """φ(q, t, m): φ_q N v̇ + φ_m m̈ = −(φ_q q̇)_q q̇ − 2 φ_qt q̇ − φ_tt − φ_q Ṅ v, c = −φ_t, with
    the rates of m beside those of q."""
    phi = s.read(expression)
    rate = s.along(phi)
    n = len(s.q)
    gradient = [sympy.diff(phi, x) for x in (*s.q, *s.m)]
    at = s.function([*gradient, phi, sympy.diff(phi, s.t), s.along(rate)])

    def rows(state: State) -> Rows:
        values = at(state)
        slopes, (value, explicit, curvature) = values[:-3], values[-3:]
        over, rest = _second_order(s, place, state, slopes[:n] @ state.N, slopes[n:])
        gamma = -curvature - slopes[:n] @ state.drift - rest
        return _one_row(over, gamma, -explicit, np.array([value]))

    return rows


def nonholonomic_row(expression: tree.Expression, s: Symbols, place: Layout) -> RowsOf:
    """e = a(q, t, m) q̇ + e_v v + e_m ṁ + b: (a N + e_v) v̇ + e_m m̈ = −e_q q̇ − e_t − a Ṅ v,
    c = −b."""
    e = s.read(expression)
    velocities = s.velocities()
    still = e.subs(dict.fromkeys((*s.r, *s.v, *velocities), 0))
    n, nv = len(s.q), len(s.v)
    slopes = [sympy.diff(e, x) if x in velocities else sympy.Integer(0) for x in s.m]
    at = s.function([*(sympy.diff(e, x) for x in (*s.r, *s.v)), *slopes, still, s.along(e)])

    def rows(state: State) -> Rows:
        values = at(state)
        a, direct, further = values[:n], values[n : n + nv], values[n + nv : -2]
        b, drift = values[-2:]
        over, rest = _second_order(s, place, state, a @ state.N + direct, further)
        return _one_row(over, -drift - a @ state.drift - rest, -b, np.zeros(0))

    return rows


def _second_order(
    s: Symbols, place: Layout, state: State, over_v: Array, slopes: Array
) -> tuple[Array, float]:
    """What a row has over ż, and what its measures have besides: Σ slope (over ż + rest)."""
    over, rest = np.concatenate([over_v, np.zeros(place.size - place.nv)]), 0.0
    for slope, known in zip(slopes, measured(s.model, state).values()):
        over = over + slope * known.over
        rest += float(slope) * known.rest
    return over, rest


def _one_row(over: Array, gamma: float, c: float, phi: Array) -> Rows:
    return Rows(over[None, :], np.array([gamma]), np.array([c]), phi)


def surface_row(item: OnSurface, s: Symbols, place: Layout) -> RowsOf:
    """φ(X, q, t) with X the point in the carrier's frame: φ_X Ẍ + φ_q q̈ = −(terms of second order
    in Ẋ, q̇ and t)."""
    X, R = sympy.symbols("X:3", real=True), sympy.symbols("R:3", real=True)
    phi = sympy.sympify(
        evaluated(item.surface, lookup(s.names | dict(zip("xyz", X)), s.rates), s.functions)
    )

    def along(expression: Any) -> Any:
        return s.along(expression) + sum(sympy.diff(expression, x) * r for x, r in zip(X, R))

    gradient = [sympy.diff(phi, x) for x in (*X, *s.q)]
    entries = [*gradient, phi, sympy.diff(phi, s.t), along(along(phi))]
    at = sympy.lambdify(
        [X, R, s.t, s.q, s.r, s.p],
        [sympy.sympify(entry) for entry in entries],
        modules="numpy",
        cse=True,
    )

    def rows(state: State) -> Rows:
        inside = _inside(item, place, state)
        value, rate = ([float(getattr(x, name)) for x in inside] for name in ("value", "rate"))
        entries = np.array(at(value, rate, state.t, state.q, state.rates, state.p), dtype=float)
        over_point, over_q, (height, explicit, curvature) = entries[:3], entries[3:-3], entries[-3:]
        coefficients = over_point @ np.array([x.over for x in inside])
        coefficients[: place.nv] += over_q @ state.N
        rest = over_point @ np.array([x.rest for x in inside]) + over_q @ state.drift + curvature
        return Rows(
            coefficients[None, :], np.array([-rest]), np.array([-explicit]), np.array([height])
        )

    return rows


def _inside(item: OnSurface, place: Layout, state: State) -> list[Jet]:
    """The point's coordinates in the frame of the body that carries the surface."""
    here = point(place, state, item.body, state.vector(item.point))
    gap = here - point(place, state, item.frame_body, np.zeros(3))
    return [dot(direction(place, state, item.frame_body, axis), gap) for axis in np.eye(3)]


def lagrange(model: Model, s: Symbols, place: Layout) -> Callable[[State], Lagrange]:
    """d/dt ∂T/∂q̇ − ∂T/∂q + ∂V/∂q = Q in the coordinates, then the rows along v: Nᵀ(·), and d/dt
    ∂T/∂v with what the brackets of the velocities' directions take from ∂T/∂v; what V has of
    measures m of the motion is a force −∂V/∂m along their own ṁ = over z.

    d(T + V − G)/dt = Q·q̇ + ∂V/∂t − ∂T/∂t with G = 2 T − q̇·∂T/∂q̇ − v·∂T/∂v, which vanishes for an
    ordinary quadratic T.
    """
    n, nv, k = len(s.q), len(s.v), len(s.m)
    at = s.function(_entries(model, s))

    def evaluate(state: State) -> Lagrange:
        sizes = np.cumsum([(n + nv) ** 2, n + nv, nv, k])
        inertia, force, momenta, slopes, (T, V, power, odd) = np.split(at(state), sizes)
        inertia, both = inertia.reshape(n + nv, n + nv), np.vstack([state.N, np.eye(nv)])
        along_v = both.T @ (force - inertia[:, :n] @ state.drift) + _brackets(state, momenta)
        pull, _ = _second_order(s, place, state, along_v, -slopes)
        return Lagrange(both.T @ inertia @ both, pull, T, V, power, odd)

    return evaluate


def _brackets(state: State, momenta: Array) -> Array:
    """Σ p_k [v, e_j]^k of the velocities along a body's axes: the bracket of two twists X, Y that
    turn along is the commutator X Y − Y X of their 4 × 4 matrices."""
    result = np.zeros(len(momenta))
    for seat in state.seats:
        p = momenta[seat.columns]
        if not p.any():
            continue
        twists = [_twist(x) for x in seat.twists.T]
        basis = np.array([x.ravel() for x in twists]).T
        moving = sum(v * x for v, x in zip(state.v[seat.columns], twists))
        for j, x in enumerate(twists):
            bracket = (moving @ x - x @ moving).ravel()
            result[seat.columns.start + j] = p @ np.linalg.lstsq(basis, bracket, rcond=None)[0]
    return result


def _twist(columns: Array) -> Array:
    """[ω]× beside v, a 4 × 4 matrix."""
    result = np.zeros((4, 4))
    result[:3, :3], result[:3, 3] = skew(columns[:3]), columns[3:]
    return result


def _entries(model: Model, s: Symbols) -> list[Any]:
    """Inertia over (q̇, v), its forces, ∂T/∂v, ∂V/∂m (nm), T, V, ∂V/∂t − ∂T/∂t and G."""
    T = s.read(model.kinetic) if model.kinetic is not None else sympy.Integer(0)
    V = s.read(model.potential) if model.potential is not None else sympy.Integer(0)
    moving = (*s.r, *s.v)
    momenta = [sympy.diff(T, r) for r in moving]
    inertia = [sympy.diff(momentum, r) for momentum in momenta for r in moving]
    slopes = [*(sympy.diff(T - V, x) for x in s.q), *(0 for _ in s.v)]
    force = [slope - s.along(momentum) for slope, momentum in zip(slopes, momenta)]
    G = 2 * T - sum(momentum * r for momentum, r in zip(momenta, moving))
    return [
        *inertia,
        *force,
        *momenta[len(s.q) :],
        *(sympy.diff(V, x) for x in s.m),
        T,
        V,
        sympy.diff(V, s.t) - sympy.diff(T, s.t),
        G,
    ]
