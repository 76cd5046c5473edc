"""Formulation × keeping × integrator: every combination that fits runs and agrees, the others are refused with a reason."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hamel
from codegen import build, compiler, loader
from codegen.integrators import INTEGRATORS
from codegen.passes import program
from derive.diagnostics import AssumptionError, ModelError
from derive.formulations import FORMULATIONS, equations
from derive.formulations.records import Equations
from derive.keepings import KEEPINGS, Keeping, Options, kept_equations
from derive.mechanics import system
from derive.mechanics.initial import initial_state
from derive.mechanics.records import System
from derive.model import load_text
from hamel.references import REFERENCES, Problem
from hamel.verbs.simulate import _state
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

# Three models without losses, so that the energy can be held: a planar loop, a nonholonomic chain, rolling in space.
SCENES = {
    "four_bar": ("coefficient: 0.01 N*m*s/rad", "coefficient: 0 N*m*s/rad"),
    "tractor_trailers": ("coefficient: 50 N*s/m", "coefficient: 0 N*s/m"),
    "rolling_disk": ("", ""),
}
TIME = 0.3
ALPHA = 10.0


@functools.cache
def mechanics(model: str) -> System:
    return system(load_text((MODELS / f"{model}.yaml").read_text().replace(*SCENES[model])))


@functools.cache
def plain(model: str, formulation: str) -> Equations | str:
    """The equations, or why the formulation does not fit."""
    try:
        return equations(mechanics(model), None, formulation)
    except AssumptionError as error:
        return str(error)


@functools.cache
def refusal(model: str, formulation: str, keeping: Keeping) -> str:
    found = plain(model, formulation)
    return found if isinstance(found, str) else keeping.refusal(found, Options(ALPHA))


@functools.cache
def made(model: str, formulation: str, rate: str) -> tuple[ModuleType, Equations]:
    """A module with every integrator and every keeping that fits; `rate` names the one that is in the equations themselves."""
    fitting = [keeping for keeping in KEEPINGS if not refusal(model, formulation, keeping)]
    if rate:
        chosen = next(keeping for keeping in fitting if keeping.name == rate)
        found, names = kept_equations(mechanics(model), None, formulation, chosen, Options(ALPHA)), (rate,)
    else:
        found = plain(model, formulation)
        assert not isinstance(found, str)
        steps = [keeping for keeping in fitting if keeping.level != "rates" and keeping.name != "invariants_euclidean"]
        for keeping in steps:
            found = keeping.equations(found, Options())
        names = tuple(keeping.name for keeping in steps)
    functions = [f.name for f in found.functions if f.name in ("dynamics", "velocity", "power", "constraints", "project")]
    functions += ["reactions"] * (formulation == "augmented")
    integrators = tuple(integrator.name for integrator in INTEGRATORS)
    return quickly_built(found, functions, integrators, names, Path(tempfile.mkdtemp(prefix="hamel-methods-"))), found


def quickly_built(
    found: Equations, functions: list[str], integrators: tuple[str, ...], keepings: tuple[str, ...], folder: Path
) -> ModuleType:
    """Compiled in a hurry: these motions are short."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiler, "FLAGS", tuple(flag for flag in compiler.FLAGS if flag != "-O2"))
        return loader.load(build.build(program(found, functions, integrators, keepings), folder / found.system.model.name).folder)


@functools.cache
def start(model: str, formulation: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    mechanical = mechanics(model)
    p = np.array(mechanical.parameters)
    found = plain(model, formulation)
    assert not isinstance(found, str)
    return _state(found, initial_state(mechanical, {}, p), p), np.zeros(len(mechanical.model.inputs)), p


def ends(module: ModuleType, x: np.ndarray, p: np.ndarray, nq: int) -> np.ndarray:
    """q and v, which mean the same in every formulation."""
    u = np.zeros(module.nu)
    return np.concatenate([x[:nq], module.velocity(TIME, x, u, p)])


@functools.cache
def expected(model: str) -> np.ndarray:
    module, _ = made(model, "quasi_velocities", "")
    x, u, p = start(model, "quasi_velocities")
    found = module.simulate((0.0, TIME), x, u, p, integrator="dop853", keeping="none", rtol=1e-13, atol=1e-14)
    return ends(module, found.x[-1], p, mechanics(model).q.numel())


def stepping(integrator: Any) -> dict[str, float]:
    return {"rtol": 1e-8, "atol": 1e-10} if integrator.adaptive else {"step_size": 1e-3, "rtol": 1e-3}


# Quickly with the two kinds of state, (q, w) and (q, v); the other formulations differ in dynamics alone and are slow to compile.
QUICK = ("quasi_velocities", "augmented")
POINTS = [
    pytest.param(model, formulation, id=f"{model}-{formulation.name}", marks=[pytest.mark.slow] * (formulation.name not in QUICK))
    for model in SCENES
    for formulation in FORMULATIONS
]


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda x: x.name)
@pytest.mark.parametrize("keeping", KEEPINGS, ids=lambda x: x.name)
@pytest.mark.parametrize(("model", "formulation"), POINTS)
def test_every_combination_agrees_or_is_refused(model: str, formulation: Any, keeping: Keeping, integrator: Any) -> None:
    why = refusal(model, formulation.name, keeping)
    if why:
        assert len(why) > 20
        return
    if keeping.name == "invariants_euclidean" or (integrator.exact and keeping.level == "stages"):
        return  # their own tests below
    module, _ = made(model, formulation.name, keeping.name if keeping.level == "rates" else "")
    x, u, p = start(model, formulation.name)
    found = module.simulate((0.0, TIME), x, u, p, integrator=integrator.name, keeping=keeping.name, **stepping(integrator))
    error = np.abs(ends(module, found.x[-1], p, mechanics(model).q.numel()) - expected(model)).max()
    scale = np.abs(expected(model)).max()
    assert error < scale * {"implicit_midpoint": 1e-3, "rk4": 1e-6}.get(integrator.name, 2e-6)
    if keeping.level in ("steps", "stages"):
        assert found.position_violation <= 1e-12 and found.velocity_violation <= 1e-12 * scale


