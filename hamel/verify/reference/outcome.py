"""The independent reference: Newton–Euler equations of every body with multipliers, solved as
numbers.

Made from the Model alone. Unknowns: ż = (v̇, acceleration of each body) and a multiplier for each
joint and constraint row,

    [K  Gᵀ] [ ż]   [F]        K: analytic inertia and body inertias, F: all forces less the
    velocity-dependent ones, [G  0 ] [−μ] = [γ]        G: joint rows above constraint rows, μ =
    (joint wrenches, λ).

The joint rows are eliminated first, six by six from the base to the tips, which leaves v̇ and λ: ż
= (v̇, J v̇ + drift). Nothing here passes through derive.mechanics, derive.joints or CasADi.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, NoReturn

import numpy as np

from derive.expressions.tree import Expression
from derive.model.constraint_records import Holonomic, Nonholonomic, OnSurface
from derive.model.load_records import Armature
from derive.model.records import GROUND, Model
from derive.model.rows import row_names
from hamel.verify.limits import ROUNDING, UNDONE
from hamel.verify.reference import analytic as by_formula
from hamel.verify.reference.layout import Layout, Rows, layout, stacked
from hamel.verify.reference.loads import (
    Applied,
    Lagrange,
    applied,
    body_inertia,
    names_in,
    shrinking,
    uses_reactions,
    weight,
)
from hamel.verify.reference.measures import values
from hamel.verify.reference.rows import RowsOf, constraint_rows, joint_blocks
from hamel.verify.reference.saddle import least_eigenvalue, left_over, rank_of, saddle, solved
from hamel.verify.reference.states import STILL, State, state
from hamel.verify.reference.stores import charging, stored
from hamel.verify.reference.vectors import Array


@dataclass(frozen=True)
class Reference:
    """A model made ready for evaluation; `lagrange` and `constraints` are compiled once."""

    model: Model
    place: Layout
    parts: tuple[RowsOf, ...]  # rows of each closure, then of each constraint
    lagrange: Callable[[State], Lagrange]

    def constraints(self, s: State) -> Rows:
        """The rows of all closures and constraints, in the model's order."""
        return stacked([part(s) for part in self.parts], self.place.size)


@dataclass(frozen=True)
class Kinematics:
    """Velocity level at one state: twists = J v (6 nb × nv), A v = c, φ; `drift` are the twist
    rates at v̇ = 0."""

    N: Array
    J: Array
    drift: Array
    A: Array
    c: Array
    beta: Array
    phi: Array
    excess: Array  # φ to first order: what a step along the rows has to take away

    def violation(self, v: Array) -> Array:
        """A v − c, in the units of each row; zero at admissible states."""
        return self.A @ v - self.c


class Energies(NamedTuple):
    """In J; `total` is T + V or, with terms not quadratic in the rates, T₂ − T₀ + V."""

    T: float
    V: float
    total: float


@dataclass(frozen=True)
class Summed:
    """The sizes of what some results are sums of: where these cancel, rounding of this size is
    left."""

    M: Array  # nv, of the diagonal
    force: Array  # nv, of h and Q but for velocity products
    V: float


@dataclass(frozen=True)
class Outcome:
    """What the reference says at one state. vdot nv, lam nc.

    M v̇ + h = Q + Aᵀ λ, A v̇ = β and q̇ = N v, in SI, h and Q along the generalized velocities v.
    """

    vdot: Array
    qdot: Array
    lam: Array
    kinematics: Kinematics
    M: Array  # nv × nv, Jᵀ K J
    h: Array  # nv, velocity products, gravity and the model's `potential`
    Q: Array  # nv, everything else that is applied: M v̇ + h = Q + Aᵀ λ
    T: float
    V: float
    energy: float  # T + V or, with terms not quadratic in the rates, Jacobi's integral T₂ − T₀ + V
    power: float  # of forces without a potential, and ∂(V − T)/∂t: d(energy)/dt = power + λᵀ c
    zdot: Array  # rates of the first-order states
    rank: int  # of A
    residual: float  # of the solved system, relative
    summed: Summed

    @property
    def least_inertia(self) -> Array:
        """What rounding may leave of the diagonal of M, per unit of the tolerance that definiteness
        is held to."""
        return ROUNDING / UNDONE * self.summed.M

    @property
    def admissible(self) -> bool:
        """Whether M has no negative eigenvalue: parameters varied one by one may be no
        machine's."""
        return least_eigenvalue(self.M, self.least_inertia) >= -UNDONE

    @property
    def force(self) -> Array:
        """Q − h."""
        return self.Q - self.h

    @property
    def constraint_force(self) -> Array:
        """Aᵀ λ, unique even where λ is not."""
        return self.kinematics.A.T @ self.lam


