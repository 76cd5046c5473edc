"""Derivatives of the state derivative, on request: ẋ = f(t, x, u, p) gives ∂f/∂x and ∂f/∂t."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.formulations.records import Argument, Function, Request, Result


def derivatives(arguments: Sequence[Argument], functions: Sequence[Function]) -> tuple[Request, ...]:
    """The requests that follow from `dynamics`; none where the module has no state derivative."""
    dynamics = next((function for function in functions if function.name == "dynamics"), None)
    if dynamics is None:
        return ()
    slot = {argument.name: argument for argument in arguments}
    return (
        Request("jacobian", "Jacobian ∂ẋ/∂x of the state derivative, nx × nx", lambda: _jacobian(dynamics, slot["x"])),
        Request("jacobian_t", "explicit rate ∂ẋ/∂t of the state derivative", lambda: _rate(dynamics, slot["t"])),
    )


def _jacobian(dynamics: Function, x: Argument) -> Function:
    value = ca.densify(ca.jacobian(dynamics.result.value, x.symbols))
    about = "Jacobian ∂ẋ/∂x of the state derivative, nx × nx"
    return Function("jacobian", about, Result("J", value, dynamics.result.labels, ()), dynamics.named, dynamics.guards)


def _rate(dynamics: Function, t: Argument) -> Function:
    value = ca.densify(ca.jacobian(dynamics.result.value, t.symbols))
    about = "explicit rate ∂ẋ/∂t of the state derivative"
    return Function("jacobian_t", about, Result("ft", value, dynamics.result.labels, ()), dynamics.named, dynamics.guards)
