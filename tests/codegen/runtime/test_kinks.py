"""Steps that end where forces go on to another piece: motions through kinks and jumps have the order
and the error of the method, in C, lanes, ctypes and NumPy; a motion held at a jump goes on.

Of derive.mechanics: kinks.
Of codegen.runtime: numpy_kinks.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hamel
from codegen import compiler, loader
from codegen.passes import program
from derive.mechanics.kinks import kinks
from derive.mechanics.records import System
from derive.model import load_text
from derive.states.nonideal import system
from hamel.build.module import published
from tests.scenes import equations_of_text

# x'' = −x − k max(x, 0) − μ sign(ẋ) + F
SPRING = """model: rubbing
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
potential: 1 N/m*x^2/2
parameters: {k: 0 N/m, mu: 0 N}
inputs: {F: {unit: N}}
forces: {x: "F - k*ramp(x) - mu*sign(der(x))"}
"""
QUICK = ("dop853", "rk4")
ADAPTIVE = ("taylor", "verner9", "dopri5", "rkf45", "radau", "rosenbrock")
OTHERS = (*ADAPTIVE, "implicit_midpoint")
WITH_COMPILER = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
# p, start, time, end: half a turn of each half plane; friction takes 2 μ from every half swing
BENT = ([3.0, 0.0], [-1.0, 0.0], 1.5 * np.pi, [-1.0, 0.0])
HELD = ([0.0, 0.6], [0.5, 0.3], 1.0, [np.hypot(1.1, 0.3) - 0.6, 0.0])
RUBBED = ([0.0, 0.1], [0.1, -1.0], 2.0 * np.pi, [0.1, -0.6])

CASES = pytest.mark.parametrize("case", [BENT, RUBBED], ids=["bent", "rubbed"])


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    return built(tmp_path_factory, QUICK)


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    return built(tmp_path_factory, OTHERS)


def built(factory: pytest.TempPathFactory, names: tuple[str, ...]) -> ModuleType:
    base = factory.mktemp("kinks")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        made = program(equations_of_text(SPRING), ("dynamics",), names)
        return loader.load(published(made, base / "rubbing").folder)


def motion(module: ModuleType, case: Any, way: str = "", **how: Any) -> tuple[Any, float]:
    """A motion and its error at the end."""
    p, start, time, end = case
    times = how.pop("times", [0.0, time])
    if way:
        simulate = importlib.import_module(f"{module.__name__}._simulate")
        library = importlib.import_module(f"{module.__name__}._library")
        advance = {"numpy": simulate.advance, "ctypes": library.advance}[way]
        tolerances = (how.pop("rtol", 1e-9), how.pop("atol", 1e-9))
        given = (times, start, None, p, *tolerances, None, 10**6, None)
        result = simulate.run(advance, way, *given, **how)
    else:
        how = {"rtol": 1e-9, "atol": 1e-9, **how}
        result = module.simulate(times, start, p=p, **how)
    return result, float(np.abs(result.x[-1] - end).max())


@WITH_COMPILER
@CASES
def test_error_control_keeps_to_the_tolerance(module: ModuleType, case: Any) -> None:
    """Without the landings one step in two is rejected, and friction is off by 30 tolerances."""
    _check_controlled(module, "dop853", case)


@pytest.mark.slow
@WITH_COMPILER
@CASES
@pytest.mark.parametrize("name", ADAPTIVE)
def test_other_methods_keep_to_the_tolerance(others: ModuleType, name: str, case: Any) -> None:
    _check_controlled(others, name, case)


def _check_controlled(module: ModuleType, name: str, case: Any) -> None:
    result, error = motion(module, case, integrator=name)
    assert result.landings >= 2
    assert error < 3e-8
    assert result.rejected <= (20 if name == "radau" else 12)


@WITH_COMPILER
@CASES
def test_equal_steps_keep_their_order(module: ModuleType, case: Any) -> None:
    _check_order(module, "rk4", 4, case)


@pytest.mark.slow
@WITH_COMPILER
@CASES
def test_implicit_equal_steps_keep_their_order(others: ModuleType, case: Any) -> None:
    _check_order(others, "implicit_midpoint", 2, case)


def _check_order(module: ModuleType, name: str, order: int, case: Any) -> None:
    steps = [case[2] / n for n in (100, 200, 400)]
    errors = [motion(module, case, integrator=name, step_size=h)[1] for h in steps]
    assert np.log2(errors[0] / errors[2]) / 2 > order - 0.4


@WITH_COMPILER
@CASES
def test_c_ctypes_numpy_and_lanes_land_alike(module: ModuleType, case: Any) -> None:
    own, _ = motion(module, case)
    for way in ("ctypes", "numpy"):
        other, error = motion(module, case, way)
        assert other.landings == own.landings >= 2 and error < 3e-8
        assert abs(other.steps - own.steps) <= 2
    p, start, time, _ = case
    starts = np.add(start, [[0.0, 1e-3 * k] for k in range(9)])
    many = module.simulate([0.0, time], starts, p=p, rtol=1e-9, atol=1e-9)
    single = [module.simulate([0.0, time], x, p=p, rtol=1e-9, atol=1e-9) for x in starts]
    assert many.landings.tolist() == [one.landings for one in single]
    assert many.landings.min() >= 2
    assert np.abs(many.x[:, -1] - [one.x[-1] for one in single]).max() < 1e-9


@WITH_COMPILER
def test_a_motion_held_at_a_jump_goes_on(module: ModuleType) -> None:
    """Friction that holds the mass makes ẋ = 0 a jump that the motion cannot leave: it is slow, as
    ever, but no search without end."""
    result, error = motion(module, HELD, rtol=1e-5, atol=1e-5)
    assert error < 1e-3
    assert result.landings < result.steps


@WITH_COMPILER
def test_a_motion_held_for_good_ends(module: ModuleType) -> None:
    """The spring is weaker than friction where it comes to rest: 10⁹ steps would not be enough."""
    with pytest.raises(module.Stopped, match="forces jump here and hold the motion") as caught:
        module.simulate([0.0, 9.0], [1.0, 0.0], p=[0.0, 0.3], max_steps=5 * 10**6)
    part = caught.value.partial
    assert part.status == module.Status.HELD and part.steps + part.rejected < 500_000


@WITH_COMPILER
def test_rows_inputs_and_events_at_a_kink(module: ModuleType) -> None:
    """A row, a knot of a table and an event stand where the kink does."""
    p, start, _, _ = BENT
    quarter = np.pi / 2
    table = module.Table([0.0, quarter, 10.0], [0.0, 0.0, 0.0])
    t = [0.0, quarter, 2 * quarter, 3 * quarter]
    events = {"zero": lambda t, x: x[0]}
    result = module.simulate(t, start, {"F": table}, p, rtol=1e-9, atol=1e-9, events=events)
    wanted = [[-1, 0], [0, 1], [0, -1], [-1, 0]]
    assert np.abs(result.x - wanted).max() < 1e-8
    assert np.abs(result.events.of("zero").t - [quarter, 2 * quarter]).max() < 1e-8


def of(force: str, more: str = "") -> System:
    return system(
        load_text(
            "model: m\ncoordinates: {x: m}\nkinetic: 1 kg*der(x)^2/2\nparameters: {b: 1 m}\n"
            f"inputs: {{F: {{unit: N}}}}\nforces: {{x: '{force}'}}\n{more}"
        )
    )


@pytest.mark.parametrize(
    ("force", "count"),
    [
        ("(1 N)*x/b", 0),
        ("(1 N)*abs(b/b)", 0),  # nothing moves there
        ("(1 N)*abs(x/b) + (2 N)*sign(x/b)", 1),
        ("(1 N/m)*(ramp(x - b) - ramp(-x - b))", 2),
        ("(1 N/m)*ramp(x) - (1 N/m)*ramp(-x)", 1),
        ("clip(F, -1 N, 1 N)", 2),
        ("(1 N/m)*clip(x, -b, b)", 2),
        ("piecewise(t, 0 N, 1 s, 1 N, 2 s, 0 N)", 2),  # which may be near each other
        ("(1 N)*step(x, b)", 0),  # smooth
        ("(1 N)*f(x)", 3),
    ],
)
def test_kinks_of_forces(force: str, count: int) -> None:
    """One function for each place of a term, wherever it comes from; none of what cannot change."""
    tables = "tables: {f: {points: [[0, 1], [1, 2], [3, 1]], units: [m, '']}}\n"
    assert len(kinks(of(force, tables if "f(x)" in force else ""))) == count


def test_a_function_changes_its_sign_at_every_fourth_threshold() -> None:
    steps = ", ".join(f"{k % 2}, {k} m" for k in range(1, 10))
    found = of(f"(1 N)*piecewise(x, {steps}, 1)")
    functions = kinks(found)
    assert len(functions) == 4
    g = ca.Function("g", [found.q], [ca.vertcat(*functions)])
    for place in range(1, 10):
        before, at, after = (g(place + d).full()[:, 0] for d in (-1e-3, 0.0, 1e-3))
        changed = before * after < 0
        assert changed.sum() == 1 and at[changed] == 0.0


def test_contact_and_potentials_have_kinks() -> None:
    sphere = """model: dropped
