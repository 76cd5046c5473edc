"""The same linear equations with all coordinates and velocities: an independent check, and what it
costs.

The multiplier equations M v̇ + h = Q + Aᵀλ, A v̇ = β are differentiated as they stand, in (q, s)
with s the generalized velocities, or the rates q̇ where those are the constant ones. Off the
constraints φ̈ = 0 and d(A v − c)/dt = 0 hold, so that each holonomic row brings two zeros and each
nonholonomic row one: 2 m_h + m_n spurious eigenvalues, in a nilpotent block. The rest is the
minimal form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.diagnostics import AssumptionError
from derive.linearize.kinks import mean_of_sides
from derive.linearize.limits import CONSTANT, ROUNDED, SAME_ROWS
from derive.linearize.minimal import position_rows
from derive.linearize.records import Linear, Steady
from derive.mechanics.records import System
from derive.states.scales import scales


@dataclass(frozen=True)
class Sizes:
    """What one of the model's own units is in SI, of q, v, s and w, of a second, and of power:
    nothing is judged by the metre."""

    q: np.ndarray
    v: np.ndarray
    s: np.ndarray
    w: np.ndarray
    time: float
    power: float

    @property
    def state(self) -> np.ndarray:
        """Units of (q, s): all coordinates, and the velocities that are linearised in."""
        return np.append(self.q, self.s)

    @property
    def x(self) -> np.ndarray:
        """Units of (q, w), the state of the minimal equations; (nx,)."""
        return np.append(self.q, self.w)


@dataclass(frozen=True)
class Unreduced:
    """`difference`: how far A on the constraints' tangent space is from the minimal form, relative
    to its largest entry; `spurious`: dimension of the rest; `nilpotent`: norm of that block's
    square, relative to the square of that entry. Both with A in the model's own units.
    """

    states: tuple[str, ...]
    A: np.ndarray
    difference: float
    spurious: int
    nilpotent: float


def unreduced(form: Linear, motions: Steady, cyclic: tuple[int, ...]) -> Unreduced:
    """At the first motion; `cyclic` are indices into q that are left out. Raises AssumptionError
    where neither the base velocities nor the rates q̇, and the tangent space in them, are constant
    along the motion, or where the mass matrix of a long chain is not written out."""
    system = form.equations.system
    if system.model.states:
        raise AssumptionError("the multiplier equations here know no first-order states")
    if not system.written:
        raise AssumptionError("the mass matrix of so long a chain is not written out")
    x, u, p = motions.x[0], motions.u[0], motions.p[0]
    for L, names in _velocities(system):
        sizes = _sizes(form, names)
        rates = _rates(form, L, x, u, p) / sizes.s * sizes.time
        if np.max(np.abs(rates), initial=0.0) > CONSTANT * (
            1 + float(np.max(np.abs(x / sizes.x), initial=0.0))
        ):
            continue
        own, tangents = sizes.x[list(form.independent)], _tangent(form, L)
        A, T = _matrix(form, L, sizes, x, u, p), tangents(x, u, p)
        even, tangent = sizes.time * _by(A, sizes.state, sizes.state), _by(T, sizes.state, own)
        ignorable = _ignorable(
            even, {j: tangent[:, k] for k, j in enumerate(form.independent) if j in cyclic}
        )
        rows = [i for i in range(len(A)) if i not in ignorable]
        columns = [k for k, j in enumerate(form.independent) if j not in ignorable]
        later = _by(tangents(_later(form, sizes, x, u, p), u, p), sizes.state, own)
        turned = np.abs(later - tangent)[np.ix_(rows, columns)]
        if np.max(turned, initial=0.0) > CONSTANT * np.max(np.abs(tangent), initial=0.0):
            continue
        minimal = ca.Function(
            "A", [a.symbols for a in form.equations.arguments], [ca.densify(form.A)]
        )(0.0, x, u, p).full()
        minimal = sizes.time * _by(minimal, own, own)
        coordinates = tuple(c.name for c in system.model.coordinates)
        states = tuple((*coordinates, *names)[i] for i in rows)
        compared = _compared(
            states,
            even[np.ix_(rows, rows)],
            tangent[np.ix_(rows, columns)],
            minimal[np.ix_(columns, columns)],
        )
        return replace(compared, A=A[np.ix_(rows, rows)])
    raise AssumptionError(
        "neither the generalized velocities nor the rates of the coordinates, and what the "
        "constraints leave of them, are constant along this motion"
    )


def _sizes(form: Linear, names: tuple[str, ...]) -> Sizes:
    system = form.equations.system
    model, own, nq = system.model, scales(system.model), system.q.numel()
    q, v = (
        own.all_of(item.unit for item in items) for items in (model.coordinates, model.velocities)
    )
    s = v if names == tuple(item.name for item in model.velocities) else q / own.time
    return Sizes(q, v, s, own.all_of(form.equations.arguments[1].units[nq:]), own.time, own.power)


def _by(matrix: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """A matrix that takes `columns` to `rows`, in these units."""
    return matrix * columns / rows[:, None]


def _ignorable(A: np.ndarray, cyclic: dict[int, np.ndarray]) -> set[int]:
    """Those of the cyclic coordinates (with their columns of T) that are cyclic in these velocities
    too: rates in ground axes know where they point."""
    left = set(cyclic)
    while True:
        rows = [i for i in range(len(A)) if i not in left]
        slopes = {j: np.abs(np.concatenate([A[rows, j], cyclic[j][rows]])) for j in left}
        lost = {j for j in left if np.any(slopes[j] > CONSTANT * np.max(np.abs(A)))}
        if not lost:
            return left
        left -= lost


def _velocities(system: System) -> list[tuple[ca.SX, tuple[str, ...]]]:
    """s = L v: the generalized velocities, and the rates where they are as many."""
    model = system.model
    bases = [(ca.SX.eye(system.v.numel()), tuple(v.name for v in model.velocities))]
    if system.q.numel() == system.v.numel():
        bases.append((system.N, tuple(f"der({c.name})" for c in model.coordinates)))
    return bases


def _at(form: Linear, value: ca.SX) -> ca.SX:
    """An expression of v over w."""
    v = form.equations.function("velocity").result.value
    return ca.substitute(value, form.equations.system.v, v)


def _later(form: Linear, sizes: Sizes, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The state a tenth of the model's own time later, or where no coordinate has gone by more than
    a tenth of its unit: coordinates go on at their rates."""
    function = form.equations.function("dynamics")
    rates = ca.Function("f", [a.symbols for a in form.equations.arguments], [function.result.value])
    moved = rates(0.0, x, u, p).full().ravel() * sizes.time
    moved[len(sizes.q) :] = 0.0
    return x + 0.1 * moved / max(1.0, float(np.max(np.abs(moved / sizes.x), initial=0.0)))


