"""The functions of the generated module that do not depend on the formulation: what v, λ and ẋ are
is handed in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.choices.records import Frame, Guard
from derive.choices.redundancy import keeps
from derive.expressions.deferred import Deferred, Term, is_deferred
from derive.expressions.scalars import Vector
from derive.formulations.configuration import configuration, is_plain
from derive.formulations.limits import CLOSED, MOST_STEPS, PER_RADIAN, USUAL
from derive.formulations.multipliers import bordered_solution
from derive.formulations.records import Argument, Function, Iteration, Result
from derive.formulations.rolled import recursion
from derive.mechanics.loops.records import Recursion
from derive.mechanics.records import Named, System
from derive.mechanics.system import inertial_forces
from derive.numerics import NONZERO
from derive.states.closing import Kinematics, nominal


@dataclass(frozen=True)
class Minimal:
    """v = S w + R c, v̇ = S ẇ + σ and what is left of the equations, mass ẇ = force: mass = Sᵀ M S,
    force = Sᵀ (Q − h − M σ). A, c, β and λ are of the independent rows."""

    S: ca.SX
    sigma: ca.SX
    A: ca.SX
    c: ca.SX
    beta: ca.SX
    lam: ca.SX
    R: Term[ca.SX] = Term()
    mass: Term[ca.SX] = Term()
    force: Term[ca.SX] = Term()


@dataclass(frozen=True)
class Motion:
    """What a formulation found, over (t, q, w, u, p)."""

    w: ca.SX
    names: tuple[str, ...]
    units: tuple[str, ...]
    B: ca.SX
    v: ca.SX
    qdot: ca.SX
    lam: ca.SX
    guards: tuple[Guard, ...]  # of v
    solving: tuple[Guard, ...]  # of ẇ and λ beyond those
    named: tuple[Named, ...]
    kept: tuple[int, ...]  # independent constraint rows
    closing: tuple[int, ...]  # independent rows among the holonomic ones
    projects_velocity: bool
    wdot: Term[ca.SX] = Term()
    vdot: Term[ca.SX] = Term()
    frame: Frame | None = None
    minimal: Minimal | None = None  # none where w are all of v, held by forces


def arguments(system: System, motion: Motion) -> tuple[Argument, ...]:
    """The slots t (s), x = (q, w, z), u and p with labels and SI units. A frame of directions,
    where the choice has one, stands behind the model's own parameters."""
    model = system.model
    free = system.given[: len(system.own_parameters)]
    return (
        Argument("t", system.t, ("t",), ("s",)),
        Argument(
            "x",
            ca.vertcat(system.q, motion.w, system.z),
            labels_of_state(system, motion),
            units_of_state(system, motion),
        ),
        Argument(
            "u", system.u, tuple(i.name for i in model.inputs), tuple(i.unit for i in model.inputs)
        ),
        with_frame(
            Argument(
                "p",
                system.p[: len(free), 0],
                tuple(x.name for x in free),
                tuple(x.unit for x in free),
            ),
            motion.frame,
        ),
    )


def labels_of_state(system: System, motion: Motion) -> tuple[str, ...]:
    """Names of the entries of x = (q, w, z)."""
    model = system.model
    own = (*(c.name for c in model.coordinates), *motion.names)
    return (*own, *(x.name for x in model.states))


def units_of_state(system: System, motion: Motion) -> tuple[str, ...]:
    """SI units of the entries of x = (q, w, z)."""
    model = system.model
    own = (*(c.unit for c in model.coordinates), *motion.units)
    return (*own, *(x.unit for x in model.states))


def with_frame(p: Argument, frame: Frame | None) -> Argument:
    """The parameters with the frame behind them."""
    if frame is None:
        return p
    return replace(
        p,
        symbols=ca.vertcat(p.symbols, frame.symbols),
        labels=(*p.labels, *frame.labels),
        units=(*p.units, *("" for _ in frame.labels)),
    )


def functions(system: System, motion: Motion) -> tuple[Function, ...]:
    """The functions of the module in the order they stand in the generated code: dynamics, mass,
    bias, inverse_dynamics, constraints, project, reactions, energy, power, outputs, events,
    velocity, state, and those of the configuration. What the model has no use for is absent."""
    result = [
        _dynamics(system, motion),
        _mass(system) if system.written else None,
        _bias(system, motion),
        _inverse_dynamics(system, motion),
        _constraints(system, motion),
        _project(system, motion),
        _reactions(system, motion),
        _energy(system, motion),
        _power(system, motion),
        outputs_of(system, motion),
        _events(system, motion),
        _velocity(system, motion),
        _state(system, motion),
        *([] if is_plain(system) else [request.function for request in configuration(system)]),
    ]
    return tuple(function for function in result if function is not None)


