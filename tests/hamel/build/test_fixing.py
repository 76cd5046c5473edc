"""Fixed inputs and parameters: the same motion as with these values given, from code that does not
take them."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import slots_of
from derive.model import load, load_text
from derive.states import sampling
from hamel.build.fix import fixed
from hamel.build.stages import mechanics_of
from tests.scenes import MODELS

FORMULA = """
model: cart
coordinates: {x: m, y: m}
parameters: {m: 2 kg, k: 30 N/m}
inputs: {push: {coordinate: x}, wind: {unit: N/m}, lift: {coordinate: y}}
kinetic: m*(der(x)**2 + der(y)**2)/2
potential: k*x**2/2
forces: {x: wind*y}
initial: {x: 0.1 m, y: 0.2 m}
"""


def dynamics(model, constants=()):
    found = equations(mechanics_of(model, constants))
    function = next(f for f in found.functions if f.name == "dynamics")
    return found, ca.Function("dynamics", slots_of(found), [function.result.value])


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (load_text(FORMULA), {"wind": "3 N/cm", "push": 0.0, "m": "2500 g"}),
        (load_text(FORMULA), {"push": -2.0, "lift": 1.0, "wind": 0.5}),
        (load(MODELS / "snake3.yaml"), {"tau2": "(2 N*m)"}),
        (load(MODELS / "four_bar.yaml"), {load(MODELS / "four_bar.yaml").inputs[0].name: -1.5}),
    ],
    ids=["formula and parameter", "all inputs", "one of two", "loop"],
)
def test_the_motion_is_that_of_the_values(model, values) -> None:
    less, constants = fixed(model, (), values)
    whole, part = dynamics(model), dynamics(less, constants)
    numbers = dict(less.fixed)
    assert numbers.keys() == values.keys()
    free_u = [i.name for i in less.inputs]
    free_p = [x.name for x in model.parameters if x.name not in numbers]
    assert part[0].arguments[2].labels == tuple(free_u)
    assert part[0].arguments[3].labels == tuple(free_p)
    states = sampling.states(part[0].system, 5, 1, parameters=0.2)
    for t, q, v, u, p in zip(states.t, states.q, states.v, states.u, states.p):
        state = next(f for f in part[0].functions if f.name == "state")
        x = ca.Function("x", slots_of(part[0], state), [state.result.value])(t, np.r_[q, v], u, p)
        given = numbers | dict(zip(free_u, u)) | dict(zip(free_p, p))
        wanted = whole[1](
            t, x, [given[i.name] for i in model.inputs], [given[x.name] for x in model.parameters]
        )
        np.testing.assert_allclose(
            np.array(part[1](t, x, u, p)), np.array(wanted), rtol=1e-11, atol=1e-12
        )


def test_a_build_says_what_is_fixed(tmp_path: Path) -> None:
    hamel.build(
        MODELS / "snake3.yaml",
        out=tmp_path / "snake3",
        fix={"tau1": 0.0, "tau2": "(1 N*m)", "m": 2.0},
    )
    manifest = json.loads((tmp_path / "snake3" / "manifest.json").read_text())
    assert manifest["fixed"] == {"tau1": 0.0, "tau2": 1.0, "m": 2.0}
    module = hamel.load(tmp_path / "snake3")
    assert module.nu == 0 and "m" not in module.parameters
    assert np.isfinite(module.dynamics(0.0, np.full(module.nx, 0.1))).all()


def test_only_inputs_and_parameters_can_be_fixed() -> None:
    model = load(MODELS / "snake3.yaml")
    with pytest.raises(ModelError, match="no such input or parameter; did you mean 'tau"):
        fixed(model, (), {"tau": 0.0})
    with pytest.raises(ModelError, match="phi1"):
        fixed(model, (), {"phi1": 0.0})
    assert fixed(model, "all", {"m": 1.0})[1] == "all"
