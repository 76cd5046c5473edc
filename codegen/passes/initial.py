"""initial: the state that a model's motion starts from, for examples."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.diagnostics import ModelError
from derive.formulations.records import Equations
from derive.states.initial import initial_state

DIGITS = 12  # that are the same on every machine; the constraints hold to as many


def initial(equations: Equations) -> tuple[float, ...]:
    """x = (q, w, z) consistent with the constraints at the initial values of the model file, inputs
    zero; empty where the file has no consistent ones or the equations no function for w."""
    function = equations.function("state") if equations.has("state") else None
    if function is None:
        return ()
    try:
        start = initial_state(equations.system)
    except ModelError:
        return ()
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    taken = slots["x"] if function.x is None else function.x.symbols
    state = ca.Function("x", [slots["t"], taken, slots["u"], slots["p"]], [function.result.value])
    x = state(0.0, start.whole, np.zeros(slots["u"].numel()), np.array(equations.parameters))
    return tuple(_rounded(np.asarray(x).ravel()))


def _rounded(values: np.ndarray) -> list[float]:
    """Rounding of solvers differs between machines, and generated text does not."""
    noise = 1e-14 * float(np.max(np.abs(values), initial=0.0))
    return [float(f"{value:.{DIGITS}g}") if abs(value) > noise else 0.0 for value in values]