def at_motion(system: System, motion: Motion, expression: ca.SX) -> ca.SX:
    """An expression of v over w, v = S w + R c."""
    return ca.substitute(expression, system.v, motion.v)


def _dynamics(system: System, motion: Motion) -> Function:
    """ẋ = (q̇, ẇ, ż), guarded by the pivots of v and those that ẇ was divided by."""
    labels = [f"der({name})" for name in labels_of_state(system, motion)]
    units = [per_second(unit) for unit in units_of_state(system, motion)]

    def value() -> ca.SX:
        return ca.vertcat(motion.qdot, motion.wdot, at_motion(system, motion, system.zdot))

    late = is_deferred(motion, "wdot")
    given = Deferred(value, len(labels)) if late else value()
    result = Result("xdot", given, tuple(labels), tuple(units))
    about = "state derivative: q̇ = N v, " + (_BASE if motion.projects_velocity else _REDUCED)
    about += ", ż as the model gives it" if system.model.states else ""
    guards = (*motion.guards, *motion.solving)
    loops = as_loops(system, motion, "dynamics")
    return Function("dynamics", about, result, motion.named, guards, recursion=loops)


def as_loops(system: System, motion: Motion, function: str) -> Callable[[], Recursion]:
    """The function as loops over links. What is called raises AssumptionError where it does not
    fit."""
    regular = not (motion.guards or motion.solving)
    direct = motion.minimal is not None and regular and is_unit(motion.B)
    other = "" if direct else "its velocities are not those of the joints"
    other = "it has first-order states" if system.model.states else other
    return functools.cache(lambda: recursion(system, function, other))


def is_unit(S: ca.SX) -> bool:
    """Exactly the unit matrix."""
    return S.is_square() and bool((S - ca.SX.eye(S.size1())).is_zero())


_BASE = "v̇ from M v̇ + h = Q + Aᵀ λ and A v̇ = β"
_REDUCED = "ẇ from (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ)"


def per_second(unit: str) -> str:
    """The unit of a rate: m/s of m, m/s^2 of m/s."""
    if unit.endswith("/s"):
        return f"{unit}^2"
    return f"{unit}/s" if unit and unit != "1" else "1/s"


def _formed(system: System, size: int, make: Callable[[], ca.SX]) -> ca.SX | Deferred[ca.SX]:
    """Now, or for a long tree on demand."""
    return Deferred(make, size) if system.long else make()


def _mass(system: System) -> Function:
    names = tuple(v.name for v in system.model.velocities)
    return Function(
        "mass",
        "mass matrix M(q) of the generalized velocities v, nv × nv",
        Result("M", ca.densify(system.M), names, (), matrix=True),
    )


def _bias(system: System, motion: Motion) -> Function:
    """h(q, v) with v = S w + R c put in: gravity and velocity products, no applied forces."""
    names = tuple(v.name for v in system.model.velocities)
    about = (
        "bias h(q, v) of the generalized velocities: velocity products, gravity and "
        "potential forces, M v̇ + h = Q + Aᵀ λ"
    )
    value = _formed(system, len(names), lambda: at_motion(system, motion, system.h))
    guards = _used(motion, system.h, system) if motion.guards else ()
    result = Result("h", value, names, ())
    loops = as_loops(system, motion, "bias")
    return Function("bias", about, result, guards=guards, recursion=loops)


