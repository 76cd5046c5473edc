"""What a report says where there is little to say: no run at all, none that is usable, few
tolerances, one of something.

Of hamel.study: advice, page, plan, progress.
Of hamel.verbs: extremes, report.
"""

from __future__ import annotations

import logging
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

import hamel
from codegen import compiler
from codegen.runtime.simulation import Status
from derive.diagnostics import AssumptionError, ModelError
from hamel import progress
from hamel.progress import bar
from hamel.study.advice import advice, rivals
from hamel.study.judgement import Reference
from hamel.study.page import outcomes, whole
from hamel.verbs import extremes as verb
from hamel.verbs import report

compiled = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
ROD = """
model: rod
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {m: 2 kg, l: 0.5 m}
bodies: {rod: {mass: m, com: [0, -l/2], inertia: m*l^2/12}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
initial: {q: 60 deg}
quasi_velocities: {whole: [der(q)]}
extremes:
  auto: {time: 1 ms, tolerance: 1e-8}
"""
REFERENCE = Reference(("a", "b"), (0.0,), (0.0,), (1.0,), 1.0, 10, 1e-14)
BASE: dict[str, Any] = {
    "formulation": "quasi_velocities",
    "choice": "a",
    "enforcement": "none",
    "status": "ok",
    "step": None,
    "phi": None,
    "velocity": 0.0,
    "operations": 10,
}


@pytest.fixture
def rod(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "rod.yaml").write_text(ROD)
    return tmp_path / "rod.yaml"


def run(integrator: str, rtol: float, error: float, ms: float, **more: Any) -> dict[str, Any]:
    drift = {"phi": 0.0}
    return BASE | drift | {"integrator": integrator, "rtol": rtol, "error": error, "ms": ms} | more


def stopped(status: str) -> dict[str, Any]:
    return run("dop853", 1e-4, 0.0, 1.0) | {"error": None, "status": status}


# ---- names


@compiled
@pytest.mark.parametrize(
    ("name", "hint"), [("hole", "did you mean 'whole'"), ("x", "known: whole")]
)
def test_a_choice_that_is_none_is_refused(name: str, hint: str, rod: Path) -> None:
    """Before anything runs, with the nearest one; it was an index out of range."""
    with pytest.raises(ModelError, match=f"unknown choice of quasi-velocities '{name}'") as caught:
        hamel.report([rod], choices=[name], out=rod.parent / "out", time=0.1)
    assert hint in caught.value.diagnostics[0].hint
    assert not (rod.parent / "out").exists()


@pytest.mark.slow
@compiled
def test_a_choice_of_one_model_of_several_is_no_mistake(rod: Path) -> None:
    """The other has no runs, and its formulations that choose say why."""
    (rod.parent / "other.yaml").write_text(ROD.replace("whole", "part").replace("rod\n", "other\n"))
    only: dict[str, Any] = {
        "formulations": ["quasi_velocities", "maggi"],
        "integrators": ["dop853"],
    }
    given = only | {"choices": ["whole"], "tolerances": [1e-6], "time": 0.1}
    found = hamel.report([rod, rod.parent / "other.yaml"], out=rod.parent / "out", **given)
    assert {row["model"] for row in found.rows} == {"rod"}
    assert found.models[1]["advice"] == [
        "No run was made: quasi_velocities (whole): unknown choice of quasi-velocities 'whole'; "
        "maggi: none of the choices that were asked for fits."
    ]


# ---- no run


@pytest.mark.slow
@compiled
def test_what_does_not_go_together_is_refused_with_the_reason(rod: Path) -> None:
    given: dict[str, Any] = {"time": 0.1, "tolerances": [1e-6], "out": rod.parent / "out"}
    message = "rod: nothing asked for can be run: maggi: library solvers run on the formulations"
    with pytest.raises(AssumptionError, match=message):
        hamel.report([rod], formulations=["maggi"], integrators=["libraries"], **given)
    given |= {"integrators": ["dop853"], "enforcements": ["baumgarte"]}
    with pytest.raises(AssumptionError, match="baumgarte: there are no constraints"):
        hamel.report([rod], formulations=["augmented"], **given)
    assert not (rod.parent / "out").exists()


@pytest.mark.slow
@compiled
def test_runs_that_there_was_no_time_for_are_counted(rod: Path) -> None:
    given: dict[str, Any] = {"time": 0.1, "tolerances": [1e-6], "integrators": ["dop853"]}
    given |= {"formulations": ["quasi_velocities", "augmented"], "budget": 0.01}
    found = hamel.report([rod], out=rod.parent / "out", **given)
    (line,) = found.models[0]["advice"]
    assert line.startswith("No run was made: ") and "not done: the 0.01 s for this" in line


def test_how_runs_ended_none_of_which_is_usable() -> None:
    """The sentence pointed to a table that was empty."""
    rows = [stopped("too long") for _ in range(3)]
    rows += [run("dop853", 1e-4, 0.5, 1.0, status="too coarse"), run("dop853", 1e-4, 0.05, 1.0)]
    assert advice(rows, REFERENCE) == [
        "No run reached a usable error: of 5 runs 3 took too long, 1 had an error above 0.1, "
        "1 had an error above 0.01."
    ]
    broken = [stopped("singular")]
    assert advice(broken, REFERENCE) == [
        "No run reached a usable error: of 1 run 1 broke off or was wrong.",
        "Singular: 1 of 1 run: quasi_velocities (a).",
    ]


