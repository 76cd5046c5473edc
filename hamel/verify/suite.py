"""`verification`: the whole suite for one choice of quasi-velocities, on one page."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from types import ModuleType

import numpy as np

from derive.formulations.charts import together
from derive.formulations.evaluate import evaluator
from derive.formulations.records import Equations
from derive.model.records import Model
from hamel.verify.checks import CHECKS, LOADED, QUICK
from hamel.verify.checks.check import Check
from hamel.verify.checks.code import refused
from hamel.verify.checks.evidence import Evidence, evidence
from hamel.verify.checks.linear import with_linearization
from hamel.verify.checks.samples import Sample, varied
from hamel.verify.long import is_long, long_verification, of_long_model
from hamel.verify.records import CheckResult, Verification
from hamel.verify.reference.outcome import reference
from hamel.verify.reference.vectors import Array

SHOWN = 8  # coordinates of a state that a message quotes
NOTHING = 1e-9  # in the model's own units
HARMLESS = 1e6  # a condition that leaves every result its value
EXCUSED = 1e3  # the checks excuse what a condition costs; below this it is not what makes one fail
REGULAR = "orthonormal"  # the choice that is regular wherever constraint rows are independent
ENOUGH = 0.5  # at least this part of the states asked for must be found


@np.errstate(all="ignore")  # a value that is no number fails its check, and is told there
def verification(
    model: Model,
    equations: Equations,
    module: ModuleType | None = None,
    states: int = 100,
    seed: int = 0,
    others: Collection[Equations] = (),
) -> Verification:
    """Compare one choice, and its generated module, with the independent reference at random
    admissible states.

    `others` are further choices of the same model: v̇ must not depend on the choice. All charts of
    the module are compared.
    """
    if module is not None and is_long(equations, module):
        return long_verification(model, equations, module, states, seed)
    equations = with_linearization(equations)
    seen = evidence(reference(model), equations, module, states, seed, (*others, *equations.charts))
    return _verdict(seen, states, seed, (*results(seen), *_in_charts(seen, CHECKS)))


@np.errstate(all="ignore")
def quick_verification(
    model: Model,
    equations: Equations,
    module: Callable[[], ModuleType],
    states: int = 20,
    seed: int = 0,
    functions: Collection[str] | None = None,
) -> Verification:
    """What a build waits for: every term against the reference, then the module, asked for when it
    is needed. It has these `functions` of the equations, all when None.

    The checks that compare terms with each other, and the other ways to call the code, are left to
    `verification`.
    """
    if of_long_model(equations) and is_long(equations, module()):
        return long_verification(model, equations, module(), states, seed)
    seen = evidence(reference(model), equations, None, states, seed)
    terms_agree = (*results(seen, QUICK), *_in_charts(seen, QUICK))
    loaded = _with_expected(seen, functions).loaded(module())
    checked = (*terms_agree, *results(loaded, LOADED), *_in_charts(loaded, LOADED))
    return _verdict(loaded, states, seed, checked)


def _with_expected(seen: Evidence, functions: Collection[str] | None) -> Evidence:
    """What the module will be compared with, computed while it is compiled."""
    for name in seen.expected if seen.samples else ():
        if functions is None or name in functions:
            _ = seen.expected[name]
    return seen


def _in_charts(seen: Evidence, checks: Sequence[Check]) -> tuple[CheckResult, ...]:
    """The same for every further chart of the module."""
    result: list[CheckResult] = []
    for number, chart in enumerate(seen.graph.equations.charts, 1):
        there = replace(seen, graph=evaluator(chart), others=(seen.graph,), chart=number)
        result += [
            replace(check, name=f"{check.name}; chart {number}, {chart.choice}")
            for check in results(there, checks)
        ]
    return tuple(result)


def _verdict(
    seen: Evidence, states: int, seed: int, results: Sequence[CheckResult]
) -> Verification:
    result = (_enough(len(seen.samples), states), *results)
    choice = together(seen.graph.equations)
    passed = all(c.passed for c in result)
    rank = max((s.outcome.rank for s in seen.samples), default=0)
    return Verification(
        seen.system.model.name, choice, passed, result, len(seen.samples), seed, rank,
        _region(seen), varied(seen.samples, seen.system), "" if passed else _where(seen, result),
    )  # fmt: skip


def _where(seen: Evidence, results: Sequence[CheckResult]) -> str:
    """A result without a value, where there is one, and the state that is nearest to singular; not
    the latter where it is far from that and says nothing about the former."""
    lost = any(not math.isfinite(result.value) for result in results)
    missing = _without_value(seen) or _refused(seen) if lost else ""
    conditions = seen.own_conditions(seen.graph)
    near = max(conditions, default=0.0) >= (HARMLESS if missing else EXCUSED)
    return "; ".join(part for part in (missing, _hardest(seen, conditions) if near else "") if part)


def _hardest(seen: Evidence, conditions: Sequence[float]) -> str:
    """The state where the choice is nearest to singular, its condition, and what else to try."""
    worst_place = int(np.argmax(conditions))
    said = f"cond [A; B] is largest, {conditions[worst_place]:.2g}, at "
    said += _position(seen, worst_place)
    others = " or ".join(_others(seen))
    return f"{said}; where that is the cause, {others} may hold" if others else said


def _others(seen: Evidence) -> list[str]:
    """Options for another choice, and for the formulation that inverts [A; B] as a whole."""
    own, names = seen.graph.equations, [x.name for x in seen.system.model.choices]
    choices = [f"--choice {name}" for name in names if name != own.choice][:3]
    if seen.system.A.size1() and own.choice != REGULAR and REGULAR not in names:
        choices.append(f"--choice {REGULAR}")
    return choices + ["--formulation maggi"] * (own.formulation != "maggi")


def _without_value(seen: Evidence) -> str:
    """The first result of the equations that has no value, and where; "" where all have."""
    for function in seen.graph.equations.functions:
        values = seen.expected[function.name][0]
        missing = np.argwhere(~np.isfinite(values))
        if not len(missing):
            continue
        place, entry = map(int, missing[0])
        labels = function.result.labels
        row = entry // max(1, function.result.value.size2())
        of = f" of {labels[row]}" if row < len(labels) else ""
        return f"{function.name}{of} has no value at {_position(seen, place)}"
    return ""


def _refused(seen: Evidence) -> str:
    """The function that the module alone has no value of, and where; "" where there is none."""
    found = refused(seen) if seen.module is not None else None
    return f"{found[0]} has no value at {_position(seen, found[1])}" if found else ""


def _position(seen: Evidence, place: int) -> str:
    """The number of a state, and some of its coordinates."""
    names = [x.name for x in seen.system.model.coordinates]
    values = [f"{n} = {x:.4g}" for n, x in zip(names[:SHOWN], seen.samples[place].q)]
    more = ", …" if len(names) > SHOWN else ""
    return f"state {place} ({', '.join(values)}{more})"


def _region(seen: Evidence) -> tuple[tuple[str, float, float], ...]:
    """The least and the largest value of time, every coordinate, velocity and input, and every
    parameter that is an argument."""
    model = seen.system.model
    free = [p for p in model.parameters if p.name not in seen.system.constants]
    names = [
        "t",
        *(
            x.name
            for items in (model.coordinates, model.velocities, model.states, model.inputs, free)
            for x in items
        ),
    ]
    columns = zip(
        *(np.concatenate([[s.t], _without_roundoff(seen, s), s.u, s.p]) for s in seen.samples)
    )
    return tuple(
        (name, float(min(column)), float(max(column))) for name, column in zip(names, columns)
    )


def _without_roundoff(seen: Evidence, s: Sample) -> Array:
    """(q, v, z), zero where roundoff is all that is left of an entry."""
    values = s.whole
    return np.where(np.abs(values) < NOTHING * seen.units.whole, 0.0, values)


@np.errstate(all="ignore")
def results(seen: Evidence, checks: Sequence[Check] = CHECKS) -> tuple[CheckResult, ...]:
    """Every check that applies, at the states of the evidence."""
    outcomes = [_check(check, seen) for check in checks if seen.samples]
    return tuple(outcome for outcome in outcomes if outcome is not None)


def _enough(found: int, wanted: int) -> CheckResult:
    missing = 1.0 - found / wanted
    return CheckResult(
        "states found",
        missing,
        ENOUGH,
        missing <= ENOUGH,
        "share of the states asked for that could not be closed",
    )


def _check(check: Check, seen: Evidence) -> CheckResult | None:
    try:
        error = check.error(seen)
    except np.linalg.LinAlgError:  # what the check solves has no solution: no number comes of it
        error = math.inf
    if error is None:
        return None
    value = math.inf if math.isnan(error) else float(error)
    tolerance = check.tolerance * (seen.real.coarseness if check.rounding else 1.0)
    return CheckResult(check.name, value, tolerance, value <= tolerance, check.about)
