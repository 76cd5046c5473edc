"""What is run: the product of formulations, choices, enforcements, integrators and tolerances, as
far as it fits the model.

A module is made for every choice of quasi-velocities; other formulations are compared at the
default choice.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from codegen.integrators import INTEGRATORS, Integrator
from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError, ModelError
from derive.enforcement import ENFORCEMENTS
from derive.formulations import FORMULATIONS, equations, misfits
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model.records import CHOICE_KINDS

DEFAULT = "quasi_velocities"
TIGHTEST, LOOSEST = 12, 4
COUNTS = (3, 10, 30, 100, 300)  # equal steps, as multiples of those of dop853 at rtol 1e-6
LIBRARIES = "libraries"  # among the integrators that are asked for: all library solvers
SCIPY = ("scipy_dop853", "scipy_radau")
SOLVERS = (
    (DEFAULT, ("cvodes", *SCIPY)),
    ("augmented", ("cvodes", "idas")),
)  # of hamel.simulate.libraries


@dataclass(frozen=True)
class Restrictions:
    """Restrictions (all when empty), the seconds that the runs of one model may take together, and
    two methods that are put side by side."""

    formulations: Collection[str] = ()
    choices: Collection[str] = ()
    enforcements: Collection[str] = ()
    integrators: Collection[str] = ()
    tolerances: Sequence[float] = ()
    budget: float = 90.0
    compare: Sequence[str] = ()


@dataclass(frozen=True)
class Unit:
    """What a module is made for. `choice` is empty where the formulation makes none; `own` names an
    enforcement that needs a module of its own, for it is in the equations."""

    formulation: str
    choice: str
    own: str = ""

    @property
    def about(self) -> dict[str, str]:
        """The fields by name, as the worker processes get them."""
        return asdict(self)


@dataclass(frozen=True)
class Excluded:
    """A combination that is not run, and why; an empty entry stands for all."""

    formulation: str
    choice: str
    enforcement: str
    integrator: str
    reason: str


@dataclass(frozen=True)
class Plan:
    units: tuple[Unit, ...]
    excluded: tuple[Excluded, ...]


def plan(system: System, asked: Restrictions) -> Plan:
    """Units in the order in which they matter."""
    choices, excluded = _choices(system, asked.choices)
    formulations = asked.formulations
    units = (
        [Unit(DEFAULT, choice) for choice in choices]
        if not formulations or DEFAULT in formulations
        else []
    )
    for formulation in FORMULATIONS:
        if formulation.name == DEFAULT or (formulations and formulation.name not in formulations):
            continue
        reason = misfits(system)[formulation.name]
        if formulation.chooses and not choices:
            reason = reason or "none of the choices that were asked for fits"
        if reason:
            excluded.append(Excluded(formulation.name, "", "", "", reason))
        else:
            units.append(Unit(formulation.name, choices[0] if formulation.chooses else ""))
    units.sort(
        key=lambda unit: (
            unit.choice not in choices[:1] or unit.formulation != DEFAULT,
            unit.formulation != "augmented",
        )
    )
    own = [name for name in OWN if not asked.enforcements or name in asked.enforcements]
    return Plan((*units, *_with_own_enforcement(units, own)), (*excluded, *_RESTRICTED))


_STAGES = ", ".join(
    enforcement.name for enforcement in ENFORCEMENTS if enforcement.level == "stages"
)
_RESTRICTED = (
    *(
        Excluded(
            "",
            "",
            _STAGES,
            method.name,
            "it needs the exact Jacobian or series of what is integrated; these solve coordinates "
            "on the way",
        )
        for method in INTEGRATORS
        if method.exact
    ),
    Excluded(
        "",
        "",
        "",
        f"all but {INTEGRATORS[0].name}",
        "with further enforcements on the default choice and the augmented equations only",
    ),
)
OWN = tuple(
    enforcement.name
    for enforcement in ENFORCEMENTS
    if enforcement.level == "rates" or enforcement.name == "invariants_euclidean"
)


def _with_own_enforcement(units: Sequence[Unit], names: Sequence[str]) -> list[Unit]:
    """On the default choice and on the augmented equations."""
    compared = (
        [*units[:1], *(unit for unit in units[1:] if unit.formulation == "augmented")]
        if units
        else []
    )
    return [replace(unit, own=name) for unit in compared for name in names]


def _choices(system: System, asked: Collection[str]) -> tuple[list[str], list[Excluded]]:
    """Those of the file and the kinds that fit any model, or those asked for; each once, whatever
    it is called."""
    rng = np.random.default_rng(0)
    speeds: dict[str, np.ndarray] = {}
    excluded = []
    known = [
        *(choice.name for choice in system.model.choices),
        *(CHOICE_KINDS if system.rows else CHOICE_KINDS[:1]),
    ]
    for name in dict.fromkeys(asked or known):
        try:
            w = _speeds(system, equations(system, name), np.random.default_rng(rng.integers(1) + 1))
        except (AssumptionError, ModelError) as error:
            excluded.append(Excluded(DEFAULT, name, "", "", error.diagnostics[0].message))
            continue
        same = next(
            (
                other
                for other, known in speeds.items()
                if np.allclose(known, w, rtol=1e-9, atol=1e-12)
            ),
            None,
        )
        if same is None:
            speeds[name] = w
        else:
            excluded.append(Excluded(DEFAULT, name, "", "", f"the same quasi-velocities as {same}"))
    return [*speeds], excluded


def _speeds(system: System, equations: Equations, rng: np.random.Generator) -> np.ndarray:
    """w = B v at states that any other choice is shown too."""
    function = equations.function("state")
    assert function.x is not None
    result = ca.Function(
        "w", [system.t, function.x.symbols, system.own_p], [ca.densify(function.result.value)]
    )
    s, own = survey_of(system).sampled, len(system.own_parameters)
    rows = [
        np.asarray(result(t, np.concatenate([q, v, p[own:]]), p[:own])).ravel()
        for t, q, v, p in zip(s.t[:3], s.q, s.v, s.p)
    ]
    return np.array(rows)[:, equations.speeds]


def runs(
    asked: Restrictions, enforcements: Sequence[str], every: bool, scale: int
) -> list[dict[str, Any]]:
    """Of one module, family by family, loose tolerances and few steps first. `scale`: steps that
    dop853 takes at rtol 1e-6.

    The first integrator runs with every enforcement, the others with every one only where that is
    asked for.
    """
    chosen = [
        method
        for method in INTEGRATORS
        if not asked.integrators or method.name in asked.integrators
    ]
    enforcements = [
        enforcement
        for enforcement in enforcements
        if not asked.enforcements or enforcement in asked.enforcements
    ]
    pairs = [
        (method, enforcement)
        for method in chosen
        for enforcement in enforcements
        if every or _is_basic(method, enforcement)
    ]
    return [
        run
        for method, enforcement in pairs
        if fits(method, enforcement)
        for run in _family(method, enforcement, asked.tolerances, scale)
    ]


def _is_basic(method: Integrator, enforcement: str) -> bool:
    return method is INTEGRATORS[0] or enforcement in ("projection", "none")


def fits(method: Integrator, enforcement: str) -> bool:
    """No enforcement that solves coordinates at every stage, for a method that needs the exact
    Jacobian of what it integrates."""
    return not (
        method.exact
        and any(known.name == enforcement and known.level == "stages" for known in ENFORCEMENTS)
    )


def _family(
    method: Integrator, enforcement: str, tolerances: Sequence[float], scale: int
) -> list[dict[str, Any]]:
    base = {"enforcement": enforcement, "integrator": method.name}
    if not method.adaptive:
        return [
            {**base, "count": n * scale, "key": f"{method.name} {enforcement} {n * scale} steps"}
            for n in COUNTS
        ]
    shown = tolerances or default_tolerances(1 if method is INTEGRATORS[0] else 2)
    return [
        {**base, "rtol": rtol, "key": f"{method.name} {enforcement} {rtol:.0e}"} for rtol in shown
    ]


def default_tolerances(every: int) -> list[float]:
    """1e-LOOSEST down to 1e-TIGHTEST, every so many decades."""
    return [float(f"1e-{k}") for k in range(LOOSEST, TIGHTEST + 1, every)]


def missing_libraries() -> dict[str, str]:
    """Why some of them cannot be had here."""
    return (
        {} if importlib.util.find_spec("scipy") else dict.fromkeys(SCIPY, "SciPy is not installed")
    )


def without_libraries(units: Sequence[Unit]) -> list[Excluded]:
    """Where none of the formulations is one that library solvers run on, what to say of it."""
    on = [formulation for formulation, _ in SOLVERS]
    if any(unit.formulation in on for unit in units):
        return []
    reason = f"library solvers run on the formulations {' and '.join(on)} only"
    names = dict.fromkeys(unit.formulation for unit in units)
    return [Excluded(name, "", "", LIBRARIES, reason) for name in names]


def library_runs(solver: str, tolerances: Sequence[float]) -> list[dict[str, Any]]:
    """One run per tolerance with a library's solver, every second decade when none are given;
    without an enforcement, for the libraries know of none."""
    shown = tolerances or default_tolerances(2)
    return [
        {"enforcement": "none", "integrator": solver, "rtol": rtol, "key": f"{solver} {rtol:.0e}"}
        for rtol in shown
    ]
