"""A module to run: one formulation, one choice, and what an enforcement makes of the equations;
with all integrators in it."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from codegen.integrators import INTEGRATORS
from derive.diagnostics import AssumptionError
from derive.enforcement import ENFORCEMENTS, Options, kept_equations, usual_rate
from derive.formulations import equations
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.robots import load
from derive.states.initial import Initial, initial_state
from hamel.build.module import published
from hamel.build.stages import mechanics_of, program_of
from hamel.settings import settings
from hamel.study.plan import OWN

FUNCTIONS = (
    "dynamics",
    "constraints",
    "project",
    "energy",
    "power",
    "velocity",
    "state",
    "reactions",
)


@dataclass(frozen=True)
class Start:
    """The mechanics of a model file with the settings, and its consistent initial state."""

    system: System
    initial: Initial
    u: np.ndarray
    p: np.ndarray


def start(path: str, values: Mapping[str, float | str]) -> Start:
    return _start(path, tuple(sorted(values.items())))


@functools.lru_cache(maxsize=2)
def _start(path: str, values: tuple[tuple[str, float | str], ...]) -> Start:
    system = mechanics_of(load(path))
    given = settings(system.model, dict(values))
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    return Start(system, initial_state(system, given.initial, p), u, p)


def built(
    path: str, values: Mapping[str, float | str], unit: Mapping[str, str], span: float, folder: str
) -> Iterator[dict[str, Any]]:
    """What runs need to know of the module that is in `folder` now."""
    found = start(path, values)
    plain = plain_equations(found, unit)
    known = {
        enforcement.name: enforcement
        for enforcement in ENFORCEMENTS
        if (enforcement.name == unit["own"] if unit["own"] else enforcement.name not in OWN)
    }
    alpha = _rate(found, plain, span) if unit["own"] else None
    options = Options(alpha, (), tuple(found.u), tuple(found.p))
    refused = {name: enforcement.refusal(plain, options) for name, enforcement in known.items()}
    fitting = [enforcement for enforcement in known.values() if not refused[enforcement.name]]
    if not fitting:
        raise AssumptionError("; ".join(refused.values()))
    made = (
        kept_equations(found.system, unit["choice"] or None, plain.formulation, fitting[0], options)
        if unit["own"]
        else plain
    )
    for enforcement in fitting if not unit["own"] else ():
        made = enforcement.equations(made, options)
    names = [function.name for function in made.functions if function.name in FUNCTIONS]
    methods = [method.name for method in INTEGRATORS]
    program = program_of(
        made, names, integrators=methods, enforcements=[enforcement.name for enforcement in fitting]
    )
    published(program, folder)
    yield {
        "operations": program.kernel("dynamics").operations["total"],
        "enforcements": list(program.enforcements),
        "misfits": {name: reason for name, reason in refused.items() if reason},
        "alpha": alpha if any(enforcement.level == "rates" for enforcement in fitting) else None,
    }


def plain_equations(found: Start, unit: Mapping[str, str]) -> Equations:
    return equations(found.system, unit["choice"] or None, unit["formulation"])


def _rate(found: Start, plain: Equations, span: float) -> float:
    return usual_rate(plain, 0.0, first_state(found, plain), found.u, found.p, span)


def first_state(found: Start, made: Equations) -> np.ndarray:
    """x at the start, by the equations' own function."""
    function = made.function("state")
    t, _, u, p = (argument.symbols for argument in made.arguments)
    assert function.x is not None
    state = ca.Function("state", [t, function.x.symbols, u, p], [ca.densify(function.result.value)])
    return np.asarray(
        state(0.0, np.concatenate([found.initial.q, found.initial.v]), found.u, found.p)
    ).ravel()
