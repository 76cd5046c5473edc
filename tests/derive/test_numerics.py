"""Degenerate numbers: bounds with a place in the file, and numeric failures told as refusals with
their stage and cause, never as a warning, a traceback or an internal error."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import hamel
from derive.diagnostics import AssumptionError, HamelError, ModelError
from derive.expressions.limits import LARGEST, SMALLEST
from derive.model import load_text
from derive.numerics import refuses_numerically
from derive.robots.reading import imported
from derive.states.limits import FARTHEST
from derive.states.scales import scales
from hamel.cli import main
from tests.scenes import MODELS

ROBOTS = Path(__file__).parents[1] / "robots"
ARM = """model: arm
plane: xy
gravity: [0, -9.81 m/s^2]
parameters: {{l: {length}, m: 1 kg}}
bodies: {{a: {{mass: m, com: [l, 0], inertia: m*l^2}}}}
joints: {{j: {{type: revolute, parent: ground, child: a}}}}
"""


@pytest.mark.parametrize(
    "length", ["1e160 m", "1e61 m", "1e58 km", "1e-61 m", "1e-59 um", "1e40*1e40 m"]
)
def test_a_number_out_of_bounds_is_told_with_its_place(length: str) -> None:
    with pytest.raises(ModelError) as raised:
        load_text(ARM.format(length=length), "arm.yaml")
    problem = raised.value.diagnostics[0]
    assert (problem.file, problem.line, problem.column) == ("arm.yaml", 4, 17)
    assert "too large" in problem.message or "too small" in problem.message
    assert "SI units" in problem.expected


def test_products_of_parameters_are_bounded_where_they_stand() -> None:
    with pytest.raises(ModelError) as raised:
        load_text(ARM.format(length="1e40 m"), "arm.yaml")
    problem = raised.value.diagnostics[0]
    assert problem.line == 5 and "1e+80 is too large" in problem.message


def test_a_formula_of_parameters_has_a_value() -> None:
    text = (
        ARM.format(length="1 m")
        + "loads: {f: {type: damper, joint: j, coefficient: (1 N*m*s*kg)/(m - m)}}\n"
    )
    with pytest.raises(ModelError, match="not a finite number"):
        load_text(text)


@pytest.mark.parametrize("value", [1e61, 1e-61, np.inf, np.nan])
def test_numbers_that_are_set_obey_the_same_bounds(value: float) -> None:
    with pytest.raises(ModelError):
        hamel.simulate(MODELS / "pendulum.yaml", values={"m": value}, time=0.1)


# what breaks a capsule of the four-bar linkage: a piece of the text and what stands in its place
MUJOCO = {
    "huge radius": ('size="0.01"', 'size="1e300"'),
    "denormal radius": ('size="0.01"', 'size="5e-324"'),
    "large radius": ('size="0.01"', 'size="1e59"'),
    "small radius": ('size="0.01"', 'size="1e-59"'),
    "infinite radius": ('size="0.01"', 'size="1e999"'),
    "huge density": ('density="2700"', 'density="1e300"'),
    "large density and size": ('size="0.01" density="2700"', 'size="1e59" density="1e59"'),
    "far end": ('fromto="0 0 0 0 0 0.2"', 'fromto="0 1e300 -1 -1e-300 0 1e-300"'),
    "denormal length": ('fromto="0 0 0 0 0 0.2"', 'fromto="0 0 0 0 0 5e-324"'),
}


@pytest.mark.parametrize("what", MUJOCO)
def test_degenerate_sizes_of_mjcf_are_refused_in_one_sentence(what, tmp_path, capsys) -> None:
    old, new = MUJOCO[what]
    text = (ROBOTS / "four_bar.xml").read_text()
    assert old in text
    file = tmp_path / "r.xml"
    file.write_text(text.replace(old, new))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(HamelError) as raised:
            imported(file)
    assert all(problem.line for problem in raised.value.diagnostics)
    with pytest.raises(SystemExit) as ended:
        main(["check", str(file)])
    assert ended.value.code == 1 and "internal" not in capsys.readouterr().err


def test_a_constraint_force_without_mass_along_it_is_refused() -> None:
    """No kinetic energy along x, and a friction that asks for the reaction there."""
    text = (MODELS / "bead_on_wire.yaml").read_text()
    text = text.replace(
        "der(x)**2 + der(y)**2 + der(z)**2)\npot", "der(x)**2 - der(x)**2 + der(z)**2)\npot"
    )
    text = text.replace("holonomic: y - r*s", "holonomic: z - r*s")
    with pytest.raises(AssumptionError, match="mass matrix is singular along a motion"):
        from derive.states import system

        system(load_text(text))


@pytest.mark.parametrize(
    "failure",
    [
        lambda: 1.0 / 0.0,
        lambda: 10.0**400,
        lambda: np.linalg.inv(np.zeros((2, 2))),
        lambda: np.linalg.eigvals(np.full((2, 2), np.nan)),
        lambda: np.linalg.svd(np.full((2, 2), np.nan)),
    ],
)
def test_failures_of_arithmetic_name_the_stage_and_the_cause(failure) -> None:
    with pytest.raises(AssumptionError, match=r"the stage cannot be computed .*: .+"):
        refuses_numerically("the stage")(failure)()


def test_a_stage_does_not_warn() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.isinf(refuses_numerically("the stage")(lambda: np.float64(1.0) / np.zeros(1))())


def test_a_failure_of_arithmetic_anywhere_is_no_internal_error(monkeypatch, capsys) -> None:
    def fail(*given: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(hamel, "check", fail)
    with pytest.raises(SystemExit) as ended:
        main(["check", "m.yaml"])
    said = capsys.readouterr().err
    assert ended.value.code == 2 and "SVD did not converge" in said


def test_scales_of_numbers_at_the_bounds_stay_numbers() -> None:
    text = (
        ARM.format(length="1e29 m")
        .replace("-9.81", "-1e-59")
        .replace("inertia: m*l^2", "inertia: 1e59")
    )
    found = scales(load_text(text))
    assert np.isfinite([found.length, found.mass, found.time, found.energy, found.power]).all()
    assert max(found.length, found.time) <= 10.0**FARTHEST


def test_the_bounds_leave_room_for_products() -> None:
    assert LARGEST**5 < 1e308 and SMALLEST**5 > 1e-308
