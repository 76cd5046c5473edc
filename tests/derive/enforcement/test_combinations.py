"""Formulation × enforcement × integrator: every combination that fits runs on three models or more
and agrees, the others are refused with the reason; every integrator has its order with every
enforcement.

Of codegen.integrators: dop853, dopri5, implicit_midpoint, radau, rk4, rkf45, rosenbrock, taylor,
verner9, verner9_dense.
Of hamel.simulate.libraries: records, scipy_solvers, sundials.
"""

from __future__ import annotations

import functools
import itertools
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import hamel
from codegen import compiler
from codegen.integrators import (
    INTEGRATORS,
    Collocation,
    Integrator,
    Midpoint,
    Rosenbrock,
    Tableau,
    Taylor,
)
from derive.diagnostics import AssumptionError
from derive.enforcement import ENFORCEMENTS, Enforcement, Options, kept_equations
from derive.formulations import FORMULATIONS
from hamel.simulate import compiled
from hamel.simulate.libraries import REFERENCES, Problem
from tests.extended import LONGER, Simulator
from tests.points import (
    ALPHA,
    LOOPS,
    NAMED,
    TREES,
    common,
    fitting,
    made,
    mechanics,
    module,
    quickly_built,
    refusal,
    start,
)
from tests.scenes import MODELS

pytestmark = pytest.mark.skipif(compiler.find_compiler() is None, reason="no C compiler")

TIME = 0.3


def needs_exact_jacobian(enforcement: Enforcement, integrator: Integrator) -> bool:
    """Refused by `hamel simulate`: see test_methods.py."""
    return integrator.exact and enforcement.level == "stages"


# Who fits whom
# -----------------------------------------------------------------------------------------------------


def reason(model: str, formulation: str, enforcement: str) -> str:
    """Why not: from the kind of constraints of a model and the kind of state of a formulation. All
    models here hold energy."""
    rows = mechanics(model).rows
    positions, drifting = (
        any(row.position >= 0 for row in rows),
        formulation in ("augmented", "udwadia_kalaba", "udwadia_phohomsiri"),
    )
    if formulation == "recursive" and rows:
        return "trees without constraints"
    if enforcement in ("none", "invariants", "invariants_euclidean"):
        return ""
    if enforcement == "baumgarte":
        return (
            "A v = c holds identically.*use feedback"
            if rows and not drifting
            else ""
            if rows
            else "there are no constraints"
        )
    if enforcement == "feedback":
        return (
            "velocities drift too.*use baumgarte"
            if positions and drifting
            else ""
            if positions
            else "no position constraints"
        )
    if positions or (rows and drifting):
        return ""
    return "nothing to project on" if enforcement == "projection" else "nothing to solve"


POINTS = [*itertools.product((*LOOPS, *TREES), FORMULATIONS)]


@pytest.mark.parametrize("enforcement", ENFORCEMENTS, ids=lambda x: x.name)
@pytest.mark.parametrize(("model", "formulation"), POINTS, ids=lambda x: getattr(x, "name", x))
def test_what_does_not_fit_is_refused_with_the_reason(
    model: str, formulation: Any, enforcement: Enforcement
) -> None:
    why = reason(model, formulation.name, enforcement.name)
    said = refusal(model, formulation.name, enforcement)
    assert bool(said) == bool(why) and re.search(why, said)


@pytest.mark.parametrize(
    ("formulation", "enforcement"),
    [*itertools.product(FORMULATIONS, ENFORCEMENTS)],
    ids=lambda x: x.name,
)
def test_refused_before_anything_is_built(
    formulation: Any, enforcement: Enforcement, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled, "promised_module", lambda *given: pytest.fail("built"))
    why = reason("rolling_disk", formulation.name, enforcement.name)
    if not why:
        return
    with pytest.raises(AssumptionError, match=why) as caught:
        hamel.simulate(
            MODELS / "rolling_disk.yaml",
            formulation=formulation.name,
            enforcement=enforcement.name,
            time=0.1,
        )
    assert caught.value.exit_code == 2


# Every combination
# ---------------------------------------------------------------------------------------------------

# Quickly on three loops and, what is for trees only, on three trees. The rest takes longer to
# compile than it tells.
LATER = [
    (model, each.name)
    for model, each in POINTS
    if (model in TREES) != (each.name == "recursive") or model == "tractor_trailers"
]
MARKED = [
    pytest.param(
        model,
        each,
        marks=[pytest.mark.slow] * ((model, each.name) in LATER),
        id=f"{model}-{each.name}",
    )
    for model, each in POINTS
]


