"""Every file in this folder broke something once; each does now what the README beside it says.

Where another test holds the cause as a class it is named in the README; here the file itself runs.
"""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import hamel
from codegen.loader import load as load_module
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import equations
from derive.robots.reading import load
from derive.states import system
from derive.states.closing import Kinematics
from derive.states.initial import initial_state
from hamel.charts import start
from hamel.verify.checks import QUICK
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence, results
from tests.scenes import ROOT

HERE = Path(__file__).parent
CHOICE_FAILS = ("rnd16", "rnd19", "rnd124")  # regular positions where one choice is singular
FORCED = ("rnd4", "rnd104", "rnd116")  # velocities that the rows force to rounding


def failed(name: str, states: int = 4) -> list[str]:
    """The checks of a build that go red before anything is compiled."""
    mechanics = system(load(HERE / name))
    seen = evidence(reference(mechanics.model), equations(mechanics), None, states)
    return [check.name for check in results(seen, QUICK) if not check.passed]


def written_by(script: str, *arguments: str, folder: Path) -> None:
    """Run one of the scripts that write a long model."""
    command = [sys.executable, str(HERE / f"{script}.py"), *arguments]
    subprocess.run(command, cwd=folder, check=True)


def test_a_hinge_without_coordinate_in_a_fresh_process(tmp_path):
    """Everything else imports CasADi first, and hid what was not pickled."""
    command = [sys.executable, "-m", "hamel", "derive", str(HERE / "hinge.yaml"), "-o", "pages"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    end = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert end.returncode == 0 and not end.stderr
    assert (tmp_path / "pages/derivation.html").exists()


@pytest.mark.parametrize(("name", "place"), [("b.3", "19:21"), ("b.5", "11:7"), ("b.6", "11:7")])
def test_degenerate_numbers_of_a_robot_are_refused_where_they_stand(name, place):
    with warnings.catch_warnings(), pytest.raises(ModelError, match=f"xml:{place}: error") as end:
        warnings.simplefilter("error")
        hamel.check(HERE / f"{name}.xml")
    assert end.value.exit_code == 1


@pytest.mark.parametrize("name", ["rothoop", "magnet"])
def test_energies_that_are_not_quadratic_are_in_balance(name):
    """They said 1.8 and 2."""
    found = hamel.simulate(HERE / f"{name}.yaml", time=2.0)
    assert found.energy_balance < 1e-12 and "jacobi" in found.motion


def test_a_free_joint_without_orientation_takes_the_quaternion():
    """It took 3,126 steps with Euler angles; rows are not steps."""
    model = load(HERE / "tumbling_euler.yaml")
    assert [x.name for x in model.coordinates][3:] == ["base_qw", "base_qx", "base_qy", "base_qz"]


def test_the_input_drives_its_own_finger():
    model = load(HERE / "arm6.urdf")
    (choice,) = [x for x in equations(system(model)).w if "finger" in x]
    assert "finger_joint2" not in choice


def test_a_start_in_millimetres_is_closed_to_rounding():
    """φ in units of its own terms: 2e-10 m was taken for closed."""
    mechanics = system(load(HERE / "crank.yaml"))
    p = np.array(mechanics.parameters)
    q = initial_state(mechanics, {}, p).q
    assert np.abs(Kinematics(mechanics).positions(0.0, q, p)[0]).max() < 1e-16


@pytest.mark.parametrize("name", ["crank", "cam"])
def test_terms_hold_at_the_parameters_that_are_varied(name):
    """crank met masses that no machine has, cam has no degree of freedom."""
    assert failed(f"{name}.yaml") == []


@pytest.mark.slow
@pytest.mark.parametrize("name", FORCED)
def test_velocities_forced_to_rounding_are_no_reason_to_refuse(name):
    assert failed(f"{name}.yaml", 20) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crank", "cam"])
def test_the_whole_suite_holds(name):
    found = hamel.verify(HERE / f"{name}.yaml", states=4)
    assert found.passed, [check for check in found.checks if not check.passed]
    assert found.varied


def test_leg_speeds_of_a_stewart_platform_determine_all():
    """Rows were solved for what they speak of as they are written, not for what eliminations bring
    in: the legs were said to depend on each other."""
    assert "legs" in hamel.check(HERE / "stewart.yaml").choices


@pytest.mark.slow
def test_leg_speeds_hold_at_hard_states():
    found = hamel.verify(HERE / "stewart.yaml", choice="legs", states=30)
    assert found.passed, [check for check in found.checks if not check.passed]


@pytest.mark.slow
@pytest.mark.parametrize("name", CHOICE_FAILS)
def test_the_module_goes_on_where_one_choice_is_singular(name, tmp_path):
    """Past the first places where the choice that is taken first is singular."""
    module = load_module(hamel.build(HERE / f"{name}.yaml", out=tmp_path / "module").folder)
    mechanics = system(load(HERE / f"{name}.yaml"))
    p, u = np.array(mechanics.parameters), np.zeros(module.nu)
    initial = initial_state(mechanics, {}, p)
    x, chart, p = start(module, initial, u, p)
    several = {"chart": chart} if hasattr(module, "charts") else {}
    assert module.simulate([0.0, 0.9], x, u, p, **several).t[-1] == 0.9


@pytest.mark.slow
def test_a_chain_of_oblique_frames_is_built_without_a_word_of_numpy(tmp_path):
    written_by("chain", "300", "chain.urdf", folder=tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.filterwarnings("ignore", "(?s).*limits are there to read")
        hamel.build(tmp_path / "chain.urdf", out=tmp_path / "m", numpy=True, constants="all")


@pytest.mark.slow
def test_many_four_bars_in_a_row_are_built(tmp_path):
    written_by("four_bars", "10", "nfb10.yaml", folder=tmp_path)
    hamel.simulate(tmp_path / "nfb10.yaml", time=0.1)


def test_a_model_without_a_configuration_is_refused_in_words():
    with pytest.raises(ModelError, match=r"no configuration near .* \(contact\.normal is off by"):
        hamel.check(HERE / "far_wheel.yaml")


def test_where_every_walk_ends_far_from_the_constraints_is_refused_in_words():
    """Two circles of a gigametre about points half a metre apart: parallel to rounding."""
    with (
        pytest.warns(RuntimeWarning, match="left out"),
        pytest.raises(AssumptionError, match=r"no configuration near|at singular positions alone"),
    ):
        hamel.check(HERE / "far_anchor.xml")
