"""The orthonormal choice goes wherever the constraints are independent: its frame is data of the
module, based anew on the way.

Of derive.choices: frozen, orthonormal.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.formulations import equations
from derive.formulations.evaluate import evaluator
from derive.formulations.frames import based
from derive.mechanics.records import System
from derive.model import load
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import temporary_module
from tests.scenes import MODELS

SNAKE = MODELS / "snake3.yaml"
DRIVEN = {"tau1": 0.01, "tau2": -0.02, "base.vx": 0.3}
needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.fixture(scope="module")
def snake() -> System:
    return system(load(SNAKE))


@pytest.fixture(scope="module")
def module(snake: System) -> Iterator[Any]:
    with temporary_module(equations(snake, "orthonormal", moving=True)) as made:
        yield made


def start(mechanics: System) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) and u of the motion that turns the frame through."""
    at = initial_state(mechanics, {"base.vx": 0.3})
    return np.concatenate([at.q, at.v]), np.array([0.01, -0.02])


def test_the_orthonormal_choice_goes_where_a_constant_frame_ends() -> None:
    """With a constant frame this motion stopped at 2.66 s, though A has full rank there."""
    there, wanted = (
        hamel.simulate(SNAKE, choice=choice, time=10.0, values=DRIVEN)
        for choice in ("orthonormal", "head")
    )
    for name in ("x", "y", "th", "phi1", "phi2", "base.vx", "base.w"):
        np.testing.assert_allclose(there.motion[name], wanted.motion[name], atol=1e-7)
    assert there.choice == "orthonormal"  # and no other one helped
    assert {name.split(" (")[0] for name in there.motion["choice"]} == {"orthonormal"}
    assert len(there.switches) >= 2 and there.energy_balance < 1e-9


