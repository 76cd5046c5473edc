"""Regressors are held to the reference at other parameters, and every planted error in them is
seen.

Of hamel.verify.checks: regressor.
Of derive.mechanics.regression: inertial_rows, regressor.
Of derive.formulations: regression.
"""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from codegen.passes import program
from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.formulations.evaluate import evaluator, function_of
from derive.mechanics.regression.regressor import parameters
from derive.model import load, load_text
from derive.states import system
from hamel.verify.checks import regressor
from hamel.verify.checks.evidence import Evidence
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results
from tests.scenes import MODELS

NAMES = (
    "standard_parameters", "regressor", "regressor_rest", "regressor_w", "regressor_rest_w",
)  # fmt: skip
# oblique axes, a slide, a weld, a spring, every load that has parameters
TREE = """
model: tree
gravity: [0.3, -0.2, -9.81 m/s^2]
parameters: {m: 1.2 kg, c: 0.3 N*m*s}
bodies:
  base: {mass: m, com: [0.1, 0.02, -0.05], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]}
  arm: {mass: 2 kg, com: [0.2, -0.03, 0.1], inertia: [0.06, 0.05, 0.02, 0, 0.001, 0]}
  tool: {mass: 0.5 kg, com: [0, 0.1, 0.02], inertia: [0.01, 0.02, 0.015, 0.001, 0, 0]}
  ring: {mass: 0.7 kg, com: [0.05, 0, 0.01], inertia: [0.004, 0.005, 0.006]}
joints:
  A: {type: revolute, parent: ground, child: base, axis: [1, 2, 2], coordinate: q1}
  B: {type: prismatic, parent: base, child: arm, at: [0.2, 0.1, 0], axis: x, coordinate: q2}
  W: {type: fixed, parent: arm, child: tool, at: {parent: {position: [0.3, 0, 0.1], rpy: [0.2, 0.5, -0.3]}}}
  C: {type: ball, parent: arm, child: ring, at: [0.1, 0.2, 0]}
inputs: {push: {joint: A}}
loads:
  friction: {type: friction, joint: A, viscous: c, coulomb: 0.2 N*m, smoothing: 0.1 rad/s}
  damper: {type: damper, joint: B, coefficient: 0.4 N*s/m}
  spring: {type: spring, joint: B, stiffness: 30 N/m}
  rotor: {type: armature, joint: A, inertia: 0.01 kg*m^2}
"""
LOOP = """
model: loop
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  crank: {mass: 1 kg, com: [0.1, 0.02], inertia: 0.01}
  coupler: {mass: 2 kg, com: [0.2, -0.03], inertia: 0.06}
  rocker: {mass: 1.5 kg, com: [0.2, 0], inertia: 0.04}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: coupler, at: [0.2, 0], coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [0.55, 0], coordinate: q3}
closures: {C: {type: revolute, between: [coupler, rocker], at: [[0.5, 0], [0.4, 0]]}}
inputs: {tau: {joint: A}}
loads: {drag: {type: damper, joint: D, coefficient: 0.1 N*m*s}}
quasi_velocities: {crank: [der(q1)]}
initial: {q1: 1, guess: {q2: -0.5, q3: 1.7}}
"""
BALL = """
model: ball
gravity: [0, 0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, com: [0.01, 0, 0.02], inertia: [0.004, 0.005, 0.006]}}
joints: {J: {type: free, parent: ground, child: ball}}
constraints:
  floor: {type: rolling, body: ball, shape: {sphere: {radius: 0.1 m}}, plane: {normal: z}}
initial: {guess: {J_z: 0.1 m}}
"""
# turns about each axis of the link and an oblique one, offsets along one and two axes and in the
# body, a slide, a screw
ARM = """
model: arm
gravity: [0.3, -0.2, -9.81 m/s^2]
bodies:
  b0: {mass: 1.2 kg, com: [0.1, 0.02, -0.05], inertia: [0.02, 0.03, 0.04, 0.001, 0.002, -0.003]}
  b1: {mass: 2 kg, com: [0.2, -0.03, 0.1], inertia: [0.06, 0.05, 0.02, 0, 0.001, 0]}
  b2: {mass: 0.5 kg, com: [0, 0.1, 0.02], inertia: [0.01, 0.02, 0.015, 0.001, 0, 0]}
  b3: {mass: 0.7 kg, com: [0.05, 0, 0.01], inertia: [0.004, 0.005, 0.006]}
  b4: {mass: 0.3 kg, com: [0.01, 0.03, 0.05], inertia: [0.003, 0.002, 0.002]}
  b5: {mass: 0.4 kg, com: [0.02, 0, 0.04], inertia: [0.002, 0.003, 0.002]}
  b6: {mass: 0.6 kg, com: [0, 0.05, 0.04], inertia: [0.005, 0.003, 0.004]}
joints:
  A: {type: revolute, parent: ground, child: b0, axis: z, coordinate: q1}
  B: {type: revolute, parent: b0, child: b1, axis: y, at: [0.2, 0, 0], coordinate: q2}
  C: {type: revolute, parent: b1, child: b2, axis: x, at: [0.1, 0.3, 0], coordinate: q3}
  D: {type: prismatic, parent: b2, child: b3, axis: z, rpy: [90 deg, 0, 0], coordinate: q4}
  E: {type: revolute, parent: b3, child: b4, axis: [1, 2, 2], coordinate: q5}
  F: {type: screw, parent: b4, child: b5, axis: x, pitch: 0.1 m, coordinate: q6}
  G:
    {type: revolute, parent: b3, child: b6, axis: y, coordinate: q7,
     at: {parent: [0.1, 0, 0], child: [0, 0.2, 0.1]}}
"""
# what leaves it pushes, however heavy it is
ROCKET = """
model: rocket
plane: xz
gravity: [0, -9.81 m/s^2]
parameters: {flow: 0.3 kg/s}
where: {m: 2 kg + ramp(1 kg - flow*t)}
bodies: {rocket: {mass: m, inertia: (0.1 m^2)*m, exhaust: {velocity: [3 m/s, -40 m/s], at: [0, -0.5]}}}
joints: {base: {type: planar, parent: ground, child: rocket}}
"""
VISCOUS = TREE.replace(", coulomb: 0.2 N*m, smoothing: 0.1 rad/s", "")
CASES = {
    "arm": ARM, "tree": TREE, "loop": LOOP, "ball": BALL, "rocket": ROCKET, "viscous": VISCOUS,
}  # fmt: skip