def reference(model: Model) -> Reference:
    """Differentiate what the model gives as formulas with SymPy, once; a pure mechanism never loads
    SymPy."""
    analytic = model.kinetic is not None or model.potential is not None
    formulas = any(
        isinstance(item, Holonomic | Nonholonomic | OnSurface) for item in model.constraints
    )
    if not (analytic or formulas):
        return Reference(
            model,
            layout(model),
            constraint_rows(model, _no_formulas),
            _no_energies,
        )
    s = by_formula.symbols(model)
    place = layout(model)
    energies_of = by_formula.lagrange(model, s, place) if analytic else _no_energies
    return Reference(
        model,
        place,
        constraint_rows(model, lambda item: by_formula.rows(item, s, place)),
        energies_of,
    )


def _no_formulas(item: object) -> NoReturn:
    raise AssertionError(f"{item} is a formula")


def _no_energies(state: State) -> Lagrange:
    nv = len(state.v)
    return Lagrange(np.zeros((nv, nv)), np.zeros(nv), 0.0, 0.0, 0.0, 0.0)


def defaults(model: Model) -> Array:
    """The parameters' own values, in the model's order, and zero for first-order states."""
    own = [parameter.value for parameter in model.parameters]
    return np.array([*own, *(0.0 for _ in model.states)])


def state_of(
    ref: Reference, t: float, q: Array, v: Array, u: Array | None = None, p: Array | None = None
) -> State:
    """The state (t, q, v, u, p) spelled out, p with first-order states at its end; missing inputs
    are zero, missing parameters their defaults."""
    u = np.zeros(len(ref.model.inputs)) if u is None else u
    p = defaults(ref.model) if p is None else p
    q, v, u, p = (np.asarray(x, dtype=float) for x in (q, v, u, p))
    return state(ref.model, float(t), q, v, u, p, partial(values, ref.model))


def kinematics(ref: Reference, s: State) -> Kinematics:
    """Twists and twist rates as functions of v and v̇, from the base to the tips; then the
    constraint rows in v.

    X_c ẋ_c = X_p ẋ_p + E H v̇ + γ of each joint gives J and drift of the child from those of the
    parent. Rows G_v v̇ + G_z ż = γ become A = G_v + G_z J and β = γ − G_z drift.
    """
    nv = ref.place.nv
    J, drift = np.zeros((ref.place.size - nv, nv)), np.zeros(ref.place.size - nv)
    for seat in s.seats:
        of_child, of_parent, gamma = joint_blocks(seat, s)
        moved = np.zeros((6, nv + 1))
        moved[:, seat.columns], moved[:, nv] = seat.twists, gamma
        if seat.joint.parent != GROUND:
            above = ref.place.row(seat.joint.parent)
            moved += of_parent @ np.column_stack([J[above], drift[above]])
        # six by six, and regular: the joint's frame moves with its child as one body
        here, solution = ref.place.row(seat.joint.child), np.linalg.solve(of_child, moved)
        J[here], drift[here] = solution[:, :nv], solution[:, nv]
    rows = ref.constraints(s)
    over_v, over_twists = rows.coefficients[:, :nv], rows.coefficients[:, nv:]
    A, summed = over_v + over_twists @ J, np.abs(over_v) + np.abs(over_twists) @ np.abs(J)
    A[left_over(A, summed)] = 0.0  # what a piece that is rigid by its joints does not forbid again
    return Kinematics(
        s.N, J, drift, A, rows.c, rows.gamma - over_twists @ drift, rows.phi, rows.excess
    )


