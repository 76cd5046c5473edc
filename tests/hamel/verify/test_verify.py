"""The suite: green on sound models of every kind, and every check seen red on a planted error.

Of hamel.verify: limits, shipped.
Of hamel.verify.checks: algebra, charts, configuration, inverse, motion, samples, udwadia, units.
"""

import json
import re
import sys
from contextlib import suppress
from dataclasses import replace
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.model import load, load_text
from derive.states import system
from hamel.build.module import temporary_module
from hamel.verify import verification
from hamel.verify.checks import CHECKS, algebra, kinks, manifold, named_frames, quasi, steps
from hamel.verify.checks.linear import JACOBIANS, with_linearization
from hamel.verify.checks.roundoff import bound
from hamel.verify.checks.samples import terms
from hamel.verify.limits import UNDONE
from hamel.verify.mutation.errors import (
    mutants,
    wrong_functions,
    wrong_matrices,
    wrong_systems,
)
from hamel.verify.mutation.mutations import mutations
from hamel.verify.published import INTEGRATOR, published_checks
from hamel.verify.reference.outcome import reference
from hamel.verify.reference.saddle import condition_of
from hamel.verify.stored import stored
from hamel.verify.suite import evidence, quick_verification
from tests.scenes import MODELS
from tests.texts import ARM, CAR_AXIS, EVERYTHING, PARALLELOGRAM, SURFACE

FEW = 6  # states: planted errors show at any of them

REDUNDANT = PARALLELOGRAM + "constraints:\n  same: {holonomic: q1 - q3}\n"
STANDING = """
model: standing
plane: xz
gravity: [0, -9.81 m/s^2]
bodies: {a: {mass: 1 kg, com: [0.7, 0.1], inertia: 0.2}, b: {mass: 1 kg, com: [1, 0.2]}}
joints:
  A: {type: planar, parent: ground, child: a}
  B: {type: revolute, parent: a, child: b, at: [1, 0.3], coordinate: q2}
loads:
  push: {type: torque, body: b, components: 0.4}
  rope: {type: spring, between: [ground, b], at: [[3, 0], [0, 0.3]], stiffness: 10, length: 0.4, damping: 0.7}
outputs: {tip: "position(b, [1 m, 0.2 m])", speed: "velocity(b, [1 m, 0.2 m])", turn: angle(b)}
"""
STUCK = """
model: stuck
bodies: {a: {mass: 1 kg}, b: {mass: 2 kg}, c: {mass: 1 kg, inertia: [0.1, 0.1, 0.2]}}
joints:
  A: {type: prismatic, axis: x, parent: ground, child: a, coordinate: x}
  B: {type: prismatic, axis: y, parent: a, child: b, coordinate: y}
  C: {type: revolute, axis: z, parent: b, child: c, coordinate: turn}
constraints:
  stays: {holonomic: x}
  rolls: {nonholonomic: "der(y) - (0.4 m)*der(turn) + 0.2*der(x)"}
"""
FAMILIES = {
    "tree": ARM, "rheonomic": CAR_AXIS, "everything": EVERYTHING, "redundant": REDUNDANT, "standing": STANDING,
}  # fmt: skip
ON_COORDINATES = """
model: thrown
bodies: {s: {mass: 2 kg, inertia: [1, 2, 2.5]}}
joints:
  base: {type: free, parent: ground, child: s, position: [x, y, z],
         orientation: {euler: zxy, angles: [yaw, lean, spin]}}
forces: {x: (1 N)*cos(yaw), lean: (2 N*m)*sin(x/(1 m))}
loads:
  drag: {type: damper, coordinate: y, coefficient: 0.3}
  rub: {type: friction, coordinate: spin, viscous: 0.3}
"""


def shown(found):
    return {check.name: check.value for check in found.failed}


def everything_of(path):
    model = load(path)
    mechanics = system(model)
    found = {}
    for choice in model.choices:
        with suppress(AssumptionError):  # a choice that the constraints refuse has no equations
            found[choice.name] = equations(mechanics, choice.name)
    return model, found


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_choice_of_every_model_passes(path):
    model, choices = everything_of(path)
    for name, chosen in choices.items():
        others = [other for key, other in choices.items() if key != name]
        found = verification(model, chosen, states=20, others=others)
        assert found.passed, (name, shown(found))
        assert found.states == 20


@pytest.mark.parametrize("formulation", ["quasi_velocities", "augmented"])
@pytest.mark.parametrize("name", FAMILIES)
def test_models_of_every_kind_pass(name, formulation):
    model = load_text(FAMILIES[name])
    found = verification(model, equations(system(model), None, formulation), states=20)
    assert found.passed, shown(found)


