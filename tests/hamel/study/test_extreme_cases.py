"""Stiff, extreme and singular cases: survived, or refused by name; never wrong.

Of hamel.simulate.exact: series.
Of derive.model.motion: extremes.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import casadi as ca
import mpmath
import numpy as np
import pytest

from codegen.reals import REALS
from codegen.runtime.simulation import Status, Stopped
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.model import load
from derive.model.limits import RTOL
from derive.states import system
from derive.states.initial import initial_state
from hamel.simulate.exact import Problem, Solution, solution, state_of, taylor
from hamel.study.extremes import judged
from tests.scenes import MODELS

AT_THE_START = {
    ("snake3", "hinges")
}  # stretched out, hinge rates say nothing of how the snake glides: refused with a status


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_no_pivot_of_an_accepted_choice_vanishes_at_the_initial_state(path: Path) -> None:
    s = system(load(path))
    start = initial_state(s)
    for choice in s.model.choices:
        try:
            e = equations(s, choice.name)
        except AssumptionError:
            continue
        guards = next(f for f in e.functions if f.name == "dynamics").guards
        values = ca.vertcat(*[g.value / g.tolerance for g in guards])
        at = ca.Function("guards", [a.symbols for a in e.arguments], [values])
        x = state_of(e, start, np.array(s.parameters))
        found = np.abs(at(0.0, x, np.zeros(s.u.numel()), e.parameters).full())
        assert np.min(found, initial=np.inf) > 1e3 or (path.stem, choice.name) in AT_THE_START, (
            choice.name
        )


EXTREMES = sorted(path for path in (MODELS / "extremes").glob("*.yaml") if load(path).extremes)
SLOW = {
    "soft_pin",
    "bushed_parallelogram",
    "chaos",
    "bricard",
    "long_run",
    "four_bar_chain",
    "heavy_top",
    "gimbal",
}
SLOW |= {"scale_megametre"}


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=[pytest.mark.slow] * (p.stem in SLOW), id=p.stem) for p in EXTREMES],
)
def test_every_case_comes_out_as_its_file_expects(path: Path) -> None:
    model = load(path)
    for entry in model.extremes:
        row = judged(path, model, entry)
        assert row.passed and row.outcome != "wrong", row


@pytest.mark.slow
def test_stiff_cases_need_at_most_three_times_the_steps_of_scipy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Said of every stiff case in the table; a case that needs more does not pass."""
    path = MODELS / "extremes" / "stiff_damper.yaml"
    model = load(path)
    entry = next(entry for entry in model.extremes if entry.name == "heavily_damped")
    row = judged(path, model, entry)
    assert row.passed and row.fewest and row.scipy and row.fewest <= row.scipy
    monkeypatch.setattr(importlib.import_module("hamel.study.extremes"), "MOST_OF_RADAU", 0.1)
    assert not judged(path, model, entry).passed


def test_spoiled_arguments_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    path = MODELS / "extremes" / "slow_drive.yaml"
    model = load(path)
    entry = next(entry for entry in model.extremes if entry.spoiled)
    row = judged(path, model, entry)
    assert (
        row.passed
        and row.outcome == "survived"
        and row.status.endswith(" 0 wrong")
        and " 0 right" not in row.status
    )
    strange = importlib.import_module("hamel.verify.checks.strange")
    monkeypatch.setattr(strange, "_close", lambda got, wanted, error: False)
    row = judged(path, model, entry)
    assert not row.passed and row.outcome == "wrong"


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ("spoiled: some", "some arguments are to be spoiled"),
        ("spoiled: all, time: 1 s", "the case 'odd' is no motion"),
        ("tolerance: 1e-8", "the case 'odd' lasts no time"),
    ],
)
def test_a_case_is_a_motion_or_has_spoiled_arguments(
    tmp_path: Path, said: str, message: str
) -> None:
    path = tmp_path / "odd.yaml"
    path.write_text((MODELS / "extremes" / "slow_drive.yaml").read_text() + f"  odd: {{{said}}}\n")
    with pytest.raises(ModelError, match=message):
        load(path)


