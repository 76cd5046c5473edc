"""What is run: the product of formulations, choices, keepings, integrators and tolerances, as far as it fits the model.

A module is made for every choice of quasi-velocities; other formulations are compared at the default choice.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.integrators import INTEGRATORS, Integrator
from derive.diagnostics import AssumptionError
from derive.formulations import FORMULATIONS, equations, misfits
from derive.formulations.choices import workshop
from derive.formulations.named_choices import OWN
from derive.formulations.records import Equations
from derive.mechanics.records import System
from hamel.report import libraries

DEFAULT = "quasi_velocities"
TIGHTEST, LOOSEST = 12, 4
COUNTS = (3, 10, 30, 100, 300)  # equal steps, as multiples of those of dop853 at rtol 1e-6
SOLVERS = ((DEFAULT, ("CVODES", *libraries.SCIPY)), ("augmented", ("CVODES", "IDAS")))


@dataclass(frozen=True)
class Unit:
    """What a module is made for. `choice` is empty where the formulation makes none; `rates` names a keeping that is in the
    equations themselves."""

    formulation: str
    choice: str
    rates: str = ""

    @property
    def about(self) -> dict[str, str]:
        return asdict(self)


@dataclass(frozen=True)
class Excluded:
    """A combination that is not run, and why; an empty entry stands for all."""

    formulation: str
    choice: str
    keeping: str
    integrator: str
    reason: str


@dataclass(frozen=True)
class Plan:
    units: tuple[Unit, ...]
    excluded: tuple[Excluded, ...]


def plan(system: System, formulations: Collection[str]) -> Plan:
    """Units in the order in which they matter; `formulations` restricts them (all when empty)."""
    choices, excluded = _choices(system)
    units = [Unit(DEFAULT, choice) for choice in choices] if not formulations or DEFAULT in formulations else []
    for formulation in FORMULATIONS:
        if formulation.name == DEFAULT or (formulations and formulation.name not in formulations):
            continue
        reason = misfits(system)[formulation.name]
        if reason:
            excluded.append(Excluded(formulation.name, "", "", "", reason))
        else:
            units.append(Unit(formulation.name, choices[0] if formulation.chooses else ""))
    return Plan(tuple(units), tuple(excluded))


def _choices(system: System) -> tuple[list[str], list[Excluded]]:
    """Those of the file and the kinds that fit any model; each once, whatever it is called."""
    rng = np.random.default_rng(0)
    found: dict[str, np.ndarray] = {}
    excluded = []
    for name in dict.fromkeys([*(choice.name for choice in system.model.choices), *(OWN if system.rows else OWN[:1])]):
        try:
            w = _speeds(system, equations(system, name), np.random.default_rng(rng.integers(1) + 1))
        except AssumptionError as error:
            excluded.append(Excluded(DEFAULT, name, "", "", error.diagnostics[0].message))
            continue
        same = next((other for other, known in found.items() if np.allclose(known, w, rtol=1e-9, atol=1e-12)), None)
        if same is None:
            found[name] = w
        else:
            excluded.append(Excluded(DEFAULT, name, "", "", f"the same quasi-velocities as {same}"))
    return [*found], excluded


def _speeds(system: System, found: Equations, rng: np.random.Generator) -> np.ndarray:
    """w = B v at states that any other choice is shown too."""
    function = next(function for function in found.functions if function.name == "state")
    assert function.x is not None
    made = ca.Function("w", [system.t, function.x.symbols, system.p], [ca.densify(function.result.value)])
    s = workshop(system).sampled
    rows = [np.asarray(made(t, np.concatenate([q, v]), p)).ravel() for t, q, v, p in zip(s.t[:3], s.q, s.v, s.p)]
    return np.array(rows)[:, system.q.numel() :]


def runs(keepings: Sequence[str], tolerances: Sequence[float], integrators: Collection[str], scale: int) -> list[dict[str, Any]]:
    """Of one module, family by family, loose tolerances and few steps first. `scale`: steps that dop853 takes at rtol 1e-6."""
    chosen = [method for method in INTEGRATORS if not integrators or method.name in integrators]
    return [run for method in chosen for keeping in keepings for run in _family(method, keeping, tolerances, scale)]


def _family(method: Integrator, keeping: str, tolerances: Sequence[float], scale: int) -> list[dict[str, Any]]:
    base = {"keeping": keeping, "integrator": method.name}
    if not method.adaptive:
        return [{**base, "count": n * scale, "key": f"{method.name} {keeping} {n * scale} steps"} for n in COUNTS]
    shown = tolerances or default_tolerances(1 if method is INTEGRATORS[0] else 2)
    return [{**base, "rtol": rtol, "key": f"{method.name} {keeping} {rtol:.0e}"} for rtol in shown]


def default_tolerances(every: int) -> list[float]:
    return [float(f"1e-{k}") for k in range(LOOSEST, TIGHTEST + 1, every)]


def library_runs(solver: str, tolerances: Sequence[float]) -> list[dict[str, Any]]:
    shown = tolerances or default_tolerances(2)
    return [{"keeping": "none", "integrator": solver, "rtol": rtol, "key": f"{solver} {rtol:.0e}"} for rtol in shown]