def test_the_euclidean_metric_leads_to_the_same_motion() -> None:
    mass, plain_ = (
        hamel.simulate(MODELS / "rolling_disk.yaml", keeping=keeping, formulation="augmented", time=0.5).final
        for keeping in ("invariants", "invariants_euclidean")
    )
    assert plain_["x"] == pytest.approx(mass["x"], abs=1e-8) and plain_["x"] != mass["x"]


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda x: x.name)
@pytest.mark.parametrize("model", ["four_bar", "rolling_disk"])
def test_libraries_agree(model: str, reference: Any) -> None:
    formulation = "augmented" if reference.name == "idas" else "quasi_velocities"
    module, found = made(model, formulation, "")
    assert not reference.refusal(found)
    x, u, p = start(model, formulation)
    motion = reference.prepare(Problem(module, found, np.array([0.0, TIME / 2, TIME]), x, u, p, 1e-8, 1e-10))()
    assert np.abs(ends(module, motion.x[-1], p, mechanics(model).q.numel()) - expected(model)).max() < 1e-5
    assert motion.steps > 3 and motion.calls > 3


# Order -------------------------------------------------------------------------------------------------------------

# Two sizes of step each, and how far the measured order may be from the nominal one. DOPRI5's leading error is so small that the
# next one shows down to rounding: it may be more than nominal. DOP853 has no room between the two either.
SIZES = {
    "dop853": (0.02, 0.01, 0.25, 0.25),
    "dopri5": (0.005, 0.0025, 0.1, 2.0),
    "rkf45": (0.0025, 0.00125, 0.15, 0.15),
    "rk4": (0.00125, 0.000625, 0.1, 0.1),
    "radau": (0.01, 0.005, 0.15, 0.3),
    "rosenbrock": (0.00125, 0.000625, 0.15, 0.1),
    "implicit_midpoint": (0.004, 0.002, 0.1, 0.1),
}


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda x: x.name)
@pytest.mark.parametrize("keeping", KEEPINGS, ids=lambda x: x.name)
@pytest.mark.parametrize("formulation", QUICK)
def test_keepings_leave_the_order_as_it_is(formulation: str, keeping: Keeping, integrator: Any) -> None:
    """On the four-bar, whose stages leave the constraints."""
    unfit = refusal("four_bar", formulation, keeping) or (integrator.exact and keeping.level == "stages")
    if unfit or keeping.name == "invariants_euclidean":
        return
    module, _ = made("four_bar", formulation, keeping.name if keeping.level == "rates" else "")
    x, u, p = start("four_bar", formulation)
    times = np.array([0.0, 0.1, 0.2])
    plainly = keeping.name if keeping.level == "rates" else "none"
    exact = module.simulate(times, x, u, p, integrator="dop853", keeping=plainly, rtol=1e-14, atol=1e-16).x
    *sizes, below, above = SIZES[integrator.name]
    given = {"integrator": integrator.name, "keeping": keeping.name, "rtol": 1e-2}
    errors = [np.sqrt(np.mean((module.simulate(times, x, u, p, step_size=h, **given).x - exact) ** 2)) for h in sizes]
    assert integrator.order - below < np.log2(errors[0] / errors[1]) < integrator.order + above