plane: xz
gravity: [0, -9.81 m/s^2]
bodies: {ball: {mass: 1 kg, inertia: 0.1}}
joints: {j: {type: planar, parent: ground, child: ball, coordinates: [x, z, turn]}}
loads:
  floor: {type: contact, body: ball, shape: {wheel: {radius: 0.1 m}}, plane: {normal: [0, 1]}, stiffness: 1000 N/m, damping: 1 s/m, friction: 0.3, smoothing: 1 mm/s}
"""
    assert len(kinks(system(load_text(sphere)))) == 2  # touching, and pressed at all
    stop = of("0 N", "potential: (1 N/m)*max(0 m, x - b)^2\n")
    assert len(kinks(stop)) == 1


SLED = """model: sled
plane: xy
bodies: {sled: {mass: 4 kg, com: [0.2, 0], inertia: 0.3}}
joints: {base: {type: planar, parent: ground, child: sled, coordinates: [x, y, heading]}}
constraints: {skate: {type: no_slip, body: sled, at: [0, 0], direction: y}}
quasi_velocities: {body: {speed: base.vx, spin: base.w}, tangent: orthonormal}
loads: {hill: {type: wrench, frame: sled, force: [-(9 N/m)*ramp(x - 0.3 m) - (4 N)*step(y), 0]}}
initial: {x: -1 m, base.vx: 1 m/s, base.w: 0.5 rad/s, y: -0.1 m}
"""


@pytest.mark.slow
@WITH_COMPILER
def test_modules_with_a_frame_and_with_charts_land_alike(tmp_path: Path) -> None:
    """Their functions have the choice's own coordinates; the motion is the same."""
    file = tmp_path / "sled.yaml"
    file.write_text(SLED, encoding="utf-8")
    how = {"time": 3.0, "rtol": 1e-10, "atol": 1e-12, "integrator": "dop853"}
    runs = [hamel.simulate(file, choice=x, **how) for x in ("body", "tangent", "body+tangent")]
    ends = [[run.final[name] for name in ("x", "y", "heading")] for run in runs]
    assert np.abs(np.subtract(ends, ends[0])).max() < 1e-8
    assert all(run.landings == runs[0].landings >= 2 for run in runs)


