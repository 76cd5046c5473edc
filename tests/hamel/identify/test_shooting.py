"""Free parameters by multiple shooting: noisy motions give them back, and what cannot be is told.

Of hamel.identify: shooting.
"""

from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, ModelError

ARM = """
model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {l: 0.5 m, k: 3 N*m/rad^3, mu: 0.1 N*m, s: 0.2 rad/s, tau: 0.1 s, idle: 1}
bodies: {rod: {mass: 1 kg, com: [0, -l], inertia: 0.02}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
inputs: {u: {unit: N*m}}
states: {act: {rate: (u - act)/tau, initial: 0 N*m}}
loads: {all: {type: expression, joint: hinge, expression: act - k*q^3 - mu*tanh(der(q)/s)}}
initial: {q: 30 deg}
outputs: {unused: idle}
"""
TRUE = {"l": 0.45, "k": 2.2, "mu": 0.25, "tau": 0.06}
NOISE = 0.002


def write(file: Path, names: str, *columns: np.ndarray) -> Path:
    np.savetxt(file, np.column_stack(columns), delimiter=",", header=names, comments="")
    return file


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    file = tmp_path / "arm.yaml"
    file.write_text(ARM, encoding="utf-8")
    return file


def test_what_the_file_or_the_model_does_not_have_is_told(arm: Path, tmp_path: Path) -> None:
    t = np.linspace(0, 1, 40)
    file = write(tmp_path / "data.csv", "t,u,q", t, t, t)
    with pytest.raises(ModelError, match="'ka' is no parameter of arm"):
        hamel.free_parameters(arm, file, ["ka"])
    with pytest.raises(ModelError, match="0 segments"):
        hamel.free_parameters(arm, file, ["k"], segments=0)
    with pytest.raises(ModelError, match="no column 'u', an input"):
        hamel.free_parameters(arm, write(tmp_path / "b.csv", "t,q", t, t), ["k"])
    with pytest.raises(ModelError, match="measures nothing of the motion"):
        hamel.free_parameters(arm, write(tmp_path / "c.csv", "t,u,Q", t, t, t), ["k"])


@pytest.mark.slow
def test_noisy_positions_give_the_parameters_back(arm: Path, tmp_path: Path) -> None:
    """A length, a cubic spring, friction and the time constant of a state, from one angle; and what
    has no effect is named."""
    t = np.linspace(0.0, 5.0, 501)
    u = 2.0 * np.sin(3.0 * t) + np.sin(7.3 * t)
    how = {"time": 5.0, "step": 0.01, "inputs": {"u": (t, u)}, "rtol": 1e-11}
    q = hamel.simulate(arm, values=TRUE, **how).motion["q"]
    noisy = q + NOISE * np.random.default_rng(1).normal(size=len(t))
    file = write(tmp_path / "data.csv", "t,u,q", t, u, noisy)
    result = hamel.free_parameters(arm, file, list(TRUE))
    for parameter in result.parameters:
        apart = abs(parameter.value - TRUE[parameter.name])
        assert apart < 3.0 * parameter.deviation < 0.02 * parameter.value
    assert result.measured["q"] == pytest.approx(NOISE, rel=0.15)
    assert result.gap < 1e-4
    with pytest.raises(AssumptionError, match="does not tell 'idle'"):
        hamel.free_parameters(arm, file, ["k", "idle"])


FOUR_BAR = """
model: loop
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {k: 2 N*m/rad}
bodies:
  crank: {mass: 1 kg, com: [0.1 m, 0], inertia: 0.01}
  rod: {mass: 1 kg, com: [0.2 m, 0], inertia: 0.02}
  rocker: {mass: 1 kg, com: [0.15 m, 0], inertia: 0.02}
joints:
  A: {type: revolute, parent: ground, child: crank, coordinate: q1}
  B: {type: revolute, parent: crank, child: rod, at: [0.2 m, 0], coordinate: q2}
  D: {type: revolute, parent: ground, child: rocker, at: [0.4 m, 0], coordinate: q3}
closures: {C: {type: revolute, between: [rod, rocker], at: [[0.4 m, 0], [0.3 m, 0]]}}
loads: {spring: {type: expression, joint: A, expression: -k*(q1 - 1)^3}}
initial: {q1: 60 deg, guess: {q2: -30 deg, q3: 100 deg}}
"""


@pytest.mark.slow
def test_a_loop_gives_its_spring_back(tmp_path: Path) -> None:
    model = tmp_path / "loop.yaml"
    model.write_text(FOUR_BAR, encoding="utf-8")
    true = hamel.simulate(model, time=1.0, step=0.005, values={"k": 3.0}, rtol=1e-11).motion
    file = write(tmp_path / "data.csv", "t,q1", true["t"], true["q1"])
    (k,) = hamel.free_parameters(model, file, ["k"], segments=4).parameters
    assert k.value == pytest.approx(3.0, rel=1e-6)
