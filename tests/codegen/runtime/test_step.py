"""Steps for controllers: what they come to, their derivatives, their estimate, and what is refused.

Of codegen.runtime: steps.
Of codegen.passes: steppers.
"""

from __future__ import annotations

import importlib
import subprocess
import warnings
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.emit import emit
from codegen.passes import in_precision, program
from codegen.runtime.simulation import Status
from codegen.runtime.steps import INACCURATE, METHODS, Face
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.build.module import published
from tests.scenes import derived, mechanics

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

FUNCTIONS = ("default", "step", "step_sensitivity")
# Two joints: dry friction in one, and a force that depends on time.
ARM = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
bodies:
  upper: {mass: 2 kg, com: [0.2 m, 0], inertia: 0.03}
  lower: {mass: 1 kg, com: [0.15 m, 0], inertia: 0.01}
joints:
  A: {type: revolute, parent: ground, child: upper, coordinate: a, friction: {coulomb: 2 N*m, smoothing: 0.01 rad/s}}
  B: {type: revolute, parent: upper, child: lower, at: [0.4 m, 0], coordinate: b}
inputs: {tau: {joint: A}}
loads:
  shaker: {type: expression, joint: B, expression: "0.3 N*m*sin(t*7 rad/s)"}
initial: {a: -80 deg, b: 10 deg}
"""
ARM_STATE = np.array([-1.4, 0.2, 0.3, -0.4])


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory):
    base = tmp_path_factory.mktemp("step")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        yield base


def module_of(home, found: Equations, name: str, real: str = "float64") -> ModuleType:
    made = in_precision(program(found, FUNCTIONS), real)
    return loader.load(published(made, home / name).folder)


@pytest.fixture(scope="module")
def arm(home) -> ModuleType:
    return module_of(home, equations(system(load_text(ARM))), "arm")


def through(module: ModuleType, backend: str, name: str = "step") -> Face:
    """The function by another way to call it."""
    binding = importlib.import_module(f"{module.__name__}.{backend}")
    face = getattr(module, f"_{name}")
    return replace(face, quick=getattr(binding, name), general=getattr(binding, f"{name}_row"))


def classical(module: ModuleType, t: float, x: np.ndarray, h: float, u: np.ndarray, n: int):
    """W. Kutta's formula."""
    part = h / n
    for k in range(n):
        s = t + k * part
        a = module.dynamics(s, x, u)
        b = module.dynamics(s + part / 2, x + part / 2 * a, u)
        c = module.dynamics(s + part / 2, x + part / 2 * b, u)
        x = x + part / 6 * (a + 2 * b + 2 * c + module.dynamics(s + part, x + part * c, u))
    return x


def extrapolated(function, size: float) -> np.ndarray:
    """The derivative by central differences of four sizes."""
    table: list[list[np.ndarray]] = []
    for k in range(4):
        d = size / 2**k
        row = [(function(d) - function(-d)) / (2 * d)]
        for j in range(1, k + 1):
            row.append(row[-1] + (row[-1] - table[k - 1][j - 1]) / (4**j - 1))
        table.append(row)
    return table[-1][-1]


def test_rk4_is_the_classical_step(arm: ModuleType) -> None:
    u, h = np.array([0.7]), 1e-4
    for n in (1, 4):
        found = arm.step(0.3, np.append(ARM_STATE, h), u, substeps=n)
        wanted = classical(arm, 0.3, ARM_STATE, h, u, n)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=4e-16)


@pytest.mark.parametrize("method", METHODS)
def test_a_step_is_of_order_four(arm: ModuleType, method: str) -> None:
    """And so are its parts: half of them, a sixteenth of the error."""
    x, u = np.append(ARM_STATE + np.array([0, 0, 2.0, 0]), 0.2), np.array([3.0])
    exact = arm.step(0.3, x, u, substeps=4000)
    errors = [
        np.abs(arm.step(0.3, x, u, substeps=n, method=method) - exact).max() for n in (8, 16, 32)
    ]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3.6).all() and (orders < 4.6).all(), orders


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("substeps", [1, 3])
def test_derivatives_are_those_of_the_step(arm: ModuleType, method: str, substeps: int) -> None:
    """Where friction bends; ten digits of differences."""
    start = np.array([-1.4, 0.2, 0.015, -0.4, 0.7])  # x, then u
    way = {"substeps": substeps, "method": method}

    def step(z: np.ndarray) -> np.ndarray:
        return arm.step(0.3, np.append(z[:4], 2e-4), z[4:], **way)

    found = arm.step_sensitivity(0.3, np.append(start[:4], 2e-4), start[4:], **way)
    columns = [
        extrapolated(lambda d, e=e: step(start + d * e), 1e-3 if e[2] else 1e-2) for e in np.eye(5)
    ]
    wanted = np.array(columns).T
    assert np.abs(found - wanted).max() <= 1e-10 * np.abs(wanted).max()


