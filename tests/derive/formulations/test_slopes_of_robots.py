"""Derivatives of a flying robot, whose base is turned by a quaternion, and of a parallel one, closed
by six rods: extrapolated differences of what is one order lower say the same.

The entries of x count as independent, those of a quaternion too, and rods may be torn: derivatives
are those of ẋ as it is written, along any direction.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from codegen import compiler, loader
from codegen.passes import program
from derive.formulations import equations
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.model import load, load_text
from derive.states import sampling, system
from hamel.build.module import published
from tests.scenes import MODELS

# ten digits of differences over four sizes, where ẋ is as large as it gets
CLOSE = 1e-8
SIZE = 1e-2  # of the first of the differences, in SI
QUADROTOR = """
model: quadrotor
gravity: [0, 0, -9.81 m/s^2]
bodies: {frame: {mass: 1.2 kg, com: [1 cm, 0, 2 cm], inertia: [0.012, 0.015, 0.022]}}
joints: {base: {type: free, parent: ground, child: frame, position: [x, y, z]}}
repeat: {i: 1..4}
inputs: {"thrust{i}": {unit: N}}
loads:
  rotor{i}: {type: force, body: frame, at: ["0.2 m*cos(90 deg*i)", "0.2 m*sin(90 deg*i)", 0], components: [0, 0, "thrust{i}"], frame: body}
  spin{i}: {type: torque, body: frame, components: [0, 0, "0.02 m*(-1)^i*thrust{i}"], frame: body}
  drag: {type: force, body: frame, components: [-0.1 kg/s*velocity(frame).x, 0, 0]}
"""
WITH_COMPILER = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")
Row = tuple[float, np.ndarray, np.ndarray, np.ndarray]


@cache
def gallery(name: str) -> Equations:
    return equations(system(load(MODELS / "gallery" / f"{name}.yaml")))


@cache
def graph(name: str, function: str) -> Callable[..., np.ndarray]:
    found = gallery(name)
    made = found.function(function) if found.has(function) else found.request(function).function
    at = function_of(found, made)
    return lambda *row: np.array(at(*row))


def rows(found: Equations, count: int) -> list[Row]:
    """Random admissible states (t, x, u, p)."""
    state, s = function_of(found, "state"), sampling.states(found.system, count, 3)
    each = zip(s.t, s.q, s.v, s.u, s.p)
    return [(t, np.array(state(t, np.r_[q, v], u, p)).ravel(), u, p) for t, q, v, u, p in each]


def slope(function: Callable[[np.ndarray], np.ndarray], z: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Along d by central differences of three sizes, extrapolated."""
    table: list[list[np.ndarray]] = []
    for k in range(3):
        h = SIZE / 2**k
        row = [(function(z + h * d) - function(z - h * d)) / (2 * h)]
        for j in range(1, k + 1):
            row.append(row[-1] + (row[-1] - table[k - 1][j - 1]) / (4**j - 1))
        table.append(row)
    return table[-1][-1]


def slopes(function: Callable[[np.ndarray], np.ndarray], z: np.ndarray) -> np.ndarray:
    """By every entry, one column each."""
    return np.column_stack([slope(function, z, e) for e in np.eye(len(z))])


def close(found: np.ndarray, wanted: np.ndarray) -> None:
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= CLOSE * np.abs(wanted).max()


@pytest.mark.parametrize("name", ["quadrotor_slung_load", "delta_robot"])
def test_derivatives_are_slopes_of_dynamics(name: str) -> None:
    """[ẋ ∂ẋ/∂x ∂ẋ/∂u] of `derivatives`."""
    dynamics, derivatives = graph(name, "dynamics"), graph(name, "derivatives")
    for t, x, u, p in rows(gallery(name), 2):
        n = len(x)

        def rates(z: np.ndarray, t=t, p=p, n=n) -> np.ndarray:
            return dynamics(t, z[:n], z[n:], p).ravel()

        z = np.r_[x, u]
        close(derivatives(t, x, u, p), np.column_stack([rates(z), slopes(rates, z)]))


@pytest.mark.parametrize("name", ["quadrotor_slung_load", "delta_robot"])
@pytest.mark.parametrize("function", ["contraction", "dynamics_hessian"])
def test_second_derivatives_are_slopes_of_the_first(name: str, function: str) -> None:
    """Σ yₖ ∂²ẋₖ, whole or along every direction, is the slope of y·[∂ẋ/∂x ∂ẋ/∂u]."""
    derivatives, second = graph(name, "derivatives"), graph(name, function)
    ((t, x, u, p),) = rows(gallery(name), 1)
    n, y = len(x), np.random.default_rng(0).normal(size=len(x))

    def first(z: np.ndarray) -> np.ndarray:
        return y @ derivatives(t, z[:n], z[n:], p)[:, 1:]

    wanted = slopes(first, np.r_[x, u])
    if function == "contraction":
        found = np.column_stack([second(t, np.r_[x, y, d], u, p) for d in np.eye(len(wanted))])
    else:
        found = second(t, np.r_[x, y], u, p)
    close(found, wanted)


@WITH_COMPILER
@pytest.mark.parametrize(
    "name",
    [
        "quadrotor",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("quadrotor_slung_load",)),
    ],
)
def test_derivatives_of_a_step_are_slopes_of_the_step(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """[∂x⁺/∂x ∂x⁺/∂u] of `step_sensitivity`, by both methods."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    found = equations(system(load_text(QUADROTOR))) if name == "quadrotor" else gallery(name)
    made = program(found, ("dynamics", "step", "step_sensitivity"))
    module = loader.load(published(made, tmp_path / name).folder)
    length = 1e-3
    for t, x, u, p in rows(found, 2):
        n = len(x)
        for method in ("rk4", "rosenbrock"):

            def step(z: np.ndarray, t=t, p=p, n=n, method=method) -> np.ndarray:
                return module.step(t, np.r_[z[:n], length], z[n:], p, method=method)

            ours = module.step_sensitivity(t, np.r_[x, length], u, p, method=method)
            close(ours, slopes(step, np.r_[x, u]))