@pytest.mark.slow
def test_forces_on_coordinates_whose_rates_are_no_velocities():
    """They pass, and every error planted in what they do is seen."""
    model = load_text(ON_COORDINATES)
    chosen = equations(system(model))
    found = verification(model, chosen, states=FEW)
    assert found.passed, shown(found)
    planted = mutations(model, chosen, most=60)
    assert planted.caught == planted.planted > 30


@pytest.mark.slow
def test_a_surface_that_moves_passes():
    model = load_text(SURFACE)
    found = verification(model, equations(system(model), None, "augmented"), states=10)
    assert found.passed, shown(found)


@pytest.mark.slow
def test_a_hundred_states_and_json():
    model = load(MODELS / "hoop.yaml")
    found = verification(model, equations(system(model)), states=100)
    assert found.passed
    assert found.states == 100
    record = json.loads(json.dumps(found.as_json()))
    assert {"model", "passed", "checks"} <= set(record)
    assert all({"name", "value", "tolerance", "passed"} <= set(check) for check in record["checks"])
    assert found == verification(model, equations(system(model)), states=100)


def test_baked_constants_pass():
    model = load(MODELS / "four_bar.yaml")
    found = verification(model, equations(system(model, "all"), "crank"), states=10)
    assert found.passed, shown(found)


# ---- planted errors
# -------------------------------------------------------------------------------------------------------

EXPECTED = {  # what is wrong in the system → a check that must go red
    "gravity": "h",
    "velocity products": "h",
    "applied force": "Q",
    "mass": "M",
    "mass on one side": "M symmetric",
    "negative mass": "M semidefinite",
    "kinematics": "q̇ = N v",
    "rates": "q̇ = N v",
    "position": "φ",
    "constraint row": "A, c",
    "constraint drift": "β",
    "kinetic energy": "T, V",
    "potential energy": "T, V",
    "power": "power",
}


@pytest.fixture(scope="module")
def four_bar():
    return everything_of(MODELS / "four_bar.yaml")


@pytest.fixture(scope="module")
def seen(four_bar):
    """Evidence about the crank choice; planted errors replace one part of it."""
    model, choices = four_bar
    return evidence(reference(model), choices["crank"], None, FEW, others=[choices["rocker"]])


def red(evidence_of, names=None):
    """The checks that go red, of those asked for."""
    with np.errstate(all="ignore"):
        found = {
            check: check.error(evidence_of)
            for check in CHECKS
            if names is None or check.name in names
        }
    return {
        check.name
        for check, error in found.items()
        if error is not None and not error <= check.tolerance
    }


@pytest.mark.parametrize("name", ["four_bar", "snake3", "rolling_disk", "bead_in_bowl"])
def test_wrong_terms_of_the_system_are_caught(name):
    model, choices = everything_of(MODELS / f"{name}.yaml")
    chosen = next(iter(choices.values()))
    planted = dict(wrong_systems(chosen.system))
    assert len(planted) >= 8
    for what, wrong in planted.items():
        found = verification(model, replace(chosen, system=wrong), states=FEW)
        assert EXPECTED[what] in shown(found), what


@pytest.mark.parametrize("name", ["four_bar", "free_body", "rolling_disk", "bead_on_wire"])
def test_every_planted_error_is_caught(name):
    """Of a sample over all terms and functions; the slow test below takes more of every model."""
    model = load(MODELS / f"{name}.yaml")
    found = mutations(model, equations(system(model)), most=60)
    assert found.planted > 30
    assert found.caught == found.planted, [
        mutation for mutation in found.list if not mutation.caught_by
    ]


def test_zeros_have_no_condition():
    assert condition_of(np.zeros((2, 2))) == np.inf and condition_of(np.diag([2.0, 8.0])) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "path",
    [*sorted(MODELS.glob("*.yaml")), *sorted(MODELS.glob("extremes/*.yaml"))],
    ids=lambda path: path.stem,
)
def test_every_planted_error_is_caught_in_every_model(path):
    model = load(path)
    found = mutations(model, equations(system(model)))
    assert found.caught == found.planted >= 100, [
        mutation for mutation in found.list if not mutation.caught_by
    ]