# q is given; its velocity jumps at 1 s, begins to grow there, or goes on as it was
DRIVEN = """model: driven
plane: xy
bodies: {{a: {{mass: 1 kg, inertia: 0.1}}, b: {{mass: 1 kg, com: [0.2 m, 0], inertia: 0.1}}}}
joints:
  j: {{type: revolute, parent: ground, child: a, coordinate: q}}
  k: {{type: revolute, parent: a, child: b, at: [0.3 m, 0], coordinate: p}}
constraints: {{m: {{type: prescribed, joint: j, motion: "piecewise(t, {}, 1 s, {})"}}}}
"""
FROM_REST = DRIVEN.format("0 rad", "(2 rad/s)*(t - 1 s)")
BACK = DRIVEN.format("(-1 rad/s)*(t - 1 s)", "(2 rad/s)*(t - 1 s)")
TO_ANOTHER_PLACE = DRIVEN.format("0 rad", "0.5 rad")
BEGINNING = DRIVEN.format("0 rad", "(2 rad/s^2)*(t - 1 s)^2")
STEADY = DRIVEN.format("(2 rad/s)*(t - 1 s)", "(2 rad/s)*(t - 1 s)")
ROWS = ([0.0, 1.0, 2.0], [0.0, 0.3, 1.0 - 1.1e-16, 2.0], [0.0, 2.0])


