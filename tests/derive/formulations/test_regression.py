"""Y π is inverse dynamics to rounding, in loops too: over all velocities of the tree, and without
multipliers over quasi-velocities.

Of derive.formulations: regression.
"""

from __future__ import annotations

import numpy as np
import pytest

from derive.formulations import equations
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.model import load
from derive.states import system
from derive.states.sampling import States, states
from tests.scenes import MODELS

QUICK = ("four_bar", "slider_crank", "universal_shaft")
LONG = (
    "andrews",
    "spatial_four_bar",
    "gallery/wishbones",
    "gallery/delta_robot",
    "gallery/scissor_lift",
    "gallery/stewart",
    "gallery/forty_four_bars",
    "gallery/tracked_chain",
)
LOOPS = [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]
COUNT = 5
# of the largest force: products and turns rounded to 1e-16 along twenty links at most
TOLERANCE = 1e-12


def requested(derived: Equations, name: str):
    return function_of(derived, derived.request(name).function)


def states_of(derived: Equations) -> States:
    return states(derived.system, COUNT, seed=3)


@pytest.mark.parametrize("name", LOOPS)
def test_the_product_is_inverse_dynamics(name: str):
    """At any accelerations, also such as the loop forbids; and over w at those that it allows."""
    derived = equations(system(load(MODELS / f"{name}.yaml")))
    drawn, rng = states_of(derived), np.random.default_rng(4)
    functions = {
        x: requested(derived, x)
        for x in (
            *("standard_parameters", "regressor", "regressor_rest", "regressor_w"),
            *("regressor_rest_w", "mass_w", "bias_w"),
        )
    }
    forces, state = function_of(derived, "inverse_dynamics"), function_of(derived, "state")
    for t, q, v, u, p in zip(drawn.t, drawn.q, drawn.v, drawn.u, drawn.p):
        idle = np.zeros_like(u)

        def at(name: str, x: np.ndarray, rest: tuple[np.ndarray, ...] = (t, idle, p)):
            return np.asarray(functions[name](rest[0], x, *rest[1:]))

        x = np.asarray(state(t, np.concatenate([q, v]), idle, p)).ravel()
        pi = at("standard_parameters", x).ravel()
        full = np.concatenate([q, v, rng.normal(size=len(v))])
        wanted = np.asarray(forces(t, full, idle, p)).ravel()
        compared(at("regressor", full), pi, at("regressor_rest", full).ravel(), wanted)
        w = x[len(q) :]
        rates = rng.normal(size=len(w))
        wanted = at("mass_w", x) @ rates + at("bias_w", x).ravel()
        full = np.concatenate([x, rates])
        compared(at("regressor_w", full), pi, at("regressor_rest_w", full).ravel(), wanted)


def compared(Y: np.ndarray, pi: np.ndarray, rest: np.ndarray, wanted: np.ndarray):
    assert np.abs(Y @ pi + rest - wanted).max() <= TOLERANCE * np.abs(wanted).max()