def test_what_the_checks_cannot_see_is_said(monkeypatch):
    """With the check that knows Q left out, wrong forces go unnoticed, and the record says so."""
    blind = tuple(check for check in CHECKS if check.name == "M")
    monkeypatch.setattr(sys.modules["hamel.verify.mutation.mutations"], "CHECKS", blind)
    model = load(MODELS / "four_bar.yaml")
    found = mutations(model, equations(system(model)), most=40)
    assert found.caught < found.planted
    assert any(mutation.where == "Q" and not mutation.caught_by for mutation in found.list)
    assert all(mutation.caught_by == ("M",) for mutation in found.list if mutation.where == "M")


@pytest.mark.slow
def test_changes_without_effect_are_not_planted():
    """x/1 for x·1 and sums with zero: no number changes, and no check could see it."""
    model = load_text(ARM)
    found = mutations(model, equations(system(model)), most=60)
    assert found.planted + found.equivalent >= 60 - 24
    assert found.caught == found.planted


def test_one_error_turns_several_rungs_red():
    """A wrong Ȧ v or a wrong sign in A is also seen along the motion, without the reference."""
    model, choices = everything_of(MODELS / "four_bar.yaml")
    planted = dict(wrong_systems(choices["crank"].system))
    expected = {
        "constraint drift": {"v̇ augmented", "β = −Ȧ v + ċ"},
        "constraint row": {"states admissible", "v̇", "λ", "d(A v − c)/dt = 0", "φ̇ = A v − c"},
        "mass": {"v̇ augmented", "T = ½ vᵀ M v"},
        "position": {"φ̇ = A v − c"},
    }
    for what, checks in expected.items():
        assert checks <= set(
            shown(verification(model, replace(choices["crank"], system=planted[what]), states=FEW))
        ), what


@pytest.mark.parametrize("name", ["four_bar", "bead_in_bowl"])
def test_every_changed_operation_of_the_motion_is_caught(name):
    """All operations of ẋ and λ, one at a time: + for −, × for ÷, sine for cosine, x² for 2 x."""
    model, choices = everything_of(MODELS / f"{name}.yaml")
    chosen = next(iter(choices.values()))
    whole = evidence(reference(model), chosen, None, 3)
    for function, checks in (("dynamics", {"v̇", "q̇ = N v"}), ("reactions", {"λ"})):
        for what, wrong in wrong_functions(chosen, function):
            assert red(replace(whole, graph=evaluator(wrong)), checks), what


FUNCTION_CHECKS = {
    "mass": "M",
    "bias": "h",
    "constraints": "constraints",
    "project": "project, one step",
    "energy": "energy",
    "power": "d(T₂ − T₀ + V)/dt",
    "outputs": "outputs",
    "velocity": "x ↔ (q, v)",
    "inverse_dynamics": "inverse dynamics",
}


@pytest.mark.parametrize("function", FUNCTION_CHECKS)
def test_changed_operations_of_the_other_functions_are_caught(seen, function):
    """The last operations of each: those near the result are never without effect."""
    planted = list(wrong_functions(seen.graph.equations, function))[-3:]
    assert planted
    for what, wrong in planted:
        assert red(replace(seen, graph=evaluator(wrong)), {FUNCTION_CHECKS[function]}), what


def test_wrong_matrices_of_the_page_are_caught(seen):
    planted = dict(wrong_matrices(seen.graph.equations))
    caught = {
        name: red(replace(seen, graph=evaluator(planted[name]))) for name in ("A", "B", "R", "S")
    }
    assert {"A R = 1", "B R = 0"} <= caught["R"]
    assert {"A S = 0", "B S = 1"} <= caught["S"]
    assert caught["A"] & {"A S = 0", "A R = 1"}
    assert caught["B"] & {"B S = 1", "B R = 0"}


def test_a_wrong_column_of_a_velocity_that_is_always_zero_is_caught():
    model = load_text(STUCK)
    chosen = with_linearization(equations(system(model), None, "augmented"))
    sound = evidence(reference(model), chosen, None, FEW, 0)
    assert not red(sound)
    function = chosen.function("constraints")
    still = chosen.arguments[1].symbols[chosen.arguments[1].labels.index("x_dot")]
    (row,) = (k for k, name in enumerate(function.result.labels) if name == "velocity rolls")
    value = ca.SX(function.result.value)
    value[row] += 0.3 * still
    wrong = replace(function, result=replace(function.result, value=value))
    functions = tuple(wrong if f.name == "constraints" else f for f in chosen.functions)
    assert "constraints" in red(
        replace(sound, graph=evaluator(replace(chosen, functions=functions)))
    )