@pytest.mark.parametrize(
    ("name", "right"),
    [
        *((name, True) for name in ("auto", "double", "1e-9.first", "größe")),
        *((name, False) for name in ("a b", "../a", ".a", "x" * 81)),
    ],
)
def test_a_case_has_a_name_that_files_can_have(tmp_path: Path, name: str, right: bool) -> None:
    """No code is generated from it, so that a word of C is as good as any other."""
    path = tmp_path / "named.yaml"
    text = (MODELS / "extremes" / "slow_drive.yaml").read_text()
    path.write_text(f'{text}  "{name}": {{spoiled: all}}\n', "utf-8")
    if right:
        assert load(path).extremes[-1].name == name
        return
    with pytest.raises(ModelError, match="is no name of a case"):
        load(path)


def test_what_a_case_is_computed_in(tmp_path: Path) -> None:
    path = tmp_path / "half.yaml"
    text = (MODELS / "extremes" / "tumbling.yaml").read_text()
    path.write_text(text.replace("real: float32", "real: float16"))
    with pytest.raises(
        ModelError, match=r"the case 'single' is to be computed in 'float16'"
    ) as caught:
        load(path)
    assert caught.value.diagnostics[0].expected == "float64 or float32"
    entries = {entry.name: entry for entry in load(MODELS / "extremes" / "tumbling.yaml").extremes}
    assert (entries["single"].real, entries["single"].rtol) == ("float32", 1e-6)
    assert (entries["disk"].real, entries["disk"].rtol) == ("float64", 1e-11)
    assert set(RTOL) == {real.name for real in REALS}


@pytest.mark.slow
def test_many_turns_stay_on_the_constraints() -> None:
    """Angles of thousands of radians have lost digits, and the linkage closes as well as these let
    it."""
    path = MODELS / "extremes" / "long" / "four_bar_forever.yaml"
    model = load(path)
    entry = next(entry for entry in model.extremes if entry.name == "thousand_seconds")
    assert judged(path, model, replace(entry, enforcement="projection", tolerance=1e-4)).passed


