"""The verbs as functions of `import hamel`."""

import importlib
import json
import re
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError, ToolchainError
from derive.formulations.requests import request_of
from hamel.build.options import affordable
from hamel.build.stages import equations_of, program_of
from hamel.cli import main
from hamel.records import as_json
from hamel.verbs.choices import recommendation
from tests.scenes import MODELS
from tests.texts import ARM, FLAT


def test_every_verb_is_a_function():
    assert all(callable(getattr(hamel, name)) for name in hamel.__all__)


@pytest.mark.parametrize(
    ("verb", "given", "said"),
    [
        ("simulate", {"inputs": len, "sample": -1}, "sample is -1: .* above zero"),
        ("sweep", {"vary": {"m": "normal(1, 2)"}, "seed": -1}, "seed is -1, which is less than 0"),
        ("sweep", {"vary": {"m": [[1], [2, 3]]}}, r"m varies over \[1], which is no number"),
    ],
)
def test_arguments_that_are_no_numbers_are_named(verb, given, said):
    with pytest.raises(HamelError, match=said):
        getattr(hamel, verb)(**{"path": MODELS / "snake3.yaml", **given})


def test_directions_of_events_are_three():
    with pytest.raises(ValueError, match="direction of an event is -1, 0 or 1, not 5"):
        hamel.Event(len, direction=5)


@pytest.mark.slow
def test_the_package_verify_does_not_hide_the_verb():
    package = importlib.import_module("hamel.verify")
    assert hamel.verify is not package
    assert hamel.verify(MODELS / "four_bar.yaml", choice="crank", states=3).passed
    assert callable(package.verification)


def test_build_and_load(tmp_path):
    built = hamel.build(
        MODELS / "four_bar.yaml", choice="crank", out=tmp_path / "four_bar", constants="all"
    )
    module = hamel.load(built.folder)
    assert (built.choice, built.model) == ("crank", "four_bar")
    assert module.nx == 4 and module.np_ == 0
    assert module.dynamics(0.0, np.zeros(module.nx) + 0.5, [0.0]).shape == (4,)
    assert "<svg" in (built.folder / "derivation.html").read_text()  # it opens with a figure


