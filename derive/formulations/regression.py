"""Inverse dynamics as a product with the standard parameters, Y π + rest: over the generalized
velocities, and without multipliers over quasi-velocities, Sᵀ Y π + Sᵀ rest.

They are made when asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import casadi as ca

from derive.diagnostics import AssumptionError, listed
from derive.formulations.motion import Minimal, Motion, at_motion, per_second
from derive.formulations.records import Argument, Function, Request, Result
from derive.mechanics.records import System
from derive.mechanics.regression import regressor as mechanics
from derive.mechanics.regression.regressor import parameter_values, parameters

REGRESSOR = "Y, nv × np: inverse_dynamics = Y standard_parameters + regressor_rest, from (q, v, v̇)"
REST = "what of inverse_dynamics no standard parameter has: springs, forces, given energies"
REGRESSOR_W = (
    "Sᵀ Y at v̇ = S ẇ + σ, nw × np: mass_w ẇ + bias_w = Sᵀ Y standard_parameters + "
    "regressor_rest_w, from (q, w, ẇ)"
)
REST_W = "what of mass_w ẇ + bias_w no standard parameter has, from (q, w, ẇ)"
VALUES = (
    "π: m, mc and tensor about the origin (xx, xy, yy, xz, yz, zz) of each moving body with what "
    "is fixed to it, in its frame; dampers, friction, rotors"
)


def regression(system: System, motion: Motion) -> tuple[Request, ...]:
    """The requests, none where the model has no parameters of the kind; those over w only where
    the formulation chooses w."""
    if not parameters(system):
        return ()
    rest = Rest(system)
    return (*_over_v(system, rest), *_over_w(system, motion, motion.minimal, rest))


class Rest:
    """What of inverse dynamics has no standard parameter, over (t, q, v, v̇), made once."""

    def __init__(self, system: System) -> None:
        self._system = system
        self.vdot = _rates(_velocities(system))

    @cached_property
    def _with_states(self) -> ca.SX:
        """nv × 1. Raises AssumptionError where forces use reactions."""
        return mechanics.rest(self._system, self.vdot)

    @cached_property
    def forces(self) -> ca.SX:
        """nv × 1. Raises AssumptionError where first-order states act, which no measured motion
        holds, or forces use reactions."""
        system, forces = self._system, self._with_states
        if system.z.numel() and ca.depends_on(forces, system.z):
            names = listed(state.name for state in system.model.states)
            raise AssumptionError(
                f"forces of {system.model.name} depend on first-order states ({names}), which a "
                "motion does not tell",
                "parameters fitted to whole motions: hamel identify --free",
            )
        return forces

    def at(self, vdot: ca.SX) -> ca.SX:
        """The same with other v̇ in the place of its own."""
        return ca.substitute(self.forces, self.vdot, vdot)

    def check(self) -> None:
        """Raises what `forces` raises."""
        _ = self.forces

    def check_linear(self) -> None:
        """Raises AssumptionError where Y π and the rest are not all of inverse dynamics, for forces
        use reactions."""
        _ = self._with_states


def _over_v(system: System, rest: Rest) -> Iterator[Request]:
    yield Request("standard_parameters", VALUES, lambda: _values(system))
    yield Request("regressor", REGRESSOR, lambda: _regressor(system), condition=rest.check_linear)
    yield Request("regressor_rest", REST, lambda: _rest(system, rest), condition=rest.check)


def _over_w(system: System, motion: Motion, of: Minimal | None, rest: Rest) -> Iterator[Request]:
    if of is None or not motion.names:
        return
    yield Request(
        "regressor_w",
        REGRESSOR_W,
        lambda: _regressor_w(system, motion, of),
        condition=rest.check_linear,
    )
    yield Request(
        "regressor_rest_w",
        REST_W,
        lambda: _rest_w(system, motion, of, rest),
        condition=rest.check,
    )


def _values(system: System) -> Function:
    result = parameters(system)
    names, units = tuple(x.name for x in result), tuple(x.unit for x in result)
    value = ca.densify(parameter_values(system))
    return Function("standard_parameters", VALUES, Result("pi", value, names, units))


def _regressor(system: System) -> Function:
    vdot = _rates(tuple(v.name for v in system.model.velocities))
    value = ca.densify(mechanics.regressor(system, vdot))
    result = Result("Y", value, _velocities(system), (), matrix=True)
    return Function("regressor", REGRESSOR, result, x=_with_vdot(system, vdot))


def _rest(system: System, rest: Rest) -> Function:
    result = Result("rest", ca.densify(rest.forces), _velocities(system), ())
    return Function("regressor_rest", REST, result, x=_with_vdot(system, rest.vdot))


def _regressor_w(system: System, motion: Motion, of: Minimal) -> Function:
    wdot = _rates(motion.names)
    Y = mechanics.regressor(system, ca.mtimes(of.S, wdot) + of.sigma)
    value = ca.densify(ca.mtimes(of.S.T, at_motion(system, motion, Y)))
    result = Result("Y_w", value, motion.names, (), matrix=True)
    taken = _with_wdot(system, motion, wdot)
    return Function("regressor_w", REGRESSOR_W, result, guards=motion.guards, x=taken)


def _rest_w(system: System, motion: Motion, of: Minimal, rest: Rest) -> Function:
    wdot = _rates(motion.names)
    forces = at_motion(system, motion, rest.at(ca.mtimes(of.S, wdot) + of.sigma))
    value = ca.densify(ca.mtimes(of.S.T, forces))
    result = Result("rest_w", value, motion.names, ())
    taken = _with_wdot(system, motion, wdot)
    return Function("regressor_rest_w", REST_W, result, guards=motion.guards, x=taken)


def _rates(names: tuple[str, ...]) -> ca.SX:
    return ca.vertcat(*[ca.SX.sym(f"d_{name}") for name in names]) if names else ca.SX(0, 1)


def _velocities(system: System) -> tuple[str, ...]:
    return tuple(v.name for v in system.model.velocities)


def _with_vdot(system: System, vdot: ca.SX) -> Argument:
    units = tuple(v.unit for v in system.model.velocities)
    symbols = ca.vertcat(system.q, system.v, vdot)
    return _argument(system, _velocities(system), units, symbols)


def _with_wdot(system: System, motion: Motion, wdot: ca.SX) -> Argument:
    symbols = ca.vertcat(system.q, motion.w, wdot)
    return _argument(system, motion.names, motion.units, symbols)


def _argument(
    system: System, names: tuple[str, ...], units: tuple[str, ...], symbols: ca.SX
) -> Argument:
    coordinates = system.model.coordinates
    labels = (*(c.name for c in coordinates), *names, *(f"der({name})" for name in names))
    rates = tuple(per_second(unit) for unit in units)
    return Argument("x", symbols, labels, (*(c.unit for c in coordinates), *units, *rates))
