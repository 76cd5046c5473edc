"""The values a model file quotes from elsewhere (`reference:`), against the motion of the
module."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from derive.expressions.evaluate import number
from derive.formulations.evaluate import Evaluator, evaluator
from derive.formulations.records import Equations
from derive.model.records import Published
from derive.states.initial import initial_state
from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array

INTEGRATOR = "dop853"  # what the module must have been made with
# A passage through a singular position is only made where two ways across agree, and at the
# tightest tolerances rounding keeps them apart: then the next one counts, for it is the quoted
# value that judges.
RTOLS = (1e-13, 1e-12, 1e-11, 1e-10, 3e-10, 1e-9)
SMALL = 1e-3  # a value counts as at least this part of the largest of its entry
MOST_STEPS = 10_000_000


def published_checks(equations: Equations, module: ModuleType) -> tuple[CheckResult, ...]:
    """One check per entry of `reference:`, from the consistent initial state with inputs at
    zero."""
    wanted = equations.system.model.published
    if not wanted:
        return ()
    seen = evaluator(equations)
    return tuple(_check(entry, _values_at(seen, module, entry)) for entry in wanted)


def _values_at(seen: Evaluator, module: ModuleType, entry: Published) -> dict[str, float]:
    """By the tightest tolerance at which the motion comes to the entry's time; nothing where none
    does."""
    for rtol in RTOLS:
        try:
            return _values(seen, entry, _state(seen, module, entry.time, rtol))
        except FloatingPointError:
            continue
    return {}


def _state(seen: Evaluator, module: ModuleType, time: float, rtol: float) -> Array:
    """x at the time."""
    system = seen.equations.system
    start, u, p = initial_state(system), np.zeros(system.u.numel()), np.array(system.own_parameters)
    x = module.state(0.0, start.whole, u, p)
    if time == 0.0:
        return np.array(x)
    times = np.array([0.0, time])
    motion = module.simulate(
        times,
        x,
        u,
        p,
        integrator=INTEGRATOR,
        rtol=rtol,
        atol=rtol / 100,
        max_steps=MOST_STEPS,
        events=False,
    )
    return np.array(motion.x[-1])


def _values(seen: Evaluator, entry: Published, x: Array) -> dict[str, float]:
    """Everything that can be quoted, by name."""
    system, results = seen.equations.system, {f.name: f.result for f in seen.equations.functions}
    place = (entry.time, x, np.zeros(system.u.numel()), np.array(system.own_parameters))
    values = dict(zip((c.name for c in system.model.coordinates), x))
    names = [v.name for v in system.model.velocities]
    qdot = seen("dynamics", *place)[: system.q.numel()]
    values |= {f"der({c.name})": rate for c, rate in zip(system.model.coordinates, qdot)}
    values |= dict(zip(names, seen("velocity", *place)))
    values |= {f"der({name})": rate for name, rate in zip(names, seen.acceleration(*place))}
    for function in ("energy", "outputs"):
        if seen.has(function):
            values |= dict(zip(results[function].labels, seen(function, *place)))
    return {name: float(value) for name, value in values.items()}


def _check(entry: Published, found: dict[str, float]) -> CheckResult:
    parameters: dict[str, float] = {}
    wanted = {name: number(value, parameters) for name, value in entry.values}
    least = SMALL * max(map(abs, wanted.values()), default=0.0)
    errors = [
        abs(found.get(name, np.inf) - value) / max(abs(value), least, 1e-300)
        for name, value in wanted.items()
    ]
    error = float(np.max(errors, initial=0.0)) if not np.isnan(errors).any() else np.inf
    about = f"published: {entry.source}"
    return CheckResult(
        f"reference {entry.name}", error, entry.tolerance, error <= entry.tolerance, about
    )