@pytest.mark.parametrize(
    ("bodies", "in_loops", "states"),
    [
        *((0, 0, 20), (100, 0, 20), (200, 0, 10), (1000, 0, 2), (5000, 0, 2)),
        *((60, 80, 20), (81, 121, 10), (200, 600, 2)),
    ],
)
@pytest.mark.parametrize("charts", [0, 1])
def test_a_build_looks_at_fewer_states_where_much_is_solved_for(bodies, in_loops, states, charts):
    """Of bodies, and of velocities in loops, none of which are there where nothing is closed; in
    each of several charts."""
    system = SimpleNamespace(
        model=SimpleNamespace(bodies=range(bodies)),
        rows=("closed",) * (in_loops > 0),
        v=SimpleNamespace(numel=lambda: in_loops or bodies),
    )
    found = affordable(SimpleNamespace(system=system, charts=range(charts)), 20)
    if charts == 0:
        assert found == states
    else:
        assert max(2, states // 2) <= found <= states


@pytest.mark.slow
def test_constants_by_name(tmp_path):
    built = hamel.build(
        MODELS / "snake3.yaml", choice="head", out=tmp_path / "snake3", constants=["l"]
    )
    assert hamel.load(built.folder).parameters == ("m", "J")


@pytest.mark.slow
def test_only_the_functions_asked_for(tmp_path):
    built = hamel.build(
        MODELS / "snake3.yaml",
        choice="head",
        out=tmp_path / "snake3",
        functions=["dynamics", "velocity"],
    )
    assert set(built.operations) == {"dynamics", "velocity"}
    assert "function mass" in built.left_out


@pytest.mark.parametrize(
    "options",
    [{"choice": "none"}, {"constants": ["none"]}, {"functions": ["none"]}],
    ids=["choice", "constant", "function"],
)
def test_names_that_do_not_exist(tmp_path, options):
    with pytest.raises(HamelError, match="none"):
        hamel.build(MODELS / "snake3.yaml", out=tmp_path / "snake3", **options)
    assert not list(tmp_path.iterdir())


def test_one_text_names_several_as_on_the_command_line(tmp_path):
    pendulum = MODELS / "cart_pole.yaml"
    built = hamel.build(
        pendulum,
        out=tmp_path / "cart",
        functions="dynamics, energy",
        constants="m",
        integrators="rk4",
    )
    assert set(built.operations) == {"dynamics", "energy"}
    with pytest.raises(HamelError, match="no function 'dynamic'"):
        hamel.build(pendulum, out=tmp_path / "other", functions="dynamic")


@pytest.mark.parametrize("options", [{"states": 0}, {"states": -3}, {"seed": -1}], ids=str)
def test_numbers_of_states_that_make_no_sense(options):
    with pytest.raises(ModelError, match="which is less than"):
        hamel.verify(MODELS / "pendulum.yaml", **options)


def test_dependent_speeds_are_a_violated_assumption(tmp_path):
    text = (MODELS / "snake3.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("  best: auto", "  bad: [base.vy, base.w]"))
    with pytest.raises(AssumptionError, match="bad") as caught:
        hamel.verify(tmp_path / "bad.yaml", choice="bad")
    assert caught.value.diagnostics[0].line == text.splitlines().index("  best: auto") + 1
    assert caught.value.exit_code == 2


@pytest.mark.slow
def test_a_choice_that_is_none_does_not_keep_the_others_from_being_verified(tmp_path):
    text = (MODELS / "snake3.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("  best: auto", "  bad: [base.vy, base.w]"))
    assert "bad" in hamel.check(tmp_path / "bad.yaml").refused
    found = hamel.verify(tmp_path / "bad.yaml", states=3)
    assert found.passed and "depends on the constraints" in found.refused["bad"]
    assert not any(check.name.startswith("bad") for check in found.checks)


def test_the_first_choice_has_to_be_one(tmp_path):
    text = (MODELS / "snake3.yaml").read_text()
    (tmp_path / "bad.yaml").write_text(text.replace("  head:", "  bad: [base.vy, base.w]\n  head:"))
    for verb in (hamel.check, hamel.verify):
        with pytest.raises(AssumptionError, match="bad"):
            verb(tmp_path / "bad.yaml")


def test_foreign_folders_are_not_replaced(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ToolchainError):
        hamel.build(MODELS / "snake3.yaml", out=tmp_path)
    assert (tmp_path / "notes.txt").exists()


def test_choices_say_why():
    found = hamel.choices(MODELS / "snake3.yaml")
    best = found.choices[0]
    assert found.default == "head"
    assert best.constant_pivots and best.pivots and best.operations > 0
    assert {choice.name for choice in found.choices} >= {
        "head",
        "frozen",
        "orthonormal",
        "mass_orthogonal",
    }
    assert "depends on the constraints" in found.refused["world"]
    assert all(
        choice.worst >= choice.condition >= 1 and 0 < choice.least_pivot <= 1
        for choice in found.choices
    )


def test_choices_do_not_refuse_what_is_built(tmp_path):
    """A file without choices is built with `auto`, which stands in the table by its speeds."""
    (tmp_path / "arm.yaml").write_text(ARM)
    record = hamel.choices(tmp_path / "arm.yaml")
    assert record.default not in {x.name for x in record.choices}
    assert "cannot be used" not in recommendation(record)
    refused = replace(record, refused={record.default: "it does not fit"})
    assert f"'{record.default}', cannot be used here" in recommendation(refused)


def test_choices_are_drawn_along_the_motion(tmp_path):
    found = hamel.choices(MODELS / "slider_crank.yaml", plot=tmp_path / "c.svg", until=0.2)
    assert found.choices[0].name == "crank" and found.choices[-1].name == "slider"
    assert (
        found.choices[-1].violation > found.choices[0].violation > 1e-8
    )  # it is singular at both dead centres
    text = (tmp_path / "c.svg").read_text()
    assert text.count("<polyline") == len(found.choices) and "slider" in text
    with pytest.raises(HamelError, match="must end in"):
        hamel.choices(MODELS / "slider_crank.yaml", plot=tmp_path / "c.pdf")


def test_explain_counts_what_the_passes_saved():
    found = hamel.explain(MODELS / "four_bar.yaml", choice="crank", constants="all")
    assert found.operations["dynamics"] > 0
    assert {entry["function"] for entry in found.ledger} >= {"dynamics"}
    # what is hoisted is still done, but once; every other step leads to what is emitted
    left = {e["function"]: e["after"] for e in found.ledger if e["step"] != "hoist"}
    assert {name: found.operations[name] for name in left} == left


def test_list_names_everything_a_model_can_hold():
    known = hamel.list().kinds
    assert {item.name for item in known["joints"]} >= {"revolute", "prismatic", "planar", "fixed"}
    assert {item.name for item in known["constraints"]} >= {"holonomic", "nonholonomic", "no_slip"}
    assert {item.name for item in known["formulations"]} > {
        "quasi_velocities",
        "maggi",
        "udwadia_kalaba",
        "augmented",
    }
    assert all(item.source for item in known["formulations"])
    assert all(item.name and item.about for items in known.values() for item in items)


def test_list_of_a_model():
    named = hamel.list(MODELS / "four_bar.yaml").kinds
    assert [item.name for item in named["bodies"]] == ["crank", "coupler", "rocker"]
    assert "dynamics" in [item.name for item in named["functions"]]
    assert {"jacobian_values", "step_sensitivity", "linearization"} <= {
        item.name for item in named["functions on request"]
    }


@pytest.mark.parametrize(
    "name",
    ["cart_pole", "gallery/dc_motor", "pendulum", pytest.param("car_axis", marks=pytest.mark.slow)],
)
def test_every_function_that_is_listed_is_built(name):
    """And what is refused is refused by a build for the reason that the list gives."""
    path = MODELS / f"{name}.yaml"
    listed, found = hamel.list(path).kinds, equations_of(path)
    for item in listed["functions on request"]:
        assert item.name in {x.name for x in program_of(found, [item.name]).kernels} or (
            request_of(found, item.name).needs
        )
    for item in listed.get("functions refused", ()):
        with pytest.raises(AssumptionError, match=re.escape(item.about)):
            program_of(found, [item.name])


@pytest.mark.slow
def test_every_function_that_is_listed_is_verified():
    """By name, `linearization` among them, each against what the reference says."""
    path = MODELS / "gallery" / "dc_motor.yaml"
    names = [item.name for item in hamel.list(path).kinds["functions on request"]]
    assert hamel.verify(path, states=3, functions=[*names, "pose_shaft"]).passed


@pytest.mark.parametrize(
    ("name", "choice"),
    [("gallery/dc_motor", "auto"), pytest.param("snakeboard", None, marks=pytest.mark.slow)],
)
def test_linear_equations_are_verified_of_one_choice_and_of_charts(name, choice):
    """Of all that is looked at: the choice asked for, and the module of two charts."""
    found = hamel.verify(
        MODELS / f"{name}.yaml", states=3, choice=choice, functions=["linearization"]
    )
    looked = {check.name.partition(": ")[0] for check in found.checks}
    assert found.passed
    for one in looked:
        assert f"{one}: linearization" in {check.name for check in found.checks}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "free_body"])
def test_every_function_of_larger_models_is_built(name):
    test_every_function_that_is_listed_is_built(name)


CROSSED = """
model: crossed
plane: xy
bodies: {a: {mass: 1 kg}}
joints: {A: {type: point, parent: ground, child: a, coordinates: [x, y]}}
constraints: {c: {holonomic: x*y}}
initial: {x: 0 m, y: 0 m, der(x): 1 m/s}
"""


def test_a_start_where_branches_cross_is_no_failed_verification(tmp_path):
    path = tmp_path / "crossed.yaml"
    path.write_text(CROSSED)
    wanted = "crossed: at the start, constraint c says nothing: no motion from it is determined"
    with pytest.raises(AssumptionError, match=wanted):
        hamel.simulate(path, time=1.0)


def test_schema_accepts_no_unknown_keys():
    schema = hamel.schema()
    assert schema["additionalProperties"] is False
    assert {"bodies", "joints", "quasi_velocities"} <= set(schema["properties"])


def test_records_are_json():
    record = hamel.check(MODELS / "four_bar.yaml")
    assert json.loads(json.dumps(as_json(record)))["degrees_of_freedom"] == 1
    assert set(as_json(record)) == {field.name for field in fields(record)}


def test_check_tells_the_consistent_initial_state():
    """The one that `simulate` starts from."""
    record = hamel.check(MODELS / "four_bar.yaml")
    assert [*record.initial] == [*record.coordinates, *record.velocities, *record.states]
    moved = hamel.simulate(MODELS / "four_bar.yaml", time=1e-9)
    for name in record.coordinates:
        assert record.initial[name] == pytest.approx(moved.final[name], abs=1e-6)


def test_a_singular_start_is_told(tmp_path, capsys):
    """It is no second degree of freedom."""
    path = tmp_path / "flat.yaml"
    path.write_text(FLAT)
    record = hamel.check(path)
    assert (record.degrees_of_freedom, record.speeds_at_start) == (1, 2)
    with pytest.raises(SystemExit):
        main(["check", str(path)])
    told = capsys.readouterr().out
    assert "singular: 2 speeds are free there, 1 elsewhere" in told
    assert "2 constraints of rank 2 (1 at the start), 1 degree of freedom" in told
    path.with_name("frame.yaml").write_text(FLAT + "quasi_velocities: {best: orthonormal}\n")
    for file in (path, path.with_name("frame.yaml")):  # whose frame is based on the start
        with pytest.raises(AssumptionError, match=r"flat: at the start, row 1 of closure C"):
            hamel.simulate(file, time=1.0)


def test_numbers_json_does_not_have_become_null():
    assert as_json({"a": [float("inf"), np.float64("nan"), np.float64(2.0)]}) == {
        "a": [None, None, 2.0]
    }
