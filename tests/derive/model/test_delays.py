"""Inputs that arrive late: Padé's approximation as first-order states.

Of derive.model.motion: delays.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import hamel
from derive.diagnostics import ModelError
from derive.formulations import equations
from derive.formulations.evaluate import function_of
from derive.model import load, load_text
from derive.model.motion.delays import coefficients
from derive.states import system

ARM = """
model: arm
plane: xy
parameters: {T: 50 ms}
tables:
  gusts: {points: [[0, 0], [1, 0.1], [2, 0]], units: [s, N*m]}
bodies: {rod: {mass: 1 kg, com: [0, -0.3 m], inertia: 0.02}}
joints: {hinge: {type: revolute, parent: ground, child: rod, coordinate: q}}
inputs:
  tau: {joint: hinge, gear: 3, delay: T, delay_order: 3}
  wind: {joint: hinge, table: gusts, delay: 10 ms}
outputs: {arrives: tau_late}
"""


@pytest.mark.parametrize("n", range(1, 11))
def test_every_frequency_passes_with_the_phase_of_the_delay(n: int) -> None:
    """Against e^(−iωT): of size one, and right to order 2n + 1."""
    text = ARM.replace("delay_order: 3", f"delay_order: {n}")
    found = equations(system(load_text(text)))
    z = slice(2, 2 + n)
    x, u, p = found.argument("x").symbols, found.argument("u").symbols, np.array([0.05])
    rate = function_of(found, "dynamics")
    late = function_of(found, "outputs")
    slots = (np.zeros(x.numel()), np.zeros(1), p)
    A = ca.Function("A", [x, u], [ca.jacobian(rate(0.0, x, u, p), x)])(*slots[:2]).full()[z, z]
    B = ca.Function("B", [x, u], [ca.jacobian(rate(0.0, x, u, p), u)])(*slots[:2]).full()[z]
    C = ca.Function("C", [x, u], [ca.jacobian(late(0.0, x, u, p), x)])(*slots[:2]).full()[0, z]
    D = float(ca.Function("D", [x, u], [ca.jacobian(late(0.0, x, u, p), u)])(*slots[:2]))
    for phase in (0.1, 0.3, 1.0, 3.0):
        gain = C @ np.linalg.solve(1j * phase / 0.05 * np.eye(n) - A, B[:, 0]) + D
        assert abs(abs(gain) - 1.0) < 1e-9
        size = coefficients(n)[-1] ** 2 * phase ** (2 * n + 1)
        assert abs(gain - np.exp(-1j * phase)) < 1.1 * size + 1e-9


def test_what_arrives_drives_the_joint() -> None:
    """With the gear; and a table arrives late, too."""
    found = equations(system(load_text(ARM)))
    assert found.argument("u").labels == ("tau",)
    assert found.z == ("tau_late1", "tau_late2", "tau_late3", "wind_late1", "wind_late2")
    inertia, x = 0.02 + 0.09, np.array([0.2, 0.0, 0.3, -0.2, 0.1, 0.05, 0.01])
    late = function_of(found, "outputs")(0.0, x, [2.0], [0.05]).full().item()
    d = coefficients(3)
    assert late == pytest.approx(-2.0 + 2 * d[0] * 0.3 + 2 * d[2] * 0.1, rel=1e-14)
    without = function_of(found, "dynamics")(0.5, x, [2.0], [0.05]).full().ravel()[1]
    shifted = function_of(found, "dynamics")(0.5, x, [3.0], [0.05]).full().ravel()[1]
    assert shifted - without == pytest.approx(-3.0 / inertia, rel=1e-12)


@pytest.mark.slow
def test_a_smooth_input_arrives_when_it_should(tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text(ARM)
    t = np.linspace(0.0, 2.0, 401)
    course = hamel.simulate(file, time=2.0, step=0.005, inputs={"tau": (t, np.sin(4 * t) ** 3)})
    wanted = np.where(t > 0.05, np.sin(4 * (t - 0.05)) ** 3, 0.0)
    assert np.abs(course.motion["arrives"] - wanted).max() < 2e-3
    assert hamel.verify(file, states=5).passed


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("delay: T", "delay: 0 s", r":10:39: error: the delay of 'tau' is 0 s"),
        ("delay: T", "delay: 3 kg", "kg"),
        ("delay: T", "delay: q", "'q' is a coordinate and cannot stand"),
        ("delay_order: 3", "delay_order: 2.5", "order of the delay of 'tau' is 2.5"),
        ("delay_order: 3", "delay_order: 11", "a whole number from 1 to 10"),
        ("delay: T, delay_order", "delay_order", "an order without a delay of 'tau'"),
        ("{T: 50 ms}", "{T: 50 ms, tau_late: 1}", "'tau_late' is the name of a parameter"),
    ],
)
def test_mistakes_are_told_where_they_are(old: str, new: str, message: str) -> None:
    assert old in ARM
    with pytest.raises(ModelError, match=message):
        load_text(ARM.replace(old, new, 1))


def test_a_submodel_brings_its_delays(tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(ARM)
    whole = "model: two\nplane: xy\nsubmodels: {left: {use: arm.yaml}, right: {use: arm.yaml}}\n"
    (tmp_path / "two.yaml").write_text(whole)
    names = [state.name for state in load(tmp_path / "two.yaml").states]
    assert "left_tau_late1" in names and "right_wind_late2" in names