@pytest.mark.slow
def test_derivatives_of_a_step_through_closed_loops_are_those_of_the_step(home) -> None:
    """Of a delta robot, 13 states over three inputs."""
    delta = module_of(home, derived("gallery/delta_robot"), "delta_robot")
    start = np.array(delta.state(0.0, initial_state(mechanics("gallery/delta_robot")).whole))
    random = np.random.default_rng(1)
    for method in METHODS:
        x = delta.project(0.0, start + np.append(np.zeros(10), random.normal(scale=0.5, size=3)))
        z = np.append(x, random.normal(size=3))

        def step(z: np.ndarray, method: str = method) -> np.ndarray:
            return delta.step(0.0, np.append(z[:13], 1e-3), z[13:], method=method)

        found = delta.step_sensitivity(0.0, np.append(z[:13], 1e-3), z[13:], method=method)
        columns = [(step(z + d) - step(z - d)) / 2e-5 for d in 1e-5 * np.eye(16)]
        np.testing.assert_allclose(found, np.array(columns).T, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["step", "step_sensitivity"])
def test_all_ways_to_call_say_the_same(arm: ModuleType, method: str, name: str) -> None:
    x = np.append(ARM_STATE, 1e-4) + 1e-5 * np.arange(15).reshape(3, 5)
    u = np.array([0.7])
    way = {"substeps": 2, "method": method, "error": True}
    wanted = getattr(arm, name)(0.3, x, u, **way)
    for got, want in zip(arm.threaded(getattr(arm, name), 2)(0.3, x, u, **way), wanted):
        np.testing.assert_array_equal(got, want)
    for backend in ("_library", "_numpy"):
        found = through(arm, backend, name)(0.3, x, u, **way)
        for got, want in zip(found, wanted):
            np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("substeps", [1.5, "two", None])
def test_substeps_are_whole_numbers(arm: ModuleType, substeps: object) -> None:
    with pytest.raises(TypeError, match=r"step\(\) needs a whole number of substeps, got"):
        arm.step(0.3, np.append(ARM_STATE, 1e-3), [0.7], substeps=substeps)


def test_dry_friction_is_refused_and_not_answered(arm: ModuleType) -> None:
    """A millisecond through regularised friction, from 0.01 rad/s: no such step is OK, and the
    estimate says why; with steps that are short enough both methods agree."""
    x = np.append([-1.4, 0.2, 0.01, 0.0], 4e-2)
    for method in METHODS:
        with pytest.raises(FloatingPointError, match=r"inaccurate.*more substeps"):
            arm.step(0.0, x, [0.0], method=method)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            value, apart = arm.step(0.0, x[np.newaxis], [0.0], method=method, error=True)
        assert np.isnan(value).all() and np.isfinite(apart).all() and len(said) == 1
        assert apart[0].max() > 0.02
    ends = [arm.step(0.0, x, [0.0], substeps=800, method=method) for method in METHODS]
    np.testing.assert_allclose(*ends, rtol=1e-5, atol=1e-8)


def test_no_step_that_is_ok_is_far_off(arm: ModuleType) -> None:
    """From slow to fast through friction, short to long steps. Three tenths of the largest value
    of the entry, or of the twentieth part of the other speed's change, of which the rule lets pass
    a hundredth."""
    rng = np.random.default_rng(3)
    x = np.zeros((400, 5))
    x[:, :2] = rng.uniform(-1, 1, (400, 2))
    x[:, 2] = rng.normal(size=400) * 10 ** rng.uniform(-3, 0, 400)
    x[:, 4] = 10 ** rng.uniform(-4, -1.5, 400)
    u = rng.normal(size=(400, 1)) * 3
    truth = arm.step(0.0, x, u, substeps=1000, method="rosenbrock")
    for method in METHODS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            found = arm.step(0.0, x, u, method=method)
        ok = np.isfinite(found).all(axis=1)
        change = np.abs(truth - x[:, :4])[:, 2:].max(axis=1)
        size = np.max([np.abs(truth)[:, 2], np.abs(x)[:, 2], 0.05 * change], axis=0)
        wrong = np.abs(found - truth)[:, 2] / size
        assert ok.sum() > 60 and (~ok).sum() > 40
        assert np.max(wrong[ok]) < 0.3


def test_a_stiff_damper_takes_the_implicit_step(home) -> None:
    """A rate of 1e5 1/s over a millisecond: rk4 is refused, the implicit step is at the end of it,
    and its derivatives say that the start is forgotten."""
    text = """
model: damped
bodies: {rod: {mass: 1 kg, inertia: 0.1 kg*m^2}}
plane: xy
joints: {A: {type: revolute, parent: ground, child: rod, coordinate: a}}
loads: {grip: {type: damper, joint: A, coefficient: 1e4 N*m*s/rad}}
"""
    module = module_of(home, equations(system(load_text(text))), "damped")
    assert module.nu == 0
    x = np.array([0.2, 0.5, 1e-3])
    with pytest.raises(FloatingPointError, match="inaccurate"):
        module.step(0.0, x)
    lengths = np.geomspace(1e-7, 1.0, 300)  # from exact to e5 times too long
    many = np.column_stack([np.tile(x[:2], (300, 1)), lengths])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        speed = module.step(0.0, many)[:, 1]
    wrong = np.abs(speed - 0.5 * np.exp(-1e5 * lengths))
    assert np.isfinite(speed[lengths < 1e-5]).all() and np.isnan(speed[lengths > 3e-5]).all()
    assert np.nanmax(wrong) < 0.2 * 0.5
    found = module.step(0.0, x, method="rosenbrock", substeps=20)
    np.testing.assert_allclose(found, [0.2 + 0.5e-5, 0.0], atol=1e-7)
    slopes = module.step_sensitivity(0.0, x, method="rosenbrock", substeps=20)
    assert slopes.shape == (2, 2)
    np.testing.assert_allclose(slopes, [[1.0, 1e-5], [0.0, 0.0]], atol=1e-7)