@functools.cache
def expected(model: str) -> np.ndarray:
    found = module(model, "quasi_velocities")
    x, u, p = start(model, "quasi_velocities")
    motion = found.simulate(
        (0.0, TIME), x, u, p, integrator="dop853", enforcement="none", rtol=1e-13, atol=1e-14
    )
    return common(model, found, motion.t, motion.x, p)[-1]


def stepping(integrator: Integrator) -> dict[str, float]:
    return (
        {"rtol": 1e-8, "atol": 1e-10} if integrator.adaptive else {"step_size": 1e-3, "rtol": 1e-3}
    )


def fits(model: str, formulation: str, enforcement: Enforcement, integrator: Integrator) -> bool:
    return not reason(model, formulation, enforcement.name) and not needs_exact_jacobian(
        enforcement, integrator
    )


@pytest.mark.parametrize("integrator", INTEGRATORS, ids=lambda x: x.name)
@pytest.mark.parametrize("enforcement", ENFORCEMENTS, ids=lambda x: x.name)
@pytest.mark.parametrize(("model", "formulation"), MARKED)
def test_every_combination_agrees_or_is_refused(
    model: str, formulation: Any, enforcement: Enforcement, integrator: Integrator
) -> None:
    if not fits(model, formulation.name, enforcement, integrator):
        assert refusal(model, formulation.name, enforcement) or needs_exact_jacobian(
            enforcement, integrator
        )
        return
    found = made(model, formulation.name, enforcement.name)
    x, u, p = start(model, formulation.name)
    motion = found.simulate(
        (0.0, TIME),
        x,
        u,
        p,
        integrator=integrator.name,
        enforcement=enforcement.name,
        **stepping(integrator),
    )
    error = np.abs(common(model, found, motion.t, motion.x, p)[-1] - expected(model)).max()
    scale = np.abs(expected(model)).max()
    assert error < scale * {"implicit_midpoint": 1e-3, "rk4": 1e-6}.get(integrator.name, 2e-6)
    if enforcement.level in ("steps", "stages") and mechanics(model).rows:
        assert motion.position_violation <= 1e-12 and motion.velocity_violation <= 1e-12 * scale


@pytest.mark.parametrize(
    ("formulation", "enforcement"),
    [*itertools.product(FORMULATIONS, ENFORCEMENTS)],
    ids=lambda x: x.name,
)
def test_every_valid_combination_is_run_on_three_models_quickly(
    formulation: Any, enforcement: Enforcement
) -> None:
    models = [
        model
        for model, each in POINTS
        if each is formulation and not reason(model, formulation.name, enforcement.name)
    ]
    assert not models or sum((model, formulation.name) not in LATER for model in models) >= 3


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda x: x.name)
@pytest.mark.parametrize("model", ["four_bar", "rolling_disk"])
def test_libraries_agree(model: str, reference: Any) -> None:
    formulation = "augmented" if reference.name == "idas" else "quasi_velocities"
    found, of = module(model, formulation), fitting(model, formulation)
    assert not reference.refusal(of)
    x, u, p = start(model, formulation)
    motion = reference.prepare(
        Problem(found, of, np.array([0.0, TIME / 2, TIME]), x, u, p, 1e-8, 1e-10)
    )()
    assert np.abs(common(model, found, motion.t, motion.x, p)[-1] - expected(model)).max() < 1e-5
    assert motion.steps > 3 and motion.calls > 3


# Order
# -------------------------------------------------------------------------------------------------------------

