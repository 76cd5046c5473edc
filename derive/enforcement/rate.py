"""The rate alpha at which violations decay where none is given: twice the system's own fastest rate
at the start.

A multiple of the fastest rigid-body rate and independent of the step: alpha = 1/h makes errors
orders of magnitude larger.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.formulations.records import Equations

TIMES = 2.0
LEAST = 10.0  # over the length of the motion, for systems without a rate of their own


def usual_rate(
    equations: Equations, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray, time: float
) -> float:
    """Twice the largest |eigenvalue| of ∂ẋ/∂x at the state x, or 10/time where that is larger; in
    1/s. `time` is the length of the motion in s. Where the Jacobian is not finite only the length
    counts."""
    slots = {argument.name: argument.symbols for argument in equations.arguments}
    xdot = equations.function("dynamics").result.value
    function = ca.Function(
        "J", [slots[name] for name in "txup"], [ca.densify(ca.jacobian(xdot, slots["x"]))]
    )
    J = np.asarray(function(t, x, u, p))
    fastest = (
        float(np.max(np.abs(np.linalg.eigvals(J)), initial=0.0)) if np.isfinite(J).all() else 0.0
    )
    return max(TIMES * fastest, LEAST / time)