def test_a_wrong_end_is_seen(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    text = (
        (MODELS / "extremes" / "stiff_spring.yaml")
        .read_text()
        .replace("y: -g*(1 s)^2/2,", "y: -g*(1 s)^2/3,")
    )
    path.write_text(text)
    model = load(path)
    row = judged(path, model, model.extremes[0])
    assert row.outcome == "wrong" and not row.passed


FALL = """model: fall
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: ball, axis: y, coordinate: y}}
initial: {y: 1 m}
events: {floor: {formula: y, direction: falling, stop: true}}
extremes:
  far: {about: stopped, set: {der(y): 1 m/s}, time: 1, tolerance: 1e-6}
  closed:
    {about: stopped, time: 1, tolerance: 1e-6, end: {y: 0 m, "der(y)": "-sqrt(2*9.81 m/s^2*1 m)"}}
  wrong:
    {about: stopped, time: 1, tolerance: 1e-6, end: {y: 0 m, "der(y)": "-sqrt(2*9.8 m/s^2*1 m)"}}
"""


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_motion_that_an_event_stops_is_judged_there(tmp_path: Path, number: int) -> None:
    path = tmp_path / "fall.yaml"
    path.write_text(FALL)
    model = load(path)
    row = judged(path, model, model.extremes[number])
    assert row.outcome == ("wrong" if row.case == "wrong" else "survived")


# ---- solutions of many digits, at closed forms

KNOWN = {
    ("pendulum", 10.0): {"x": "-0.27508746257611686005", "y": "-0.96141920509912506427"},
    ("free_body", 10.0): {
        "base.wx": "-0.466448718855779853",
        "base.wy": "-0.180071076738607982",
        "base.wz": "0.994581052055285966",
    },
}


@pytest.mark.parametrize(("name", "time"), KNOWN, ids=[name for name, _ in KNOWN])
def test_solutions_meet_closed_forms_in_all_their_digits(name: str, time: float) -> None:
    found = solved(name, time, 20)
    assert found.bound < 1e-19 and found.agreement < 1e-12
    for key, value in KNOWN[name, time].items():
        assert abs(found.at(0)[key] - Decimal(value)) <= Decimal(10) ** (5 - len(value)), key


# Falls on a spring with g = 10 m/s² and ω = 20/s, and flies up again.
BOUNCE = """model: bounce
plane: xy
bodies: {a: {mass: 2 kg}}
joints: {A: {type: prismatic, parent: ground, child: a, axis: x, coordinate: x}}
loads: {g: {type: expression, joint: A, expression: "-20 N + (800 N/m)*ramp(-x)"}}
initial: {x: START}
events: {top: {formula: der(x), direction: falling, stop: true}}
extremes: {top: {about: comes back, time: 5, tolerance: 1e-6}}
"""


@pytest.mark.parametrize(("start", "time"), [("1 m", 1.3), ("0 m", 0.1)])
def test_solutions_cross_kinks(start: str, time: float, tmp_path: Path) -> None:
    """By the piece in force at the start of a step, a right motion was called wrong."""
    path = tmp_path / "bounce.yaml"
    path.write_text(BOUNCE.replace("START", start))
    s = system(load(path))
    e = equations(s)
    x = tuple(map(float, state_of(e, initial_state(s), np.array(s.parameters))))
    found = solution(Problem(e, x, (), ()), [time], 25)
    with mpmath.workdps(50):
        g, omega, t = mpmath.mpf(10), mpmath.mpf(20), mpmath.mpf(time)
        wanted = (mpmath.cos(omega * t) - 1) * g / omega**2
        if start == "1 m":
            fall = mpmath.sqrt(2 / g)
            pressed = 2 * (mpmath.pi - mpmath.atan(g * fall * omega / g)) / omega
            wanted = 1 - g / 2 * (2 * fall + pressed - t) ** 2
        assert found.bound < 1e-24 and found.steps < 60
        assert abs(mpmath.mpf(str(found.at(0)["x"])) - wanted) < 1e-25


def test_a_velocity_that_an_event_makes_vanish_is_no_measure(tmp_path: Path) -> None:
    path = tmp_path / "bounce.yaml"
    path.write_text(BOUNCE.replace("START", "1 m"))
    model = load(path)
    row = judged(path, model, model.extremes[0])
    assert row.outcome == "survived" and row.error is not None and row.error < 1e-11


@pytest.mark.slow
def test_thirty_digits_are_thirty_digits() -> None:
    found = solved("pendulum", 1.0, 30)
    finer = solved("pendulum", 1.0, 40)
    assert found.bound < 1.1e-30
    for key, value in found.at(0).items():
        assert abs(value - finer.at(0)[key]) < Decimal("1e-30")


def test_a_series_that_cannot_go_on_has_a_status(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same record as of any other motion, with the rows up to there."""
    monkeypatch.setattr(taylor, "MOST_EXACT_STEPS", 3)
    x = ca.SX.sym("x")
    nothing = ca.SX(0, 1)
    flow = ca.Function("flow", [ca.SX.sym("t"), x, nothing, nothing], [x])
    problem = taylor.Problem(flow, (Fraction(1),), (), ())
    with pytest.raises(Stopped) as caught:
        taylor.integrated(problem, [0.0, 1e3], 20, 24, 200)
    partial = caught.value.partial
    assert partial.status is Status.MORE and partial.x.tolist() == [[1]] and partial.t == [0.0]


def test_a_motion_of_far_too_many_steps_is_foreseen() -> None:
    """An oscillation of 16 kHz for 10 s: nobody waits for 20,000 of 200,000 steps."""
    x, nothing = ca.SX.sym("x", 2), ca.SX(0, 1)
    rates = ca.vertcat(x[1], -1e10 * x[0])
    flow = ca.Function("flow", [ca.SX.sym("t"), x, nothing, nothing], [rates])
    problem = taylor.Problem(flow, (Fraction(1), Fraction(0)), (), ())
    with pytest.raises(Stopped, match="more than 20000 steps") as caught:
        taylor.integrated(problem, [10.0], 20, 24, 200)
    assert caught.value.partial.steps == 1_000


def solved(name: str, time: float, digits: int) -> Solution:
    s = system(load(MODELS / f"{name}.yaml"))
    e = equations(s)
    x = state_of(e, initial_state(s), np.array(s.parameters))
    return solution(
        Problem(e, tuple(map(float, x)), (0.0,) * s.u.numel(), tuple(e.parameters)), [time], digits
    )