def energies(ref: Reference, s: State) -> Energies:
    """T and V (J): ½ m |v_com|² + ½ ω · I ω of every body, rotors and the analytic T; gravity,
    springs and the analytic V. And what is in balance with the power, T₂ − T₀ + V."""
    return _energies(ref, s, ref.lagrange(s), _bodies(ref, s))


def _energies(ref: Reference, s: State, analytic: Lagrange, bodies: Bodies) -> Energies:
    T = sum(0.5 * twist @ (own @ twist) for twist, own, _ in bodies) + 0.5 * rotors(ref, s) @ s.v**2
    T = float(T) + analytic.T
    V = applied(ref.model, ref.place, s, nonideal=False).V + analytic.V + stored(ref.model, s)
    return Energies(T, V, T + V - analytic.odd)


def evaluate(ref: Reference, s: State) -> Outcome:
    """Solve [M Aᵀ; A 0] [v̇; −λ] = [Q − h; β] for v̇ and λ at one state; twice where a
    force uses a reaction of the ideal problem, which is put under the names reaction.ROW.

    Raises numpy.linalg.LinAlgError where this has no solution, or the state is no number any more.
    """
    return _evaluated(ref, with_reactions(ref, s), nonideal=True)


def with_reactions(ref: Reference, s: State) -> State:
    """The state with reaction.ROW of the ideal problem among its names, where forces use any."""
    if not _uses_reactions(ref.model):
        return s
    ideal = _evaluated(ref, s, nonideal=False)
    return replace(s, names=s.names | _reactions(ref, ideal.lam))


def still_forces(ref: Reference, s: State) -> Array:
    """h at rest (nv), of the positions of a state. Loads are left out, with the definitions that
    they alone use: h has none of them, and at rest some have no value (tyres slip by 0/0)."""
    bare = replace(ref, model=_without_loads(ref.model))
    still = state_of(bare, s.t, s.q, np.zeros_like(s.v), s.u, s.p)
    kin, bodies = kinematics(bare, still), _bodies(bare, still)
    gravity = weight(bare.model, bare.place, still)
    return _own_forces(bare, bare.lagrange(still), gravity, kin, bodies)


def _without_loads(model: Model) -> Model:
    """And without the definitions that neither bodies nor what holds them use."""
    holding = (model.gravity, model.bodies, model.joints, model.closures, model.constraints)
    used = set(names_in((*holding, model.frames, model.paths, model.measures)))
    kept: list[tuple[str, Expression]] = []
    for name, formula in reversed(model.definitions):  # each uses earlier ones
        if name in used:
            used.update(names_in(formula))
            kept.append((name, formula))
    return replace(model, loads=(), definitions=tuple(reversed(kept)))


def _uses_reactions(model: Model) -> bool:
    own = [x.nonideal for x in model.constraints if isinstance(x, Holonomic | Nonholonomic)]
    return uses_reactions((*own, *model.loads))


def _reactions(ref: Reference, lam: Array) -> dict[str, float]:
    """reaction.ROW of every row; they stand in the model's order, closures first."""
    return {f"reaction.{row}": float(x) for row, x in zip(row_names(ref.model), lam)}


def _evaluated(ref: Reference, s: State, nonideal: bool) -> Outcome:
    analytic, loads, kin = (
        ref.lagrange(s),
        applied(ref.model, ref.place, s, nonideal),
        kinematics(ref, s),
    )
    bodies, nv = _bodies(ref, s), ref.place.nv
    M, h = _mass(ref, s, kin, bodies), _own_forces(ref, analytic, loads.weight, kin, bodies)
    Q = _over_v(kin, loads.springs + loads.other)
    rank = rank_of(kin.A)
    solution, residual = solved(
        saddle(M, kin.A), np.concatenate([Q - h, kin.beta]), redundant=rank < len(kin.A)
    )
    # the saddle matrix is symmetric with −λ as its unknown
    vdot, lam = solution[:nv], -solution[nv:]
    z = np.concatenate([s.v, kin.J @ s.v])
    zdot = s.vector([state.rate for state in ref.model.states])
    power = float(loads.other @ z) + analytic.power + charging(ref.model, s, zdot)
    power += shrinking(ref.model, ref.place, s)
    T, V, energy = _energies(ref, s, analytic, bodies)
    return Outcome(
        vdot=vdot, qdot=s.rates, lam=lam, kinematics=kin, M=M, h=h, Q=Q,
        T=T, V=V, energy=energy, power=power, zdot=zdot, rank=rank, residual=residual,
        summed=_summed(ref, analytic, loads, kin, bodies),
    )  # fmt: skip