# Motions whose leading error terms are not small by accident: swinging about an equilibrium,
# rolling on a wavy path, sliding about the lowest point. The four-bar has one degree of freedom:
# with its energy held, only a shift in time is left to be wrong, and methods of odd order gain one.
# So the energy is held on the other two.
MOTIONS = {
    "four_bar": {"q1": np.radians(-115.0), "der(q1)": 1.0},
    "rolling_disk": {"lean": 0.1, "der(spin)": 5.0, "der(yaw)": -1.0},
    "ellipsoid": {"x": 0.3, "y": -0.1, "der(x)": 0.3, "der(y)": 1.0},
}
SPAN, COUNT = 4.0, 10
# Steps between two rows, and the errors between which the order shows: above rounding, which still
# counts for tenfold errors, and below where higher terms are large. Where doubles leave too few
# decades between the two, the same code runs in long doubles.
SIZES = {
    "dop853": ((5, 6, 7, 8, 9, 10, 12, 14, 16, 20), 1e-14, 1e-8)
    if LONGER
    else ((4, 5, 6, 7, 8, 9, 10, 12, 14), 3e-13, 1e-8),
    "verner9": ((2, 3, 4, 5, 6, 7, 8, 10, 12), 3e-13, 1e-6),
    "dopri5": ((22, 32, 45, 64, 90, 128, 180, 256), 1e-14, 1e-8)
    if LONGER
    else ((16, 22, 32, 45, 64, 90, 128), 1e-12, 1e-8),
    "rkf45": ((22, 32, 45, 64, 90), 3e-13, 1e-6),
    "rk4": ((45, 64, 90, 128), 3e-13, 1e-5),
    "radau": ((8, 11, 16, 22, 32, 45), 1e-12, 1e-6),
    "rosenbrock": ((45, 64, 90, 128), 3e-13, 1e-5),
    "implicit_midpoint": ((45, 64, 90), 3e-13, 1e-1),
}


@functools.cache
def errors(
    model: str, formulation: str, enforcement: str, integrator: str
) -> tuple[np.ndarray, np.ndarray]:
    """Step sizes and, one row each, the errors of all q and v at all output times in parts of their
    sizes."""
    sizes = SIZES[integrator][0]
    if LONGER and integrator in LONG:
        exact = long_rows(model, formulation, "projection", "dop853", 80)
        scale = np.maximum(np.abs(exact).max(axis=0), 1e-2)
        found = [
            ((long_rows(model, formulation, enforcement, integrator, many) - exact) / scale).ravel()
            for many in sizes
        ]
        return SPAN / COUNT / np.array(sizes), np.array(found).astype(float)
    exact = rows(model, "quasi_velocities", "projection", "dop853", 60)
    scale = np.maximum(np.abs(exact).max(axis=0), 1e-2)
    found = [
        ((rows(model, formulation, enforcement, integrator, many) - exact) / scale).ravel()
        for many in sizes
    ]
    return SPAN / COUNT / np.array(sizes), np.array(found)


LONG = ("dop853", "dopri5")
WITH_ORDER = [integrator for integrator in INTEGRATORS if integrator.order]  # of their own


@functools.cache
def long_made(model: str, formulation: str, enforcement: str) -> Simulator:
    """With this enforcement and, to compare with, projection."""
    found = kept_equations(mechanics(model), None, formulation, NAMED[enforcement], Options(ALPHA))
    functions = [
        function.name for function in found.functions if function.name in ("dynamics", "project")
    ]
    return Simulator(
        found, functions, (*LONG, "verner9"), tuple(dict.fromkeys((enforcement, "projection")))
    )


def long_rows(
    model: str, formulation: str, enforcement: str, integrator: str, many: int
) -> np.ndarray:
    """The states themselves, from a start on the constraints to the last digit."""
    x = long_made(model, formulation, "projection").projected(
        start(model, formulation, MOTIONS[model])[0]
    )
    step = SPAN / COUNT / many * (1 + 1e-12)
    made_ = long_made(model, formulation, enforcement)
    return made_.rows(np.linspace(0.0, SPAN, COUNT + 1), x, integrator, enforcement, step)[1:]


@functools.cache
def rows(model: str, formulation: str, enforcement: str, integrator: str, many: int) -> np.ndarray:
    return moved(
        made(model, formulation, enforcement), model, formulation, enforcement, integrator, many
    )


def moved(
    found: ModuleType, model: str, formulation: str, enforcement: str, integrator: str, many: int
) -> np.ndarray:
    times = np.linspace(0.0, SPAN, COUNT + 1)
    x, u, p = start(model, formulation, MOTIONS[model])
    step = SPAN / COUNT / many * (1 + 1e-12)  # not a sliver more than `many` to the next row
    motion = found.simulate(
        times, x, u, p, integrator=integrator, enforcement=enforcement, step_size=step, rtol=1e-2
    )
    return common(model, found, motion.t, motion.x, p)[1:]


