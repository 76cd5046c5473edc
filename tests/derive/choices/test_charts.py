"""Modules of several charts: choices of quasi-velocities that take over from each other where one
is singular.

Of derive.choices: assessment, candidates, elimination, explicit, limits, momenta, ranking, reduction,
resolution, walk.
Of derive.formulations: charts.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hamel
from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import temporary_module
from hamel.verify import quick_verification, verification
from tests.points import LOSSES
from tests.scenes import MODELS

SLIDER_CRANK = MODELS / "slider_crank.yaml"
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
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
ALL = ("dop853", "verner9", "dopri5", "rkf45", "rk4", "rosenbrock", "radau", "implicit_midpoint")
KEPT = ("projection", "none", "partitioning", "tangent")


class Case:
    """A system, its start, and the modules of some choices."""

    def __init__(self, mechanics: System, stack: ExitStack, **options: Any) -> None:
        self.mechanics, self.stack, self.options = mechanics, stack, options
        self.start = initial_state(mechanics)
        self.u, self.p = np.zeros(mechanics.u.numel()), np.array(mechanics.parameters)
        self.qv = np.concatenate([self.start.q, self.start.v])

    def module(self, choice: str) -> ModuleType:
        return self.stack.enter_context(
            temporary_module(equations(self.mechanics, choice), **self.options)
        )

    def run(self, module: ModuleType, span: Any, **options: Any) -> Any:
        return module.simulate(
            span, module.state(0.0, self.qv, self.u, self.p), self.u, self.p, **{**TIGHT, **options}
        )


@pytest.fixture(scope="module")
def crank() -> Iterator[Case]:
    """The slider's speed fails at the dead centres, the rod's turning rate half way between:
    neither can go on alone."""
    with ExitStack() as stack:
        yield Case(changed("slider_crank", ROD, FAST), stack, integrators=ALL, enforcements=KEPT)


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


def test_two_charts_go_where_neither_goes_alone(
    crank: Case, slider_rod: ModuleType, reference: ModuleType
) -> None:
    times = np.linspace(0.0, 3.0, 1001)
    found, whole = crank.run(slider_rod, times), crank.run(reference, times)
    v = reference.velocity(times, whole.x, crank.u, crank.p)
    np.testing.assert_allclose(found.x[:, :3], whole.x[:, :3], atol=1e-9)
    np.testing.assert_allclose(found.v, v, atol=1e-8)
    np.testing.assert_allclose(found.work, whole.work, atol=1e-9)
    assert (
        found.position_violation < 1e-12
        and found.velocity_violation < 1e-13
        and found.status.name == "OK"
    )
    for choice in ("slider", "rod"):
        with pytest.raises(FloatingPointError, match="singular"):
            crank.run(crank.module(choice), times)


def test_outputs_are_in_the_coordinates_of_the_first_chart(
    crank: Case, slider_rod: ModuleType
) -> None:
    found = crank.run(slider_rod, np.linspace(0.0, 1.0, 200))
    assert set(found.chart.tolist()) == {0, 1} and slider_rod.charts == ("slider", "rod")
    slider = [joint.name for joint in crank.mechanics.model.velocities].index("der(s)")
    np.testing.assert_allclose(found.x[:, 3], found.v[:, slider], atol=1e-15)
    for row in np.nonzero(found.chart == 1)[0]:  # and v is that of the chart the motion was in
        x = slider_rod.state_chart1(
            found.t[row], np.concatenate([found.x[row, :3], found.v[row]]), crank.u, crank.p
        )
        np.testing.assert_allclose(
            slider_rod.velocity_chart1(found.t[row], x, crank.u, crank.p), found.v[row], atol=1e-12
        )


def test_a_turn_switches_there_and_back(crank: Case, slider_rod: ModuleType) -> None:
    """Slider to rod at either dead centre, rod to slider half way between: four changes per turn,
    in turns."""
    found = crank.run(slider_rod, np.linspace(0.0, 2.0, 20001))
    angle = found.x[:, 0]
    rows = np.nonzero(np.diff(found.chart))[0]
    assert found.switches == len(rows)  # no two between rows
    turning = rows[angle[rows] < angle.max() - 0.1]
    assert len(turning) >= 8
    entered = found.chart[turning + 1]
    assert (np.diff(entered) != 0).all()
    left = angle[turning] % np.pi  # the angle since the last dead centre
    assert (np.minimum(left, np.pi - left)[entered == 1] < 0.35).all() and (
        np.abs(left - np.pi / 2)[entered == 0] < 0.5
    ).all()


EXACT = ("rosenbrock", "radau", "implicit_midpoint")  # need the Jacobian of what is integrated
FITTING = [(i, k) for i in ALL for k in KEPT if k in KEPT[:2] or i not in EXACT]


@pytest.mark.parametrize(("integrator", "enforcement"), FITTING)
def test_every_integrator_and_enforcement_switches(
    crank: Case, slider_rod: ModuleType, reference: ModuleType, integrator: str, enforcement: str
) -> None:
    """Six digits where there is step control; the order of the others says what equal steps
    give."""
    stepping = {"rk4": {"step_size": 2e-4}, "implicit_midpoint": {"step_size": 2e-5}}.get(
        integrator, {"rtol": 1e-8, "atol": 1e-10}
    )
    found = crank.run(
        slider_rod, (0.0, 0.3), integrator=integrator, enforcement=enforcement, **stepping
    )
    whole = crank.run(reference, (0.0, 0.3))
    assert found.switches >= 3
    np.testing.assert_allclose(found.x[-1, :3], whole.x[-1, :3], atol=2e-6)
    np.testing.assert_allclose(
        found.v[-1], reference.velocity(0.3, whole.x[-1], crank.u, crank.p), atol=1e-4
    )


def test_all_backends_take_the_same_steps(crank: Case, slider_rod: ModuleType) -> None:
    simulate = importlib.import_module(f"{slider_rod.__name__}._simulate")
    library = importlib.import_module(f"{slider_rod.__name__}._library")
    times = [0.1, 0.25, 0.4]
    first = crank.run(slider_rod, [0.0], times=times, rtol=1e-8, atol=1e-10, enforcement="none")
    x = slider_rod.state(0.0, crank.qv, crank.u, crank.p)
    for backend, advance in (("ctypes", library.advance), ("numpy", simulate.advance)):
        other = simulate.run(
            advance,
            backend,
            (0.0, 0.4),
            x,
            crank.u,
            crank.p,
            1e-8,
            1e-10,
            times,
            10_000,
            None,
            None,
            "none",
        )
        assert (other.steps, other.rejected, other.calls) == (
            first.steps,
            first.rejected,
            first.calls,
        )
        assert (
            other.switches == first.switches >= 3 and other.chart.tolist() == first.chart.tolist()
        )
        np.testing.assert_allclose(other.x, first.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(other.v, first.v, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_it_can_start_in_any_chart(crank: Case, slider_rod: ModuleType) -> None:
    """Also at the dead centre, where the slider's speed says nothing."""
    x = slider_rod.state_chart1(0.0, crank.qv, crank.u, crank.p)
    here, there = (
        slider_rod.simulate((0.0, 0.2), y, crank.u, crank.p, chart=k, **TIGHT)
        for y, k in ((x, "rod"), (x, 1))
    )
    np.testing.assert_array_equal(here.x, there.x)
    np.testing.assert_allclose(here.x[-1], crank.run(slider_rod, (0.0, 0.2)).x[-1], atol=1e-8)
    with pytest.raises(ValueError, match="no chart 'rood'; there are slider, rod"):
        slider_rod.simulate((0.0, 0.2), x, crank.u, crank.p, chart="rood")
    final = hamel.simulate(
        SLIDER_CRANK, choice="slider+tangent", time=0.2, values={"q1": "0 deg"}
    ).final
    same = hamel.simulate(SLIDER_CRANK, choice="crank", time=0.2, values={"q1": "0 deg"}).final
    assert [final[name] for name in ("q1", "s")] == pytest.approx(
        [same[name] for name in ("q1", "s")], abs=1e-8
    )


