"""Discrete time: δx(t + h) = Φ δx + Γ δu by the sensitivities of Runge–Kutta steps, along any
motion, u held over the step."""

from __future__ import annotations

import casadi as ca
import numpy as np

from derive.linearize.limits import DISCRETE_STEPS
from derive.linearize.records import Linear


class Discrete:
    """Φ (n × n) and Γ (n × nu) in the minimal states of a linear form; the graph is made once.

    The state moves by `steps` classical Runge–Kutta steps of h/steps with the nonlinear equations,
    and the step is differentiated exactly: near a steady motion Φ is e^{A h} to O(h⁵/steps⁴), along
    others it is what a controller that samples needs.
    """

    def __init__(self, form: Linear, steps: int = DISCRETE_STEPS) -> None:
        self.form = form
        equations = form.equations
        t, x, u, p = (argument.symbols for argument in equations.arguments)
        f = equations.function("dynamics").result.value
        one = _step(ca.Function("f", [t, x, u, p], [f]), *(s.numel() for s in (x, u, p)))
        self.flow = _flow(one, steps, *(s.numel() for s in (x, u, p)))
        self.T = ca.Function("T", [t, x, u, p], [ca.densify(form.T)])

    def __call__(
        self, t: float, x: np.ndarray, u: np.ndarray, p: np.ndarray, h: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(Φ, Γ) over the step of length h (s) from (t, x) with inputs u held: δx_i(t + h) = Φ δx_i
        + Γ δu, Φ = [∂x⁺/∂x]_i T."""
        _, Fx, Fu = (m.full() for m in self.flow(t, x, u, p, h))
        rows = list(self.form.independent)
        return Fx[rows] @ self.T(t, x, u, p).full(), Fu[rows]


def _step(f: ca.Function, nx: int, nu: int, np_: int) -> ca.Function:
    """One step of the classical fourth-order method."""
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    x, u, p = ca.MX.sym("x", nx), ca.MX.sym("u", nu), ca.MX.sym("p", np_)
    k1 = f(t, x, u, p)
    k2 = f(t + h / 2, x + h / 2 * k1, u, p)
    k3 = f(t + h / 2, x + h / 2 * k2, u, p)
    k4 = f(t + h, x + h * k3, u, p)
    return ca.Function("step", [t, x, u, p, h], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])


def _flow(step: ca.Function, steps: int, nx: int, nu: int, np_: int) -> ca.Function:
    """The end of the interval and its derivatives in x and u."""
    t, h = ca.MX.sym("t"), ca.MX.sym("h")
    x, u, p = ca.MX.sym("x", nx), ca.MX.sym("u", nu), ca.MX.sym("p", np_)
    end = x
    for k in range(steps):
        end = step(t + k * h / steps, end, u, p, h / steps)
    return ca.Function("flow", [t, x, u, p, h], [end, ca.jacobian(end, x), ca.jacobian(end, u)])
