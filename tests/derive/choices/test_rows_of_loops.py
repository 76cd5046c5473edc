"""Loops in a row that come to lie flat together: each motion finds its way across, or says that it
did not.

A row of parallelograms moves as one pendulum: its n + 1 rods turn alike, its n couplers go round
without turning. Where all links lie along one line every loop can leave that motion, and rates of
the rods are quotients of numbers that vanish together.

Of derive.choices: orthonormal, walk; of derive.mechanics: gaps; of the run-time: guards.
"""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from derive.choices import orthonormal, resolution
from derive.diagnostics import AssumptionError
from derive.expressions.counting import operations
from derive.formulations import equations
from derive.mechanics.geometry.gaps import gap
from derive.mechanics.records import System
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import temporary_module
from tests.loops import KITE, four_bars

LOOPS, END = 12, 6.0
FUNCTIONS = ("dynamics", "project", "constraints", "velocity", "state")


@pytest.fixture(scope="module")
def row() -> System:
    return system(load_text(four_bars(LOOPS)))


@pytest.fixture(scope="module", params=["crank", "orthonormal"])
def module(row: System, request: pytest.FixtureRequest) -> Iterator[Any]:
    made = equations(row, request.param)
    with temporary_module(made, ("dop853",), ("projection",), FUNCTIONS) as module:
        yield module


@pytest.fixture(scope="module")
def closed_form() -> np.ndarray:
    return pendulum(LOOPS)