def _inverse_dynamics(system: System, motion: Motion) -> Function:
    """(q, v, z, v̇) → M v̇ + h − Q at u = 0: what actuators and constraints have to supply, by
    Newton–Euler alone."""
    model, nv = system.model, system.v.numel()
    vdot = ca.vertcat(*[ca.SX.sym(f"d_{v.name}") for v in model.velocities]) if nv else ca.SX(0, 1)
    names = tuple(v.name for v in model.velocities)
    known = _in_velocities(system)
    taken = Argument(
        "x",
        ca.vertcat(known.symbols, vdot),
        (*known.labels, *(f"der({name})" for name in names)),
        (*known.units, *(per_second(v.unit) for v in model.velocities)),
    )

    def forces() -> ca.SX:
        # the inputs are what inverse dynamics is asked for; springs, dampers and friction stay
        idle = ca.substitute(system.Q, system.u, ca.SX.zeros(system.u.numel()))
        inertial = inertial_forces(system, vdot) + ca.mtimes(system.M_extra, vdot)
        return inertial + system.h_extra - idle

    value = _formed(system, nv, forces)
    label = "(q, v, z, v̇)" if model.states else "(q, v, v̇)"
    about = f"forces conjugate to v that give v̇: M v̇ + h − Q at u = 0, from {label}"
    result = Result("tau", value, names, ())
    loops = as_loops(system, motion, "inverse_dynamics")
    return Function("inverse_dynamics", about, result, x=taken, recursion=loops)


def _in_velocities(system: System) -> Argument:
    """(q, v, z) in the slot of x."""
    model = system.model
    moving = (*model.coordinates, *model.velocities, *model.states)
    symbols = ca.vertcat(system.q, system.v, system.z)
    return Argument(
        "x", symbols, tuple(item.name for item in moving), tuple(item.unit for item in moving)
    )


def _used(motion: Motion, expression: ca.SX, system: System) -> tuple[Guard, ...]:
    """The guards matter where v does, because v = S w + R c needs the pivots."""
    return motion.guards if ca.depends_on(expression, system.v) else ()


def positions(system: System) -> int:
    """How many of the leading rows of `constraints` are about positions: φ, then the lengths of
    quaternions. The rest are velocities, A v − c."""
    return system.phi.numel() + len(system.quaternions)


def _constraints(system: System, motion: Motion) -> Function | None:
    """φ, |q|² − 1 of quaternions, A v − c: zero at admissible states. In quasi-velocities the last
    part is zero up to rounding, which makes it a check of S and R."""
    if not system.rows and not system.quaternions:
        return None
    velocity = ca.mtimes(system.A, system.v) - system.c
    coordinates = system.model.coordinates
    labels = (
        *(f"phi {row.name}" for row in system.rows if row.position >= 0),
        *(f"length {coordinates[i].owner}" for i in system.quaternions),
        *(f"velocity {row.name}" for row in system.rows),
    )
    value = ca.vertcat(system.phi, _lengths(system), at_motion(system, motion, velocity))
    about = "constraint violation: φ(q, t), " + (
        "|q|² − 1 of each quaternion, then A v − c row by row"
        if system.quaternions
        else "then A v − c row by row"
    )
    return Function(
        "constraints",
        about,
        Result("violation", value, labels, ()),
        guards=_used(motion, velocity, system),
    )


def _project(system: System, motion: Motion) -> Function | None:
    """One Newton step onto φ = 0, nearest in the metric of M (or of 1 where M is singular): δ =
    −M⁻¹ Aᵀ (A M⁻¹ Aᵀ)⁻¹ φ; quaternions are brought to length one.
    """
    closing = list(motion.closing)
    if not closing and not system.quaternions and not (motion.projects_velocity and motion.kept):
        return None
    q = system.q + _position_step(system, closing) if closing else system.q
    sizes = _sizes(system) if closing else []
    positions = [system.rows[i].position for i in closing]
    turned = _turned(system, positions)
    violation = [
        (system.phi[k] if sizes[k] == 1.0 else system.phi[k] / sizes[k]) / turned for k in positions
    ]
    w = motion.w
    if motion.projects_velocity and motion.kept:
        w, rest = _velocity_step(system, motion)
        violation += rest
    violation += ca.vertsplit(_lengths(system)) if system.quaternions else []
    about = "nearest consistent state: q on φ = 0" + (
        ", v on A v = c" if motion.projects_velocity else ", w kept"
    )
    about += ", z kept" if system.model.states else ""
    closed = ca.vertcat(_with_unit_quaternions(system, q), w, system.z)
    step = Result("x", closed, labels_of_state(system, motion), ())
    return Function(
        "project",
        about,
        step,
        iteration=Iteration(CLOSED, MOST_STEPS),
        residual=_largest(violation),
    )


