"""Modules of several charts: choices of quasi-velocities that take over from each other where one is singular."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterator
from contextlib import ExitStack
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError
from derive.formulations import equations
from derive.mechanics import system
from derive.mechanics.initial import initial_state
from derive.mechanics.records import System
from derive.model import load_text
from hamel.pipeline import temporary_module
from tests.scenes import MODELS

SLIDER_CRANK = MODELS / "slider_crank.yaml"
TIGHT = {"rtol": 1e-11, "atol": 1e-13}
LOW = 0.2  # of a guard's largest value: where a chart is left


def changed(name: str, *changes: tuple[str, str]) -> System:
    """The mechanics of a model with some of its text replaced."""
    text = (MODELS / f"{name}.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return system(load_text(text))


ROD = ("  slider: [der(s)]", "  slider: [der(s)]\n  rod: [der(q1) + der(q2)]")
FAST = ("der(q1): 10 rad/s", "der(q1): 20 rad/s")
ALL = ("dop853", "dopri5", "rkf45", "rk4", "rosenbrock", "radau", "implicit_midpoint")
KEPT = ("projection", "none", "partitioning", "tangent")


class Case:
    """A system, its start, and the modules of some choices."""

    def __init__(self, mechanics: System, stack: ExitStack, **options: Any) -> None:
        self.mechanics, self.stack, self.options = mechanics, stack, options
        self.start = initial_state(mechanics)
        self.u, self.p = np.zeros(mechanics.u.numel()), np.array(mechanics.parameters)
        self.qv = np.concatenate([self.start.q, self.start.v])

    def module(self, choice: str) -> ModuleType:
        return self.stack.enter_context(temporary_module(equations(self.mechanics, choice), **self.options))

    def run(self, module: ModuleType, span: Any, **options: Any) -> Any:
        return module.simulate(span, module.state(0.0, self.qv, self.u, self.p), self.u, self.p, **{**TIGHT, **options})


@pytest.fixture(scope="module")
def crank() -> Iterator[Case]:
    """The slider's speed fails at the dead centres, the rod's turning rate half way between: neither can go on alone."""
    with ExitStack() as stack:
        yield Case(changed("slider_crank", ROD, FAST), stack, integrators=ALL, keepings=KEPT)


@pytest.fixture(scope="module")
def slider_rod(crank: Case) -> ModuleType:
    return crank.module("slider+rod")


@pytest.fixture(scope="module")
def reference(crank: Case) -> ModuleType:
    """A choice that is regular everywhere."""
    return crank.module("crank")


def states(case: Case, module: ModuleType, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and states in chart 0 along a motion, with v beside them."""
    found = case.run(module, np.linspace(0.0, 1.0, count))
    return found.x, found.v


# ---- the motion goes through


def test_two_charts_go_where_neither_goes_alone(crank: Case, slider_rod: ModuleType, reference: ModuleType) -> None:
    times = np.linspace(0.0, 3.0, 1001)
    found, whole = crank.run(slider_rod, times), crank.run(reference, times)
    v = reference.velocity(times, whole.x, crank.u, crank.p)
    np.testing.assert_allclose(found.x[:, :3], whole.x[:, :3], atol=1e-9)
    np.testing.assert_allclose(found.v, v, atol=1e-8)
    np.testing.assert_allclose(found.work, whole.work, atol=1e-9)
    assert found.position_violation < 1e-12 and found.velocity_violation < 1e-13 and found.status == "ok"
    for choice in ("slider", "rod"):
        with pytest.raises(FloatingPointError, match="singular"):
            crank.run(crank.module(choice), times)


def test_outputs_are_in_the_coordinates_of_the_first_chart(crank: Case, slider_rod: ModuleType) -> None:
    found = crank.run(slider_rod, np.linspace(0.0, 1.0, 200))
    assert set(found.chart.tolist()) == {0, 1} and slider_rod.charts == ("slider", "rod")
    slider = [joint.name for joint in crank.mechanics.model.velocities].index("der(s)")
    np.testing.assert_allclose(found.x[:, 3], found.v[:, slider], atol=1e-15)
    for row in np.nonzero(found.chart == 1)[0]:  # and v is that of the chart the motion was in
        x = slider_rod.state_chart1(found.t[row], np.concatenate([found.x[row, :3], found.v[row]]), crank.u, crank.p)
        np.testing.assert_allclose(slider_rod.velocity_chart1(found.t[row], x, crank.u, crank.p), found.v[row], atol=1e-12)