def test_rows_come_with_the_frame_they_are_measured_along(snake: System, module: Any) -> None:
    """v by the module's own function is that of the motion, and the energy is in balance."""
    qv, u = start(snake)
    found = module.simulate(
        np.linspace(0.0, 5.0, 51), module.state(0.0, qv, u), u, rtol=1e-10, atol=1e-12
    )
    assert found.bases >= 2 and found.p.shape == (51, module.np_)
    energy = module.energy(found.t, found.x, u, found.p).sum(axis=1) - found.work
    np.testing.assert_allclose(energy, energy[0], atol=1e-9)
    v = module.velocity(found.t, found.x, u, found.p)
    with temporary_module(equations(snake, "head")) as other:
        whole = other.simulate(found.t, other.state(0.0, qv, u), u, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(v, other.velocity(found.t, whole.x, u), atol=1e-7)


def test_basing_anew_is_exact(snake: System, module: Any) -> None:
    """At random states far from the first base: nothing of the frame is lost, v is the same, and ẋ
    gives the same v̇ as the choice of the file."""
    rng = np.random.default_rng(3)
    nq = snake.q.numel()
    for _ in range(20):
        q = np.concatenate([rng.uniform(-1, 1, 2), rng.uniform(-2.5, 2.5, nq - 2)])
        x = np.concatenate([q, np.zeros(module.nx - nq)])
        p = module.rebase(0.0, x, [0.0, 0.0])
        assert module.frame(0.0, x, [0.0, 0.0], p) == pytest.approx(1.0, abs=1e-12)
        frame = p[-2 * snake.v.numel() :].reshape(2, -1)
        np.testing.assert_allclose(frame @ frame.T, np.eye(2), atol=1e-13)
        x[nq:] = rng.normal(size=2)
        v = module.velocity(0.0, x, [0.0, 0.0], p)
        np.testing.assert_allclose(frame @ v, x[nq:], atol=1e-12)  # N = E there
        again = module.state(0.0, np.concatenate([q, v]), [0.0, 0.0], p)
        np.testing.assert_allclose(again, x, atol=1e-12)


@needs_compiler
def test_all_backends_base_alike(snake: System, module: Any) -> None:
    simulate = importlib.import_module(f"{module.__name__}._simulate")
    library = importlib.import_module(f"{module.__name__}._library")
    qv, u = start(snake)
    x, p = module.state(0.0, qv, u), np.array(module.defaults)
    times = np.array([1.0, 2.0, 2.5])
    first = module.simulate([0.0], x, u, p, times=times, rtol=1e-7, atol=1e-9)
    for backend, advance in (("ctypes", library.advance), ("numpy", simulate.advance)):
        other = simulate.run(advance, backend, (0.0, 2.5), x, u, p, 1e-7, 1e-9, times, 10_000, None)
        assert other.bases == first.bases
        # a step more or less is a matter of rounding, and so are the directions of w after it
        assert abs(other.steps - first.steps) <= 1
        nq = snake.q.numel()
        np.testing.assert_allclose(other.x[:, :nq], first.x[:, :nq], rtol=1e-6, atol=1e-6)
        speeds = [module.velocity(times, found.x, u, found.p) for found in (other, first)]
        np.testing.assert_allclose(*speeds, rtol=1e-6, atol=1e-6)


def test_parameters_without_a_frame_mean_the_usual_one(snake: System, module: Any) -> None:
    """f(t, x, u, p) takes the model's own parameters alone, for one state and for many."""
    qv, u = start(snake)
    x = module.state(0.0, qv, u)
    short = np.array(snake.parameters)
    np.testing.assert_array_equal(module.dynamics(0.0, x, u, short), module.dynamics(0.0, x, u))
    many = module.dynamics(0.0, np.tile(x, (3, 1)), u, np.tile(short, (3, 1)))
    np.testing.assert_allclose(many, np.tile(module.dynamics(0.0, x, u), (3, 1)), rtol=1e-13)


def test_the_usual_frame_in_numbers_gives_the_same_equations(snake: System) -> None:
    """What verification and the textbook look at: no symbol of the frame is left."""
    moving, still = (equations(snake, "orthonormal", moving=x) for x in (True, False))
    assert moving.frame is not None and based(moving).frame is None
    assert based(moving).arguments[3].labels == still.arguments[3].labels
    x = np.linspace(0.1, 0.7, moving.arguments[1].symbols.numel())
    place = (0.0, x, np.array([0.3, 0.1]), np.array(snake.parameters))
    for name in ("dynamics", "velocity", "reactions"):
        np.testing.assert_allclose(
            evaluator(moving)(name, *place), evaluator(still)(name, *place), rtol=1e-11, atol=1e-13
        )


# ---- what a stop says, and which choice a row is in


def test_a_stop_says_that_only_the_choice_is_singular() -> None:
    """The slider's speed fails at its dead centre, where the constraints are independent."""
    mechanics = system(load(MODELS / "slider_crank.yaml"))
    at = initial_state(mechanics)
    with temporary_module(equations(mechanics, "slider")) as module:
        x = module.state(0.0, np.concatenate([at.q, at.v]))
        with pytest.raises(FloatingPointError, match="this choice of quasi-velocities is singular"):
            module.simulate((0.0, 3.0), x, rtol=1e-11, atol=1e-13)


def test_a_start_in_another_choice_is_a_switch() -> None:
    """At its dead centre the slider's speed says nothing: another choice has the first row."""
    found = hamel.simulate(
        MODELS / "slider_crank.yaml", choice="slider", time=0.2, values={"q1": "0 deg"}
    )
    assert found.motion["choice"][0] != "slider" and found.switches[0].time == 0.0
    assert found.switches[0].left == "slider"
    assert found.choice == "slider"


def test_a_function_alone_takes_the_parameters_of_the_file() -> None:
    """The numbers of the frame stand behind them; who passes p need not know."""
    sled = system(load(MODELS / "chaplygin_sleigh.yaml"))
    found = equations(sled, "tangent", moving=True)
    with temporary_module(found, functions=("mass_w",)) as made:
        own = np.array(sled.own_parameters)
        x = np.linspace(0.1, 0.5, made.nx)
        assert len(own) < made.np_ and callable(made.rebase)
        np.testing.assert_array_equal(made.mass_w(0.0, x, (), own), made.mass_w(0.0, x))


def test_derivatives_by_parameters_are_those_of_the_model(snake: System) -> None:
    found = equations(snake, "orthonormal", moving=True)
    taken, own = len(found.argument("p").labels), len(snake.model.parameters)
    assert taken > own  # the frame is behind them
    assert found.request("jacobian_p").function.result.value.shape[1] == own