def test_a_state_that_is_not_the_inverse_of_the_velocity_is_caught(seen):
    chosen = seen.graph.equations
    function = next(f for f in chosen.functions if f.name == "state")
    wrong = replace(function, result=replace(function.result, value=function.result.value * 1.001))
    functions = tuple(wrong if f.name == "state" else f for f in chosen.functions)
    assert "x ↔ (q, v)" in red(replace(seen, graph=evaluator(replace(chosen, functions=functions))))


def test_a_projection_that_stops_short_is_caught(seen):
    chosen = seen.graph.equations
    function = next(f for f in chosen.functions if f.name == "project")
    x = next(a.symbols for a in chosen.arguments if a.name == "x")
    wrong = replace(function, result=replace(function.result, value=x))
    functions = tuple(wrong if f.name == "project" else f for f in chosen.functions)
    assert {"project", "project, one step"} <= red(
        replace(seen, graph=evaluator(replace(chosen, functions=functions)))
    )


def test_a_projection_that_moves_what_need_not_move_is_caught(seen):
    """The velocities doubled: φ is closed all the same."""
    chosen = seen.graph.equations
    function = next(f for f in chosen.functions if f.name == "project")
    wrong = replace(
        function, result=replace(function.result, value=ca.vertcat(function.result.value[:-1], 0))
    )
    functions = tuple(wrong if f.name == "project" else f for f in chosen.functions)
    assert "project, nothing to do" in red(
        replace(seen, graph=evaluator(replace(chosen, functions=functions)))
    )


@pytest.mark.parametrize("formulation", ["augmented", "quasi_velocities"])
def test_velocities_that_are_not_the_nearest_are_caught(formulation):
    """A step by another metric ends on A v = c as well; one that takes w along is no step."""
    chosen = equations(system(load(MODELS / "four_bar.yaml")), None, formulation)
    function = next(f for f in chosen.functions if f.name == "project")
    x = chosen.argument("x").symbols
    value = ca.SX(function.result.value)
    if formulation == "augmented":
        heavier = ca.diag(ca.SX([3, 1, 2]))
        step = value[3:6] - x[3:6]
        rows = chosen.system.A
        wrong = ca.mtimes(heavier, rows.T)
        value[3:6] = x[3:6] + ca.mtimes(wrong, ca.solve(rows @ wrong, rows @ step))
    else:
        value[3] = x[3] + 1e-6
    planted = replace(function, result=replace(function.result, value=value))
    functions = tuple(planted if f.name == "project" else f for f in chosen.functions)
    whole = evidence(reference(chosen.system.model), chosen, None, 3)
    wrong = replace(whole, graph=evaluator(replace(chosen, functions=functions)))
    names = {"project", "project, velocities of one step"}
    assert not red(whole, names)
    assert red(wrong, names) == {"project, velocities of one step"}


def test_a_multiplier_that_balances_nothing_is_caught(seen):
    _, wrong = list(wrong_functions(seen.graph.equations, "reactions"))[-1]
    assert red(replace(seen, graph=evaluator(wrong)), {"M v̇ + h = Q + Aᵀ λ"})


@pytest.mark.parametrize("function", ["qdot", "integrate", "difference", "normalise"])
def test_a_step_in_the_configuration_space_that_is_wrong_is_caught(function):
    model = load(MODELS / "free_body.yaml")
    chosen = equations(system(model))
    whole = evidence(reference(model), chosen, None, 3)
    assert red(whole) == set()
    for what, wrong in list(wrong_functions(chosen, function))[-3:]:
        assert red(replace(whole, graph=evaluator(wrong)), {function}), what


PUBLISHED = """
model: falling
plane: xz
gravity: [0, -10 m/s^2]
bodies: {stone: {mass: 2 kg}}
joints: {up: {type: prismatic, parent: ground, child: stone, axis: y, coordinate: z}}
initial: {z: 100 m}
outputs: {depth: 100 m - z}
reference:
  start: {source: Galilei, tolerance: 1e-12, accelerations: {der(z): -10}}
  fallen: {source: Galilei, time: 2 s, tolerance: 1e-12, values: {z: 80 m, der(z): -20 m/s, depth: 20 m, T: 400 J}}
  wrong: {source: Aristotle, time: 2 s, tolerance: 1e-6, values: {z: 90 m}}
"""


def test_published_values_are_held_to():
    chosen = equations(system(load_text(PUBLISHED.replace("axis: y", "axis: [0, 1]"))))
    with temporary_module(chosen, (INTEGRATOR,)) as module:
        found = {check.name: check for check in published_checks(chosen, module)}
    assert [check.passed for check in found.values()] == [True, True, False]
    assert found["reference wrong"].value == pytest.approx(1 / 9)