# ---- which chart, and the way between


def test_the_way_there_and_back_is_exact(crank: Case, slider_rod: ModuleType) -> None:
    x, v = states(crank, slider_rod, 50)
    good = slider_rod.chart(0.0, x, crank.u, crank.p) == 0
    there = slider_rod.transform("slider", "rod", 0.0, x[good], crank.u, crank.p)
    np.testing.assert_allclose(
        slider_rod.velocity_chart1(0.0, there, crank.u, crank.p), v[good], rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(
        slider_rod.transform(1, 0, 0.0, there, crank.u, crank.p), x[good], rtol=1e-12, atol=1e-12
    )
    np.testing.assert_array_equal(slider_rod.transform(0, 0, 0.0, x, crank.u, crank.p), x)


def test_hysteresis_keeps_the_chart_that_dwells_near_the_bound(
    crank: Case, slider_rod: ModuleType
) -> None:
    """A state that trembles about the bound changes the chart once, and back only where the other
    one is bad."""
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


def _margin(module: ModuleType, case: Case, x: np.ndarray, chart: int = 0) -> float:
    """The smallest pivot relative to the largest seen when the equations were made."""
    whole = importlib.import_module(f"{module.__name__}._charts").WHOLE[chart]
    return float(
        np.min(
            np.abs((module.guards_chart1 if chart else module.guards)(0.0, x, case.u, case.p))
            / whole
        )
    )


def test_a_motion_that_dwells_near_the_bound_does_not_chatter() -> None:
    """A stiff spring holds the crank where the slider's pivot is at the bound: fifty oscillations
    about it."""
    changes = (ROD, ("der(q1): 10 rad/s", "der(q1): 6 rad/s"))
    spring = (
        "  gas: {type: spring, joint: guide, stiffness: k, rest: 0.25 m}",
        "  hold: {type: spring, joint: A, stiffness: 4000 N*m/rad, rest: 8.5 deg}",
    )
    mechanics = changed(
        "slider_crank",
        *changes,
        spring,
        ("q1: 30 deg", "q1: 8.5 deg"),
        ("q2: -41 deg", "q2: -12 deg"),
    )
    with ExitStack() as stack:
        case = Case(mechanics, stack)
        module = case.module("slider+rod")
        found = case.run(module, np.linspace(0.0, 2.0, 2001))
        margins = np.array([_margin(module, case, x) for x in found.x])
        assert np.sum(np.diff(np.sign(margins - LOW)) != 0) > 50  # crossed that often
        assert found.switches == 1


def test_the_margin_is_zero_where_a_chart_is_singular(crank: Case, slider_rod: ModuleType) -> None:
    dead = np.array([0.0, 0.0, 0.55, 0.0])
    assert (
        slider_rod.chart(0.0, dead, crank.u, crank.p)
        == 1
        == slider_rod.chart(0.0, dead, crank.u, crank.p, active="slider")
    )
    with pytest.raises(FloatingPointError, match="singular"):
        slider_rod.transform(0, 1, 0.0, dead, crank.u, crank.p)
    with pytest.raises(ValueError, match="no chart 2"):
        slider_rod.chart(0.0, dead, crank.u, crank.p, active=2)


# ---- other mechanisms


@pytest.mark.slow
def test_universal_shaft_by_the_angles_of_its_crosses() -> None:
    """Two universal joints: the angles of a cross stand still twice per turn, those of its other
    axis in between."""
    with ExitStack() as stack:
        case = Case(changed("universal_shaft"), stack)
        found, whole = (
            case.run(case.module(choice), (0.0, 1.5)) for choice in ("a1_dot+a2_dot", "input")
        )
        nq = case.mechanics.q.numel()
        assert found.switches >= 4
        np.testing.assert_allclose(found.x[-1, :nq], whole.x[-1, :nq], atol=1e-8)


@pytest.mark.slow
def test_four_bar_goes_through_the_dead_centres_of_its_rocker() -> None:
    with ExitStack() as stack:
        case = Case(changed("four_bar"), stack)
        module, times = case.module("rocker+tangent"), np.linspace(0.0, 3.0, 31)
        found, whole = case.run(module, times), case.run(case.module("crank"), times)
        np.testing.assert_allclose(found.x[:, :3], whole.x[:, :3], atol=1e-8)
        energies = [
            (module.energy_chart1 if k else module.energy)(0.0, _in(module, case, row, k)).sum()
            for row, k in _rows(found)
        ]
        np.testing.assert_allclose(energies - found.work, energies[0], rtol=1e-9)
        assert found.switches >= 1


def _rows(found: Any) -> list[tuple[np.ndarray, int]]:
    return [(np.concatenate([x[:3], v]), int(k)) for x, v, k in zip(found.x, found.v, found.chart)]


def _in(module: ModuleType, case: Case, qv: np.ndarray, chart: int) -> np.ndarray:
    return (module.state_chart1 if chart else module.state)(0.0, qv, case.u, case.p)


@pytest.mark.parametrize("integrator", ["dop853", "verner9"])
@pytest.mark.slow
def test_a_coarse_tolerance_does_not_add_up_over_singular_positions(integrator: str) -> None:
    """Some 40 passages in ten seconds in the speed of the rocker; 69.99285 rad by all methods at
    1e-12."""
    found = hamel.simulate(
        MODELS / "four_bar.yaml", choice="rocker", integrator=integrator, rtol=1e-4, time=10.0
    )
    assert found.final["q1"] == pytest.approx(69.99285, abs=0.1)


def test_crank_and_rod_of_one_length() -> None:
    """On the branch q2 = -2 q1 the energy gives q1 by a quadrature; where A loses rank, all charts
    are singular together."""
    with ExitStack() as stack:
        case = Case(changed("extremes/isosceles_slider"), stack)
        found = case.run(
            case.module("slider+crank"), [0.0, 1.0, 2.0, 4.0], rtol=1e-9, atol=1e-11
        )  # finer: few come through
        mass, length = 1.0, 0.5
        start, speed = np.radians(30.0), 3.0

        def inertia(q: float) -> float:
            return (
                mass
                * length**2
                * (5 / 12 + 2.25 * np.sin(q) ** 2 + 0.25 * np.cos(q) ** 2 + 4.0 * np.sin(q) ** 2)
            )

        def rate(_: float, q: np.ndarray) -> list[float]:
            return [speed * np.sqrt(inertia(start) / inertia(q[0]))]

        wanted = solve_ivp(rate, (0.0, 4.0), [start], rtol=1e-12, atol=1e-12, t_eval=found.t).y[0]
        np.testing.assert_allclose(found.x[:, 0], wanted, atol=1e-7)
        assert found.switches >= 1 and found.crossings >= 3  # upright three times


# ---- build and verify


def test_functions_alone_have_their_charts(tmp_path: Path) -> None:
    """Without dynamics, too: what differs is there for each chart, with the way between."""
    made = hamel.build(
        SLIDER_CRANK, choice="slider+crank", functions=("mass", "energy"), out=tmp_path / "few"
    )
    module = loader.load(made.folder)
    assert (
        made.choice == "slider+crank"
        and hasattr(module, "energy_chart1")
        and not hasattr(module, "mass_chart1")
    )
    x = np.array([0.5, -0.68, 0.5, 1.0])
    there = module.transform("slider", "crank", 0.0, x)
    np.testing.assert_allclose(module.energy_chart1(0.0, there), module.energy(0.0, x), rtol=1e-12)


def test_a_function_alone_brings_what_keeps_the_frame_of_its_chart(tmp_path: Path) -> None:
    """One chart of the governor is in a frame, whose numbers stand behind the parameters."""
    model = MODELS / "gallery" / "governor.yaml"
    built = hamel.build(model, out=tmp_path / "governor", functions=["mass_w"])
    assert built.verified and {"mass_w", "dynamics", "constraint_rows"} <= {*built.operations}


@pytest.mark.slow
def test_a_build_holds_charts_where_no_choice_is_safe(tmp_path: Path) -> None:
    """The board's speed along itself fails with crossed wheels, its turning with parallel ones;
    either is one of four speeds."""
    made = hamel.build(MODELS / "snakeboard.yaml", out=tmp_path / "board")
    module, case = loader.load(made.folder), Case(changed("snakeboard"), ExitStack())
    assert made.choice == "rates+base_w psi_dot phi_f_dot phi_b_dot" and module.charts == (
        "rates",
        "base_w psi_dot phi_f_dot phi_b_dot",
    )
    manifest = json.loads((made.folder / "manifest.json").read_text())
    assert [chart["suffix"] for chart in manifest["charts"]] == ["", "_chart1"]
    assert (
        module.chart_states[1][-4:]
        == tuple(manifest["charts"][1]["quasi_velocities"])
        == ("base_w", "psi_dot", "phi_f_dot", "phi_b_dot")
    )
    assert any("another takes over" in said for said in manifest["assumptions"])
    case.u = np.array([0.0, 4.0, -1.0])  # steers one pair of wheels across the board
    found = case.run(module, (0.0, 3.0))
    with temporary_module(equations(case.mechanics, "orthonormal")) as other:
        whole = case.run(other, (0.0, 3.0))
    nq = case.mechanics.q.numel()
    assert found.switches == 2
    np.testing.assert_allclose(found.x[-1, :nq], whole.x[-1, :nq], atol=1e-8)


@pytest.mark.parametrize(
    ("name", "choice"),
    [
        ("slider_crank", None),
        ("slider_crank", "slider"),
        ("snakeboard", "rates"),
        ("bicycle", None),
    ],
)
def test_one_chart_where_a_choice_is_safe_or_named(name: str, choice: str | None) -> None:
    """The rates of the bicycle are not safe, but another choice is."""
    assert not equations(changed(name), choice, charts=True).charts


@needs_compiler
def test_the_c_functions_say_the_same(crank: Case, slider_rod: ModuleType) -> None:
    library = importlib.import_module(f"{slider_rod.__name__}._library")._library
    pointer, number = ctypes.c_void_p, ctypes.c_int
    library.slider_crank_chart.argtypes = [number, ctypes.c_double, pointer, pointer, pointer]
    library.slider_crank_transform.argtypes = [
        number,
        number,
        ctypes.c_double,
        pointer,
        pointer,
        pointer,
        pointer,
    ]
    x, _ = states(crank, slider_rod, 200)
    for active in (None, 0, 1):
        wanted = slider_rod.chart(0.0, x, crank.u, crank.p, active=active)
        given = -1 if active is None else active
        assert wanted.tolist() == [
            library.slider_crank_chart(
                given, 0.0, row.ctypes.data, crank.u.ctypes.data, crank.p.ctypes.data
            )
            for row in x
        ]
    for row in x[slider_rod.chart(0.0, x, crank.u, crank.p) == 0]:
        out = row.copy()  # the argument and the result may be one array
        assert not library.slider_crank_transform(
            0, 1, 0.0, out.ctypes.data, crank.u.ctypes.data, crank.p.ctypes.data, out.ctypes.data
        )
        np.testing.assert_array_equal(out, slider_rod.transform(0, 1, 0.0, row, crank.u, crank.p))


@needs_compiler
@pytest.mark.slow
def test_the_example_runs(tmp_path: Path, crank: Case) -> None:
    files = emit(program(equations(crank.mechanics, "slider+rod")))
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    command = next(
        line.split("&&")[0]
        for line in files["example.c"].splitlines()
        if line.strip().startswith("cc ")
    )
    warned = [
        *compiler.find_compiler(),
        "-Wall",
        "-Wextra",
        "-pedantic",
        "-Werror",
        *command.split()[1:],
    ]
    subprocess.run(warned, cwd=tmp_path, check=True)
    said = subprocess.run(
        ["./example"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    assert len(said) == 4 + 1 + 4 and said[4] in ("in chart 0:", "in chart 1:")
    subprocess.run(
        [*warned[:5], "-std=c99", "-c", "slider_crank_simulate.c"], cwd=tmp_path, check=True
    )


@pytest.mark.slow
def test_verification_sees_every_chart_and_the_way_between(
    crank: Case, slider_rod: ModuleType
) -> None:
    derived = equations(crank.mechanics, "slider+rod")

    def failed(**wrong: Any) -> list[str]:
        module = ModuleType(slider_rod.__name__)
        vars(module).update({**vars(slider_rod), **wrong})
        found = quick_verification(crank.mechanics.model, derived, lambda: module, states=4)
        return [check.name for check in found.checks if not check.passed]

    whole = verification(crank.mechanics.model, derived, slider_rod, states=2)
    assert whole.choice == "slider+rod" and whole.passed
    assert len([check for check in whole.checks if check.name.endswith("; chart 1, rod")]) > 30
    assert failed() == []
    assert failed(transform=lambda *a: slider_rod.transform(*a) * (1 + 1e-9)) == ["transform"]
    assert failed(transform=lambda old, new, *a: slider_rod.transform(new, old, *a)) == [
        "transform"
    ]
    assert failed(energy_chart1=lambda *a: slider_rod.energy_chart1(*a) * (1 + 1e-9)) == [
        "module = graph; chart 1, rod"
    ]


def test_a_wrong_chart_is_seen_in_its_equations(crank: Case) -> None:
    found = equations(crank.mechanics, "slider+rod")
    chart = found.charts[0]
    state = next(function for function in chart.functions if function.name == "state")
    wrong = replace(state, result=replace(state.result, value=1.001 * state.result.value))
    changed_chart = replace(
        chart, functions=tuple(wrong if f.name == "state" else f for f in chart.functions)
    )
    seen = verification(
        crank.mechanics.model, replace(found, charts=(changed_chart,)), None, states=3
    )
    assert not seen.passed and any(
        "chart 1" in check.name for check in seen.checks if not check.passed
    )


# ---- hamel simulate


def test_simulate_goes_through_and_says_so() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider", time=1.0)
    same = hamel.simulate(SLIDER_CRANK, choice="crank", time=1.0)
    assert found.switches and not same.switches and found.choice == "slider"
    t = list(found.motion["t"])  # a switch is told between two rows that follow each other
    assert all(t.index(x.before) == t.index(x.time) + 1 for x in found.switches)
    for name in ("q1", "q2", "s"):
        assert found.final[name] == pytest.approx(same.final[name], abs=1e-8)
    assert found.energy_balance < 1e-9 and found.acceleration_violation < 1e-10
    assert json.dumps(hamel.records.as_json(found))


@pytest.mark.slow
def test_named_charts_are_simulated_as_they_are() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider+tangent", time=1.0)
    assert found.choice == "slider+tangent" and {switch.entered for switch in found.switches} == {
        "tangent"
    }
    assert found.motion["s_dot"] == pytest.approx(found.motion["der(s)"], abs=1e-12)


@needs_compiler
@pytest.mark.parametrize("enforcement", ["invariants", "invariants_euclidean"])
@pytest.mark.slow
def test_the_energy_is_held_through_the_changes(enforcement: str, tmp_path: Path) -> None:
    """That of the start, in every chart, where projection lets it go by what the tolerance is."""
    path = tmp_path / "slider_crank.yaml"
    path.write_text(LOSSES.sub(r"\g<1>0", SLIDER_CRANK.read_text().replace(*ROD).replace(*FAST)))
    given: dict[str, Any] = {"choice": "slider+rod", "time": 0.5, "step": 0.01, "rtol": 1e-6}
    held, let = (
        hamel.simulate(path, enforcement=name, **given) for name in (enforcement, "projection")
    )
    assert len(held.switches) >= 4 and held.energy_balance < 1e-10 < 1e-7 < let.energy_balance
    assert held.position_violation < 1e-12 and held.velocity_violation < 1e-12
    exact = hamel.simulate(path, choice="crank", time=0.5, rtol=1e-12).final
    assert [held.final[name] for name in ("q1", "s")] == pytest.approx(
        [exact[name] for name in ("q1", "s")], abs=1e-6
    )


@pytest.mark.parametrize(
    ("choice", "says"),
    [
        ("slider+slider", "'slider' is named twice among the charts slider\\+slider"),
        ("slider+slidr", "unknown choice of quasi-velocities 'slidr'"),
        ("slider+", "unknown choice of quasi-velocities ''"),
    ],
)
def test_names_that_are_no_charts_are_refused(choice: str, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        hamel.simulate(SLIDER_CRANK, choice=choice, time=0.1)


@pytest.mark.parametrize("name", ["scipy_dop853", "scipy_radau", "scipy_lsoda", "cvodes", "idas"])
def test_libraries_do_not_change_charts(name: str) -> None:
    options: dict[str, Any] = {"integrator": name, "enforcement": "none", "time": 0.1}
    with pytest.raises(
        AssumptionError, match=r"does not fit the charts slider\+crank.*name one choice"
    ):
        hamel.simulate(SLIDER_CRANK, choice="slider+crank", **options)


@pytest.mark.slow
def test_generalized_velocities_make_no_charts() -> None:
    found = hamel.simulate(SLIDER_CRANK, choice="slider+crank", formulation="augmented", time=0.1)
    assert not found.switches and found.formulation == "augmented"


def test_gimbal_lock_makes_no_second_chart_of_the_same_speeds() -> None:
    """It vanishes in any choice, so that another one is no way round it."""
    text = """
model: top
parameters: {om: 30 rad/s}
bodies:
  lift: {mass: 0}
  top: {mass: 0.3 kg, com: [0, 0, 0.1], inertia: [5e-4, 5e-4, 3e-4]}
joints:
  up: {type: prismatic, parent: ground, child: lift, axis: z, coordinate: z}
  foot: {type: ball, parent: lift, child: top, orientation: {euler: zxz, angles: [prec, nut, spin]}}
constraints: {d: {type: prescribed, joint: up, motion: 0.02 m*sin(om*t)}}
initial: {nut: 20 deg, foot.wz: 200 rad/s}
"""
    found = equations(system(load_text(text)), charts=True)
    assert any(x.name.startswith("gimbal lock") for x in found.function("dynamics").guards)
    assert not found.charts