@cache
def seen(case: str) -> Evidence:
    """With the functions of this page alone, beside the default ones."""
    model = load_text(CASES[case])
    found = equations(system(model))
    functions = tuple(found.request(name).function for name in NAMES)
    full = replace(found, functions=(*found.functions, *functions))
    return evidence(reference(model), full, None, 3)


def red(e: Evidence) -> set[str]:
    return {result.name for result in results(e, regressor.CHECKS) if not result.passed}


@pytest.mark.parametrize("case", CASES)
def test_every_check_looks_and_is_green(case):
    found = {result.name: result for result in results(seen(case), regressor.CHECKS)}
    assert {*found} == {check.name for check in regressor.CHECKS}
    assert red(seen(case)) == set()


@pytest.mark.parametrize(
    "dry, kinds",
    [
        (", coulomb: 0.2 N*m, smoothing: 0.1 rad/s", ["viscous", "coulomb"]),
        (", coulomb: 0 N*m, smoothing: 1 rad/s", ["viscous", "coulomb"]),
        (", smoothing: 1 rad/s", ["viscous", "coulomb"]),
        ("", ["viscous"]),
    ],
)
def test_friction_is_dry_where_the_file_speaks_of_it(dry, kinds):
    """Over a smoothing that nobody gave, the column is nearly that of viscous friction."""
    found = system(load_text(VISCOUS.replace("viscous: c", f"viscous: c{dry}")))
    own = [x for x in parameters(found) if x.owner == "friction"]
    assert [x.kind for x in own] == kinds
    assert [x.name for x in own] == [f"friction_{kind}" for kind in kinds]


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES)
def test_an_entry_that_is_wrong_by_a_thousandth_is_seen(case, name):
    """The largest entry of each function; one more where a result is zero everywhere."""
    e = seen(case)
    equations = e.graph.equations
    function = equations.function(name)
    value = ca.SX(function.result.value)
    at = evaluator(equations).functions[name]
    size = np.zeros(value.shape)
    for k, x in enumerate(e.arguments_of(name)):
        s = e.samples[k]
        size = np.maximum(size, np.abs(np.array(at(s.t, x, s.u, s.p))))
    i, j = np.unravel_index(int(np.argmax(size)), size.shape)
    wrong = ca.SX(value)
    wrong[i, j] = value[i, j] * 1.001 if size[i, j] else value[i, j] + 1.0
    spoiled = replace(function, result=replace(function.result, value=wrong))
    functions = tuple(spoiled if f.name == name else f for f in equations.functions)
    assert red(replace(e, graph=evaluator(replace(equations, functions=functions))))


