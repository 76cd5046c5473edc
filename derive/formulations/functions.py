"""The functions of the generated module that do not depend on the formulation: what v, λ and ẋ are
is handed in."""

from __future__ import annotations

import functools
from collections.abc import Callable

import casadi as ca

from derive.choices.records import Guard
from derive.choices.redundancy import keeps
from derive.expressions.deferred import Deferred, is_deferred
from derive.formulations.configuration import configuration, is_plain
from derive.formulations.motion import (
    Motion,
    at_motion,
    guards_of,
    is_unit,
    labels_of_state,
    per_second,
    units_of_state,
)
from derive.formulations.projection import constraint_violation, projection
from derive.formulations.records import Argument, Function, Result
from derive.formulations.rolled.recursion import recursion
from derive.mechanics.loops.records import Recursion
from derive.mechanics.records import System
from derive.mechanics.system import inertial_forces


def functions(system: System, motion: Motion) -> tuple[Function, ...]:
    """The functions of the module in the order they stand in the generated code: dynamics, mass,
    bias, inverse_dynamics, constraints, project, reactions, energy, power, outputs, events,
    velocity, state, and those of the configuration. What the model has no use for is absent."""
    result = [
        _dynamics(system, motion),
        _mass(system) if system.written else None,
        _bias(system, motion),
        _inverse_dynamics(system, motion),
        constraint_violation(system, motion),
        projection(system, motion),
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
    direct = motion.minimal is not None and is_unit(motion.B)
    other = "" if regular else "there are positions that it has to be guarded against"
    other = other if direct else "its velocities are not those of the joints"
    other = "it has first-order states" if system.model.states else other
    return functools.cache(lambda: recursion(system, function, other))


_BASE = "v̇ from M v̇ + h = Q + Aᵀ λ and A v̇ = β"
_REDUCED = "ẇ from (Sᵀ M S) ẇ = Sᵀ (Q − h − M σ)"


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
        "what a potential given by formula makes, M v̇ + h = Q + Aᵀ λ; springs are in Q"
    )
    value = _formed(system, len(names), lambda: at_motion(system, motion, system.h))
    guards = guards_of(motion, system.h, system) if motion.guards else ()
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
    guards = guards_of(motion, system.T, system) if motion.guards else ()
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
    guards = (
        (*motion.guards, *motion.solving) if moving else guards_of(motion, system.power, system)
    )
    drives = " and of constraints that move" if moving else ""
    balanced = "T" if system.homogeneous else "T2 - T0"
    return Function(
        "power",
        f"power of forces without potential{drives}: d({balanced} + V)/dt",
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
    value, guards = _of_the_motion(system, motion, ca.vertcat(*values))
    result = Result("y", value, tuple(labels), tuple(units))
    return Function("outputs", "the model's outputs", result, guards=guards)


def _of_the_motion(system: System, motion: Motion, value: ca.SX) -> tuple[ca.SX, tuple[Guard, ...]]:
    """With λ in the place of reactions and v̇ in that of its symbols; and what has to be regular
    for them."""
    reactions = system.symbols.reactions([row.name for row in system.rows])
    solved, vdot = ca.depends_on(value, reactions), system.symbols.vdot
    value = ca.substitute(value, reactions, motion.lam)
    if ca.depends_on(value, vdot):  # for a long tree it is formed now
        solved, value = True, ca.substitute(value, vdot, motion.vdot)
    return value, (*motion.guards, *(motion.solving if solved else ()))


def _events(system: System, motion: Motion) -> Function | None:
    if not system.events:
        return None
    names = tuple(name for name, _ in system.events)
    values = ca.vertcat(*(at_motion(system, motion, value) for _, value in system.events))
    value, guards = _of_the_motion(system, motion, values)
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