def pendulum(loops: int) -> np.ndarray:
    """Angle and rate of the rods at the end, ½ I ω² + m g sin a being constant."""
    inertia, moment = (loops + 1) / 3 + loops, (loops + 1) / 2 + loops
    turn = 9.81 * moment / inertia
    motion = solve_ivp(
        lambda _, y: [y[1], -turn * np.cos(y[0])], (0.0, END), [np.pi / 2, -1.0], "DOP853",
        rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return motion.y[:, -1]


def start(row: System, module: Any) -> np.ndarray:
    return np.asarray(module.state(0.0, initial_state(row).whole))


def off(module: Any, x: np.ndarray, closed_form: np.ndarray) -> float:
    count = (len(module.velocity(END, x)) + 1) // 2
    rods, v = x[:count], module.velocity(END, x)[:count]
    return float(max(np.abs(rods - closed_form[0]).max(), np.abs(v - closed_form[1]).max()))


def test_the_first_rows_tell_the_shortest_way_of_writing_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where one way of writing them has solved more than another by then."""
    loops, counts = 30, set[int]()
    row = system(load_text(four_bars(loops)))
    for telling in (loops, 2 * loops):
        monkeypatch.setattr(resolution, "TELLING", telling)
        counts.add(operations(equations(row, "crank").function("dynamics").result.value))
    assert len(counts) == 1


@pytest.mark.parametrize("rtol", [1e-7, 1e-8, 1e-9])
def test_a_row_goes_through_flat_positions_as_one_pendulum(
    row: System, module: Any, closed_form: np.ndarray, rtol: float
) -> None:
    times = np.linspace(0.0, END, 301)
    found = module.simulate(times, start(row, module), rtol=rtol, atol=rtol)
    assert off(module, found.x[-1], closed_form) < max(1e3 * rtol, 5e-6)


def test_what_arrives_is_right(row: System, module: Any, closed_form: np.ndarray) -> None:
    """Steps that end anywhere, tolerances down to rounding: no other branch is called a motion."""
    assert arrivals(module, start(row, module), closed_form) >= 10


def test_long_rows_are_crossed_too() -> None:
    """Most often: at 1e-11 the digits that are left decide."""
    long = system(load_text(four_bars(24)))
    with temporary_module(
        equations(long, "crank"), ("dop853",), ("projection",), FUNCTIONS
    ) as made:
        assert arrivals(made, start(long, made), pendulum(24)) >= 17


def arrivals(module: Any, x: np.ndarray, closed_form: np.ndarray) -> int:
    """How many motions of 32 arrive. Those that do have to be right, the others have to say why."""
    count = 0
    for rtol in (1e-9, 1e-10, 1e-11, 1e-12):
        for rows, atol in itertools.product((2, 61, 301, 600), (rtol, rtol / 100)):
            times = np.linspace(0.0, END, rows)
            try:
                found = module.simulate(times, x, rtol=rtol, atol=atol)
            except FloatingPointError as stopped:
                assert any(word in str(stopped) for word in ("singular", "too small"))
                continue
            assert off(module, found.x[-1], closed_form) < 1e-5, (rtol, rows, atol)
            count += 1
    return count


def test_lanes_and_numpy_go_the_same_way(row: System, module: Any, closed_form: np.ndarray) -> None:
    times, x = np.linspace(0.0, END, 31), start(row, module)
    one = module.simulate(times, x, rtol=1e-8, atol=1e-8)
    many = module.simulate(times, np.tile(x, (9, 1)), rtol=1e-8, atol=1e-8)
    assert (many.status == 0).all()
    np.testing.assert_allclose(many.x, np.tile(one.x, (9, 1, 1)), atol=1e-5)
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    given = (x, np.zeros(0), np.array(module.defaults), 1e-8, 1e-8, times, 10_000, None)
    slow = simulate.run(simulate.advance, "numpy", (0.0, END), *given)
    assert slow.crossings == one.crossings
    assert off(module, slow.x[-1], closed_form) < 1e-5


def test_what_hardly_moves_is_on_its_branch() -> None:
    """Velocities of rounding, which a projection changes as it likes, are no jump."""
    hanging = KITE.replace("q1: 70 deg, guess: {q2: -20 deg, q3: 80 deg}",
                           "q1: -70 deg, guess: {q2: 20 deg, q3: -80 deg}")  # fmt: skip
    mechanics = system(load_text(hanging.replace("gravity: [0, -9.81 m/s^2]", "gravity: [0, 0]")))
    made = equations(mechanics, None, "augmented")
    with temporary_module(made, ("dop853",), ("projection",), FUNCTIONS) as module:
        x = np.asarray(module.state(0.0, initial_state(mechanics).whole))
        x[3:] = [1e-14, -3e-14, 2e-14]  # on no constraint
        found = module.simulate(np.linspace(0.0, 5.0, 6), x)
        assert np.abs(found.x[-1, :3] - x[:3]).max() < 1e-12


def test_a_projection_is_that_of_rows_made_orthogonal() -> None:
    """At random: N of both ways agrees up to its sign, A N = 0 and Nᵀ N = 1."""
    rng = np.random.default_rng(5)
    for rows, columns, free in ((13, 14, 1), (14, 17, 3), (20, 21, 1)):
        A = rng.normal(size=(rows, columns)) * (rng.random((rows, columns)) < 0.4)
        A[:, :rows] += 2 * np.eye(rows)
        listed = [[float(x) for x in row] for row in A]
        frame = [[float(x) for x in row] for row in rng.normal(size=(free, columns))]
        projected = orthonormal._projected(listed, frame)[0]
        sparse = np.array(orthonormal._gram_schmidt(projected)[0], float)
        dense = np.array(orthonormal._gram_schmidt([*listed, *frame])[0][rows:], float)
        np.testing.assert_allclose(sparse, dense, atol=1e-10)
        np.testing.assert_allclose(A @ sparse.T, 0.0, atol=1e-10)
        np.testing.assert_allclose(sparse @ sparse.T, np.eye(free), atol=1e-10)


def test_the_orthonormal_choice_of_a_row_grows_with_its_length() -> None:
    counts = {}
    for loops in (8, 16):
        made = equations(system(load_text(four_bars(loops))), "orthonormal")
        counts[loops] = operations(made.function("dynamics").result.value)
    assert counts[16] < 2.1 * counts[8]


def test_constants_of_a_gap_are_taken_together() -> None:
    """Far from the ground's origin: the digits of two points near by."""
    a, b, l = (ca.SX.sym(name) for name in "abl")
    first = [37 * l + l * ca.cos(a), l * ca.sin(a)]
    second = [38 * l + l * ca.cos(b) - 0.25, l * ca.sin(b)]
    way = gap(first, second, l)
    value = ca.Function("way", [a, b, l], [ca.vertcat(*way)])
    angle, length = 0.7, 0.1
    np.testing.assert_array_equal(
        np.array(value(angle, angle, length)).ravel(), [length - 0.25, 0.0]
    )
    plain = ca.Function("plain", [a, b, l], [ca.vertcat(*second) - ca.vertcat(*first)])
    given = (0.3, -1.2, 0.7)
    np.testing.assert_allclose(np.array(value(*given)), np.array(plain(*given)), atol=1e-14)
    assert value.n_instructions() <= plain.n_instructions()
    assert ca.is_equal(gap([l * ca.cos(a)], [2 * l + b], l)[0], 2 * l + b - l * ca.cos(a), 3)


@pytest.mark.parametrize("loops", [2, 45])
def test_a_speed_that_every_motion_has_as_zero_is_refused_by_name(loops: int) -> None:
    """The rods turn alike: the difference of two is a row that says nothing, told by rounding."""
    text = four_bars(loops).replace("crank: [der(a0)]", 'crank: ["der(a0) - der(a1)"]')
    s = system(load_text(text))
    with pytest.raises(AssumptionError, match=r"'crank'.*'w1' depends on the constraints"):
        equations(s, "crank")