def test_a_start_from_rest_is_no_error(home) -> None:
    """What is zero at first and moved by the square of another speed has no digit of its own; the
    step is right all the same. So is one of length zero, and one at rest."""
    module = module_of(home, derived("double_pendulum"), "pendulums")
    u = np.zeros(module.nu)
    for method in METHODS:
        for state in ([1.2, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [1e-9, 0.0, 0.0, 0.0]):
            for h in (0.0, 1e-4, 1e-2):
                value, apart = module.step(0.0, [*state, h], u, method=method, error=True)
                exact = module.step(0.0, [*state, h], u, substeps=50)
                np.testing.assert_allclose(value, exact, atol=1e-6)
                assert h or not apart.any()
    np.testing.assert_array_equal(
        module.step_sensitivity(0.0, [1.2, 0.3, 0.0, 0.0, 0.0], u, method="rosenbrock")[:, :4],
        np.eye(4),
    )


@pytest.mark.parametrize("method", METHODS)
def test_each_lane_has_its_own_status(arm: ModuleType, method: str) -> None:
    x = np.tile(np.append(ARM_STATE, 1e-4), (4, 1))
    x[1, 0], x[2] = np.nan, [-1.4, 0.2, 0.01, 0.0, 4e-2]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = arm.step(0.0, x, [0.7], method=method)
    assert list(np.isnan(found).any(axis=1)) == [False, True, True, False]
    np.testing.assert_array_equal(found[0], arm.step(0.0, x[0], [0.7], method=method))
    assert "failed" in str(said[0].message)


def test_what_cannot_be_is_said(arm: ModuleType) -> None:
    x = np.append(ARM_STATE, 1e-4)
    with pytest.raises(ValueError, match="substeps from 1"):
        arm.step(0.0, x, [0.0], substeps=0)
    with pytest.raises(TypeError):
        arm.step(0.0, x, [0.0], substeps=1.5)
    with pytest.raises(ValueError, match="no method 'euler'; it has rk4, rosenbrock"):
        arm.step(0.0, x, [0.0], method="euler")
    with pytest.raises(ValueError, match="5 values"):
        arm.step(0.0, x[:4], [0.0], method="rosenbrock")
    with pytest.raises(FloatingPointError, match="finite"):
        arm.step(0.0, np.append(ARM_STATE, np.nan), [0.0], method="rosenbrock")
    out = np.empty(4)
    assert arm.step(0.0, x, [0.0], out=out, substeps=2) is out
    with pytest.raises(ValueError, match="shape"):
        arm.step(0.0, x, [0.0], out=np.empty(3), substeps=2)


def test_float32_has_the_same_steps(home) -> None:
    found = equations(system(load_text(ARM)))
    single = module_of(home, found, "arm32", "float32")
    double = module_of(home, found, "arm64")
    x = np.append(ARM_STATE, 1e-4)
    for method in METHODS:
        value, apart = single.step(0.1, x, [0.7], method=method, error=True)
        assert value.dtype == apart.dtype == np.float32
        wanted = double.step(0.1, x, [0.7], method=method)
        np.testing.assert_allclose(value, wanted, rtol=1e-5, atol=1e-5)
        slopes = single.step_sensitivity(0.1, x, [0.7], method=method)
        wanted = double.step_sensitivity(0.1, x, [0.7], method=method)
        np.testing.assert_allclose(slopes, wanted, rtol=1e-3, atol=1e-4)
    command, folder = compiler.find_compiler(), Path(single.__file__).parent
    strict = ("-std=c99", "-Wall", "-Wextra", "-Wdouble-promotion", "-Wconversion", "-Werror")
    made = folder.parent / "arm32.o"
    source = folder / "arm_simulate.c"
    subprocess.run([*(command or []), *strict, "-c", source, "-o", made], check=True)


def test_who_asks_for_no_step_carries_nothing_of_it() -> None:
    """No file, no line; and what was there is what it is with a step."""
    without = emit(program(derived("cart_pole")))
    made = program(derived("cart_pole"), FUNCTIONS)
    assert not any("step.h" in name or name == "_steps.py" for name in without)
    own = [text for name, text in without.items() if name != "runtime_module.h"]  # all statuses
    assert not any("INACCURATE" in text or "step_by" in text for text in own)
    assert made.kernel("dynamics") == program(derived("cart_pole")).kernel("dynamics")
    names = [kernel.name for kernel in made.offered]
    assert names[-2:] == ["step", "step_sensitivity"]
    assert INACCURATE not in {int(status) for status in Status}
