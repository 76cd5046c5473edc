"""A module to run: one formulation, one choice, and what an enforcement makes of the equations;
with the integrators that are compared."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from codegen.passes.taylor import SERIES, series_refusal
from derive.diagnostics import AssumptionError
from derive.enforcement import (
    ENFORCEMENTS,
    Enforcement,
    Options,
    kept_equations,
    usual_rate,
)
from derive.formulations import equations
from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.robots import File
from derive.robots.reading import load
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


def start(path: File, values: Mapping[str, float | str]) -> Start:
    """System, consistent initial state, inputs and parameters of a model file with settings; kept,
    because one process makes many runs of the same model."""
    return _start(path, tuple(sorted(values.items())))


def start_now(path: File, values: Mapping[str, float | str]) -> Start:
    """The same of the file as it is now: it may have been edited since an earlier study of this
    process."""
    _start.cache_clear()
    return start(path, values)


@functools.lru_cache(maxsize=2)
def _start(path: File, values: tuple[tuple[str, float | str], ...]) -> Start:
    system = mechanics_of(load(path))
    given = settings(system.model, dict(values))
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    return Start(system, initial_state(system, given.initial, p), u, p)


def module(
    path: File,
    values: Mapping[str, float | str],
    unit: Mapping[str, str],
    span: float,
    folder: str,
    integrators: Sequence[str],
) -> dict[str, Any]:
    """Builds the module of a unit with these integrators into `folder`; what runs need to know of
    it."""
    begin = start(path, values)
    plain = plain_equations(begin, unit)
    alpha = _rate(begin, plain, span) if unit["own"] else None
    options = Options(alpha, (), tuple(begin.u), tuple(begin.p))
    refused = {each.name: each.refusal(plain, options) for each in _candidates(unit)}
    fitting = [each for each in _candidates(unit) if not refused[each.name]]
    if not fitting:
        raise AssumptionError("; ".join(refused.values()))
    formed = _formed(begin, unit, plain, fitting, options)
    names = [function.name for function in formed.functions if function.name in FUNCTIONS]
    methods = [name for name in integrators if name != SERIES]
    enforcements = [enforcement.name for enforcement in fitting]
    program = program_of(formed, names, integrators=methods, enforcements=enforcements)
    unfit = series_refusal(program) if SERIES in integrators else ""
    if SERIES in integrators and not unfit:
        program = replace(program, integrators=(*program.integrators, SERIES))
    published(program, folder)
    return {
        "operations": program.kernel("dynamics").operations["total"],
        "enforcements": list(program.enforcements),
        "integrators": list(program.integrators),
        "unfit": {SERIES: unfit} if unfit else {},
        "misfits": {name: reason for name, reason in refused.items() if reason},
        "alpha": alpha if any(enforcement.level == "rates" for enforcement in fitting) else None,
    }


def _candidates(unit: Mapping[str, str]) -> list[Enforcement]:
    """The enforcement that the unit is made for, else all that leave the equations as they are."""
    if unit["own"]:
        return [each for each in ENFORCEMENTS if each.name == unit["own"]]
    return [each for each in ENFORCEMENTS if each.name not in OWN]


def _formed(
    begin: Start,
    unit: Mapping[str, str],
    plain: Equations,
    fitting: Sequence[Enforcement],
    options: Options,
) -> Equations:
    """The equations with what the enforcements add."""
    if unit["own"]:
        choice = unit["choice"] or None
        return kept_equations(begin.system, choice, plain.formulation, fitting[0], options)
    for enforcement in fitting:
        plain = enforcement.equations(plain, options)
    return plain


def plain_equations(begin: Start, unit: Mapping[str, str]) -> Equations:
    """Without an enforcement."""
    return equations(begin.system, unit["choice"] or None, unit["formulation"])


def _rate(begin: Start, plain: Equations, span: float) -> float:
    return usual_rate(plain, 0.0, first_state(begin, plain), begin.u, begin.p, span)


def first_state(begin: Start, equations: Equations) -> np.ndarray:
    """x at the start, by the equations' own function."""
    state = function_of(equations, "state")
    return np.asarray(state(0.0, begin.initial.whole, begin.u, begin.p)).ravel()