def order(nominal: int, h: np.ndarray, errors: np.ndarray, least: float, most: float) -> float:
    """The k with which C hᵏ + D hᵏ⁺¹ fits the errors best, C and D free for every entry: the
    leading term apart from the next one, after Richardson. Within 0.9 of the nominal order, for
    with C = 0 the pair below it would fit as well."""
    size = np.sqrt(np.mean(errors**2, axis=1))
    used = (least < size) & (size < most)
    assert used.sum() >= 3
    h, weight = h[used] / h[used][0], 1 / np.hypot(size[used], 10 * least)

    def left(k: float) -> float:
        terms = np.stack([h**k, h ** (k + 1)], axis=1) * weight[:, np.newaxis]
        data = errors[used] * weight[:, np.newaxis]
        return float(np.sum((data - terms @ np.linalg.lstsq(terms, data, rcond=None)[0]) ** 2))

    return float(min(np.arange(nominal - 0.9, nominal + 0.9, 0.01), key=left))


ENERGY = ("invariants", "invariants_euclidean")
MEASURED = [
    (model, formulation, enforcement.name, integrator)
    for model, formulation, enforcement, integrator in itertools.product(
        MOTIONS, ("quasi_velocities", "augmented"), ENFORCEMENTS, WITH_ORDER
    )
    if model
    in (
        ("rolling_disk", "ellipsoid")
        if enforcement.name in ENERGY
        else ("rolling_disk", "four_bar")
    )
]


@pytest.mark.parametrize(
    ("model", "formulation", "enforcement", "integrator"),
    MEASURED,
    ids=lambda x: getattr(x, "name", x),
)
def test_order_is_nominal(
    model: str, formulation: str, enforcement: str, integrator: Integrator
) -> None:
    """To 0.1; to 0.15 with the energy held above order 4 where there are doubles only, which leave
    few decades of errors to see it in. At order 9 the leading term is so small that the next ones
    show as well."""
    if not fits(model, formulation, NAMED[enforcement], integrator):
        return
    found = order(
        integrator.order,
        *errors(model, formulation, enforcement, integrator.name),
        *SIZES[integrator.name][1:],
    )
    if integrator.order == 9:
        assert 8.6 < found < 10
        return
    within = 0.15 if enforcement in ENERGY and integrator.order > 4 and not LONGER else 0.1
    assert found == pytest.approx(integrator.order, abs=within)


@pytest.mark.skipif(not LONGER, reason="long doubles are doubles here")
@pytest.mark.parametrize("model", ["four_bar", "rolling_disk"])
def test_order_nine_shows_in_short_steps(model: str) -> None:
    few, many = 16, 20
    exact, coarse, fine = (
        long_rows(model, "augmented", "projection", *by)
        # more steps of the former and what they round adds up to a share of the latter's errors
        for by in (("dop853", 90), ("verner9", few), ("verner9", many))
    )
    scale = np.maximum(np.abs(exact).max(axis=0), 1e-2)
    off = [float(np.sqrt(np.mean(((found - exact) / scale) ** 2))) for found in (coarse, fine)]
    assert np.log(off[0] / off[1]) / np.log(many / few) == pytest.approx(9, abs=0.1)


def spoiled(integrator: Tableau | Rosenbrock | Collocation) -> Integrator:
    """One coefficient of an inner stage is a hundredth too large."""

    def off(table: tuple[Any, ...]) -> tuple[Any, ...]:
        return (*table[:2], (*table[2][:-1], table[2][-1] * Fraction(101, 100)), *table[3:])

    match integrator:
        case Tableau():
            return replace(integrator, a=off(integrator.a))
        case Rosenbrock():
            return replace(integrator, c=off(integrator.c))
        case Collocation():
            return replace(integrator, inverse=off(integrator.inverse))


def test_one_wrong_coefficient_shows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    wrong = tuple(
        spoiled(integrator)
        for integrator in INTEGRATORS
        if not isinstance(integrator, Midpoint | Taylor)
    )
    exact = rows("four_bar", "quasi_velocities", "projection", "dop853", 60)
    monkeypatch.setattr("codegen.targets.simulate.INTEGRATORS", wrong)
    names = tuple(integrator.name for integrator in wrong)
    found = quickly_built(
        fitting("four_bar", "quasi_velocities"),
        ["dynamics", "velocity"],
        names,
        ("projection",),
        tmp_path,
    )
    for integrator in wrong:
        sizes = SIZES[integrator.name][0]
        off = [
            moved(found, "four_bar", "quasi_velocities", "projection", integrator.name, many)
            - exact
            for many in sizes
        ]
        slope = order(
            integrator.order,
            SPAN / COUNT / np.array(sizes),
            np.array([each.ravel() for each in off]),
            1e-12,
            1.0,
        )
        assert slope < integrator.order - 0.2