def _summed(
    ref: Reference, analytic: Lagrange, loads: Applied, kin: Kinematics, bodies: Bodies
) -> Summed:
    J, nv = np.abs(kin.J), ref.place.nv
    # the same sums with all signs positive: how large the parts are that may cancel
    sizes = [(abs(twist), abs(inertia), abs(wrench)) for twist, inertia, wrench in bodies]
    mass = np.einsum("ij,ij->j", J, _inertial(sizes, J)) + np.abs(np.diag(analytic.inertia))
    forces = np.abs(loads.weight) + np.abs(loads.springs) + np.abs(loads.other)
    inertial = _inertial(sizes, np.abs(kin.drift)[:, None])[:, 0]
    turning = np.concatenate([wrench for _, _, wrench in sizes]) if sizes else np.zeros(0)
    forces[: len(analytic.force)] += np.abs(analytic.force)
    force = forces[:nv] + J.T @ (forces[nv:] + inertial + turning)
    return Summed(mass, force, loads.summed + abs(analytic.V))


def _over_v(kin: Kinematics, force: Array) -> Array:
    """Generalised force along v of a force along z: f_v + Jᵀ f_twists."""
    nv = kin.J.shape[1]
    return force[:nv] + kin.J.T @ force[nv:]


Bodies = list[tuple[Array, Array, Array]]


def _bodies(ref: Reference, s: State) -> Bodies:
    """(twist, inertia, velocity-dependent wrench) of every body."""
    frames = [s.frames.get(body.name, STILL) for body in ref.model.bodies]
    twists = [np.concatenate([frame.omega, frame.velocity]) for frame in frames]
    return [(twist, *body_inertia(body, s)) for twist, body in zip(twists, ref.model.bodies)]


def _inertial(bodies: Bodies, rates: Array) -> Array:
    """Each body's inertia times its rows of `rates`, 6 nb × k."""
    own = np.array([inertia for _, inertia, _ in bodies]).reshape(-1, 6, 6)
    return (own @ rates.reshape(-1, 6, rates.shape[1])).reshape(rates.shape)


def rotors(ref: Reference, s: State) -> Array:
    """Inertia of the rotors that turn with each generalized velocity, nv."""
    result = np.zeros(ref.place.nv)
    names = [velocity.name for velocity in ref.model.velocities]
    for load in ref.model.loads:
        if isinstance(load, Armature):
            result[names.index(load.velocity)] += s.value(load.inertia)
    return result


def mass(ref: Reference, s: State, kin: Kinematics) -> Array:
    """M (nv × nv) = Jᵀ K J, analytic inertia and rotors included."""
    return _mass(ref, s, kin, _bodies(ref, s))


def _mass(ref: Reference, s: State, kin: Kinematics, bodies: Bodies) -> Array:
    return ref.lagrange(s).inertia + np.diag(rotors(ref, s)) + kin.J.T @ _inertial(bodies, kin.J)


def _own_forces(
    ref: Reference, analytic: Lagrange, gravity: Array, kin: Kinematics, bodies: Bodies
) -> Array:
    """h (nv): what inertia demands at v̇ = 0, less gravity and what the formulas give."""
    along_z = np.array(gravity)
    along_z[: len(analytic.force)] += analytic.force
    for body, (_, _, gyroscopic) in zip(ref.model.bodies, bodies):
        along_z[ref.place.twist(body.name)] -= gyroscopic
    return kin.J.T @ _inertial(bodies, kin.drift[:, None])[:, 0] - _over_v(kin, along_z)
