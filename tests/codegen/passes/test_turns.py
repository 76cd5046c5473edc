"""Whole turns of angles are taken out while integrating where nothing sees them, and nowhere
else."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from codegen import compiler
from codegen.passes import pipeline, program
from derive.enforcement import Options
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.model import load_text
from derive.states import system
from tests.points import NAMED, quickly_built
from tests.scenes import MODELS

needs_compiler = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

# Two arms of a mill on one axis, coupled by what is asked for.
MILL = """
model: mill
coordinates: {{a: rad, b: rad}}
parameters: {{n: 2, k: 3 N*m}}
kinetic: (der(a)**2 + 2*der(b)**2 + der(a)*der(b)*cos(a - b)) * 1 kg*m^2
potential: "{potential}"
outputs: {{turns: a}}
initial: {{a: 0.5, der(a): 11 rad/s, der(b): -7 rad/s}}
"""


def mill(potential: str, **options: Any) -> Equations:
    return equations(system(load_text(MILL.format(potential=potential)), **options))


@pytest.mark.parametrize(
    ("potential", "round_"),
    [
        ("k*cos(a)*sin(b)", "ab"),
        ("k*cos(2*a - 3*b)", "ab"),
        ("k*cos(a)**2/(2 + sin(b))", "ab"),
        ("k*a + k*cos(b)", "ab"),  # a constant torque: no function that is integrated sees a
        ("k*a*b", ""),
        ("k*(a - b)**2/2", ""),  # a spring between them
        ("k*b**2/2 + k*cos(a)", "a"),
        ("k*cos(a/2)", "b"),  # two turns
        ("k*cos(n*a + b)", "b"),  # n may be any number
        ("k*abs(a)", "b"),
        ("k*exp(sin(a))", "ab"),
    ],
)
def test_angles_go_round_where_nothing_sees_their_turns(potential: str, round_: str) -> None:
    found = program(mill(potential))
    assert "".join("ab"[i] for i in found.turning) == round_


def test_a_parameter_that_is_a_constant_may_be_a_whole_number() -> None:
    assert program(mill("k*cos(n*a + b)", constants=("n",))).turning == (0, 1)


def test_energy_that_is_held_sees_what_the_motion_does_not() -> None:
    held = NAMED["invariants"].equations(mill("k*a + k*cos(b)"), Options())
    assert program(held, enforcements=("none",)).turning == (0, 1)
    assert program(held, enforcements=("invariants",)).turning == (1,)


@pytest.mark.parametrize(
    ("name", "round_"),
    [
        ("four_bar", ("q1", "q2", "q3")),
        ("slider_crank", ("q1", "q2")),
        ("spatial_four_bar", ("q", "alpha", "beta")),  # not its quaternion
        ("rolling_disk", ("yaw", "lean", "spin")),
        ("gear_train", ()),  # its constraints are of the angles themselves
        ("car_axis", ()),
    ],
)
@pytest.mark.parametrize("formulation", ["quasi_velocities", "augmented"])
def test_mechanisms(name: str, round_: tuple[str, ...], formulation: str) -> None:
    found = program(
        equations(system(load_text((MODELS / f"{name}.yaml").read_text())), None, formulation)
    )
    assert tuple(found.argument("x").labels[i] for i in found.turning) == round_


def test_without_motions_there_is_nothing_to_take_out() -> None:
    assert program(mill("k*cos(a)"), functions=("energy",)).turning == ()


# ---- the motion is the same


def reference(module: ModuleType, times: np.ndarray, x: np.ndarray) -> np.ndarray:
    found = solve_ivp(module.dynamics, (0.0, times[-1]), x, "DOP853", times, rtol=1e-13, atol=1e-13)
    return found.y.T


TIMES = np.linspace(0.0, 5.0, 41)
START = np.array([0.5, 0.0, 11.0, -7.0])
INTEGRATORS = ("dop853", "radau", "rosenbrock", "implicit_midpoint")


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    return quickly_built(
        mill("k*cos(a)*sin(b)"),
        ["dynamics", "energy"],
        INTEGRATORS,
        ("none",),
        tmp_path_factory.mktemp("turning"),
    )


@needs_compiler
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_rows_have_their_whole_turns(turning: ModuleType, integrator: str) -> None:
    stepping = (
        {"step_size": 1e-4} if integrator == "implicit_midpoint" else {"rtol": 1e-10, "atol": 1e-12}
    )
    found = turning.simulate(TIMES, START, integrator=integrator, **stepping)
    np.testing.assert_allclose(
        found.x, reference(turning, TIMES, START), atol=1e-4 if "step_size" in stepping else 1e-6
    )
    taken = (found.x - found.reduced) / (2 * np.pi)
    np.testing.assert_allclose(taken, np.round(taken), atol=1e-15 * np.abs(taken).max() + 1e-15)
    assert (
        taken[-1, 0] > 5
        and taken[-1, 1] < -3
        and (taken[:, 2:] == 0).all()
        and np.abs(found.reduced[:, :2]).max() < 7
    )


@needs_compiler
def test_a_start_of_many_turns_makes_no_difference(turning: ModuleType) -> None:
    """But for the rounding of the start itself; the tolerance is relative to a turn, not to all of
    them."""
    many = START + 2 * np.pi * np.array([1e6, -1e3, 0.0, 0.0])
    near, far = (turning.simulate(TIMES, x, rtol=1e-9, atol=1e-11) for x in (START, many))
    np.testing.assert_allclose(far.x - many, near.x - START, atol=1e-7)
    assert (
        abs(far.steps - near.steps) < 0.05 * near.steps
        and np.abs(far.reduced[0] - START).max() < 1e-9
    )


@needs_compiler
def test_a_motion_within_a_turn_stays_as_it_is(
    turning: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    swinging = np.array([3.0, 6.0, 0.1, -0.1])
    found = turning.simulate((0.0, 1.0), swinging)
    monkeypatch.setattr(pipeline, "turns", lambda *given: (set(), set()))
    plain = quickly_built(mill("k*cos(a)*sin(b)"), ["dynamics"], ("dop853",), ("none",), tmp_path)
    np.testing.assert_array_equal(plain.simulate((0.0, 1.0), swinging).x, found.x)


@needs_compiler
def test_turns_that_are_seen_would_show(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """What the decision is for: with a spring wound up by turns the motion is another one when
    these are taken out."""
    spring = mill("k*(a - b)**2/100")
    right = quickly_built(spring, ["dynamics"], ("dop853",), ("none",), tmp_path / "right")
    monkeypatch.setattr(pipeline, "turns", lambda *given: ({0, 1}, set()))
    wrong = quickly_built(spring, ["dynamics"], ("dop853",), ("none",), tmp_path / "wrong")
    wanted = reference(right, TIMES, START)
    np.testing.assert_allclose(right.simulate(TIMES, START, rtol=1e-10).x, wanted, atol=1e-6)
    assert np.abs(wrong.simulate(TIMES, START, rtol=1e-10).x - wanted).max() > 0.1


@needs_compiler
def test_all_backends_take_out_the_same_turns(turning: ModuleType) -> None:
    simulate, library = (
        importlib.import_module(f"{turning.__name__}.{name}") for name in ("_simulate", "_library")
    )
    first = turning.simulate(TIMES, START, rtol=1e-7, atol=1e-9)
    p = np.array(turning.defaults)
    for backend, advance in (("ctypes", library.advance), ("numpy", simulate.advance)):
        other = simulate.run(
            advance, backend, (0.0, 5.0), START, [], p, 1e-7, 1e-9, TIMES, 10_000, None
        )
        assert (other.steps, other.rejected, other.calls) == (
            first.steps,
            first.rejected,
            first.calls,
        )
        np.testing.assert_allclose(other.x, first.x, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(other.reduced, first.reduced, atol=1e-8)
