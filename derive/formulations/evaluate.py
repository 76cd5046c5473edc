"""Equations evaluated by CasADi's virtual machine: nothing is generated and nothing compiled.

Every function is f(t, x, u, p); x is the state (q, w), unless a function takes something else
there (`state` takes q and v).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from derive.expressions.deferred import OnDemand
from derive.formulations.frames import based
from derive.formulations.records import Equations, Function
from derive.mechanics.records import Named


@dataclass(frozen=True)
class Evaluator:
    """The functions of one choice as CasADi evaluates them, and v with its rate along ẋ."""

    equations: Equations
    functions: Mapping[str, ca.Function]
    named: Mapping[str, ca.Function]  # S, R, Y, B … as functions of (t, x, u, p)
    residuals: Mapping[str, ca.Function]  # of the functions that are iterated
    rate: ca.Function  # (t, x, u, p, ẋ) → v̇

    def __call__(
        self, name: str, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """The result of a function at one state, as the generated module shapes it."""
        return shaped(np.array(self.functions[name](t, x, u, p)))

    def iterated(
        self, name: str, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray
    ) -> np.ndarray:
        """The result of a function that is one Newton step, repeated as the generated module
        repeats it."""
        iteration = self.equations.function(name).iteration
        if iteration is None:
            return self(name, t, x, u, p)
        for _ in range(iteration.most):
            x, residual = self(name, t, x, u, p), float(self.residuals[name](t, x, u, p))
            if residual <= iteration.tolerance:
                break
        return x

    def acceleration(self, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """v̇ (nv) as the derivative of v(t, x) along ẋ, ∂v/∂t + ∂v/∂x ẋ. It uses nothing of how ẇ
        was found, so it is an independent check of σ."""
        return np.array(self.rate(t, x, u, p, self.functions["dynamics"](t, x, u, p))).ravel()

    def has(self, name: str) -> bool:
        """Whether a function of that name is among the default ones; a formulation may lack some,
        such as `guards`."""
        return name in self.functions


def evaluator(equations: Equations) -> Evaluator:
    """Everything at once: the functions, what is named in them, residuals of iterations, v̇.

    Directions that are based anew on the way stand as at their usual base.
    """
    equations = based(equations)
    arguments = slots_of(equations)
    named = {item.name: partial(_intermediate, item, arguments) for item in equations.named}
    residuals = {
        f.name: ca.Function(f.name, slots_of(equations, f), [f.residual])
        for f in equations.functions
        if f.residual is not None
    }
    functions = {f.name: partial(function_of, equations, f) for f in equations.functions}
    velocity = ca.densify(equations.function("velocity").result.value)
    rate = _rate(arguments, velocity)
    return Evaluator(equations, OnDemand(functions), OnDemand(named), residuals, rate)


def _intermediate(item: Named, arguments: list[ca.SX]) -> ca.Function:
    return ca.Function(item.name, arguments, [ca.densify(item.value)])


def function_of(equations: Equations, function: Function | str) -> ca.Function:
    """(t, x, u, p) → the dense result of one function, given by itself or by name."""
    chosen = equations.function(function) if isinstance(function, str) else function
    return ca.Function(chosen.name, slots_of(equations, chosen), [ca.densify(chosen.result.value)])


def slots_of(equations: Equations, function: Function | None = None) -> list[ca.SX]:
    """t, x, u, p as columns, empty ones for what the model has not; x as the function wants it."""
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    columns = [slots.get(name, ca.SX(0, 1)) for name in ("t", "x", "u", "p")]
    if function is not None and function.x is not None:
        columns[1] = function.x.symbols
    return columns


def shaped(value: np.ndarray) -> np.ndarray:
    """n × 1 as (n,)."""
    return value[:, 0] if value.shape[1] == 1 else value


def _rate(arguments: list[ca.SX], velocity: ca.SX) -> ca.Function:
    t, x, _, _ = arguments
    xdot = ca.SX.sym("xdot", x.numel())
    along = ca.jtimes(velocity, ca.vertcat(t, x), ca.vertcat(1, xdot))
    return ca.Function("rate", [*arguments, xdot], [ca.densify(along)])
