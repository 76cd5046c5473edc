"""Equations evaluated by CasADi at sampled states, for tests that compare them."""

import casadi as ca
import numpy as np

from derive.formulations.records import Equations


def functions(e: Equations) -> dict[str, ca.Function]:
    t, x, u, p = (a.symbols for a in e.arguments)
    return {
        f.name: ca.Function(f.name, [t, f.x.symbols if f.x else x, u, p], [f.result.value])
        for f in e.functions
    }


def accelerations(e: Equations, found) -> np.ndarray:
    """v̇ at the sampled states: the derivative of v(t, x) along ẋ, so that a wrong ẇ shows whatever
    σ says."""
    f = functions(e)
    t, x, u, p = (a.symbols for a in e.arguments)
    value = {function.name: function.result.value for function in e.functions}
    vdot = ca.jtimes(
        ca.densify(value["velocity"]),
        ca.vertcat(t, x),
        ca.vertcat(1, ca.densify(value["dynamics"])),
    )
    rate = ca.Function("rate", [t, x, u, p], [ca.densify(vdot)])
    return np.array([rate(*a).full().ravel() for a in arguments(f, found)])


def arguments(f: dict[str, ca.Function], found) -> list[tuple]:
    every = zip(found.t, found.q, found.v, found.u, found.p)
    return [
        (t, f["state"](t, np.concatenate([q, v]), u, p).full().ravel(), u, p)
        for t, q, v, u, p in every
    ]