def driven(text: str, base: Path) -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        functions = ("dynamics", "constraints", "project")
        made = program(equations_of_text(text), functions, QUICK)
        return loader.load(published(made, base / "driven").folder)


@WITH_COMPILER
@pytest.mark.parametrize(
    ("text", "q"),
    [(FROM_REST, 0.0), (BACK, 1.0), (TO_ANOTHER_PLACE, 0.0)],
    ids=["rest", "back", "elsewhere"],
)
def test_a_velocity_that_constraints_make_jump_is_a_blow(
    text: str, q: float, tmp_path: Path
) -> None:
    """Quasi-velocities go on as they were through what is no blow; here the motion ends, wherever
    rows are. It went on with the pendulum's momentum changed by nothing."""
    module, start = driven(text, tmp_path), [q, 0.3, 0.5]
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    library = importlib.import_module(f"{module.__name__}._library")
    for rows in ROWS:
        for how in ({}, {"integrator": "rk4", "step_size": 0.01}):
            with pytest.raises(module.Stopped, match="a prescribed velocity") as stop:
                module.simulate(rows, start, **how)
            assert 0.98 < float(str(stop.value).partition(" t = ")[2].partition(":")[0]) < 1.0
            for way, advance in (("numpy", simulate.advance), ("ctypes", library.advance)):
                given = (rows, start, None, [], 1e-9, 1e-9, None, 10**6, None)
                with pytest.raises(FloatingPointError, match="a prescribed velocity"):
                    simulate.run(advance, way, *given, **how)
    starts = np.add(start, [[0.0, 0.0, 0.1 * k] for k in range(9)])
    with pytest.warns(RuntimeWarning, match="9 of 9 motions ended early"):
        many = module.simulate(ROWS[0], starts)
    assert set(many.status.tolist()) == {int(module.Status.JUMP)}


@WITH_COMPILER
@pytest.mark.parametrize("text", [BEGINNING, STEADY], ids=["beginning", "steady"])
def test_what_begins_at_a_row_is_no_blow(text: str, tmp_path: Path) -> None:
    """The step that ends there knows nothing of what comes, and the next one nothing of what was:
    the motion is that of two runs."""
    module = driven(text, tmp_path)
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    start = [0.0 if text == BEGINNING else -2.0, 0.3, 0.5]
    exact = {"rtol": 1e-12, "atol": 1e-12}
    half = module.simulate([0.0, 1.0 - 1e-15], start, **exact).x[-1]
    end = module.simulate([1.0, 2.0], half, **exact).x[-1]
    for rows in ROWS:
        for how in ({}, {"integrator": "rk4", "step_size": 0.01}):
            own = module.simulate(rows, start, **how)
            given = (rows, start, None, [], 1e-10, 1e-10, None, 10**6, None)
            other = simulate.run(simulate.advance, "numpy", *given, **how)
            for result in (own, other):
                assert np.abs(result.x[-1] - end).max() < 1e-6


# corners a thousandth of a second apart: two blows, of which neither was seen
NEAR = DRIVEN.format("0 rad", "(2 rad/s)*(max(t - 1 s, 0 s) - max(t - 1.001 s, 0 s))")


# m x'' = −k max(x − gap, 0), and from a time on −F too; until then it flies freely on both sides
CART = """model: cart_and_buffer
coordinates: {s: m}
kinetic: 3 kg*der(s)^2/2
potential: 0 J
forces: {s: "-2e4 N/m*ramp(s - 0.3 m) + piecewise(t, 0 N, 1 s, -3 N)"}
events:
  near: {formula: s - 0.2999 m, direction: rising}
  touch: {formula: s - 0.3 m, direction: rising}
  soon: {formula: t - 0.9999 s, direction: rising}
  back: {formula: s + 0.5 m, direction: falling, stop: true}
"""


