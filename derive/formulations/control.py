"""What controllers ask for, in the quasi-velocities themselves:

    M_w ẇ + b_w = B_w u,   M_w = Sᵀ M S,   b_w = Sᵀ (h + M σ − Q₀),   B_w = Sᵀ ∂Q/∂u

with Q = Q₀ + ∂Q/∂u u. There are no multipliers, also with loops and nonholonomic constraints: as
many equations as degrees of freedom. They are made when asked for.
"""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from derive.choices.records import Guard
from derive.diagnostics import AssumptionError
from derive.expressions.counting import cheapest
from derive.expressions.scalars import Vector
from derive.formulations.distribution import check_reach, distribution
from derive.formulations.functions import outputs_of
from derive.formulations.motion import (
    Minimal,
    Motion,
    at_motion,
    labels_of_state,
    per_second,
    units_of_state,
)
from derive.formulations.records import Argument, Function, Request, Result
from derive.mechanics.analytic import turned
from derive.mechanics.elimination.solve import scalars
from derive.mechanics.records import System
from derive.mechanics.recursions.coriolis import coriolis_matrix
from derive.mechanics.system import inertial_forces

PARTIAL = "partial velocities S of v = S w + R c, nv × nw"
MASS = "mass matrix Sᵀ M S of the quasi-velocities w, nw × nw"
BIAS = (
    "what the inputs have to balance at ẇ = 0: Sᵀ (h + M σ − Q) at u = 0; "
    "mass_w ẇ + bias_w = input_map u"
)
GRAVITY = "part of bias_w that is there at rest: Sᵀ h at v = 0, of gravity and `potential`"
CORIOLIS = (
    "Coriolis matrix C, nw × nw: C w are the velocity products of bias_w, Sᵀ (h − h₀ + M σ), and "
    "d/dt mass_w − 2 C is antisymmetric"
)
INPUTS = "forces of the inputs over w: Sᵀ ∂Q/∂u, nw × nu"
INVERSE = (
    "inputs u that give ẇ: input_map u = mass_w ẇ + bias_w, from (q, w, ẇ); of several the one "
    "with least u·u"
)
OUTPUTS = "Jacobian ∂y/∂x of the outputs by the state, ny × nx"


def control(system: System, motion: Motion) -> tuple[Request, ...]:
    """The requests, each with what it takes of the model; in generalized velocities, where
    multipliers hold the constraints, only `outputs_jacobian`."""
    return (*_over_quasi_velocities(system, motion, motion.minimal), *_outputs(system, motion))


def _over_quasi_velocities(system: System, motion: Motion, of: Minimal | None) -> Iterator[Request]:
    if of is None or not motion.names:
        return
    yield Request("partial_velocities", PARTIAL, lambda: _partial(system, motion, of))
    if system.written:
        yield Request("mass_w", MASS, lambda: _mass(motion, of))
        yield Request(
            "coriolis_w",
            CORIOLIS,
            lambda: _coriolis(system, motion, of),
            condition=lambda: _check_coriolis(system, of),
        )
    yield Request("bias_w", BIAS, lambda: _bias(system, motion, of))
    yield Request("gravity_w", GRAVITY, lambda: _gravity(system, motion, of))
    yield Request(
        "input_map",
        INPUTS,
        lambda: _input_map(system, motion, of),
        condition=lambda: _check_inputs(system),
    )
    yield Request(
        "inverse_dynamics_u",
        INVERSE,
        lambda: _inverse(system, motion, of),
        condition=lambda: _check_inverse(system, motion, of),
    )


def _outputs(system: System, motion: Motion) -> Iterator[Request]:
    yield Request(
        "outputs_jacobian",
        OUTPUTS,
        lambda: _outputs_jacobian(system, motion),
        condition=lambda: _check_outputs(system),
    )


def _check_outputs(system: System) -> None:
    if not system.outputs:
        raise AssumptionError(f"{system.model.name} has no outputs", "`outputs:` names them")


def _partial(system: System, motion: Motion, of: Minimal) -> Function:
    names = tuple(v.name for v in system.model.velocities)
    return _matrix("partial_velocities", PARTIAL, "S", of.S, names, motion)


def _mass(motion: Motion, of: Minimal) -> Function:
    return _matrix("mass_w", MASS, "M_w", of.mass, motion.names, motion)


def _input_map(system: System, motion: Motion, of: Minimal) -> Function:
    return _matrix("input_map", INPUTS, "B_w", _of_inputs(system, of), motion.names, motion)


def _matrix(
    name: str, about: str, symbol: str, value: ca.SX, rows: tuple[str, ...], motion: Motion
) -> Function:
    result = Result(symbol, ca.densify(value), rows, (), matrix=True)
    return Function(name, about, result, guards=motion.guards)


def _bias(system: System, motion: Motion, of: Minimal) -> Function:
    value = -_without_inputs(system, of.force)
    return Function("bias_w", BIAS, _over_w("b_w", value, motion), guards=motion.guards)


def _gravity(system: System, motion: Motion, of: Minimal) -> Function:
    value = ca.mtimes(of.S.T, _at_rest(system))
    return Function("gravity_w", GRAVITY, _over_w("g_w", value, motion), guards=motion.guards)


def _over_w(symbol: str, value: ca.SX, motion: Motion) -> Result:
    return Result(symbol, ca.densify(value), motion.names, ())


def _at_rest(system: System) -> ca.SX:
    return ca.substitute(system.h, system.v, ca.SX.zeros(system.v.numel()))


def _without_inputs(system: System, expression: ca.SX) -> ca.SX:
    return ca.substitute(expression, system.u, ca.SX.zeros(system.u.numel()))