@pytest.mark.parametrize(
    "entry, message",
    [
        ("{tolerance: 1e-9, values: {z: 1 m}}", "source"),
        ("{source: a, tolerance: 1e-9}", "reference 'x' holds no value"),
        ("{source: a, tolerance: 0, values: {z: 1 m}}", "a tolerance of 0"),
        ("{source: a, tolerance: 1e-9, time: -1 s, values: {z: 1 m}}", "a reference at -1 s"),
        ("{source: a, tolerance: 1e-9, values: {zz: 1 m}}", "unknown coordinate or velocity 'zz'"),
        ("{source: a, tolerance: 1e-9, values: {z: 1 kg}}", "the published z in kg"),
        ("{source: a, tolerance: 1e-9, accelerations: {z: 1}}", "unknown generalized velocity 'z'"),
    ],
)
def test_a_reference_that_is_wrong_is_said_with_its_place(entry, message):
    with pytest.raises(ModelError, match=r":13:\d+: error: .*") as error:
        load_text(PUBLISHED.replace("axis: y", "axis: [0, 1]") + f"  x: {entry}\n")
    assert message in str(error.value)


def test_an_inverse_that_is_none_is_caught(seen):
    """Wrong in v̇ alone, and the dynamics wrong under a right inverse."""
    for function in ("inverse_dynamics", "dynamics"):
        planted = list(wrong_functions(seen.graph.equations, function))[-1:]
        assert red(replace(seen, graph=evaluator(planted[0][1])), {"dynamics ∘ inverse"}), function


@pytest.mark.slow
def test_a_right_inverse_through_a_small_pivot_passes_and_an_error_in_it_is_caught():
    """The second chart of the bicycle on tyres: R loses four digits at one state of a hundred,
    where Y is well conditioned; an entry that is off by 1e-9 of itself is more than that."""
    model = load(MODELS / "extremes" / "bicycle_toroidal.yaml")
    found = equations(system(model), charts=True, moving=True)
    seen = evidence(reference(model), found, None, 100, 0)
    chart = found.charts[1]
    there = replace(seen, graph=evaluator(chart), chart=2)
    assert algebra.inverse(there, "A", "R") == 0.0
    named = [replace(x, value=(1.0 + 1e-9) * x.value) if x.name == "R" else x for x in chart.named]
    wrong = replace(there, graph=evaluator(replace(chart, named=tuple(named))))
    assert algebra.inverse(wrong, "A", "R") > UNDONE


def test_a_row_too_many_is_caught(seen, four_bar):
    """A system without one of its rows has another rank, and leaves another number of
    quasi-velocities."""
    _, choices = four_bar
    short = replace(choices["crank"], w=("a", "b"))
    assert red(replace(seen, graph=evaluator(short)), {"rank A"})
    fewer = replace(seen.system, A=ca.vertcat(seen.system.A[0, :], seen.system.A[0, :]))
    wrong = replace(seen, system=fewer, terms_at=terms(fewer))
    assert red(wrong, {"rank A"})


def test_another_choice_with_another_motion_is_caught(seen, four_bar):
    _, choices = four_bar
    _, wrong = next(iter(wrong_functions(choices["rocker"], "dynamics")))
    assert red(replace(seen, others=(evaluator(wrong),))) == {"v̇ of other choices"}


def module_of(seen, **instead):
    """A module that computes what the graph says, but for the functions given."""
    made = ModuleType("made_for_test")
    made.defaults = np.zeros(0)  # in float64, like all of it
    for name in seen.graph.functions:
        setattr(
            made,
            name,
            instead.get(name, lambda t, x, u, p, n=name: seen.graph.iterated(n, t, x, u, p)),
        )
    return made


SPOILED = {
    "a little": lambda y: y * (1 + 1e-9),
    "the sign": np.negative,
    "not a number": lambda y: y * np.nan,
    "too short": lambda y: y[1:],
}