@WITH_COMPILER
@pytest.mark.parametrize("way", ["", "numpy"])
def test_no_event_is_passed_over_near_a_kink(way: str, tmp_path: Path) -> None:
    """A step that erred far across one kink was taken to end before another, and carried on over
    the next one to the end; what lay between the end of a step and its kink was told at the kink."""
    made = program(equations_of_text(CART), ("dynamics",), ("dopri5", "dop853", "rk4"))
    module = loader.load(published(made, tmp_path / "cart").folder)
    v = 0.93
    returned = 0.3 / v + np.pi * np.sqrt(3 / 2e4)
    place = 0.3 - v * (1 - returned)
    wanted = {"near": 0.2999 / v, "touch": 0.3 / v, "soon": 0.9999}
    wanted["back"] = 1 - v + np.sqrt(v**2 + 2 * (place + 0.5))
    sizes = [{"integrator": "rk4", "step_size": h} for h in (0.003, 0.0011)]
    tolerances = np.logspace(-10, -3, 12 if way else 71).tolist()
    sizes += [
        {"integrator": name, "rtol": rtol, "atol": rtol / 100}
        for name in ("dopri5", "dop853")
        for rtol in tolerances
    ]
    for how in sizes:
        result, _ = motion(module, ([], [0.0, v], 2.0, [0.0, 0.0]), way, **how)
        for name, time in wanted.items():
            (found,) = result.events.of(name).t
            exact = 1e-3 if name == "back" else 1e-12
            assert found == pytest.approx(time, abs=exact), (how, name)


BETWEEN = """model: between_buffers
coordinates: {s: m}
kinetic: 3 kg*der(s)^2/2
potential: 0 J
parameters: {k: 1e4 N/m, gap: 0.3 m, F: 0 N, t1: 1 s}
forces: {s: "-k*ramp(s - gap) + k*ramp(-s - gap) + piecewise(t, 0 N, t1, -F)"}
events: {left: {formula: s + gap, direction: falling}}
"""
# p, start, time
SEVERAL = (
    ([127.7, 0.16, 300.0, 1.0], [-0.05, 0.18], 1.3),
    ([13196.34, 0.4508, 0.0, 1.0], [0.4387, -0.94024], 2.1207),
    ([38590.2, 0.12954, 0.0, 1.0], [-0.04636, -2.01456], 2.03),
    ([140822.7, 0.33207, 0.0, 0.26748], [-0.24895, 2.17222], 2.4618),
)


@WITH_COMPILER
@pytest.mark.parametrize("case", SEVERAL)
def test_no_kink_is_gone_across_to_another(case: Any, tmp_path: Path) -> None:
    """With few rows steps are long and err across several kinks: cut before one that was named by
    what they had come to, they were carried on across another, right through a buffer."""
    p, start, time = case
    made = program(equations_of_text(BETWEEN), ("dynamics",), ("dopri5", "dop853"))
    module = loader.load(published(made, tmp_path / "between").folder)
    exact = {"rtol": 1e-12, "atol": 1e-14}
    wanted, _ = motion(module, (p, start, time, 0.0), times=np.linspace(0, time, 301), **exact)
    events = wanted.events.of("left").t
    for way, name, rtol in [
        *(("", name, 10.0**-k) for name in ("dopri5", "dop853") for k in range(4, 13)),
        *(("numpy", "dop853", 10.0**-k) for k in (5, 8)),
    ]:
        how = {"integrator": name, "rtol": rtol, "atol": rtol / 100}
        for rows in (2, 7):
            times = np.linspace(0, time, rows)
            found, error = motion(module, (p, start, time, wanted.x[-1]), way, times=times, **how)
            assert error < 3e2 * rtol + 1e-10, (way, name, rtol, rows)
            assert found.steps < 4000
            assert found.events.of("left").t == pytest.approx(events, abs=3e2 * rtol + 1e-10)


@WITH_COMPILER
def test_of_two_corners_near_each_other_the_first_is_seen(tmp_path: Path) -> None:
    module = driven(NEAR, tmp_path)
    for how in ({}, {"rtol": 1e-4}, {"integrator": "rk4", "step_size": 0.2}):
        with pytest.raises(module.Stopped, match="a prescribed velocity"):
            module.simulate([0.0, 2.0], [0.0, 0.3, 0.5], **how)


