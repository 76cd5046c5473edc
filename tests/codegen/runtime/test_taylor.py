"""Motions along Taylor series: they agree with many digits and with Runge-Kutta methods, take steps
that the tolerance asks for from symmetric starts too, stop at the ends of pieces, and are refused
where a series is not the motion."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import program
from codegen.passes.taylor import series_in_lanes
from codegen.program import Kernel, Pivot, Program, Statement
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import published
from hamel.settings import settings
from hamel.simulate.exact import Problem, solution, state_of
from tests.arrays import address, aligned
from tests.points import quickly_built
from tests.scenes import RACER, derived, equations_of_text
from tests.toy import circle

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
# Everything that time, parameters and pieces can do to a force.
DRIVEN = """model: driven
coordinates: {x: m, y: m}
parameters: {m: 2 kg, k: 3 N/m, c: 0.2 N*s/m, om: 5 rad/s}
kinetic: m*(der(x)^2 + der(y)^2)/2
forces: {x: "-k*x + 1 N*sin(om*t) + k*y*t/(1 s)", y: "-k*y*(1 + x^2/(1 m^2)) - c*der(y)"}
initial: {x: 0.1 m, y: 0.4 m, der(x): 0 m/s, der(y): 1 m/s}
"""
KINK = """model: kink
coordinates: {x: m}
kinetic: 1 kg*der(x)^2/2
forces: {x: "-4 N/m*x - 0.3 N*s^2/m^2*der(x)*abs(der(x))"}
initial: {x: 1 m, der(x): 0 m/s}
"""
PHASES = """model: phases
coordinates: {x: m, y: m}
parameters: {a: 0 rad, om: 5 rad/s}
kinetic: 1 kg*(der(x)^2 + der(y)^2)/2
forces: {x: "-4 N/m*x + 1 N*sin(om*t + a)", y: "-3 N/m*y - 1 N/m^3*y*x^2 - 0.1 N*s/m*der(y)"}
initial: {x: 0.1 m, y: 0.4 m, der(x): 0 m/s, der(y): 1 m/s}
"""
ESCAPE = """model: escape
coordinates: {x: m}
parameters: {a: 0 rad}
kinetic: 1 kg*der(x)^2/2
forces: {x: "2 N/m^3*x^3 + 1e-3 N*sin(1 rad/s*t + a)"}
initial: {x: 1 m, der(x): 1 m/s}
"""
HANGING = """model: hanging
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {upper: {mass: 1 kg, com: [0, -1 m], inertia: 0}, lower: {mass: 1 kg, com: [0, -1 m], inertia: 0}}
joints:
  pivot: {type: revolute, parent: ground, child: upper, coordinate: q1}
  elbow: {type: revolute, parent: upper, child: lower, at: [0, -1 m], coordinate: q2}
initial: {q1: 90 deg, q2: 0 deg, der(q1): 0 rad/s, der(q2): 0 rad/s}
"""


def module(e: Equations, folder: Path, *others: str) -> ModuleType:
    made = program(e, None, ("taylor", *others))
    return loader.load(published(made, folder / e.system.model.name).folder)


def start(e: Equations, **values: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, u and p of the file."""
    given = settings(e.system.model, values)
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    return state_of(e, initial_state(e.system, given.initial, p), p), u, p


def many_digits(e: Equations, time: float, **values: float) -> np.ndarray:
    """q and v at the end."""
    x, u, p = start(e, **values)
    held = tuple(map(float, x)), tuple(map(float, u)), tuple(map(float, p))
    found = solution(Problem(e, *held), [time], 16).at(0)
    model = e.system.model
    names = [c.name for c in (*model.coordinates, *model.velocities)]
    return np.array([float(found[name]) for name in names])


def missed(e: Equations, made: ModuleType, time: float, rtol: float, **values: float) -> float:
    """How far q and v end from many digits, relative to the largest."""
    x, u, p = start(e, **values)
    found = made.simulate((0.0, time), x, u, p, integrator="taylor", rtol=rtol, atol=rtol / 100)
    end = found.x[-1]
    v = made.velocity(time, end, u, p)
    q = end[: len(end) - len(e.w)]
    wanted = many_digits(e, time, **values)
    return float(np.abs(np.concatenate([q, v]) - wanted).max() / np.abs(wanted).max())