@pytest.mark.parametrize("spoil", SPOILED.values(), ids=SPOILED)
@pytest.mark.parametrize("function", ["dynamics", "project"])
def test_wrong_code_is_caught(seen, monkeypatch, function, spoil):
    """In the module as loaded, in its NumPy text and in its ctypes fallback alike."""
    right = getattr(module_of(seen), function)
    wrong = module_of(seen, **{function: lambda *arguments: spoil(right(*arguments))})
    assert red(replace(seen, module=module_of(seen)), {"module = graph"}) == set()
    assert red(replace(seen, module=wrong), {"module = graph"})
    for backend, check in (("_numpy", "NumPy = graph"), ("_library", "ctypes = graph")):
        monkeypatch.setitem(sys.modules, "made_for_test", module_of(seen))
        monkeypatch.setitem(sys.modules, f"made_for_test.{backend}", wrong)
        assert red(replace(seen, module=module_of(seen)), {check}) == {check}


def test_a_batch_that_differs_is_caught(seen):
    def batch(t, x, u, p):
        return np.array([seen.graph("dynamics", *row) for row in zip(t, x, u, p)])

    checks = {"batch = one by one"}
    assert red(replace(seen, module=module_of(seen, dynamics=batch)), checks) == set()
    assert (
        red(
            replace(seen, module=module_of(seen, dynamics=lambda *rows: batch(*rows)[::-1])), checks
        )
        == checks
    )


def test_code_that_refuses_a_state_is_caught(seen):
    def refused(*arguments):
        raise FloatingPointError("singular")

    assert red(replace(seen, module=module_of(seen, dynamics=refused)), {"module = graph"})


def test_states_that_cannot_be_found_are_a_failure():
    impossible = PARALLELOGRAM + "constraints:\n  never: {holonomic: 2 + cos(q1)}\n"
    model = load_text(PARALLELOGRAM)
    chosen = equations(system(model))
    found = verification(model, replace(chosen, system=system(load_text(impossible))), states=2)
    assert not found.passed
    assert [check.name for check in found.failed] == ["states found"]


PRODUCTS = ("dynamics_forward", "dynamics_adjoint", "jacobian_forward")


@pytest.fixture(scope="module")
def linearised(four_bar):
    """The crank choice with what is derived from its ẋ on request."""
    model, choices = four_bar
    chosen = with_linearization(choices["crank"])
    asked = (*JACOBIANS, *PRODUCTS, "derivatives", "contraction", "dynamics_hessian")
    asked = (*asked, "jacobian_values", "jacobian_u_values", "jacobian_p_values")
    made = tuple(request.function for request in chosen.requests if request.name in asked)
    return evidence(
        reference(model), replace(chosen, functions=(*chosen.functions, *made)), None, FEW
    )


def with_entry(seen, name, k):
    """One entry of a function's result too large by a thousandth."""
    chosen = seen.graph.equations
    function = next(f for f in chosen.functions if f.name == name)
    value = ca.densify(function.result.value)
    value[k] *= 1.001
    wrong = replace(function, result=replace(function.result, value=value))
    functions = tuple(wrong if f.name == name else f for f in chosen.functions)
    return replace(seen, graph=evaluator(replace(chosen, functions=functions)))


def test_wrong_linear_equations_are_caught(linearised):
    """Every entry that is not zero, in A, B, C and D; A also without any differences, along a
    steady motion."""
    names = {"linearization", "linearization, unreduced"}
    assert red(linearised, names) == set()
    value = next(
        f.result.value for f in linearised.graph.equations.functions if f.name == "linearization"
    )
    places = [k for k in range(value.numel()) if not ca.SX(value[k]).is_zero()]
    assert len(places) >= 6
    for k in places:
        assert "linearization" in red(with_entry(linearised, "linearization", k), names), k
    assert "linearization, unreduced" in red(with_entry(linearised, "linearization", 1), names)


VALUES = ["jacobian_values", "jacobian_u_values", "jacobian_p_values"]


@pytest.mark.parametrize("name", ["jacobian", "jacobian_u", "jacobian_p", "derivatives", *VALUES])
def test_wrong_jacobians_are_caught(linearised, name):
    assert red(linearised, {"Jacobians"}) == set()
    value = next(f.result.value for f in linearised.graph.equations.functions if f.name == name)
    k = next(k for k in reversed(range(value.numel())) if not ca.SX(value[k]).is_zero())
    assert red(with_entry(linearised, name, k), {"Jacobians"})


@pytest.mark.parametrize(
    ("name", "check"),
    [
        ("dynamics_forward", "products of Jacobians"),
        ("dynamics_adjoint", "products of Jacobians"),
        ("jacobian_forward", "slopes of a product"),
        ("contraction", "contraction"),
        ("dynamics_hessian", "contraction"),
    ],
)
def test_wrong_products_of_derivatives_are_caught(linearised, name, check):
    """Every entry that is not zero."""
    assert red(linearised, {check}) == set()
    value = linearised.graph.equations.function(name).result.value
    for k in range(value.numel()):
        if not ca.SX(value[k]).is_zero():
            assert red(with_entry(linearised, name, k), {check}), k