# What cannot be ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"keeping": "baumgarte"}, "A v = c holds identically"),
        ({"keeping": "feedback", "formulation": "augmented"}, "the velocities drift too in this formulation; use baumgarte"),
        ({"keeping": "invariants"}, "energy is not conserved"),
        ({"keeping": "tangent", "integrator": "rosenbrock"}, "exact Jacobian"),
        ({"keeping": "projection", "integrator": "cvodes"}, "a library's loop has no place for it"),
        ({"integrator": "idas"}, "give it the formulation augmented"),
        ({"integrator": "idas", "formulation": "augmented", "keeping": "baumgarte"}, "holds the constraints itself"),
    ],
)
def test_refused_before_anything_is_built(options: dict[str, str], why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hamel.verbs.simulate.temporary_module", lambda *given: pytest.fail("built"))
    with pytest.raises(AssumptionError, match=why) as caught:
        hamel.simulate(MODELS / "four_bar.yaml", time=0.1, **options)  # type: ignore[arg-type]
    assert caught.value.exit_code == 2


def test_free_systems_have_nothing_to_keep() -> None:
    for keeping in ("projection", "partitioning", "baumgarte", "feedback"):
        with pytest.raises(AssumptionError, match="no"):
            hamel.simulate(MODELS / "double_pendulum.yaml", keeping=keeping, time=0.1)


@pytest.mark.parametrize(
    "options",
    [{"keeping": "glue"}, {"integrator": "euler"}, {"integrator": "rk4"}, {"integrator": "cvodes", "step_size": 0.1}],
    ids=str,
)
def test_unknown_names_and_missing_steps(options: dict[str, Any]) -> None:
    with pytest.raises(ModelError):
        hamel.simulate(MODELS / "pendulum.yaml", choice="tangent", time=0.1, **options)


def test_momenta_are_held_where_they_are_conserved(tmp_path: Path) -> None:
    path = tmp_path / "sliding.yaml"
    path.write_text(SLIDING)
    given = {"keeping": "invariants", "time": 5.0, "rtol": 1e-4, "integrator": "dopri5"}
    held = hamel.simulate(path, conserve=["s"], **given).motion
    momentum = 3.0 * held["der(s)"] + held["der(x)"]
    assert (
        np.abs(momentum - momentum[0]).max() < 1e-12 and np.abs(held["T"] + held["V"] - held["T"][0] - held["V"][0]).max() < 1e-11
    )
    with pytest.raises(AssumptionError, match="the momentum of x is not conserved"):
        hamel.simulate(path, conserve=["x"], **given)
    with pytest.raises(AssumptionError, match="'nothing' is no invariant"):
        hamel.simulate(path, conserve=["nothing"], **given)


# A pendulum in Cartesian coordinates relative to a sled that slides freely.
SLIDING = """
model: sliding
coordinates: {s: m, x: m, y: m}
kinetic: (2*der(s)**2 + (der(s) + der(x))**2 + der(y)**2)/2 * 1 kg
potential: 9.81 N * y
constraints: {rod: {holonomic: x**2 + y**2 - 1 m^2}}
initial: {x: 0.6 m, guess: {y: -0.8 m}, der(s): 1 m/s, der(x): 0.5 m/s}
"""


# Singular positions ------------------------------------------------------------------------------------------------

CHAIN_END = np.array([0.328458111540815379, 0.944518538178600962])  # of B0 at t = 10 s


POINTS_OF_THE_CHAIN = (("quasi_velocities", "crank"), ("quasi_velocities", "best"), ("augmented", None), ("udwadia_kalaba", None))
CHARTED = ("none", "projection", "partitioning", "selective", "tangent")


def test_chain_through_its_singular_positions(tmp_path: Path) -> None:
    """IFToMM A02, N = 2: ten passages where one degree of freedom becomes three. The right end or an honest status, nothing else;
    rods that stay parallel have a closed form."""
    mechanical = system(load_text((MODELS / "stress/four_bar_chain.yaml").read_text()))
    p = np.array(mechanical.parameters)
    initial = initial_state(mechanical, {}, p)
    right = set()
    for formulation, choice in POINTS_OF_THE_CHAIN:
        found = equations(mechanical, choice, formulation)
        names = CHARTED
        if formulation in ("augmented", "udwadia_kalaba"):
            held = next(keeping for keeping in KEEPINGS if keeping.name == "invariants")
            assert not held.refusal(found, Options())
            found, names = held.equations(found, Options()), (*CHARTED, "invariants")
        module = quickly_built(
            found, ["dynamics", "project", "constraints"], ("dop853", "rk4"), names, tmp_path / f"{formulation}_{choice}"
        )
        x = _state(found, initial, p)
        for keeping in names:
            right |= {(formulation, choice, keeping) for options in RUNS if reaches_the_end(module, x, p, keeping, options)}
    assert len(right) >= 3


# Steps fall on either side of the singular positions as rounding has it, so that each method is given several ways across.
RUNS: tuple[dict[str, Any], ...] = (
    *({"step_size": h, "rtol": 1e-9} for h in (4e-3, 5e-3, 6e-3, 8e-3, 1e-2, 1.25e-2)),
    *({"rtol": rtol} for rtol in (1e-9, 1e-10, 3e-11, 1e-11)),
    {"integrator": "rk4", "step_size": 1e-2, "rtol": 1e-6},
)


def reaches_the_end(module: ModuleType, x: np.ndarray, p: np.ndarray, keeping: str, options: dict[str, Any]) -> bool:
    """To 1e-8. A motion that stops must say why, one that arrives must have crossed and be as good as its tolerance."""
    try:
        found = module.simulate((0.0, 10.0), x, [], p, keeping=keeping, atol=options["rtol"] / 100, **options)
    except FloatingPointError as stopped:
        assert any(word in str(stopped) for word in ("singular", "too small", "not finite", "projected"))
        return False
    q0 = found.x[-1, 0]
    error = np.abs([np.cos(q0), np.sin(q0)] - CHAIN_END).max()
    assert error < 1000 * options["rtol"] and found.crossings >= 10
    return bool(error < 1e-8)


# Published digits --------------------------------------------------------------------------------------------------

ANDREWS = {  # the corrected column: the published one is good to 3e-8 only
    "beta": 15.810771195153707, "Theta": -15.756371058411840, "gamma": 0.0408222401196458, "Phi": -0.534730116342080,
    "delta": 0.524409965879954, "Omega": 0.534730116342080, "epsilon": 1.048080741041938,
}  # fmt: skip
CAR_AXIS = {"xl": 0.0493455784275402809, "yl": 0.496989460230171154, "xr": 1.04174252488542152, "yr": 0.373911027265361257}
PENDULUM = {"x": -0.27508746257611686, "y": -0.96141920509912507}


@pytest.mark.parametrize(
    ("model", "options", "expected_", "tolerance"),
    [
        ("andrews", {"time": 0.03}, ANDREWS, 1e-10),
        ("andrews", {"time": 0.03, "formulation": "augmented", "keeping": "tangent"}, ANDREWS, 1e-10),
        ("car_axis", {"time": 3.0}, CAR_AXIS, 1e-9),
        ("car_axis", {"time": 3.0, "formulation": "augmented", "keeping": "partitioning"}, CAR_AXIS, 1e-9),
        ("pendulum", {"time": 10.0, "choice": "tangent"}, PENDULUM, 1e-11),
        ("pendulum", {"time": 10.0, "formulation": "augmented", "keeping": "invariants"}, PENDULUM, 1e-11),
    ],
)
def test_published_digits(model: str, options: dict[str, Any], expected_: dict[str, float], tolerance: float) -> None:
    final = hamel.simulate(MODELS / f"{model}.yaml", rtol=1e-13, atol=1e-15, **options).final
    assert max(abs(final[name] / value - 1) for name, value in expected_.items()) < tolerance


# Long runs ---------------------------------------------------------------------------------------------------------

LONG = [
    ("four_bar", {}),
    ("four_bar", {"formulation": "augmented"}),
    ("four_bar", {"formulation": "augmented", "keeping": "partitioning"}),
    ("four_bar", {"keeping": "tangent"}),
    ("slider_crank", {}),
    ("slider_crank", {"formulation": "augmented", "keeping": "partitioning"}),
    ("spatial_four_bar", {}),
    ("tractor_trailers", {"formulation": "augmented"}),
    ("tractor_trailers", {"formulation": "augmented", "keeping": "tangent"}),
    ("rolling_disk", {"formulation": "augmented"}),
    ("rolling_disk", {"formulation": "augmented", "keeping": "invariants"}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("model", "options"), LONG, ids=str)
def test_constraints_hold_through_ten_thousand_seconds(model: str, options: dict[str, Any]) -> None:
    found = hamel.simulate(MODELS / f"{model}.yaml", time=1e4, step=10.0, rtol=1e-8, **options)
    assert found.position_violation <= 1e-12 and found.velocity_violation <= 1e-12 and found.acceleration_violation <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("formulation", "power"), [("quasi_velocities", 1), ("augmented", 2)])
def test_growth_without_keeping(formulation: str, power: int) -> None:
    """Violations of positions grow as t where A v = c holds identically, as t² where velocities drift too."""
    given = {"step_size": 0.01, "integrator": "rk4", "keeping": "none", "time": 100.0, "step": 1.0, "rtol": 1e-2}
    found = hamel.simulate(MODELS / "rolling_disk.yaml", formulation=formulation, **given)  # type: ignore[arg-type]
    t, drift = found.motion["t"][10:], np.maximum.accumulate(found.motion["position_violation"])[10:]
    slope = np.polyfit(np.log(t), np.log(drift), 1)[0]
    assert slope == pytest.approx(power, abs=0.4)
