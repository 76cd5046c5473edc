"""The smallest models, and those that leave nothing to move, through every verb: each does its work
or says in words of mechanics why there is none."""

import json
import pickle
from pathlib import Path

import casadi as ca
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError, VerificationError

SLIDER = {
    "model": "m",
    "bodies": {"c": {"mass": 1}},
    "joints": {"C": {"type": "prismatic", "parent": "ground", "child": "c", "axis": "x"}},
}
COORDINATE = {
    "model": "m",
    "coordinates": {"q": "m"},
    "kinetic": "(1 kg)*der(q)^2/2",
}
AT_REST = {
    "no slip": SLIDER
    | {"constraints": {"e": {"type": "no_slip", "body": "c", "at": [0, 0, 0], "direction": "x"}}},
    "ball": SLIDER
    | {
        "closures": {
            "e": {"type": "ball", "between": ["ground", "c"], "at": [[0, 0, 0], [0, 0, 0]]}
        }
    },
    "rate": COORDINATE | {"constraints": {"e": {"nonholonomic": "der(q)"}}},
    "position": COORDINATE | {"constraints": {"e": {"holonomic": "q"}}},
}


def written(folder: Path, model: dict) -> str:
    path = folder / "m.yaml"
    path.write_text(json.dumps(model, indent=1))
    return str(path)


def test_what_is_left_of_a_single_symbol_is_an_empty_column():
    """What casadi makes of x[1:] for one symbol is a row, which vertcat counts as an entry."""
    x = ca.SX.sym("x")
    assert x[1:].shape == (1, 0) and ca.vertcat(x, x[1:]).numel() == 2
    assert x[1:, 0].shape == (0, 1)


@pytest.mark.parametrize("kind", AT_REST)
def test_a_model_without_freedom_is_derived_and_linearised(kind, tmp_path):
    path = written(tmp_path, AT_REST[kind])
    assert hamel.check(path).degrees_of_freedom == 0
    hamel.derive(path, out=str(tmp_path / "pages"))
    hamel.linearize(path, out=str(tmp_path / "page.html"))
    assert hamel.choices(path).choices


@pytest.mark.parametrize("kind", ["ball", "rate"])
def test_a_model_without_freedom_is_built_and_verified(kind, tmp_path):
    path = written(tmp_path, AT_REST[kind])
    module = hamel.load(hamel.build(path, out=str(tmp_path / "m")).folder)
    assert module.nx == 1 and module.dynamics(0.0, [0.0], [], []) == 0.0


def test_a_disk_that_lies_flat_is_told_by_name(tmp_path):
    shape = {"disk": {"radius": 0.5, "axis": [0, 1, 0]}}
    rolling = {"type": "rolling", "body": "c", "shape": shape, "plane": {"normal": "y"}}
    path = written(tmp_path, SLIDER | {"constraints": {"e": rolling}})
    with pytest.raises(AssumptionError, match="e: the disk lies flat") as error:
        hamel.check(path)
    assert error.value.diagnostics[0].line


def test_choices_of_a_body_without_inertia_say_that_it_has_none(tmp_path):
    """As `check` and `build` say it."""
    point = SLIDER | {
        "joints": {"C": {"type": "revolute", "parent": "ground", "child": "c", "axis": "z"}}
    }
    path = written(tmp_path, point)
    for verb in (hamel.choices, hamel.check):
        with pytest.raises(AssumptionError, match="determines the acceleration of body c") as told:
            verb(path)
        (problem,) = told.value.diagnostics
        assert problem.source_line[problem.column - 1 :].startswith("c")
        assert "do not turn it" in problem.expected and "formulation" not in str(problem)


SCREWED = SLIDER | {
    "closures": {
        "e": {
            "type": "screw",
            "between": ["ground", "c"],
            "at": [[0.1, 0.2, 0.3], [0.1, 0.2, 0.3]],
            "matrix": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
            "pitch": 0.2,
            "axis": "x",
        }
    }
}
# a disk on a hinge stands where its lowest point touches: its slip is zero but for rounding
LEANING = {
    "model": "m",
    "bodies": {"c": {"mass": 1, "inertia": [0.1, 0.2, 0.3]}},
    "joints": {"C": {"type": "revolute", "parent": "ground", "child": "c", "axis": "z"}},
    "constraints": {
        "e": {
            "type": "rolling",
            "body": "c",
            "shape": {"disk": {"radius": 0.5, "axis": "x"}},
            "plane": {"normal": "y"},
            "at": [0.1, 0.2, 0.3],
        }
    },
}
# a knife edge: its directions are a frame that the module bases anew
SLED = {
    "model": "m",
    "plane": "xy",
    "bodies": {"c": {"mass": 1, "inertia": 0.1}},
    "joints": {
        "C": {"type": "planar", "parent": "ground", "child": "c", "coordinates": ["x", "y", "a"]}
    },
    "constraints": {
        "e": {"type": "no_slip", "body": "c", "at": [0.1, 0], "direction": "y"},
    },
}