def _check_inputs(system: System) -> None:
    """Forces have to be a linear function of the inputs, whatever the velocities are."""
    if not system.u.numel():
        raise AssumptionError(f"{system.model.name} has no inputs", "`inputs:` names them")
    B = ca.jacobian(system.Q, system.u)
    if ca.depends_on(B, system.u):
        raise AssumptionError(
            f"{system.model.name}: a force is not linear in the inputs, so there is no input_map",
            "use the force itself as the input",
        )
    if ca.depends_on(B, system.v):
        raise AssumptionError(
            f"{system.model.name}: what an input does depends on velocities, so there is no "
            "input_map",
            "use the force itself as the input",
        )


def _of_inputs(system: System, of: Minimal) -> ca.SX:
    """B_w."""
    return ca.sparsify(ca.mtimes(of.S.T, ca.jacobian(system.Q, system.u)))


def _check_inverse(system: System, motion: Motion, of: Minimal) -> None:
    """The inputs have to reach every force over w."""
    _check_inputs(system)
    check_reach(system, motion, _of_inputs(system, of))


def _inverse(system: System, motion: Motion, of: Minimal) -> Function:
    """r = mass_w ẇ + bias_w, by matrices or by Newton–Euler on v̇ = S ẇ + σ, whichever takes fewer
    operations; then u of input_map u = r."""
    wdot = ca.vertcat(*[ca.SX.sym(f"d_{name}") for name in motion.names])
    wanted = cheapest([scalars(x) for x in _demands(system, motion, of, wdot)])
    needed: Vector = [row[0] for row in wanted]
    outcome = distribution(system, motion, _of_inputs(system, of), needed)
    names = tuple(item.name for item in system.model.inputs)
    units = tuple(item.unit for item in system.model.inputs)
    result = Result("u", ca.densify(ca.vertcat(*outcome.u)), names, units)
    guards: tuple[Guard, ...] = (*motion.guards, *outcome.guards)
    taken = _with_rates(system, motion, wdot)
    return Function("inverse_dynamics_u", INVERSE, result, guards=guards, x=taken)


def _demands(system: System, motion: Motion, of: Minimal, wdot: ca.SX) -> Iterator[ca.SX]:
    if system.written:
        yield ca.mtimes(of.mass, wdot) - _without_inputs(system, of.force)
    vdot = ca.mtimes(of.S, wdot) + of.sigma
    forces = inertial_forces(system, vdot) + ca.mtimes(system.M_extra, vdot) + system.h_extra
    balance = forces - _without_inputs(system, system.Q)
    yield ca.mtimes(of.S.T, at_motion(system, motion, balance))


def _with_rates(system: System, motion: Motion, wdot: ca.SX) -> Argument:
    """(q, w, z, ẇ)."""
    labels = (
        *labels_of_state(system, motion),
        *(f"der({name})" for name in motion.names),
    )
    units = (
        *units_of_state(system, motion),
        *(per_second(unit) for unit in motion.units),
    )
    return Argument("x", ca.vertcat(system.q, motion.w, system.z, wdot), labels, units)


def _coriolis(system: System, motion: Motion, of: Minimal) -> Function:
    """Sᵀ (C S + M Ṡ) of the tree's C: Ṁ_w = C_w + C_wᵀ holds with it, whatever S is, so with loops
    and nonholonomic constraints as well."""
    qdot = ca.substitute(system.qdot, system.v, motion.v)
    turning = ca.jtimes(of.S, system.q, qdot)
    v = [system.v[j] for j in range(system.v.numel())]
    links = cheapest([coriolis_matrix(system.links, x, v) for x in system.inertias])
    extra = _coriolis_of_formulas(system)
    tree = at_motion(system, motion, ca.vertcat(*(ca.horzcat(*row) for row in links)) + extra)
    value = ca.mtimes(of.S.T, ca.mtimes(ca.sparsify(tree), of.S) + ca.mtimes(system.M, turning))
    return _matrix("coriolis_w", CORIOLIS, "C_w", value, motion.names, motion)


def _coriolis_of_formulas(system: System) -> ca.SX:
    """C of the kinetic energy that a file gives by formula, C u = M (∇ᵥ u − u̇): half the slope of
    h, and half of M [v, u] with the bracket of velocities along a body's axes. Without these
    Christoffel's symbols."""
    v = system.v
    brackets = [turned(system.model, v, row.T).T for row in ca.vertsplit(system.M_given)]
    return 0.5 * (ca.jacobian(system.h_extra, v) - ca.vertcat(*brackets))


def _check_coriolis(system: System, of: Minimal) -> None:
    """C stands for all velocity products where every velocity is S w."""
    name = system.model.name
    if not system.c.is_zero() or ca.depends_on(ca.vertcat(ca.vec(of.S), ca.vec(of.mass)), system.t):
        raise AssumptionError(
            f"{name}: constraints or masses move by themselves, so velocity products are not C w",
            "bias_w holds all of them",
        )
    if not system.homogeneous:
        raise AssumptionError(
            f"{name}: the kinetic energy has terms that are not quadratic in the rates, so "
            "velocity products are not C w",
            "bias_w holds all of them",
        )


def _outputs_jacobian(system: System, motion: Motion) -> Function:
    outputs = outputs_of(system, motion)
    assert outputs is not None  # else it is not offered
    x = ca.vertcat(system.q, motion.w, system.z)
    value = ca.densify(ca.jacobian(outputs.result.value, x))
    result = Result("Jy", value, outputs.result.labels, (), matrix=True)
    return Function("outputs_jacobian", OUTPUTS, result, guards=outputs.guards)