def test_a_turn_switches_there_and_back(crank: Case, slider_rod: ModuleType) -> None:
    """Slider to rod at either dead centre, rod to slider half way between: four changes per turn, in turns."""
    found = crank.run(slider_rod, np.linspace(0.0, 2.0, 20001))
    angle = found.x[:, 0]
    rows = np.nonzero(np.diff(found.chart))[0]
    assert found.switches == len(rows)  # no two between rows
    turning = rows[angle[rows] < angle.max() - 0.1]
    assert len(turning) >= 8
    entered = found.chart[turning + 1]
    assert (np.diff(entered) != 0).all()
    left = angle[turning] % np.pi  # the angle since the last dead centre
    assert (np.minimum(left, np.pi - left)[entered == 1] < 0.35).all() and (np.abs(left - np.pi / 2)[entered == 0] < 0.5).all()


EXACT = ("rosenbrock", "radau", "implicit_midpoint")  # need the Jacobian of what is integrated
FITTING = [(i, k) for i in ALL for k in KEPT if k in KEPT[:2] or i not in EXACT]


@pytest.mark.parametrize(("integrator", "keeping"), FITTING)
def test_every_integrator_and_keeping_switches(
    crank: Case, slider_rod: ModuleType, reference: ModuleType, integrator: str, keeping: str
) -> None:
    """Six digits where there is step control; the order of the others says what equal steps give."""
    stepping = {"rk4": {"step_size": 2e-4}, "implicit_midpoint": {"step_size": 2e-5}}.get(
        integrator, {"rtol": 1e-8, "atol": 1e-10}
    )
    found = crank.run(slider_rod, (0.0, 0.3), integrator=integrator, keeping=keeping, **stepping)
    whole = crank.run(reference, (0.0, 0.3))
    assert found.switches >= 3
    np.testing.assert_allclose(found.x[-1, :3], whole.x[-1, :3], atol=2e-6)
    np.testing.assert_allclose(found.v[-1], reference.velocity(0.3, whole.x[-1], crank.u, crank.p), atol=1e-4)