@pytest.mark.parametrize("model", [SCREWED, LEANING], ids=["screw", "leaning disk"])
def test_what_is_nothing_but_rounding_is_not_compared_with_itself(tmp_path, model):
    record = hamel.verify(written(tmp_path, model), states=3)
    assert record.passed, [check.name for check in record.checks if not check.passed]


def test_directions_that_are_based_anew_are_verified_and_linearised(tmp_path):
    path = written(tmp_path, SLED)
    assert hamel.verify(path, choice="orthonormal", states=3).passed
    assert hamel.linearize(path, choice="orthonormal").A


@pytest.mark.parametrize("choice", [None, "orthonormal", "mass_orthogonal"])
def test_every_function_of_a_free_coordinate_is_built_and_verified(choice, tmp_path):
    """All of its acceleration is zero by structure."""
    path = written(tmp_path, COORDINATE)
    names = [item.name for item in hamel.list(path).kinds["functions on request"]]
    assert {"jacobian", "derivatives", "jacobian_forward", "step_sensitivity"} <= set(names)
    hamel.build(path, choice=choice, functions=("default", *names), out=str(tmp_path / "m"))


SLED = {
    "model": "m",
    "plane": "xy",
    "bodies": {"s": {"mass": 4, "com": [0.2, 0], "inertia": 0.3}},
    "joints": {"base": {"type": "planar", "parent": "ground", "child": "s"}},
    "constraints": {"e": {"type": "no_slip", "body": "s", "at": [0, 0], "direction": "y"}},
    "quasi_velocities": {"tangent": "orthonormal"},
    "initial": {"base.vx": 1, "base.w": 2},
}


def test_maggi_keeps_the_lengths_of_a_frame_that_is_based_anew(tmp_path):
    path = written(tmp_path, SLED)
    assert hamel.verify(path, formulation="maggi", states=20).passed
    ends = [
        hamel.simulate(path, formulation=formulation, time=3.0).motion["base_x"][-1]
        for formulation in ("maggi", "quasi_velocities")
    ]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6, abs=1e-6)


ELLIPSOID = {
    "model": "m",
    "bodies": {"s": {"mass": 1, "inertia": 1e-3}},
    "joints": {
        "base": {
            "type": "free",
            "parent": "ground",
            "child": "s",
            "position": ["x", "y", "z"],
            "orientation": {"euler": "zxy", "angles": ["yaw", "roll", "pitch"]},
        }
    },
    "where": {
        "nx": "dot(direction(ground, z), direction(s, x))",
        "ny": "dot(direction(ground, z), direction(s, y))",
        "nz": "dot(direction(ground, z), direction(s, z))",
        "r": "sqrt((0.2 m)^2*nx^2 + (0.03 m)^2*ny^2 + (0.02 m)^2*nz^2)",
    },
    "constraints": {
        "touch": {"holonomic": "z - r"},
        "slipx": {
            "nonholonomic": "base.vx - base.wy*(0.02 m)^2*nz/r + base.wz*(0.03 m)^2*ny/r",
        },
        "slipy": {
            "nonholonomic": "base.vy - base.wz*(0.2 m)^2*nx/r + base.wx*(0.02 m)^2*nz/r",
        },
    },
    "quasi_velocities": {"body": ["base.wx", "base.wy", "base.wz"]},
    "initial": {"base.wz": 5, "pitch": 0.01, "guess": {"z": 0.01}},
}


@pytest.mark.slow
def test_the_page_of_a_rolling_ellipsoid(tmp_path):
    """Terms over a root that cancel each other, or that another root took."""
    path = written(tmp_path, ELLIPSOID)
    hamel.derive(path, out=str(tmp_path / "pages"))
    assert hamel.verify(path).passed


