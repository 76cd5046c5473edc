"""Frames and functions over quasi-velocities are held to the reference, and every planted error in
them is seen.

Of hamel.verify.checks: named_frames, quasi, linear.
Of hamel.verify.reference: named_frames, loads.
"""

from dataclasses import replace
from functools import cache

import casadi as ca
import pytest

from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.formulations.records import Equations
from derive.formulations.requests import request_of
from derive.model import load_text
from derive.states import system
from hamel.verify.checks import CHECKS, linear, named_frames, quasi
from hamel.verify.checks.evidence import Evidence
from hamel.verify.mutation.mutations import mutations
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results

OWN = (*named_frames.CHECKS, *quasi.CHECKS, *linear.CHECKS)
FEW = 3  # states: planted errors show at any of them
OVER_W = (
    "partial_velocities",
    "mass_w",
    "coriolis_w",
    "bias_w",
    "gravity_w",
    "input_map",
    "inverse_dynamics_u",
)
# a loop in a plane, with a frame that is turned, wrenches and more inputs than it needs
LOOP = """
model: loop
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m}
bodies:
  crank: {mass: 1 kg, com: [0.1, 0.02], inertia: 0.01}
  coupler: {mass: 2 kg, com: [0.2, -0.03], inertia: 0.06}
  rocker: {mass: 1.5 kg, com: [0.2, 0], inertia: 0.04}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: coupler, at: [0.2, 0], coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [0.55, 0], coordinate: q3}
closures: {C: {type: revolute, between: [coupler, rocker], at: [[l, 0], [0.4, 0]]}}
inputs: {tau: {joint: A}, brake: {joint: D}, push: {unit: N}}
frames: {tip: {body: coupler, position: [0.3, 0.1], angle: 30 deg}}
loads:
  pen: {type: wrench, frame: tip, axes: frame, force: [push, 2*push], moment: 0.1 m*push}
outputs: {tip: "position(coupler, [0.3, 0.1])", turn: angle(rocker)}
quasi_velocities: {crank: [der(q1)]}
initial: {q1: 1, guess: {q2: -0.5, q3: 1.7}}
"""
# a ball that rolls, with a quaternion and a frame off its centre
BALL = """
model: ball
gravity: [0, 0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, com: [0.01, 0, 0.02], inertia: [0.004, 0.005, 0.006]}}
joints: {J: {type: free, parent: ground, child: ball}}
constraints:
  floor: {type: rolling, body: ball, shape: {sphere: {radius: 0.1 m}}, plane: {normal: z}}
frames: {camera: {body: ball, position: [0.05, -0.02, 0.03], rpy: [0.3, -0.4, 0.5]}}
initial: {guess: {J_z: 0.1 m}}
"""
CASES = {"loop": (LOOP, "tip"), "ball": (BALL, "camera")}
# a light ball whose inputs throw it: of J v̇ + J̇ v all but a thousandth is J S ẇ
SADDLE = """
model: saddle
gravity: [0, 0, -9.81 m/s^2]
bodies: {ball: {mass: 0.4 kg, com: [0.01, 0.005, -0.008], inertia: [0.0006, 0.0007, 0.0008]}}
joints: {base: {type: free, parent: ground, child: ball, position: [x, y, z]}}
constraints:
  c:
    {type: rolling, body: ball, shape: {sphere: {radius: 0.06 m}},
     surface: z - (0.8 1/m)*x^2 + (0.5 1/m)*y^2 - (0.3 1/m)*x*y}
inputs: {u: {velocity: base.wx}, w: {velocity: base.wy}, k: {velocity: base.wz}}
frames: {side: {body: ball, position: [0.02, 0.01, 0]}}
initial: {x: 0.1 m, y: 0.15 m, guess: {z: 0.06 m}}
"""


@cache
def seen(case: str) -> Evidence:
    """With every function of the frame, of the ground and over w."""
    text, frame = CASES[case]
    model = load_text(text)
    found = equations(system(model))
    names = [f"{family.name}_{frame}" for family in found.families]
    names += ["pose_ground", "jacobian_ground", *OVER_W, "outputs_jacobian"]
    asked = [request_of(found, name) for name in names]
    functions = tuple(request.function for request in asked if request and request.refusal is None)
    full = replace(found, functions=(*found.functions, *functions))
    return evidence(reference(model), full, None, FEW)