def test_errors_are_planted_in_functions_on_request_and_seen(tmp_path):
    """By name, as in a build; what no check looked at would be left unseen."""
    names = ["pose_ball", "jacobian_values", "dynamics_adjoint", "mass_w"]
    (tmp_path / "rod.yaml").write_text(ROD)
    found = hamel.verify(tmp_path / "rod.yaml", functions=names, states=FEW, mutate=True)
    assert found.passed and found.mutations is not None
    assert {f"{name}()" for name in names} <= {each.where for each in found.mutations.list}
    with pytest.raises(HamelError, match="rod has no frame 'bal'"):
        hamel.verify(tmp_path / "rod.yaml", functions=["pose_bal"])


def test_errors_are_planted_where_functions_are_numbers():
    """Without freedom and with nothing that varies some functions are matrices of numbers."""
    model = load_text(HELD)
    found = mutations(model, equations(system(model)), most=40)
    assert found.caught == found.planted > 0


HELD = """
model: held
plane: xy
bodies: {a: {mass: 1 kg, inertia: 0.1}}
joints: {A: {type: revolute, parent: ground, child: a, coordinate: q1}}
constraints: {stop: {holonomic: q1 - 0.3}}
initial: {guess: {q1: 0.3}}
"""

ROD = """
model: rod
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, com: [0.5 m, 0], inertia: 0.1}}
joints: {hinge: {type: revolute, parent: ground, child: ball}}
inputs: {torque: {joint: hinge}}
"""


@pytest.mark.parametrize("name", ["four_bar", "bead_in_bowl", "free_body"])
def test_a_motion_that_pseudo_inverses_do_not_find_is_caught(name):
    chosen = equations(system(load(MODELS / f"{name}.yaml")))
    whole = evidence(reference(chosen.system.model), chosen, None, FEW)
    names = {"v̇ Udwadia–Kalaba", "v̇ Udwadia–Phohomsiri"}
    assert red(whole, names) == set()
    assert red(with_entry(whole, "dynamics", len(chosen.arguments[1].labels) - 1), names) == names


def test_without_an_inverse_of_m_only_phohomsiri_answers():
    """A massless mid-point between two springs, held by a rod: M is singular, M and A together are
    not."""
    model = load_text(MASSLESS)
    whole = evidence(
        reference(model), equations(system(model), None, "udwadia_phohomsiri"), None, FEW
    )
    values = {check.name: check.error(whole) for check in CHECKS if check.name.startswith("v̇ U")}
    assert values["v̇ Udwadia–Kalaba"] is None and values["v̇ Udwadia–Phohomsiri"] < 1e-12


MASSLESS = """
model: massless
coordinates: {x: m, y: m}
parameters: {mass: 2 kg, k: 3 N/m}
kinetic: mass/2*der(x)^2
potential: k/2*x^2
constraints: {rod: {holonomic: x^2 + 2*y^2 - 2 m^2}}
initial: {guess: {x: 1 m, y: 0.7 m}}
"""


def test_every_rung_has_been_seen_red(seen, four_bar):
    """Checks and the test above, or in test_verify_motion, that turns each red; a new check needs a
    planted error of its own."""
    by_code = {"module = graph", "ctypes = graph", "NumPy = graph", "batch = one by one"}
    by_code |= {
        "-O0 = graph",
        "no number from none",
        "simulate",
        "order of the integrator",
        "work = Δ(T₂ − T₀ + V)",
        "there and back",
    }
    by_code |= {"momenta"}
    by_code |= {
        "transform",
        "Pinocchio",
        "MuJoCo",
        "Exudyn",
    }  # test_charts; where they are installed, test_engines
    named = {
        *EXPECTED.values(),
        *FUNCTION_CHECKS.values(),
        "v̇",
        "λ",
        "v̇ augmented",
        "v̇ of other choices",
        "project",
        "project, velocities of one step",
    }
    named |= {"states admissible", "A S = 0", "A R = 1", "B S = 1", "B R = 0", "T = ½ vᵀ M v"}
    named |= {"dynamics ∘ inverse", "rank A", "project, nothing to do", "M v̇ + h = Q + Aᵀ λ"}
    named |= {
        "linearization",
        "linearization, unreduced",
        "Jacobians",
        "contraction",
        "products of Jacobians",
        "slopes of a product",
        "v̇ Udwadia–Kalaba",
        "v̇ Udwadia–Phohomsiri",
    }
    named |= {"energy", "qdot", "integrate", "difference", "normalise"}
    named |= {"d(A v − c)/dt = 0", "β = −Ȧ v + ċ", "φ̇ = A v − c"}
    named |= {"events"}  # test_events
    named |= {check.name for check in (*named_frames.CHECKS, *quasi.CHECKS)}  # test_named_frames
    named |= {"Jacobian of outputs"}  # the same
    named |= {check.name for check in (*manifold.CHECKS, *kinks.CHECKS)}  # test_manifold
    named |= {check.name for check in steps.CHECKS}  # test_steps
    named |= {"π", "Y π + rest", "Sᵀ (Y π + rest)"}  # test_regressors
    named |= {"ż"}  # test_states
    assert {check.name for check in CHECKS} == named | by_code