def test_bodies_may_be_called_like_functions_of_bodies(tmp_path):
    path = written(
        tmp_path,
        SLIDER
        | {
            "bodies": {"cross": {"mass": 1}, "norm": {"mass": 1, "inertia": 1}},
            "joints": {
                "C": {"type": "prismatic", "parent": "ground", "child": "cross", "axis": "x"},
                "D": {"type": "revolute", "parent": "cross", "child": "norm", "axis": "z"},
            },
            "outputs": {"d": "norm(position(norm, [1 m, 0, 0], cross))"},
        },
    )
    hamel.simulate(path, time=0.1)


DRIVEN = {
    "model": "m",
    "bodies": {"c": {"mass": 1}},
    "joints": SLIDER["joints"],
    "constraints": {"drive": {"type": "prescribed", "joint": "C", "motion": "(1 m/s^2)*t^2"}},
    "outputs": {"force": "reaction(drive)"},
}


def test_outputs_that_are_reactions_are_told_as_such(tmp_path):
    path = written(tmp_path, DRIVEN)
    for kept in ("highest(force)", "reaction.drive"):
        with pytest.raises(ModelError, match="is a reaction, and sweeps compute none"):
            hamel.sweep(path, vary={"C": [0.0, 1.0]}, keep=[kept], time=0.1)
    event = written(tmp_path, DRIVEN | {"events": {"e": {"formula": "force - (1 N)"}}})
    with pytest.raises(ModelError, match="'force' is a reaction and cannot stand in an event"):
        hamel.check(event)


def test_constraints_that_disagree_are_named_where_they_stand(tmp_path):
    twice = {"type": "prescribed", "joint": "C", "motion": "(3 m/s)*t"}
    other = twice | {"motion": "(2 m/s)*t"}
    path = written(tmp_path, SLIDER | {"constraints": {"one": twice, "two": other}})
    with pytest.raises(ModelError) as found:
        hamel.check(path)
    text = str(found.value)
    assert "one and two are off by 0.5" in text and '"one": {' in text
    assert "initial values" not in text


TETHER = """\
model: tether
plane: xy
bodies: {rock: {mass: HEAVY}, sat: {mass: 500 kg}}
joints:
  r: {type: point, parent: ground, child: rock}
  s: {type: point, parent: ground, child: sat}
constraints:
  tether: {type: distance, between: [rock, sat], at: [[0, 0], [0, 0]], length: 10 km}
initial: {s_x: 10 km, der(s_y): 2 m/s}
"""


@pytest.mark.parametrize(
    "heavy", ["5e4 kg", pytest.param("1e9 kg", marks=pytest.mark.slow), "1e15 kg"]
)
def test_a_light_body_is_not_told_by_a_heavy_one(tmp_path, heavy):
    """Its speed along and across the tether is a difference of the heavy one's otherwise, and Sᵀ M S
    loses its inertia: 1e-16 of 1e15 kg are 0.1 kg."""
    file = tmp_path / "m.yaml"
    file.write_text(TETHER.replace("HEAVY", heavy))
    hamel.build(file, out=tmp_path / "g")  # raises where verification fails
    best = hamel.choices(file).choices[0]
    assert {"r_x_dot", "r_y_dot"} <= set(best.rows) or heavy == "5e4 kg"


SMALL_AND_FAR = """\
model: m
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {arm: {mass: 10 kg, com: [1 m, 0], inertia: 10}, plate: {mass: 10 g, inertia: 1e-6}}
joints:
  A: {type: revolute, parent: ground, child: arm, coordinate: q1}
  B: {type: revolute, parent: arm, child: plate, at: [2 m, 0], coordinate: q2}
closures: {P: {type: revolute, between: [arm, plate], at: [[2 m, 1 cm], [0, 1 cm]]}}
initial: {q1: -80 deg}
"""
SLIDES_AND_FAR = """\
model: m
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  big: {mass: 10 kg, com: [1 m, 0], inertia: 10}
  small: {mass: 10 g, com: [1 mm, 0], inertia: 1e-6}
  s2: {mass: 10 g, com: [1 mm, 0], inertia: 1e-6}
joints:
  A: {type: revolute, parent: ground, child: big, coordinate: q1}
  B: {type: revolute, parent: big, child: small, at: [2 m, 0], coordinate: q2}
  C: {type: revolute, parent: big, child: s2, at: [2 m, 1 mm], coordinate: q3}
closures: {P: {type: prismatic, between: [small, s2], at: [[1 mm, 0], [1 mm, 0]], axis: y}}
initial: {q1: -80 deg, guess: {q2: 0.1, q3: 0.1}}
"""