NEEDED = ("dynamics", "velocity", "state", "outputs")  # what the checks themselves call


def alone(e: Evidence, name: str, value: ca.SX) -> Evidence:
    """With that value of one function, and with no other function on request."""
    chosen = e.graph.equations
    function = chosen.function(name)
    wrong = replace(function, result=replace(function.result, value=value))
    functions = tuple(f for f in chosen.functions if f.name in NEEDED)
    return replace(e, graph=evaluator(replace(chosen, functions=(*functions, wrong))))


def own_functions(equations: Equations) -> list[str]:
    default = {"dynamics", "mass", "bias", "state", "velocity", "outputs", "inverse_dynamics"}
    default |= {"constraints", "project", "reactions", "energy", "power"}
    default |= {"qdot", "integrate", "difference", "normalise"}
    return [f.name for f in equations.functions if f.name not in default]


@pytest.mark.parametrize("case", CASES)
def test_every_check_looks_and_is_green(case):
    found = {result.name: result for result in results(seen(case), OWN)}
    assert {check.name for check in named_frames.CHECKS} <= {*found}
    assert {name for name in found if not found[name].passed} == set()
    missing = {check.name for check in quasi.CHECKS} - {*found}
    assert missing == (set() if case == "loop" else {"input map", "inputs for ẇ"})


@cache
def thrown() -> Evidence:
    found = equations(system(load_text(SADDLE)), "orthonormal")
    request = request_of(found, "jdot_w_side")
    assert request is not None
    full = replace(found, functions=(*found.functions, request.function))
    return evidence(reference(found.system.model), full, None, 20)


def test_what_is_left_without_the_own_accelerations_is_seen_through_their_rounding() -> None:
    """J v̇ + J̇ v less J S ẇ; a ten-thousandth of an entry is seen all the same."""
    e = thrown()
    found = {result.name: result for result in results(e, named_frames.CHECKS)}
    assert found["accelerations of frames"].passed
    value = ca.densify(ca.SX(e.graph.equations.function("jdot_w_side").result.value))
    for k in range(6):
        wrong = ca.SX(value)
        wrong[k] = 1.0001 * wrong[k]
        assert not all(x.passed for x in results(alone(e, "jdot_w_side", wrong), OWN)), k


@pytest.mark.parametrize("case", CASES)
def test_an_entry_that_is_wrong_by_a_thousandth_is_seen_in_every_function(case):
    """The largest entry; and of a result that is zero everywhere, an entry that is not."""
    e = seen(case)
    unseen = []
    for name in own_functions(e.graph.equations):
        value = ca.densify(ca.SX(e.graph.equations.function(name).result.value))
        places = [k for k in range(value.numel()) if not ca.SX(value[k]).is_zero()]
        for k in places[:1] + places[-1:]:
            wrong = ca.SX(value)
            wrong[k] = 1.001 * wrong[k] + 1e-4
            if all(result.passed for result in results(alone(e, name, wrong), OWN)):
                unseen.append((name, k))
    assert not unseen


@pytest.mark.slow
def test_the_mutations_in_these_functions_are_caught():
    """Operations swapped, negated, left out: the suite sees each."""
    e = seen("loop")
    chosen = e.graph.equations
    kept = tuple(f for f in chosen.functions if f.name in {*NEEDED, *own_functions(chosen)})
    found = mutations(chosen.system.model, replace(chosen, functions=kept), most=60)
    planted = [x for x in found.list if x.where.removesuffix("()") in own_functions(chosen)]
    assert len(planted) >= 25
    assert [x for x in planted if not x.caught_by] == []


def test_a_wrong_wrench_is_seen():
    """Its force at the body's origin in place of the frame's: Q differs from the reference's."""
    wrong = LOOP.replace("tip: {body: coupler, position: [0.3, 0.1]", "tip: {body: coupler")
    model = load_text(LOOP)
    found = evidence(reference(model), equations(system(load_text(wrong))), None, FEW)
    red = {result.name for result in results(found, CHECKS) if not result.passed}
    assert "Q" in red