def test_libraries_alone_are_judged_by_themselves() -> None:
    rows = [run("scipy_dop853", 1e-8, 1e-9, 3.0), run("cvodes", 1e-8, 1e-9, 2.0)]
    first, *_ = advice(rows, REFERENCE)
    assert first.startswith("Use quasi_velocities (a), cvodes: it reaches an error of 1e-08")


# ---- comparison


def test_a_tolerance_that_a_library_just_misses_is_not_held_against_it() -> None:
    """At 1e-8 it is off by 1.3e-8 and takes 13 times as long; the next run took 454 times."""
    rows = [run("dop853", 1e-8, 8e-9, 1.0), run("dop853", 1e-5, 1e-5, 0.5)]
    rows += [run("scipy_dop853", 1e-8, 1.3e-8, 13.0), run("scipy_dop853", 1e-12, 1e-13, 454.0)]
    said = advice(rows, REFERENCE)
    line = "The best library solver took 13 times as long at an error of 1.3e-08 "
    assert line + "(quasi_velocities (a), scipy_dop853)." in said


def test_a_library_is_compared_with_runs_as_exact_as_its_own() -> None:
    rows = [run("dop853", 1e-8, 9e-9, 1.0), run("dop853", 1e-11, 1e-12, 10.0)]
    exact = run("cvodes", 1e-10, 2e-12, 30.0)
    assert rivals([exact], rows, 1e-8) == (exact, rows[1])
    said = advice([*rows, exact], REFERENCE)
    assert any("took 3 times as long at an error of 2.0e-12 " in line for line in said)
    far = run("cvodes", 1e-4, 1e-5, 30.0)
    said = advice([*rows, far], REFERENCE)
    start = "The best library solver came no nearer than an error of 1.0e-05, for which it took 30"
    assert any(line.startswith(start) for line in said)
    beyond = run("cvodes", 1e-12, 1e-13, 30.0)
    assert rivals([beyond], rows, 1e-8) is None
    # a method that is near the level goes before one that is faster far from it
    near = run("idas", 1e-8, 2e-8, 90.0)
    assert rivals([far, near], rows, 1e-8) == (near, rows[0])


# ---- one of something


def test_one_case_is_one(rod: Path) -> None:
    """It is called as a keyword of C is: nothing is generated from its name."""
    found = hamel.extremes([rod])
    console = Console(file=StringIO(), width=200)
    verb.show(found, console)
    text = console.file.getvalue()
    assert found.passed and "rod: auto" in text and "\n1 case: 1 survived, 0 refused" in text
    assert outcomes(found.rows).startswith("1 extreme case: ")


@pytest.mark.slow
@compiled
def test_one_run_is_one(rod: Path) -> None:
    given: dict[str, Any] = {"time": 0.1, "tolerances": [1e-6], "integrators": ["dop853"]}
    given |= {"formulations": ["maggi"], "enforcements": ["none"]}
    found = hamel.report([rod], out=rod.parent / "out", **given)
    console = Console(file=StringIO(), width=200)
    report.show(found, console)
    assert "\n1 run, 1 to the end; wrote" in console.file.getvalue()
    assert ". 1 run, " in found.html.read_text("utf-8")


def test_a_choice_that_is_singular_alone_says_what_simulate_does() -> None:
    """81 of 98 runs were "singular" of choices that simulate crosses with."""
    lines = advice([stopped(Status.SINGULAR_CHOICE.cause)], REFERENCE)
    assert any("new base or another choice there and goes on" in line for line in lines)
    assert not any("a module of several, goes on" in line for line in lines)


@pytest.mark.slow
@compiled
def test_building_is_shown_as_done_too(rod: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Nothing was said until the first run, which came after half of the time; nor by -v."""
    given: dict[str, Any] = {"time": 0.1, "tolerances": [1e-6], "integrators": ["dop853"]}
    given |= {"formulations": ["maggi", "augmented"], "enforcements": ["none"]}
    shares: list[float] = []
    caplog.set_level(logging.INFO, "hamel")
    hamel.report([rod], out=rod.parent / "out", progress=shares.append, **given)
    assert shares == sorted(shares) and 0.0 < shares[0] < 0.4 <= shares[-1] <= 1.0
    said = [message.split()[0] for message in caplog.messages]
    assert [name for name in said if name != "model"][:3] == ["modules", "reference", "runs"]


def test_without_a_terminal_a_line_now_and_then_says_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with bar(2.0, "running") as shown:
        shown(0.5)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(progress, "SPARSE", 0.0)
    with bar(2.0, "running") as shown:
        shown(0.5)
    assert capsys.readouterr().err == "running: 25% after 0 s\n"


def test_numbers_are_not_broken_at_their_minus() -> None:
    """Of "1e-10" the 10 stood on the next line."""
    shown = whole("an error of 2.1e-09 <b>")
    assert shown == 'an error of <span class="number">2.1e-09</span> &lt;b&gt;'