@pytest.mark.parametrize("case", CASES)
def test_the_product_with_the_files_own_parameters_is_inverse_dynamics(case):
    """Also where bodies are fixed to each other, with friction, rotors and springs."""
    e = seen(case)
    for k, x in enumerate(e.arguments_of("regressor")):
        s = e.samples[k]
        pi = np.reshape(e.graph("standard_parameters", s.t, e.x[k], s.u, s.p), -1)
        Y = np.reshape(e.graph("regressor", s.t, x, s.u, s.p), (-1, len(pi)))
        wanted = np.reshape(e.graph("inverse_dynamics", s.t, x, s.u, s.p), -1)
        got = Y @ pi + np.reshape(e.graph("regressor_rest", s.t, x, s.u, s.p), -1)
        assert np.abs(got - wanted).max() <= 1e-12 * np.abs(wanted).max()


@pytest.mark.parametrize(("case", "most"), [("arm", 1540), ("tree", 353), ("loop", 37)])
def test_what_a_joint_does_not_feel_is_taken_from_the_carrier(case, most):
    """Operations of Y; by products of twist and wrench alone they are more."""
    kernel = program(equations(system(load_text(CASES[case]))), ["regressor"]).kernels[0]
    assert kernel.operations["total"] <= most


def test_names_and_units_of_the_parameters_are_said():
    labels = seen("loop").graph.equations.function("standard_parameters").result
    assert labels.labels[:4] == ("m_crank", "mx_crank", "my_crank", "Izz_crank")
    assert labels.labels[-1] == "drag"
    assert labels.units[:4] == ("kg", "kg*m", "kg*m", "kg*m^2")


def test_a_model_without_bodies_offers_none():
    model = load_text(
        "model: point\ncoordinates: {q: rad}\nkinetic: 0.5 kg*m^2*der(q)^2\npotential: 2 N*m*cos(q)\n"
    )
    assert not {r.name for r in equations(system(model)).requests} & {*NAMES}


@pytest.mark.parametrize("name", NAMES[1:])
def test_a_force_that_uses_a_reaction_is_refused(name):
    text = LOOP.replace(
        "loads: {drag: {type: damper, joint: D, coefficient: 0.1 N*m*s}}",
        "loads: {rub: {type: expression, joint: D, expression: -0.01 m*reaction.C.x}}",
    )
    found = equations(system(load_text(text)))
    with pytest.raises(AssumptionError, match="uses reactions"):
        function_of(found, found.request(name).function)


def test_first_order_states_are_no_part_of_what_a_regressor_takes() -> None:
    found = equations(system(load(MODELS / "gallery" / "muscle_activation.yaml")))
    added = found.request("regressor_w").function
    full = replace(found, functions=(*found.functions, added))
    e = evidence(reference(found.system.model), full, None, 3)
    assert [len(x) for x in e.arguments_of("regressor_w")] == [3, 3, 3]  # (q, w, ẇ)
    assert red(e) == set()
