"""What single enforcements and integrators promise: refusals, invariants, singular positions,
published digits, long runs.

Of derive.expressions: any_piece.
Of derive.enforcement: baumgarte, charts, feedback, invariants, limits, projection, rate, records.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hamel
from codegen import compiler
from derive.diagnostics import AssumptionError, ModelError
from derive.enforcement import ENFORCEMENTS, Options
from derive.formulations import equations
from derive.model import load_text
from derive.states import system
from derive.states.initial import initial_state
from hamel.simulate import compiled
from hamel.simulate.exact import state_of
from tests.points import LOSSES, quickly_built
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")


@pytest.mark.slow
def test_the_euclidean_metric_leads_to_the_same_motion() -> None:
    mass, plain_ = (
        hamel.simulate(
            MODELS / "rolling_disk.yaml", enforcement=enforcement, formulation="augmented", time=0.5
        ).final
        for enforcement in ("invariants", "invariants_euclidean")
    )
    assert plain_["x"] == pytest.approx(mass["x"], abs=1e-8)
    assert plain_ != mass  # in the last digits


# What cannot be
# ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"enforcement": "baumgarte"}, "A v = c holds identically"),
        (
            {"enforcement": "feedback", "formulation": "augmented"},
            "the velocities drift too in this formulation; use baumgarte",
        ),
        ({"enforcement": "invariants"}, "energy is not conserved"),
        ({"enforcement": "tangent", "integrator": "rosenbrock"}, "exact Jacobian"),
        (
            {"enforcement": "projection", "integrator": "cvodes"},
            "a library's loop has no place for it",
        ),
        ({"integrator": "idas"}, "give it the formulation augmented"),
        (
            {"integrator": "idas", "formulation": "augmented", "enforcement": "baumgarte"},
            "holds the constraints itself",
        ),
    ],
)
def test_refused_before_anything_is_built(
    options: dict[str, str], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "promised_module", lambda *given: pytest.fail("built"))
    with pytest.raises(AssumptionError, match=why) as caught:
        hamel.simulate(MODELS / "four_bar.yaml", time=0.1, **options)  # type: ignore[arg-type]
    assert caught.value.exit_code == 2


def test_free_systems_have_nothing_to_keep() -> None:
    for enforcement in ("projection", "partitioning", "baumgarte", "feedback"):
        with pytest.raises(AssumptionError, match="no"):
            hamel.simulate(MODELS / "double_pendulum.yaml", enforcement=enforcement, time=0.1)


@pytest.mark.parametrize(
    "options",
    [
        {"enforcement": "glue"},
        {"integrator": "euler"},
        {"integrator": "rk4"},
        {"integrator": "cvodes", "step_size": 0.1},
    ],
    ids=str,
)
def test_unknown_names_and_missing_steps(options: dict[str, Any]) -> None:
    with pytest.raises(ModelError):
        hamel.simulate(MODELS / "pendulum.yaml", choice="tangent", time=0.1, **options)


def test_momenta_are_held_where_they_are_conserved(tmp_path: Path) -> None:
    path = tmp_path / "sliding.yaml"
    path.write_text(SLIDING)
    given = {"enforcement": "invariants", "time": 5.0, "rtol": 1e-4, "integrator": "dopri5"}
    held = hamel.simulate(path, conserve=["s"], **given).motion
    momentum = 3.0 * held["der(s)"] + held["der(x)"]
    assert (
        np.abs(momentum - momentum[0]).max() < 1e-12
        and np.abs(held["T"] + held["V"] - held["T"][0] - held["V"][0]).max() < 1e-11
    )
    with pytest.raises(AssumptionError, match="the momentum of x is not conserved"):
        hamel.simulate(path, conserve=["x"], **given)
    with pytest.raises(AssumptionError, match="'nothing' is no invariant"):
        hamel.simulate(path, conserve=["nothing"], **given)


FLOOR = """
model: dropped
plane: xy
gravity: [0, -9.81 m/s^2]
bodies: {{ball: {{mass: 0.3 kg}}}}
joints: {{fly: {{type: prismatic, parent: ground, child: ball, axis: y, coordinate: y}}}}
loads: {{floor: {{type: contact, body: ball, plane: {{normal: [0, 1]}}, stiffness: 2e4 N/m{0}}}}}
initial: {{y: 1 m}}
"""


@pytest.mark.parametrize(
    ("loss", "refused"), [(", damping: 0.2 s/m", True), ("", False)], ids=["lossy", "elastic"]
)
def test_energy_that_is_lost_at_a_contact_is_lost_though_no_sample_touches_it(
    loss: str, refused: bool
) -> None:
    """Refused from some starts and taken from others: a ball that bounced back to its height."""
    found = equations(system(load_text(FLOOR.format(loss))))
    own = next(x for x in ENFORCEMENTS if x.name == "invariants")
    why = own.refusal(found, Options())
    assert ("energy is not conserved" in why) == refused


# A pendulum in Cartesian coordinates relative to a sled that slides freely.
SLIDING = """
model: sliding
coordinates: {s: m, x: m, y: m}
kinetic: (2*der(s)**2 + (der(s) + der(x))**2 + der(y)**2)/2 * 1 kg
potential: 9.81 N * y
constraints: {rod: {holonomic: x**2 + y**2 - 1 m^2}}
initial: {x: 0.6 m, guess: {y: -0.8 m}, der(s): 1 m/s, der(x): 0.5 m/s}
"""


# Singular positions
# ------------------------------------------------------------------------------------------------

CHAIN_END = np.array([0.328458111540815379, 0.944518538178600962])  # of B0 at t = 10 s


POINTS_OF_THE_CHAIN = (
    ("quasi_velocities", "crank"),
    ("quasi_velocities", "best"),
    ("augmented", None),
    ("udwadia_kalaba", None),
)
CHARTED = ("none", "projection", "partitioning", "selective", "tangent")


@pytest.mark.slow
def test_chain_through_its_singular_positions(tmp_path: Path) -> None:
    """IFToMM A02, N = 2: ten passages where one degree of freedom becomes three. The right end or
    an honest status, nothing else; rods that stay parallel have a closed form."""
    mechanical = system(load_text((MODELS / "extremes/four_bar_chain.yaml").read_text()))
    p = np.array(mechanical.parameters)
    initial = initial_state(mechanical, {}, p)
    right = set()
    for formulation, choice in POINTS_OF_THE_CHAIN:
        found = equations(mechanical, choice, formulation)
        names = CHARTED
        if formulation in ("augmented", "udwadia_kalaba"):
            held = next(
                enforcement for enforcement in ENFORCEMENTS if enforcement.name == "invariants"
            )
            assert not held.refusal(found, Options())
            found, names = held.equations(found, Options()), (*CHARTED, "invariants")
        module = quickly_built(
            found,
            ["dynamics", "project", "constraints"],
            ("dop853", "rk4"),
            names,
            tmp_path / f"{formulation}_{choice}",
        )
        x = state_of(found, initial, p)
        for enforcement in names:
            right |= {
                (formulation, choice, enforcement)
                for options in RUNS
                if reaches_the_end(module, x, p, enforcement, options)
            }
    assert len(right) >= 3


# Steps fall on either side of the singular positions as rounding has it, so that each method is
# given several ways across.
RUNS: tuple[dict[str, Any], ...] = (
    *({"step_size": h, "rtol": 1e-9} for h in (4e-3, 5e-3, 6e-3, 8e-3, 1e-2, 1.25e-2)),
    *({"rtol": rtol} for rtol in (1e-9, 1e-10, 3e-11, 1e-11)),
    {"integrator": "rk4", "step_size": 1e-2, "rtol": 1e-6},
)


def reaches_the_end(
    module: ModuleType, x: np.ndarray, p: np.ndarray, enforcement: str, options: dict[str, Any]
) -> bool:
    """To 1e-8. A motion that stops must say why, one that arrives must have crossed and be as good
    as its tolerance; one step in some thousands ends so near to a singular position that it costs
    two digits more."""
    try:
        found = module.simulate(
            (0.0, 10.0), x, [], p, enforcement=enforcement, atol=options["rtol"] / 100, **options
        )
    except FloatingPointError as stopped:
        assert any(
            word in str(stopped) for word in ("singular", "too small", "not finite", "projected")
        )
        return False
    q0 = found.x[-1, 0]
    error = np.abs([np.cos(q0), np.sin(q0)] - CHAIN_END).max()
    assert error < max(1000 * options["rtol"], 1e-6) and found.crossings >= 10
    return bool(error < 1e-8)


# Published digits
# --------------------------------------------------------------------------------------------------

ANDREWS = {  # the corrected column: the published one is good to 3e-8 only
    "beta": 15.810771195153707, "Theta": -15.756371058411840, "gamma": 0.0408222401196458, "Phi": -0.534730116342080,
    "delta": 0.524409965879954, "Omega": 0.534730116342080, "epsilon": 1.048080741041938,
}  # fmt: skip
CAR_AXIS = {
    "xl": 0.0493455784275402809,
    "yl": 0.496989460230171154,
    "xr": 1.04174252488542152,
    "yr": 0.373911027265361257,
}
PENDULUM = {"x": -0.27508746257611686, "y": -0.96141920509912507}


@pytest.mark.parametrize(
    ("model", "options", "expected_", "tolerance"),
    [
        ("andrews", {"time": 0.03}, ANDREWS, 1e-10),
        (
            "andrews",
            {"time": 0.03, "formulation": "augmented", "enforcement": "tangent"},
            ANDREWS,
            1e-10,
        ),
        (
            "andrews",
            {"time": 0.03, "formulation": "augmented", "integrator": "idas"},
            ANDREWS,
            1e-9,
        ),
        ("car_axis", {"time": 3.0}, CAR_AXIS, 1e-9),
        (
            "car_axis",
            {"time": 3.0, "formulation": "augmented", "enforcement": "partitioning"},
            CAR_AXIS,
            1e-9,
        ),
        ("pendulum", {"time": 10.0, "choice": "tangent"}, PENDULUM, 1e-11),
        (
            "pendulum",
            {"time": 10.0, "formulation": "augmented", "enforcement": "invariants"},
            PENDULUM,
            1e-11,
        ),
    ],
)
def test_published_digits(
    model: str, options: dict[str, Any], expected_: dict[str, float], tolerance: float
) -> None:
    final = hamel.simulate(MODELS / f"{model}.yaml", rtol=1e-13, atol=1e-15, **options).final
    assert max(abs(final[name] / value - 1) for name, value in expected_.items()) < tolerance


def test_an_angle_of_many_turns_can_be_projected() -> None:
    turns = 2 * np.pi * 10_000
    given = {"q1": np.radians(60) + turns, "q2": np.radians(-30) - turns}
    found = hamel.simulate(MODELS / "four_bar.yaml", values=given, time=0.2, step=0.1)
    assert found.steps < 100 and found.motion["position_violation"][-1] <= 1e-11


# Long runs
# ---------------------------------------------------------------------------------------------------------

LONG = [
    ("four_bar", {}),
    ("four_bar", {"formulation": "augmented"}),
    ("four_bar", {"formulation": "augmented", "enforcement": "partitioning"}),
    ("four_bar", {"enforcement": "tangent"}),
    ("slider_crank", {}),
    ("slider_crank", {"formulation": "augmented", "enforcement": "partitioning"}),
    ("spatial_four_bar", {}),
    ("tractor_trailers", {"formulation": "augmented"}),
    ("tractor_trailers", {"formulation": "augmented", "enforcement": "tangent"}),
    ("rolling_disk", {"formulation": "augmented"}),
    ("rolling_disk", {"formulation": "augmented", "enforcement": "invariants"}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("model", "options"), LONG, ids=str)
def test_constraints_hold_through_ten_thousand_seconds(model: str, options: dict[str, Any]) -> None:
    found = hamel.simulate(MODELS / f"{model}.yaml", time=1e4, step=10.0, rtol=1e-8, **options)
    assert (
        found.position_violation <= 1e-12
        and found.velocity_violation <= 1e-12
        and found.acceleration_violation <= 1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"formulation": "augmented"},
        {"formulation": "augmented", "enforcement": "partitioning"},
        {"formulation": "augmented", "enforcement": "invariants"},
        {"enforcement": "tangent"},
    ],
    ids=str,
)
@pytest.mark.parametrize("model", ["four_bar", "slider_crank"])
def test_loops_that_go_on_turning(model: str, options: dict[str, Any], tmp_path: Path) -> None:
    """Without losses cranks take ten thousands of turns, which angles would lose four digits to."""
    path = tmp_path / "turning.yaml"
    path.write_text(LOSSES.sub(r"\g<1>0", (MODELS / f"{model}.yaml").read_text()))
    found = hamel.simulate(path, time=1e4, step=10.0, rtol=1e-8, **options)
    angle = max(abs(found.motion["q1"]))
    assert angle > 5e4 and found.position_violation <= 1e-12
    assert found.velocity_violation <= 1e-12 and found.acceleration_violation <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("formulation", "power"), [("quasi_velocities", 1), ("augmented", 2)])
def test_growth_without_enforcement(formulation: str, power: int) -> None:
    """Violations of positions grow as t where A v = c holds identically, as t² where velocities
    drift too."""
    given = {
        "step_size": 0.01,
        "integrator": "rk4",
        "enforcement": "none",
        "time": 100.0,
        "step": 1.0,
        "rtol": 1e-2,
    }
    found = hamel.simulate(MODELS / "rolling_disk.yaml", formulation=formulation, **given)  # type: ignore[arg-type]
    t, drift = (
        found.motion["t"][10:],
        np.maximum.accumulate(found.motion["position_violation"])[10:],
    )
    slope = np.polyfit(np.log(t), np.log(drift), 1)[0]
    assert slope == pytest.approx(power, abs=0.4)