def test_the_result_is_kept_beside_the_module(seen):
    """Twice the same bytes; a failure is told as one."""
    chosen = seen.graph.equations
    found = verification(chosen.system.model, chosen, states=FEW)
    text = stored(found, chosen, {})
    assert text == stored(verification(chosen.system.model, chosen, states=FEW), chosen, {})
    summary = json.loads(text)["summary"]
    assert summary["passed"] == summary["checks"] == len(found.checks)
    assert summary["rank"] == 2 and summary["margin"] >= 1
    assert set(summary["region"]) > {"t", "q1", "q2", "q3", "der(q1)", "tau", "l1"}
    assert summary["region"]["l1"][0] < 0.2 < summary["region"]["l1"][1]
    assert "dynamics" in summary["guards"]
    _, wrong = next(iter(wrong_systems(chosen.system)))
    bad = verification(chosen.system.model, replace(chosen, system=wrong), states=FEW)
    assert json.loads(stored(bad, chosen, {}))["summary"]["margin"] < 0


SLOT = """
model: slot
coordinates: {x: m, y: m}
parameters: {m: 1e-3 kg, k: 1e9 N/m, c: 0.6, s: 0.8}
kinetic: m/2*(der(x)^2 + der(y)^2)
potential: k/2*(s*x + c*y)^2
constraints: {slot: {holonomic: c*x - s*y}}
initial: {x: 0.3 m, guess: {y: 0.2 m}}
"""


def test_a_multiplier_that_is_zero_is_held_against_the_largest_force():
    """The spring pulls along the slot: all that is left of λ is roundoff of 1e9 N. An error of a
    millionth of that is one."""
    model = load_text(SLOT)
    e = equations(system(model))
    assert verification(model, e, states=FEW).passed
    wrong = [
        replace(f, result=replace(f.result, value=f.result.value + 1.0))
        if f.name == "reactions"
        else f
        for f in e.functions
    ]
    assert "λ" in shown(verification(model, replace(e, functions=tuple(wrong)), states=FEW))


# ---- tools
# ----------------------------------------------------------------------------------------------------------------


def test_mutants_change_one_operation_each():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    value = ca.vertcat(ca.sin(x) * y, x - y)
    found = [str(wrong) for _, wrong in mutants(value)]
    assert found == ["[(cos(x)*y), (x-y)]", "[(sin(x)/y), (x-y)]", "[(sin(x)*y), (x+y)]"]


def test_roundoff_bound_covers_another_order_of_a_sum():
    x = ca.SX.sym("x", 6)
    forwards, backwards = ca.sum1(x), x[5] + x[4] + x[3] + x[2] + x[1] + x[0]
    at = ca.Function("f", [x], [forwards, backwards])
    numbers = np.array([1e16, 1.0, -1e16, 1.0, 3.0, 1e-3])
    one, other = (float(y) for y in at(numbers))
    limit = float(bound([x], ca.densify(forwards), numbers[np.newaxis, :])[0, 0])
    assert one != other
    assert abs(one - other) <= 2 * limit < 20


def test_what_the_module_alone_has_no_value_of_is_named():
    equations_ = equations(system(load(MODELS / "pendulum.yaml")))
    with temporary_module(equations_) as module:

        class Broken:
            """The module, but for one function that has no value."""

            def __getattr__(self, name):
                return getattr(module, name)

            def bias(self, *_):
                raise FloatingPointError

        found = quick_verification(load(MODELS / "pendulum.yaml"), equations_, Broken, 3)
    assert not found.passed
    assert re.search(r"^bias has no value at state 0 \(\w+ = ", found.where)
