"""The controllers in examples/: computed torque in C, operational space on an arm, passivity on a
delta robot, predictive control of a tree and of a loop. Each does what its theory says."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen.compiler import find_compiler
from tests.scenes import ROOT

pytestmark = pytest.mark.slow


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec and spec.loader
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_computed_torque_in_c_follows_the_crank(tmp_path: Path):
    """The torque is held for a millisecond, which leaves an error of that order of the motion."""
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no compiler")
    assert example("computed_torque").largest_error(tmp_path, compiler) < 1e-3


def test_the_hand_comes_to_its_circle_as_a_damped_oscillator_does(tmp_path: Path):
    """With a = a_d + 2 k ė + k² e the error is (e₀ + (ė₀ + k e₀) t) exp(−k t), exactly: at rest off
    the circle ė₀ is the circle's velocity."""
    space = example("operational_space")
    module = space.built(tmp_path)
    found = space.errors(module, 1.5)
    k, t = space.RATE, space.STEP * np.arange(len(found))
    point, speed, _ = space.circle(0.0, np.zeros(3))
    gap = point + np.multiply.outer(t, speed + k * point)
    wanted = np.linalg.norm(gap, axis=1) * np.exp(-k * t)
    assert found == pytest.approx(wanted, abs=1e-7)


def test_the_storage_of_the_delta_falls_as_fast_as_damping_takes_it(tmp_path: Path):
    """V = ½ sᵀ M_w s along the motion: V̇ = −sᵀ K s by differences, and the arms arrive."""
    delta = example("passivity_delta")
    module = delta.built(tmp_path)
    times, states = delta.motion(module, 1.5)
    pairs = [delta.storage(module, t, x) for t, x in zip(times[:200], states)]
    V, taken = np.array(pairs).T
    rate = (V[2:] - V[:-2]) / (times[2:200] - times[:198])
    assert rate == pytest.approx(-taken[1:-1], rel=1e-3)
    assert np.abs(states[-1, :3] - delta.wanted(times[-1])[0]).max() < 1e-3
    assert np.abs(module.constraints(times[-1], states[-1])).max() < 1e-12


def test_predictive_control_swings_the_pole_up_and_holds_it():
    nmpc = example("nmpc_swing_up")
    path = nmpc.swing_up(nmpc.CART_POLE)[1]
    assert np.abs(path[0, 1]) == pytest.approx(np.pi)
    assert np.abs(1 - np.cos(path[-20:, 1])).max() < 1e-3
    assert np.abs(path[-1, 0]) < 0.05


def test_predictive_control_swings_a_closed_loop_up_and_holds_it():
    """From the lowest position of the four-bar to its highest, with less torque than gravity takes
    on the way."""
    nmpc = example("nmpc_swing_up")
    path = nmpc.swing_up(nmpc.FOUR_BAR)[1]
    assert np.abs(path[0, 0] - nmpc.HIGHEST) > 2.9
    assert np.abs(1 - np.cos(path[-20:, 0] - nmpc.HIGHEST)).max() < 1e-6
    assert np.abs(path[-20:, 3]).max() < 1e-3


@pytest.mark.slow
def test_exact_differential_dynamic_programming_swings_the_pole_up():
    """It ends where iLQR ends, in fewer iterations, and its feedback holds the motion on the plan."""
    exact, plain, path = example("ddp_swing_up").main()
    assert exact.costs[-1] == pytest.approx(plain.costs[-1], rel=1e-6)
    assert len(exact.costs) < len(plain.costs)
    assert all(b < a for a, b in zip(exact.costs, exact.costs[1:]))
    assert np.abs(1 - np.cos(path[-1, 1])) < 1e-4
    assert np.abs(path[-1, [0, 2, 3]]).max() < 0.05