def _lengths(system: System) -> ca.SX:
    """|q|² − 1 of each quaternion."""
    # squares: no root, and regular at every quaternion but zero
    lengths = [ca.sumsqr(system.q[i : i + 4]) - 1 for i in system.quaternions]
    return ca.vertcat(*lengths) if lengths else ca.SX(0, 1)


def _turned(system: System, positions: list[int]) -> ca.SX:
    """How much of φ is rounding where angles have turned many times: each power of ten costs a
    digit. 1 up to 1,000 rad."""
    angles = [system.q[i] for i, c in enumerate(system.model.coordinates) if c.unit == "rad"]
    closed = ca.vertcat(*[system.phi[k] for k in positions])
    symbols = {symbol.element_hash() for symbol in ca.symvar(closed)} if positions else set[int]()
    involved = [angle for angle in angles if angle.element_hash() in symbols]
    return ca.fmax(1, PER_RADIAN * _largest(involved)) if involved else ca.SX(1)


def _sizes(system: System) -> list[float]:
    """How large the terms of each φ are at the initial values, as powers of ten; 1 where that is
    not far from one.

    A length of a megametre squared cannot be closed to 1e-13, and one of a micrometre would be
    closed too early.
    """
    q, p = nominal(system), np.array(system.parameters)
    J = Kinematics(system).closing_rows(np.zeros(1), q[None], p[None])[1].finite()
    lengths = [abs(x) for c, x in zip(system.model.coordinates, q) if c.unit == "m"]
    longest = max(lengths, default=0.0) or 1.0
    reach = [longest if v.unit == "m/s" else 1.0 for v in system.model.velocities]
    sizes: NDArray[np.float64] = abs(J) @ np.array(reach)
    powers = np.round(np.log10(np.maximum(sizes, NONZERO)))
    return [1.0 if abs(k) <= USUAL or k < -200 else float(f"1e{int(k)}") for k in powers]


def _with_unit_quaternions(system: System, q: ca.SX) -> ca.SX:
    entries = [q[i] for i in range(q.numel())]
    for start in system.quaternions:
        length = ca.sqrt(ca.sumsqr(q[start : start + 4]))
        entries[start : start + 4] = [x / length for x in entries[start : start + 4]]
    return ca.vertcat(*entries)


def _position_step(system: System, closing: list[int]) -> ca.SX:
    phi = [system.phi[system.rows[i].position] for i in closing]
    nothing: Vector = [0.0] * system.v.numel()
    # holonomic rows of A are φ_q N: a step over v that meets A δ = −φ, and q moves by N δ
    step = bordered_solution(metric(system), system.A[closing, :], nothing, [-x for x in phi])
    return ca.substitute(system.qdot, system.v, ca.vertcat(*step.x))


def _velocity_step(system: System, motion: Motion) -> tuple[ca.SX, list[ca.SX]]:
    """w + B δ with the least δ, in the metric of M, that brings A v to c: linear, so one step does
    it."""
    rows = list(motion.kept)
    violation = ca.mtimes(system.A[rows, :], system.v) - system.c[rows, :]
    violation = at_motion(system, motion, violation)
    entries = [violation[i] for i in range(len(rows))]
    step = bordered_solution(
        metric(system), system.A[rows, :], [0.0] * system.v.numel(), [-x for x in entries]
    )
    return motion.w + ca.mtimes(motion.B, ca.vertcat(*step.x)), entries


def metric(system: System) -> ca.SX:
    """The matrix in which a projection is nearest: M where it is positive definite for certain (no
    massless direction shows at the nominal values), else 1.

    In the metric of M the correction is the one that takes least kinetic energy, and it does not
    depend on the units of the coordinates.
    """
    return system.M if system.definite and system.written else ca.SX.eye(system.v.numel())


def _largest(entries: list[ca.SX]) -> ca.SX:
    result = ca.SX(0)
    for x in entries:
        result = ca.fmax(result, ca.fabs(x))
    return result


def _reactions(system: System, motion: Motion) -> Function | None:
    if not system.rows:
        return None
    about = (
        "multipliers λ of M v̇ + h = Q + Aᵀ λ: the force along each constraint row"
        + _of_repeated(system, motion)
    )
    names = tuple(row.name for row in system.rows)
    return Function(
        "reactions",
        about,
        Result("lam", motion.lam, names, ()),
        guards=(*motion.guards, *motion.solving),
    )