@pytest.mark.parametrize(
    ("name", "time"),
    [
        ("double_pendulum", 2.0),
        ("four_bar", 1.0),
        pytest.param("snake3", 5.0, marks=pytest.mark.slow),
        pytest.param("bicycle", 0.2, marks=pytest.mark.slow),
        pytest.param("andrews", 0.01, marks=pytest.mark.slow),
        pytest.param("spatial_four_bar", 0.5, marks=pytest.mark.slow),
    ],
)
def test_ends_where_many_digits_end(name: str, time: float, tmp_path: Path) -> None:
    """Trees, loops and rolling, with projection; errors go with the tolerance down to rounding."""
    e = derived(name)
    made = module(e, tmp_path)
    values = {"tau1": 0.01, "tau2": -0.02, "base.vx": 0.3} if name == "snake3" else {}
    errors = [missed(e, made, time, rtol, **values) for rtol in (1e-8, 1e-14)]
    assert errors[0] < 1e-6
    assert errors[1] < 1e-12


def test_time_parameters_at_run_time_and_work(tmp_path: Path) -> None:
    """As verner9, for other parameters than those of the file."""
    e = equations_of_text(DRIVEN)
    made = module(e, tmp_path, "verner9")
    x, u, _ = start(e)
    p = [1.5, 4.0, 0.3, 7.0]
    how = {"times": [0.3, 0.31, 2.0], "rtol": 1e-13, "atol": 1e-15}
    one = made.simulate((0.1, 2.0), x, u, p, integrator="taylor", **how)
    other = made.simulate((0.1, 2.0), x, u, p, integrator="verner9", **how)
    np.testing.assert_allclose(one.x, other.x, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(one.work, other.work, rtol=1e-11, atol=1e-12)
    assert one.steps < 0.6 * other.steps


@pytest.mark.parametrize("rtol", [10.0 ** (-k / 2) for k in range(12, 31)])
def test_a_symmetric_start_does_not_hide_how_long_a_step_may_be(
    hanging: tuple[Equations, ModuleType], hanging_end: np.ndarray, rtol: float
) -> None:
    """Of the series from rest at a right angle three of four terms are zero."""
    e, made = hanging
    x, u, p = start(e)
    found = made.simulate((0.0, 1.0), x, u, p, integrator="taylor", rtol=rtol, atol=rtol / 100)
    assert np.abs(found.x[-1] - hanging_end).max() < 1e3 * rtol + 1e-13
    assert found.steps < 40


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> tuple[Equations, ModuleType]:
    e = equations(system(load_text(HANGING)), None, "quasi_velocities")
    return e, module(e, tmp_path_factory.mktemp("taylor"), "verner9")


@pytest.fixture(scope="module")
def hanging_end(hanging: tuple[Equations, ModuleType]) -> np.ndarray:
    return many_digits(hanging[0], 1.0)


def test_order_goes_with_the_tolerance(hanging: tuple[Equations, ModuleType]) -> None:
    """Equal steps halved: the error falls by two to the power of the order, ⌈1 − 0.7 ln rtol⌉."""
    e, made = hanging
    x = start(e)[0] + [0.0, 0.3, 0.5, -0.2]
    for rtol, order in ((1e-2, 5), (1e-3, 6), (1e-4, 8)):
        ends = [
            made.simulate((0.0, 0.4), x, integrator="taylor", rtol=rtol, atol=rtol, step_size=h).x[
                -1
            ]
            for h in (0.05, 0.025, 0.001)
        ]
        slope = np.log2(np.abs(ends[0] - ends[2]).max() / np.abs(ends[1] - ends[2]).max())
        assert abs(slope - order) < 0.5


def test_the_end_of_a_piece_is_seen(tmp_path: Path) -> None:
    """Drag by |v| v: a series goes on along the piece it starts in, the slope at its end does
    not."""
    e = equations_of_text(KINK)
    made = module(e, tmp_path, "dop853")
    x, u, p = start(e)
    how = {"rtol": 1e-10, "atol": 1e-12}
    one = made.simulate((0.0, 5.0), x, u, p, integrator="taylor", **how)
    other = made.simulate((0.0, 5.0), x, u, p, integrator="dop853", **how)
    np.testing.assert_allclose(one.x[-1], other.x[-1], atol=1e-8)
    assert one.rejected > 0


def test_lanes_leave_what_is_not_plain_to_the_loop_of_one(tmp_path: Path) -> None:
    """Every third motion has the sine of an angle that lanes do not take."""
    e = equations_of_text(PHASES)
    made = module(e, tmp_path)
    p = np.array([[1e17 if k % 3 == 0 else 0.1 * k, 5.0 + 0.1 * k] for k in range(21)])
    alike_in_lanes(e, made, p, "x")
    alike_in_lanes(e, made, p, "work", step_size=0.05)


def alike_in_lanes(e: Equations, made: ModuleType, p: np.ndarray, what: str, **how: float) -> None:
    """Rows and counts are those of one motion at a time."""
    assert series_in_lanes(program(e))
    x = start(e)[0]
    many = made.simulate((0.1, 4.0), x, None, p, integrator="taylor", **how)
    ones = [made.simulate((0.1, 4.0), x, None, row, integrator="taylor", **how) for row in p]
    wanted = [getattr(one, what) for one in ones]
    np.testing.assert_allclose(getattr(many, what), wanted, rtol=1e-12, atol=1e-13)
    assert [*many.steps] == [one.steps for one in ones]
    assert [*many.calls] == [one.calls for one in ones]


def test_symmetric_starts_in_lanes(hanging: tuple[Equations, ModuleType]) -> None:
    """From rest, more terms are looked at in the first step, and in no other."""
    e, made = hanging
    x = start(e)[0] + np.linspace(0.0, 2.0, 17)[:, np.newaxis] * [1.0, 0.5, 0.0, 0.0]
    for rtol in (1e-3, 1e-5, 1e-8, 1e-12):
        how = {"integrator": "taylor", "rtol": rtol, "atol": rtol / 100}
        many = made.simulate((0.0, 3.0), x, **how)
        ones = [made.simulate((0.0, 3.0), row, **how) for row in x]
        np.testing.assert_allclose(many.x, [one.x for one in ones], rtol=1e-10, atol=1e-11)
        assert [*many.steps] == [one.steps for one in ones]


def test_what_escapes_has_its_status_in_every_lane(tmp_path: Path) -> None:
    """x'' = 2 x³ is infinite after a second."""
    e = equations_of_text(ESCAPE)
    made = module(e, tmp_path)
    p = np.array([[1e17 if k % 3 == 0 else 0.1 * k] for k in range(21)])
    x = start(e)[0]
    with pytest.warns(RuntimeWarning, match="21 of 21 motions ended early"):
        many = made.simulate((0.0, 4.0), x, None, p, integrator="taylor")
    for k in range(21):
        with pytest.raises(made.Stopped) as stopped:
            made.simulate((0.0, 4.0), x, None, p[k], integrator="taylor")
        one = stopped.value.partial
        assert many.status[k] == one.status == made.Status.STEP_TOO_SMALL
        assert many.steps[k] == one.steps if k % 3 == 0 else abs(many.steps[k] - one.steps) < 4


def test_coefficients_in_lanes_are_those_of_one(tmp_path: Path) -> None:
    """To rounding; a pivot near zero is said of its lane alone."""
    lanes, order = 4, 12
    for name, source in emit(program(circle(), None, ("taylor",))).items():
        narrow = re.sub(r"LANES = \d+", f"LANES = {lanes}", source)
        (tmp_path / name).write_text(narrow, encoding="utf-8")
    command = compiler.find_compiler()
    assert command
    compiler.compile_folder(tmp_path, "circle", command)
    library = ctypes.CDLL(str(tmp_path / compiler.shared_library("circle")))
    t = np.array([0.5, 1.0, 9.0 - 1e-10, 8.5])
    angle, u, p = 0.1 * t, 0.3 + t, 1.0 + t
    x = np.stack([np.cos(angle), np.sin(angle)])
    room, stray = np.zeros(24 * 40 * lanes), np.zeros(lanes)
    many, one = np.zeros((order + 1, 3, lanes)), np.zeros((order + 1, 3))
    given = [aligned(value) for value in (t, x, u, p)]
    many, room = made = aligned(many), aligned(room)
    library.circle_taylor_lanes(
        *map(address, given[:3]), None, address(given[3]), None, order, *map(address, made),
        address(stray),
    )  # fmt: skip
    for k in range(lanes):
        own = [v[..., k].copy() for v in (x, u, p)]
        at_x, at_u, at_p = map(address, own)
        status = library.circle_taylor(
            ctypes.c_double(t[k]), at_x, at_u, None, at_p, None, order, address(one)
        )
        assert status == int(k == 2) and (stray[k] == 0.0) == (k != 2)
        if k != 2:
            np.testing.assert_allclose(many[:, :2, k], one[:, :2], rtol=1e-13, atol=1e-15)
            np.testing.assert_allclose(many[1:, 2, k], one[1:, 2], rtol=1e-13, atol=1e-15)


def with_numbers(made: Program) -> Program:
    """The same with a guard, a root, a sine and a rate of numbers alone, which no lane differs in."""
    kernels: list[Kernel] = []
    for kernel in made.kernels:
        if kernel.name == "dynamics":
            hoisted = kernel.hoisted
            kernel = _with_numbers(kernel)
            if hoisted:
                kernel = replace(kernel, hoisted=replace(hoisted, rest=_with_numbers(hoisted.rest)))
        kernels.append(kernel)
    return replace(made, kernels=tuple(kernels))


def _with_numbers(kernel: Kernel) -> Kernel:
    first = kernel.sections[0]
    added = (
        Statement("root2", ("sqrt", 2.0)),
        Statement("sine", ("sin", ("mul", 2.0, "root2"))),
        Statement("tilted", ("mul", "root2", 3.0)),
    )
    sections = (replace(first, statements=(*added, *first.statements)), *kernel.sections[1:])
    guards = (
        *kernel.guards,
        *(Pivot(n, v, 1e-6, 1e-6, 0.1) for n, v in (("one", 1.0), ("root", "root2"))),
    )
    outputs = (("add", kernel.outputs[0], ("mul", 0.0, "sine")), "tilted")
    return replace(kernel, sections=sections, guards=guards, outputs=outputs)


@pytest.mark.slow
def test_what_is_the_same_in_all_lanes_stands_in_each(tmp_path: Path) -> None:
    """A pivot that is one, and values of numbers alone: vectors where a vector is asked for. The
    compiler refused a number there."""
    made = with_numbers(program(circle(), None, ("taylor",)))
    for name, source in emit(made).items():
        (tmp_path / name).write_text(source, encoding="utf-8")
    assert (tmp_path / "circle_taylor_lanes.c").exists()
    command = compiler.find_compiler()
    assert command
    compiler.compile_folder(tmp_path, "circle", command)


def test_pieces_go_one_by_one(tmp_path: Path) -> None:
    """Behind the same call, to the bit."""
    e = equations_of_text(KINK)
    assert not series_in_lanes(program(e))
    made = module(e, tmp_path)
    x = start(e)[0] + np.linspace(-0.5, 0.5, 11)[:, np.newaxis]
    many = made.simulate((0.0, 3.0), x, integrator="taylor")
    ones = [made.simulate((0.0, 3.0), row, integrator="taylor").x for row in x]
    np.testing.assert_array_equal(many.x, ones)


def test_not_finite_and_short_budgets_have_their_status(
    hanging: tuple[Equations, ModuleType],
) -> None:
    e, made = hanging
    x, _, _ = start(e)
    with pytest.raises(made.Stopped) as stopped:
        made.simulate((0.0, 1.0), x, integrator="taylor", max_steps=3)
    assert stopped.value.partial.status == 5
    assert stopped.value.partial.steps == 3
    rows = made.simulate((0.0, 1.0), [x, x * np.nan, x + 0.1], integrator="taylor")
    assert [*rows.status] == [0, 3, 0]


def test_a_motion_goes_on_after_a_pause_as_without_one(
    hanging: tuple[Equations, ModuleType],
) -> None:
    e, made = hanging
    x, _, _ = start(e)
    times = np.linspace(0.0, 1.0, 30)
    whole = made.simulate((0.0, 1.0), x, integrator="taylor", times=times)
    both = made.simulate((0.0, 1.0), x, integrator="verner9", times=times, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(whole.x, both.x, atol=1e-7)


def test_refuses_what_acts_at_every_stage(tmp_path: Path) -> None:
    e = derived("four_bar")
    made = program(e, None, ("taylor",), ("projection", "tangent"))
    found = loader.load(published(made, tmp_path / "both").folder)
    x, u, p = start(e)
    with pytest.raises(ValueError, match="taylor does not fit the enforcement tangent"):
        found.simulate((0.0, 1.0), x, u, p, enforcement="tangent")


def test_auto_takes_series_for_one_motion_and_lanes_for_many(tmp_path: Path) -> None:
    """The record says which it was."""
    e = equations_of_text(HANGING)
    found = loader.load(published(program(e, None, ("auto",)), tmp_path / "auto").folder)
    assert found.integrators == ("dop853", "verner9", "taylor")
    x = start(e)[0]
    picked = [
        found.simulate((0.0, 0.1), state, integrator="auto", rtol=rtol, atol=rtol).integrator
        for state, rtol in ((x, 1e-10), (x, 1e-4), ([x, x + 0.1], 1e-10), ([x], 1e-4))
    ]
    assert picked == ["taylor", "dop853", "verner9", "dop853"]


def test_the_polynomial_of_a_step_finds_events(
    hanging: tuple[Equations, ModuleType], hanging_end: np.ndarray
) -> None:
    """q1 passes where it is after a second, within a step, at that second."""
    e, made = hanging
    found = made.simulate(
        (0.0, 1.5),
        start(e)[0],
        integrator="taylor",
        rtol=1e-13,
        atol=1e-15,
        events={"met": lambda t, x: x[0] - hanging_end[0]},
    )
    assert np.abs(found.events.t - 1.0).min() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_a_step_over_a_direction_that_turns_round_is_none(rtol: float, tmp_path: Path) -> None:
    """The length of a direction of fixed base vanishes and grows again within a step. Behind that
    the motion was another, with status OK."""
    mechanical = system(load_text(RACER))
    found = equations(mechanical, "orthonormal")
    module = quickly_built(found, ["dynamics"], ("taylor", "dop853"), ("none",), tmp_path)
    p = np.array(mechanical.parameters)
    x = state_of(found, initial_state(mechanical, {}, p), p)
    options = {"rtol": rtol, "atol": rtol / 100}
    for integrator in ("taylor", "dop853"):
        with pytest.raises(FloatingPointError, match="singular here"):
            module.simulate((0.0, 3.0), x, [], p, integrator=integrator, **options)
    with pytest.warns(RuntimeWarning, match="3 of 3 motions ended early"):
        module.simulate((0.0, 3.0), np.tile(x, (3, 1)), [], p, integrator="taylor", **options)
    before = module.simulate((0.0, 0.9), np.tile(x, (3, 1)), [], p, integrator="taylor", **options)
    one = module.simulate((0.0, 0.9), x, [], p, integrator="taylor", **options)
    np.testing.assert_allclose(before.x[:, -1], [one.x[-1]] * 3, rtol=1e-12, atol=1e-12)
    assert all(before.calls == one.calls)