@pytest.mark.parametrize("text", [SMALL_AND_FAR, SLIDES_AND_FAR], ids=["pinned", "slides"])
def test_a_small_closure_at_the_end_of_a_long_arm_is_verified(tmp_path, text):
    """Its gap is counted from the arm: of two places 2 m away a gap of 1 cm has two digits less, and
    the reference's own rounding, which does that, is no error."""
    (tmp_path / "m.yaml").write_text(text)
    assert hamel.verify(tmp_path / "m.yaml", states=20).passed


DRIVEN_ROD = """\
model: m
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {om: 3 rad/s}
bodies: {rod: {mass: 1 kg, com: [0, -0.5], inertia: 0.1}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
constraints: {d: {type: prescribed, coordinate: q, motion: 0.5*sin(om*t)}}
outputs: {tip: "position(rod, [0, -1])"}
"""


def test_every_derivative_of_a_state_of_one_entry(tmp_path):
    """Nothing is solved for, and a column of results is still a matrix."""
    (tmp_path / "m.yaml").write_text(DRIVEN_ROD)
    asked = ["default", "contraction", "dynamics_hessian", "outputs_jacobian", "derivatives"]
    hamel.build(tmp_path / "m.yaml", out=tmp_path / "g", functions=asked)


RC = """\
model: m
plane: xy
bodies: {rod: {mass: 1 kg, com: [0, -0.5], inertia: 0.1}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: power}}
inputs: {tau: {joint: hinge}}
loads: {s: {type: spring, joint: hinge, stiffness: 3}}
states: {v1: {rate: -v1/(2 s), unit: V}}
"""


def test_a_coordinate_may_be_called_power_and_a_model_may_have_no_parameters(tmp_path):
    (tmp_path / "m.yaml").write_text(RC)
    hamel.build(tmp_path / "m.yaml", out=tmp_path / "g")
    module = hamel.load(tmp_path / "g")
    assert module.mass(0.0, [0.1, 0.2, 1.0]).shape == (1, 1)  # nv × nv
    with pytest.raises(module.Stopped) as stopped:
        module.simulate((0.0, 1.0), [0.1, 0.0, 0.0], [float("nan")])
    again = pickle.loads(pickle.dumps(stopped.value))
    assert str(again) == str(stopped.value) and again.partial.status == stopped.value.partial.status
    linear = hamel.linearize(tmp_path / "m.yaml")
    assert len(linear.A) == len(linear.states) == 3


def test_declared_speeds_of_a_model_with_states_and_no_parameters(tmp_path):
    text = RC + "quasi_velocities: {d: [2*der(power)]}\ninitial: {der(power): 1 rad/s}\n"
    (tmp_path / "m.yaml").write_text(text)
    assert hamel.simulate(tmp_path / "m.yaml", time=1.0).energy_balance < 1e-9


GAP = """\
model: gap
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {a: {mass: 1 kg}, b: {mass: 1 kg, com: [0.2, 0], inertia: 0.02}, c: {mass: 1 kg}}
joints:
  A: {type: revolute, parent: ground, child: a, coordinate: q1}
  B: {type: revolute, parent: a, child: b, at: [0.2, 0], coordinate: q2}
  C: {type: revolute, parent: ground, child: c, at: [0.4, 0], coordinate: q3}
closures: {D: {type: revolute, between: [b, c], at: [[0.4, 0], [0.3, 0]]}}
initial: {q1: 60 deg, guess: {q2: -30 deg, q3: 80 deg}}
outputs: {gap: "distance(b, [0.4, 0], c, [0.3, 0])"}
"""


def test_an_output_may_be_what_a_closure_holds_at_zero(tmp_path):
    path = tmp_path / "gap.yaml"
    path.write_text(GAP, "utf-8")
    assert hamel.verify(path, states=20).passed
    # it has no slope there
    with pytest.raises(VerificationError, match=r"outputs_jacobian of gap has no value at state"):
        hamel.build(path, out=tmp_path / "slopes", functions=["outputs_jacobian"])


@pytest.mark.parametrize("name", ["build", "build_arm"])
def test_a_model_may_be_called_like_the_scripts_of_targets(tmp_path, name):
    path = written(tmp_path, SLIDER | {"model": name})
    hamel.build(path, out=tmp_path / name, targets=["casadi"])
    assert (tmp_path / name / f"{name}_casadi.py").is_file()