def _of_repeated(system: System, motion: Motion) -> str:
    if len(motion.kept) == len(system.rows):
        return ""
    return "; where rows repeat others, not unique: " + (
        "the least ones" if keeps(system) else "zero for those that are dropped"
    )


def _energy(system: System, motion: Motion) -> Function:
    """T, V (J), and Jacobi's integral where T has terms that are not quadratic in the rates."""
    about, labels = "kinetic and potential energy T, V", ("T", "V")
    if not system.homogeneous:
        about, labels = f"{about}, and {_JACOBI}", (*labels, INTEGRAL)

    def energies() -> ca.SX:
        own = [at_motion(system, motion, system.T), system.V]
        rest = [] if system.homogeneous else [at_motion(system, motion, system.energy)]
        return ca.vertcat(*own, *rest)

    value = _formed(system, len(labels), energies)
    guards = _used(motion, system.T, system) if motion.guards else ()
    return Function(
        "energy", about, Result("energy", value, labels, ("J",) * len(labels)), guards=guards
    )


INTEGRAL = "jacobi"  # label of Jacobi's integral, which `energy` gives where it is not T + V
_JACOBI = "Jacobi's integral T2 - T0 + V"


def _power(system: System, motion: Motion) -> Function:
    """d(T₂ − T₀ + V)/dt = Q·v of the forces without potential + ∂(V − T)/∂t + λᵀ c of constraints
    that move; T = T₂ + T₁ + T₀ by powers of the rates, most often T₂ alone."""
    power = at_motion(system, motion, system.power)
    moving = [
        i
        for i in range(len(system.rows))
        if not (system.c[i].is_constant() and float(system.c[i]) == 0)
    ]
    for i in moving:
        power = power + motion.lam[i] * system.c[i]
    guards = (*motion.guards, *motion.solving) if moving else _used(motion, system.power, system)
    return Function(
        "power",
        f"power of forces without potential: d({'T' if system.homogeneous else 'T2 - T0'} + V)/dt",
        Result("power", power, ("power",), ("W",)),
        guards=guards,
    )


def outputs_of(system: System, motion: Motion) -> Function | None:
    """The model's outputs over (t, x, u, p); None where it has none."""
    if not system.outputs:
        return None
    labels: list[str] = []
    units: list[str] = []
    values: list[ca.SX] = []
    for name, value, unit in system.outputs:
        count = value.numel()
        labels += [name] if count == 1 else [f"{name}[{k}]" for k in range(count)]
        units += [unit] * count
        values.append(at_motion(system, motion, value))
    value, guards = _with_multipliers(system, motion, ca.vertcat(*values))
    result = Result("y", value, tuple(labels), tuple(units))
    return Function("outputs", "the model's outputs", result, guards=guards)


def _with_multipliers(
    system: System, motion: Motion, value: ca.SX
) -> tuple[ca.SX, tuple[Guard, ...]]:
    """With λ in the place of reactions; and what has to be regular for it."""
    reactions = system.symbols.reactions([row.name for row in system.rows])
    solving = motion.solving if ca.depends_on(value, reactions) else ()
    return ca.substitute(value, reactions, motion.lam), (*motion.guards, *solving)


def _events(system: System, motion: Motion) -> Function | None:
    if not system.events:
        return None
    names = tuple(name for name, _ in system.events)
    values = ca.vertcat(*(at_motion(system, motion, value) for _, value in system.events))
    value, guards = _with_multipliers(system, motion, values)
    result = Result("g", value, names, ("",) * len(names))
    about = "what changes its sign at the model's events"
    return Function("events", about, result, guards=guards)


def _velocity(system: System, motion: Motion) -> Function:
    names, units = (
        tuple(v.name for v in system.model.velocities),
        tuple(v.unit for v in system.model.velocities),
    )
    return Function(
        "velocity",
        "generalized velocities v = S w + R c",
        Result("v", motion.v, names, units),
        guards=motion.guards,
    )


def _state(system: System, motion: Motion) -> Function:
    """(q, v, z) → x: w = B v."""
    value = ca.vertcat(system.q, ca.mtimes(motion.B, system.v), system.z)
    labels, units = labels_of_state(system, motion), units_of_state(system, motion)
    result = Result("x", value, labels, units)
    label = "x = (q, w, z) from (q, v, z)" if system.model.states else "x = (q, w) from (q, v)"
    return Function("state", f"state {label}: w = B v", result, x=_in_velocities(system))
