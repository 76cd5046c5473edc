"""`verification`: the whole ladder for one choice of quasi-velocities, on one page."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from types import ModuleType

import numpy as np

from derive.formulations.charts import together
from derive.formulations.records import Equations
from derive.model.records import Model
from hamel.verify.checks import LOADED, QUICK, RUNGS
from hamel.verify.checks.check import Rung
from hamel.verify.checks.evidence import Evidence, Sample, graph, samples, terms
from hamel.verify.checks.linear import with_linearization
from hamel.verify.records import Check, Verification
from hamel.verify.reference.outcome import Reference, reference
from hamel.verify.reference.vectors import Array

NOTHING = 1e-9  # in the model's own units
ENOUGH = 0.5  # at least this part of the states asked for must be found


def verification(
    model: Model,
    equations: Equations,
    module: ModuleType | None = None,
    states: int = 100,
    seed: int = 0,
    others: Collection[Equations] = (),
) -> Verification:
    """Compare one choice, and its generated module, with the independent reference at random admissible states.

    `others` are further choices of the same model: v̇ must not depend on the choice. All charts of the module are compared.
    """
    equations = with_linearization(equations)
    seen = evidence(reference(model), equations, module, states, seed, (*others, *equations.charts))
    return _verdict(seen, states, seed, (*climbed(seen), *_in_charts(seen, RUNGS)))


def quick_verification(
    model: Model, equations: Equations, module: Callable[[], ModuleType], states: int = 20, seed: int = 0
) -> Verification:
    """What a build waits for: every term against the reference, then the module, asked for when it is needed.

    The rungs that compare terms with each other, and the other ways to call the code, are left to `verification`.
    """
    seen = evidence(reference(model), equations, None, states, seed)
    terms_agree = (*climbed(seen, QUICK), *_in_charts(seen, QUICK))
    loaded = _with_expected(seen).loaded(module())
    return _verdict(seen, states, seed, (*terms_agree, *climbed(loaded, LOADED), *_in_charts(loaded, LOADED)))


def _with_expected(seen: Evidence) -> Evidence:
    """What the module will be compared with, computed while it is compiled."""
    if seen.samples:
        _ = seen.expected
    return seen


def _in_charts(seen: Evidence, rungs: Sequence[Rung]) -> tuple[Check, ...]:
    """The same for every further chart of the module."""
    found: list[Check] = []
    for number, chart in enumerate(seen.graph.equations.charts, 1):
        there = replace(seen, graph=graph(chart), others=(seen.graph,), chart=number)
        found += [replace(check, name=f"{check.name}; chart {number}, {chart.choice}") for check in climbed(there, rungs)]
    return tuple(found)


def _verdict(seen: Evidence, states: int, seed: int, climbed: Sequence[Check]) -> Verification:
    found = (_enough(len(seen.samples), states), *climbed)
    choice = together(seen.graph.equations)
    passed = all(c.passed for c in found)
    rank = max((s.outcome.rank for s in seen.samples), default=0)
    return Verification(seen.system.model.name, choice, passed, found, len(seen.samples), seed, rank, _region(seen))


def _region(seen: Evidence) -> tuple[tuple[str, float, float], ...]:
    """The least and the largest value of time, every coordinate, velocity and input, and every parameter that is an argument."""
    model = seen.system.model
    free = [p for p in model.parameters if p.name not in seen.system.constants]
    names = ["t", *(x.name for items in (model.coordinates, model.velocities, model.inputs, free) for x in items)]
    columns = zip(*(np.concatenate([[s.t], _without_roundoff(seen, s), s.u, s.p]) for s in seen.samples))
    return tuple((name, float(min(column)), float(max(column))) for name, column in zip(names, columns))


def _without_roundoff(seen: Evidence, s: Sample) -> Array:
    """(q, v), zero where roundoff is all that is left of an entry."""
    values = np.concatenate([s.q, s.v])
    return np.where(np.abs(values) < NOTHING * seen.units.both, 0.0, values)


def evidence(
    ref: Reference,
    equations: Equations,
    module: ModuleType | None = None,
    states: int = 100,
    seed: int = 0,
    others: Collection[Equations] = (),
) -> Evidence:
    """What the rungs look at."""
    system = equations.system
    seen = samples(system, ref, states, seed)
    return Evidence(system, ref, seen, terms(system), graph(equations), tuple(graph(other) for other in others), module)


def climbed(seen: Evidence, rungs: Sequence[Rung] = RUNGS) -> tuple[Check, ...]:
    """Every rung that applies, at the states of the evidence."""
    checks = [_check(rung, seen) for rung in rungs if seen.samples]
    return tuple(check for check in checks if check is not None)


def _enough(found: int, wanted: int) -> Check:
    missing = 1.0 - found / wanted
    return Check("states found", missing, ENOUGH, missing <= ENOUGH, "share of the states asked for that could not be closed")


def _check(rung: Rung, seen: Evidence) -> Check | None:
    error = rung.error(seen)
    if error is None:
        return None
    value = math.inf if math.isnan(error) else float(error)
    tolerance = rung.tolerance * (seen.real.coarseness if rung.rounding else 1.0)
    return Check(rung.name, value, tolerance, value <= tolerance, rung.about)