def test_all_backends_take_the_same_steps(crank: Case, slider_rod: ModuleType) -> None:
    simulate = importlib.import_module(f"{slider_rod.__name__}._simulate")
    library = importlib.import_module(f"{slider_rod.__name__}._library")
    times = [0.1, 0.25, 0.4]
    first = crank.run(slider_rod, [0.0], times=times, rtol=1e-7, atol=1e-9, keeping="none")
    x = slider_rod.state(0.0, crank.qv, crank.u, crank.p)
    for backend, advance in (("ctypes", library.advance), ("numpy", simulate.advance)):
        other = simulate.run(advance, backend, (0.0, 0.4), x, crank.u, crank.p, 1e-7, 1e-9, times, 10_000, None, None, "none")
        assert (other.steps, other.rejected, other.calls) == (first.steps, first.rejected, first.calls)
        assert other.switches == first.switches >= 3 and other.chart.tolist() == first.chart.tolist()
        np.testing.assert_allclose(other.x, first.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(other.v, first.v, rtol=1e-9, atol=1e-9)


def test_it_can_start_in_any_chart(crank: Case, slider_rod: ModuleType) -> None:
    """Also at the dead centre, where the slider's speed says nothing."""
    x = slider_rod.state_chart1(0.0, crank.qv, crank.u, crank.p)
    here, there = (slider_rod.simulate((0.0, 0.2), y, crank.u, crank.p, chart=k, **TIGHT) for y, k in ((x, "rod"), (x, 1)))
    np.testing.assert_array_equal(here.x, there.x)
    np.testing.assert_allclose(here.x[-1], crank.run(slider_rod, (0.0, 0.2)).x[-1], atol=1e-8)
    with pytest.raises(ValueError, match="no chart 'rood'; there are slider, rod"):
        slider_rod.simulate((0.0, 0.2), x, crank.u, crank.p, chart="rood")
    final = hamel.simulate(SLIDER_CRANK, choice="slider+tangent", time=0.2, values={"q1": "0 deg"}).final
    same = hamel.simulate(SLIDER_CRANK, choice="crank", time=0.2, values={"q1": "0 deg"}).final
    assert [final[name] for name in ("q1", "s")] == pytest.approx([same[name] for name in ("q1", "s")], abs=1e-8)


# ---- which chart, and the way between


def test_the_way_there_and_back_is_exact(crank: Case, slider_rod: ModuleType) -> None:
    x, v = states(crank, slider_rod, 50)
    good = slider_rod.chart(0.0, x, crank.u, crank.p) == 0
    there = slider_rod.transform("slider", "rod", 0.0, x[good], crank.u, crank.p)
    np.testing.assert_allclose(slider_rod.velocity_chart1(0.0, there, crank.u, crank.p), v[good], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(slider_rod.transform(1, 0, 0.0, there, crank.u, crank.p), x[good], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(slider_rod.transform(0, 0, 0.0, x, crank.u, crank.p), x)


def test_hysteresis_keeps_the_chart_that_dwells_near_the_bound(crank: Case, slider_rod: ModuleType) -> None:
    """A state that trembles about the bound changes the chart once, and back only where the other one is bad."""
    x, _ = states(crank, slider_rod, 5001)
    margins = np.array([_margin(slider_rod, crank, row) for row in x])
    near = np.nonzero(np.abs(margins - LOW) < 0.02)[0]
    trembling = np.random.default_rng(0).choice(near, 500)
    crossed = np.sum(np.diff(margins[trembling] < LOW))
    active, switches = 0, 0
    for row in x[trembling]:
        entered = int(slider_rod.chart(0.0, row, crank.u, crank.p, active=active))
        switches, active = switches + (entered != active), entered
    assert crossed > 100 and switches == 1


def _margin(module: ModuleType, case: Case, x: np.ndarray) -> float:
    return float(np.min(np.abs(module.guards(0.0, x, case.u, case.p)))) / 1e9


def test_a_motion_that_dwells_near_the_bound_does_not_chatter() -> None:
    """A stiff spring holds the crank where the slider's pivot is at the bound: fifty oscillations about it."""
    changes = (ROD, ("der(q1): 10 rad/s", "der(q1): 6 rad/s"))
    spring = (
        "  gas: {type: spring, joint: guide, stiffness: k, rest: 0.25 m}",
        "  hold: {type: spring, joint: A, stiffness: 4000 N*m/rad, rest: 8.5 deg}",
    )
    mechanics = changed("slider_crank", *changes, spring, ("q1: 30 deg", "q1: 8.5 deg"), ("q2: -41 deg", "q2: -12 deg"))
    with ExitStack() as stack:
        case = Case(mechanics, stack)
        module = case.module("slider+rod")
        found = case.run(module, np.linspace(0.0, 2.0, 2001))
        margins = np.array([_margin(module, case, x) for x in found.x])
        assert np.sum(np.diff(np.sign(margins - LOW)) != 0) > 50  # crossed that often
        assert found.switches == 1


def test_the_margin_is_zero_where_a_chart_is_singular(crank: Case, slider_rod: ModuleType) -> None:
    dead = np.array([0.0, 0.0, 0.55, 0.0])
    assert slider_rod.chart(0.0, dead, crank.u, crank.p) == 1 == slider_rod.chart(0.0, dead, crank.u, crank.p, active="slider")
    with pytest.raises(FloatingPointError, match="singular"):
        slider_rod.transform(0, 1, 0.0, dead, crank.u, crank.p)
    with pytest.raises(ValueError, match="no chart 2"):
        slider_rod.chart(0.0, dead, crank.u, crank.p, active=2)


# ---- other mechanisms


def test_universal_shaft_by_the_angles_of_its_crosses() -> None:
    """Two universal joints: the angles of a cross stand still twice per turn, those of its other axis in between."""
    with ExitStack() as stack:
        case = Case(changed("universal_shaft"), stack)
        found, whole = (case.run(case.module(choice), (0.0, 1.5)) for choice in ("a1_dot+a2_dot", "input"))
        nq = case.mechanics.q.numel()
        assert found.switches >= 4
        np.testing.assert_allclose(found.x[-1, :nq], whole.x[-1, :nq], atol=1e-8)


def test_four_bar_by_rocker_and_tangent_goes_through_the_rockers_dead_centres() -> None:
    with ExitStack() as stack:
        case = Case(changed("four_bar"), stack)
        found, whole = (case.run(case.module(choice), np.linspace(0.0, 3.0, 31)) for choice in ("rocker+tangent", "crank"))
        np.testing.assert_allclose(found.x[:, :3], whole.x[:, :3], atol=1e-8)
        module = case.module("rocker+tangent")
        energies = [
            getattr(module, f"energy{'_chart1' if k else ''}")(0.0, _in(module, case, row, k)).sum() for row, k in _rows(found)
        ]
        np.testing.assert_allclose(energies - found.work, energies[0], rtol=1e-9)
        assert found.switches >= 1


def _rows(found: Any) -> list[tuple[np.ndarray, int]]:
    return [(np.concatenate([x[:3], v]), int(k)) for x, v, k in zip(found.x, found.v, found.chart)]


def _in(module: ModuleType, case: Case, qv: np.ndarray, chart: int) -> np.ndarray:
    return (module.state_chart1 if chart else module.state)(0.0, qv, case.u, case.p)


def test_snakeboard_goes_through_straight_wheels_of_either_kind() -> None:
    """Nonholonomic, four degrees of freedom: the board's speed along itself fails with crossed wheels, its turning with
    parallel ones."""
    with ExitStack() as stack:
        case = Case(changed("snakeboard"), stack)
        found, whole = (case.run(case.module(choice), (0.0, 3.0)) for choice in ("base_w,psi,phi_f,phi_b+rates", "orthonormal"))
        nq = case.mechanics.q.numel()
        assert found.switches >= 1
        np.testing.assert_allclose(found.x[-1, :nq], whole.x[-1, :nq], atol=1e-8)


# ---- hamel simulate


def test_simulate_goes_through_and_says_so() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider", time=1.0)
    same = hamel.simulate(SLIDER_CRANK, choice="crank", time=1.0)
    assert found.switches and not same.switches and found.choice == "slider"
    for name in ("q1", "q2", "s"):
        assert found.final[name] == pytest.approx(same.final[name], abs=1e-8)
    assert found.energy_balance < 1e-9 and found.acceleration_violation < 1e-10
    assert json.dumps(hamel.records.as_json(found))


def test_named_charts_are_simulated_as_they_are() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider+tangent", time=1.0)
    assert found.choice == "slider+tangent" and {switch.entered for switch in found.switches} == {"tangent"}
    assert found.motion["s_dot"] == pytest.approx(found.motion["der(s)"], abs=1e-12)


@pytest.mark.parametrize(
    ("choice", "options", "says"),
    [
        ("slider+slider", {}, "'slider' is named twice among the charts slider\\+slider"),
        ("slider+slidr", {}, "unknown choice of quasi-velocities 'slidr'"),
        ("slider+", {}, "unknown choice of quasi-velocities ''"),
        ("slider+crank", {"integrator": "scipy_dop853"}, "does not fit the charts slider\\+crank"),
    ],
)
def test_what_are_no_charts_is_refused(choice: str, options: dict[str, Any], says: str) -> None:
    with pytest.raises(AssumptionError, match=says):
        hamel.simulate(SLIDER_CRANK, choice=choice, time=0.1, **options)


def test_base_velocities_make_no_charts() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider+crank", formulation="augmented", time=0.1)
    assert not found.switches and found.formulation == "augmented"