PUSHED = """model: pushed
bodies: {b: {mass: 1 kg}}
joints: {j: {type: prismatic, parent: ground, child: b, axis: x, coordinate: x}}
loads: {f: {type: expression, joint: j, expression: "(5 N)*(1 + sign(t - START s))"}}
"""


@WITH_COMPILER
@pytest.mark.parametrize("start", [0.0, 2.0])
def test_a_motion_that_begins_at_a_jump_has_what_is_behind_it(start: float, tmp_path: Path) -> None:
    """The first stage of steps of given size had half the force: x was off by 1e-2."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        made = program(equations_of_text(PUSHED.replace("START", str(start))), ("dynamics",), QUICK)
        module = loader.load(published(made, tmp_path / "pushed").folder)
    times = [start, start + 1.0]
    for how in ({}, {"integrator": "rk4", "step_size": 0.01}):
        for way in ("", "ctypes", "numpy"):
            result, error = motion(
                module, ([], [0.0, 0.0], 1.0, [5.0, 10.0]), way, times=times, **how
            )
            assert error < 1e-10 and result.landings == 0
        many = module.simulate(times, np.zeros((9, 2)), **how)
        assert np.abs(many.x[:, -1] - [5.0, 10.0]).max() < 1e-10


# A pulse of 10 ms between three ramps, met by steps of some tenths of a second.
PULSE = """model: pulse
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
forces: {x: "(500 N/s)*(ramp(t - 2 s) - 2*ramp(t - 2.01 s) + ramp(t - 2.02 s))"}
"""
# Two feet of a box, which touch and leave within a short time.
BOX = """model: box
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {box: {mass: 2 kg, inertia: 0.1}}
joints: {J: {type: planar, parent: ground, child: box, coordinates: [x, y, th]}}
loads:
  left: {type: contact, body: box, at: [-0.3, -0.1], plane: {normal: y}, stiffness: 1e6 N/m, damping: 0.5 s/m}
  right: {type: contact, body: box, at: [0.3, -0.1], plane: {normal: y}, stiffness: 1e6 N/m, damping: 0.5 s/m}
"""
EACH = ("taylor", "dop853", "verner9")


@WITH_COMPILER
def test_neighbours_do_not_hide_one_another(tmp_path: Path) -> None:
    """Two changes of one sign within a quarter of a step were none: half of the pulse was lost."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        made = program(equations_of_text(PULSE), ("dynamics",), EACH)
        pulse = loader.load(published(made, tmp_path / "pulse").folder)
    for name in EACH:
        result, error = motion(
            pulse, ([], [0.0, 1.0], 5.0, [5.1495, 1.05]), integrator=name, rtol=1e-9
        )
        assert result.landings == 3 and error < 1e-8


@WITH_COMPILER
def test_feet_touch_and_leave_whatever_the_method(tmp_path: Path) -> None:
    """A series went past a foot that touches and leaves in one of its steps, and a trial step that
    ended anywhere at all said where the kink was: steps became too small in free flight."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        made = program(equations_of_text(BOX), ("dynamics",), EACH)
        box = loader.load(published(made, tmp_path / "box").folder)
    rng = np.random.default_rng(3)
    x = np.zeros((300, 6))
    x[:, 1], x[:, 2] = rng.uniform(0.15, 0.55, 300), rng.uniform(-0.3, 0.3, 300)
    x[0, 1:3] = 0.2792728226401851, 0.06824976587745213
    exact = box.simulate((0.0, 0.45), x, integrator="verner9", rtol=1e-13, atol=1e-15)
    for name in EACH:
        for rtol in (1e-6, 1e-10):
            many = box.simulate((0.0, 0.45), x, integrator=name, rtol=rtol, atol=rtol / 100)
            assert not many.status.any()
            off = np.abs(many.x[:, -1] - exact.x[:, -1]).max(axis=1)
            assert np.median(off) < 10 * rtol and np.quantile(off, 0.97) < 1e3 * rtol