def _rates(form: Linear, L: ca.SX, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
    """ṡ along the motion."""
    symbols = [a.symbols for a in form.equations.arguments]
    f = form.equations.function("dynamics").result.value
    s = ca.mtimes(_at(form, L), _at(form, form.equations.system.v))
    return ca.Function("sdot", symbols, [ca.jtimes(s, symbols[1], f)])(0.0, x, u, p).full().ravel()


def _tangent(form: Linear, L: ca.SX) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """δ(q, s) per minimal state."""
    symbols = [a.symbols for a in form.equations.arguments]
    s = ca.mtimes(_at(form, L), _at(form, form.equations.system.v))
    nq = form.equations.system.q.numel()
    function = ca.Function(
        "T",
        symbols,
        [ca.densify(ca.vertcat(form.T[:nq, :], ca.mtimes(ca.jacobian(s, symbols[1]), form.T)))],
    )

    def at(x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """The function as a plain matrix at t = 0: a steady motion does not depend on the time."""
        return function(0.0, x, u, p).full()

    return at


def _matrix(
    form: Linear, L: ca.SX, sizes: Sizes, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """∂(q̇, ṡ)/∂(q, s) of the multiplier equations, by the implicit function theorem at the
    motion's own v̇ and λ."""
    system = form.equations.system
    nq, nv, nc = system.q.numel(), system.v.numel(), len(system.rows)
    vdot, lam = ca.SX.sym("vdot", nv), ca.SX.sym("lam", nc)
    balance = ca.mtimes(system.M, vdot) + system.h - system.Q - ca.mtimes(system.A.T, lam)
    row = ca.mtimes(system.A, vdot) - system.beta
    state, rest = ca.vertcat(system.q, system.v), ca.vertcat(vdot, lam)
    residual = ca.vertcat(balance, row)
    sdot = ca.mtimes(L, vdot) + ca.jtimes(ca.mtimes(L, system.v), system.q, system.qdot)
    forces = ca.jacobian(residual, state)
    if form.across is not None:
        forces = mean_of_sides(forces, state, _across(form, form.across, x, u, p))
    values = [
        residual,
        ca.jacobian(residual, rest),
        forces,
        ca.jacobian(sdot, state),
        L,
    ]
    values += [ca.jacobian(system.qdot, state), ca.jacobian(ca.mtimes(L, system.v), system.q)]
    function = ca.Function(
        "kkt",
        [system.t, system.q, system.v, rest, system.u, system.p],
        [ca.densify(value) for value in values],
    )
    velocity = (
        ca.Function("v", [a.symbols for a in form.equations.arguments], [_at(form, system.v)])(
            0.0, x, u, p
        )
        .full()
        .ravel()
    )
    at = (0.0, x[:nq], velocity)
    residual0, start, *_ = (m.full() for m in function(*at, np.zeros(nv + nc), u, p))
    solution = -_solved(start, residual0, sizes).ravel()
    terms: list[NDArray[np.float64]] = [m.full() for m in function(*at, solution, u, p)]
    _, K, slope, direct, Ln, rates, turn = terms
    accelerations = -_solved(K, slope, sizes)[:nv]
    G = np.vstack([rates, direct + Ln @ accelerations])  # over (δq, δv)
    # s = L(q) v: at held s a change of q changes v as well
    at_rest = np.linalg.solve(Ln, turn)
    inverse = np.linalg.inv(Ln)
    into = np.block([[np.eye(nq), np.zeros((nq, nv))], [-at_rest, inverse]])
    return G @ into


def _across(
    form: Linear, way: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray
) -> np.ndarray:
    """In (q, v) the way across kinks that is given in x."""
    symbols = [a.symbols for a in form.equations.arguments]
    v = _at(form, form.equations.system.v)
    moved = ca.Function("across", symbols, [ca.mtimes(ca.jacobian(v, symbols[1]), way)])
    return np.append(way[: form.equations.system.q.numel()], moved(0.0, x, u, p).full().ravel())


def _solved(K: np.ndarray, right: np.ndarray, sizes: Sizes) -> np.ndarray:
    """K⁻¹ right, the least one where rows of A repeat each other; K = [M −Aᵀ; A 0] in the model's
    own units with even rows."""
    nv = len(sizes.v)
    rows = _row_sizes(K[nv:, :nv] * sizes.v)
    given = np.append(sizes.power / sizes.v, rows / sizes.time)
    sought = np.append(sizes.v / sizes.time, sizes.power / rows)
    return (
        sought[:, None]
        * np.linalg.lstsq(_by(K, given, sought), right / given[:, None], rcond=None)[0]
    )


def _row_sizes(matrix: np.ndarray) -> np.ndarray:
    """The largest entry of each row; that of the whole where a row is made of rounding, for scaled
    up it would say something."""
    rows = np.max(np.abs(matrix), axis=1, initial=0.0)
    whole = float(np.max(rows, initial=0.0)) or 1.0
    return np.where(rows > ROUNDED * whole, rows, whole)


def _compared(
    states: tuple[str, ...], A: np.ndarray, T: np.ndarray, minimal: np.ndarray
) -> Unreduced:
    """A T = T A_min, and what A does across the tangent space."""
    difference = float(
        np.max(np.abs(A @ T - T @ minimal), initial=0.0) / (np.max(np.abs(A), initial=0.0) or 1.0)
    )
    Z = np.linalg.svd(T)[0][:, T.shape[1] :]
    block = Z.T @ A @ Z
    size = float(np.max(np.abs(A), initial=0.0)) or 1.0
    return Unreduced(
        states, A, difference, block.shape[0], float(np.linalg.norm(block @ block)) / size**2
    )


def constraint_counts(system: System, q: np.ndarray, p: np.ndarray) -> tuple[int, int]:
    """(m_h, m_n): independent position rows at q, and how many more independent velocity rows there
    are. The minimal form has 2n − 2 m_h − m_n states, n coordinates."""
    own, model = scales(system.model), system.model
    sizes = (
        own.all_of(item.unit for item in items) for items in (model.coordinates, model.velocities)
    )
    values = (ca.jacobian(position_rows(system), system.q), system.A)
    ranks: list[int] = []
    for value, columns in zip(values, sizes):
        matrix = (
            ca.Function("rows", [system.t, system.q, system.own_p], [ca.densify(value)])(
                0.0, q, p
            ).full()
            * columns
        )
        even = matrix / _row_sizes(matrix)[:, None]
        ranks.append(int(np.linalg.matrix_rank(even, tol=SAME_ROWS)) if matrix.size else 0)
    holonomic = ranks[0] - len(system.quaternions)
    return holonomic, ranks[1] - holonomic
