"""Gimbal lock is refused by every choice of quasi-velocities where q̇ or v would be divided by
nothing, and passed by in a motion that comes through.

Of derive.choices: locks.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from codegen import loader
from codegen.passes import program
from derive.choices.limits import SINGULAR
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from hamel.build.module import published

BODY = """
model: body
gravity: [0, 0, 0]
bodies: {b: {mass: 1 kg, inertia: [0.1, 0.2, 0.15]}}
joints: {f: {type: JOINT, parent: ground, child: b, orientation: {euler: SEQUENCE}}}
quasi_velocities: {rates: [RATES]}
"""
LINEAR, ANGULAR = ["der(f_x)", "der(f_y)", "der(f_z)"], [f"der(f_angle{i})" for i in (1, 2, 3)]


def derived(joint: str, sequence: str, choice: str) -> Equations:
    rates = [*(LINEAR if joint == "free" else []), *ANGULAR]
    text = BODY.replace("JOINT", joint).replace("SEQUENCE", sequence)
    return equations(system(load_text(text.replace("RATES", ", ".join(rates)))), choice)


@pytest.mark.parametrize("choice", ["rates", "auto"])
@pytest.mark.parametrize(("joint", "sequence"), [("free", "zyx"), ("ball", "zxz")])
def test_dynamics_is_guarded_where_two_axes_are_parallel(
    joint: str, sequence: str, choice: str
) -> None:
    """As far from lock as pivots are from zero; functions of v alone only where w are rates."""
    made = derived(joint, sequence, choice)
    (guard,) = [x for x in made.function("dynamics").guards if x.name == "gimbal lock of f"]
    assert guard.tolerance == SINGULAR
    energy = [x.name for x in made.function("energy").guards]
    assert ("gimbal lock of f" in energy) == (choice == "rates")


def test_other_joints_have_no_lock() -> None:
    text = BODY.replace("JOINT", "free").replace("{euler: SEQUENCE}", "quaternion")
    plain = text.replace("rates: [RATES]", "own: [f.vx, f.vy, f.vz, f.wx, f.wy, f.wz]")
    assert equations(system(load_text(plain)), "own").function("dynamics").guards == ()


@pytest.mark.slow
@pytest.mark.parametrize("choice", ["rates", "auto"])
def test_a_module_says_so_and_a_motion_comes_through(choice: str, tmp_path: Path) -> None:
    """A body turning about its middle axis alone passes lock at a quarter turn. With rates of
    angles it gave -7.6e15 there, with status OK."""
    folder = published(program(derived("free", "zyx", choice)), tmp_path / "made").folder
    module = loader.load(folder)
    x = np.zeros(12)
    x[4], x[10] = np.pi / 2, 1.0
    with pytest.raises(FloatingPointError, match="gimbal lock of f"):
        module.dynamics(0.0, x, [], [])
    x[4] = 0.5
    assert np.isfinite(module.dynamics(0.0, x, [], [])).all()
    motion = module.simulate(np.linspace(0.0, 3.0, 31), np.where(np.arange(12) == 4, 0.0, x))
    assert motion.status == 0
    np.testing.assert_allclose(motion.x[-1, 4], 3.0, atol=1e-9)
