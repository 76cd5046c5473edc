"""Extreme cases: each is simulated as a user would, and its end is judged by a closed form or by a
solution of many digits.

The judge knows nothing of the run but its end: a case that drifts off, changes branch or loses its
digits is wrong however well its constraints and its energy look.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from codegen.integrators import INTEGRATORS
from codegen.runtime.simulation import Stopped
from derive.diagnostics import AssumptionError, HamelError, ModelError
from derive.expressions.evaluate import number
from derive.formulations import equations
from derive.formulations.charts import together
from derive.model.builder import Model as BuiltModel
from derive.model.motion.extremes import REAL
from derive.model.records import Extreme, Model
from derive.robots import File
from derive.robots.reading import load
from derive.states.initial import initial_state
from hamel.build.module import temporary_module
from hamel.build.stages import mechanics_of
from hamel.engines import HERE, PROCESSES, engine
from hamel.records import ExtremeRow, Simulated
from hamel.settings import settings
from hamel.simulate.compiled import Rows, simulation
from hamel.simulate.exact import Problem, solution, state_of
from hamel.simulate.exact.series import NotAnalytic
from hamel.simulate.method import Method
from hamel.study.limits import AGREES, DIGITS, LEAST_ERROR, MOST_OF_RADAU
from hamel.verify.checks import strange
from hamel.verify.reference.outcome import reference
from hamel.verify.suite import evidence

STIFF = {method.name for method in INTEGRATORS if method.adaptive and method.needs}


@dataclass(frozen=True)
class Ended:
    """Where a case has to end, by name, and who says so."""

    values: dict[str, float]
    by: str


def files(paths: Iterable[File]) -> Iterator[File]:
    """Models as they are, folders as the model files in them. Raises ModelError where there is
    none."""
    for path in paths:
        folder = None if isinstance(path, BuiltModel) else Path(path)
        if folder is None or not folder.is_dir():
            yield path
            continue
        models = sorted(folder.glob("*.yaml"))
        if not models:
            raise ModelError(f"{path} holds no model file")
        yield from models


def extremes_table(
    paths: Iterable[File],
    case: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[ExtremeRow, ...]:
    """Every case of the files (or the ones called `case`), run and judged."""
    rows = []
    for name, judge in judgements(paths, case):
        if progress is not None:
            progress(name)
        rows.append(judge())
    return tuple(rows)


def judgements(
    paths: Iterable[File], case: str | None = None
) -> Iterator[tuple[str, Callable[[], ExtremeRow]]]:
    """The name of every case (or of those called `case`), and a function that waits for its row, as
    `judged` gives or raises it. Several cases run side by side, in processes."""
    result = [
        (path, model.name, number, entry.name)
        for path in files(paths)
        for model in [load(path)]
        for number, entry in enumerate(model.extremes)
        if case in (None, entry.name)
    ]
    with engine(PROCESSES if len(result) > 1 else HERE) as by:
        futures = [by.executor.submit(judged_case, path, k) for path, _, k, _ in result]
        for (_, model, _, entry), future in zip(result, futures):
            yield f"{model}: {entry}", future.result


def judged_case(path: File, number: int) -> ExtremeRow:
    """The case of that number in a file."""
    model = load(path)
    return judged(path, model, model.extremes[number])


def judged(path: File, model: Model, entry: Extreme) -> ExtremeRow:
    """One case. An error of the model's file is no refusal and is raised."""
    if entry.spoiled:
        return _spoiled(model, entry)
    try:
        run = _run(path, entry)
    except HamelError as error:
        if not entry.refused and isinstance(error, ModelError):
            raise
        return _refused(model, entry, error.diagnostics[0].message)
    wanted = _reference(model, entry, _end(run))
    error = _error(model, run, wanted.values)
    good = error <= (np.inf if entry.tolerance is None else entry.tolerance)
    fewest, scipy = _steps(path, model, entry, wanted.values) if good else (None, None)
    return ExtremeRow(
        model=model.name,
        case=entry.name,
        about=entry.about,
        method=f"{run.choice}, {run.enforcement}, {run.integrator}{_precision(entry)}",
        outcome="survived" if good else "wrong",
        error=error,
        tolerance=entry.tolerance,
        status="",
        expected="refused" if entry.refused else "survived",
        passed=good
        and not entry.refused
        and not (fewest and scipy and fewest > MOST_OF_RADAU * scipy),
        judged_by=wanted.by,
        steps=run.steps,
        seconds=run.seconds,
        moved=max((abs(by["used"] - by["given"]) for by in run.moved.values()), default=0.0),
        constraints=max(run.position_violation, run.velocity_violation),
        energy=run.energy_balance,
        fewest=fewest,
        scipy=scipy,
    )


def _run(path: File, entry: Extreme) -> Simulated:
    named = (entry.choice or None, entry.enforcement or None)
    method = Method(
        "quasi_velocities", *named, entry.integrator, None, entry.rtol, None, real=entry.real
    )
    return simulation(path, method, Rows(entry.time, entry.time), dict(entry.values))


def _end(run: Simulated) -> float:
    """When the motion ended, in s: an event may have stopped it before its time."""
    return run.time if run.stopped_by is None else run.events[run.stopped_by][-1]


def _steps(
    path: File, model: Model, entry: Extreme, wanted: dict[str, float]
) -> tuple[int | None, int | None]:
    """Of a stiff case: how many steps the tolerance takes, and how many with SciPy's Radau."""
    if entry.integrator not in STIFF or entry.tolerance is None:
        return None, None
    ours, scipy = (
        _fewest(path, model, replace(entry, integrator=name), wanted)
        for name in (entry.integrator, "scipy_radau")
    )
    return ours, scipy


def _fewest(path: File, model: Model, entry: Extreme, wanted: dict[str, float]) -> int | None:
    for rtol in (10.0**-k for k in range(2, 13)):
        with suppress(HamelError), np.errstate(all="ignore"):
            best = _run(path, replace(entry, rtol=rtol))
            if _error(model, best, wanted) <= (entry.tolerance or 0.0):
                return best.steps
    return None


def _spoiled(model: Model, entry: Extreme) -> ExtremeRow:
    """Every argument of every function, in C and in NumPy, made strange: the graph's own result or
    a refusal."""
    chosen = equations(mechanics_of(model), entry.choice or None)
    with temporary_module(chosen, real=entry.real) as module:
        seen = evidence(reference(model), chosen, module, 1)
        said = Counter(
            each for backend in strange.backends(module) for each in strange.answers(seen, backend)
        )
    right, refused = said.pop(strange.RIGHT, 0), said.pop(strange.REFUSED, 0)
    wrong, good = said.total(), right > 0 and not said
    return ExtremeRow(
        model=model.name,
        case=entry.name,
        about=entry.about,
        method=f"{together(chosen)}{_precision(entry)}",
        outcome="survived" if good else "wrong",
        error=None,
        tolerance=None,
        status="; ".join(
            (
                f"{right + refused + wrong} calls: {right} right, {refused} refused, {wrong} wrong",
                *[*said][:1],
            )
        ),
        expected="survived",
        passed=good,
        judged_by="CasADi's graph",
        steps=0,
        seconds=0.0,
        moved=0.0,
        constraints=0.0,
        energy=0.0,
    )


def _refused(model: Model, entry: Extreme, status: str) -> ExtremeRow:
    method = f"{entry.choice or 'default'}, {entry.integrator}{_precision(entry)}"
    right = bool(entry.refused) and entry.refused in status
    expected = "refused" if entry.refused else "survived"
    judge = "what the file expects"
    names = (
        model.name,
        entry.name,
        entry.about,
        method,
        "refused",
        None,
        entry.tolerance,
        status,
        expected,
        right,
        judge,
    )
    return ExtremeRow(*names, 0, 0.0, 0.0, 0.0, 0.0)


def _precision(entry: Extreme) -> str:
    return "" if entry.real == REAL else f", {entry.real}"


def _reference(model: Model, entry: Extreme, time: float) -> Ended:
    """The closed form of the file, else a solution of many digits at `time`."""
    system = mechanics_of(model)
    given = settings(model, dict(entry.values))
    if entry.end:
        return Ended(
            {name: number(value, given.parameters) for name, value in entry.end}, "closed form"
        )
    p, u = tuple(given.parameters.values()), tuple(given.inputs.values())
    start, problem = initial_state(system, given.initial, np.array(p)), ""
    for choice in dict.fromkeys((entry.choice or None, *(choice.name for choice in model.choices))):
        try:
            plain = equations(system, choice)
            x = tuple(map(float, state_of(plain, start, np.array(p))))
            result = solution(Problem(plain, x, u, p, tuple(given.initial)), [time], DIGITS)
        except (AssumptionError, NotAnalytic, Stopped) as error:
            problem = str(error)
            continue
        if result.agreement <= AGREES:
            return Ended(
                {name: float(value) for name, value in result.at(0).items()},
                f"{result.steps} Taylor steps",
            )
        problem = f"accelerations differ by {result.agreement:.0e} from the independent derivation"
    raise ModelError(
        f"{model.name}, case {entry.name}: nothing to judge it by: {problem}; "
        "give it an end: in closed form"
    )


def _error(model: Model, found: Simulated, wanted: dict[str, float]) -> float:
    """The largest difference, in radians for angles, else relative to the largest value of the same
    unit at the end. Where an event stops a motion a length or a velocity may be zero by that: then
    the start counts, too, and such a length in the time that the motion took."""
    units = {item.name: item.unit for item in (*model.coordinates, *model.velocities)}
    scales = {"rad": 1.0}
    for name, value in wanted.items():
        start = found.motion[name][0] if found.stopped_by else 0.0
        scales[units[name]] = max(scales.get(units[name], 0.0), abs(value), abs(start))
    for unit in [unit for unit in scales if found.stopped_by and f"{unit}/s" in scales]:
        scales[f"{unit}/s"] = max(scales[f"{unit}/s"], scales[unit] / (_end(found) or 1.0))
    pairs = _turned(model, found, wanted)
    errors = [
        abs(found.final[name] - value) / (scales[units[name]] or 1.0) for name, value in pairs
    ]
    return (
        max(float(np.max(errors, initial=0.0)), LEAST_ERROR)
        if np.isfinite(errors).all()
        else float("inf")
    )


def _turned(
    model: Model, found: Simulated, wanted: dict[str, float]
) -> Sequence[tuple[str, float]]:
    """A quaternion and its negative are the same."""
    signs = dict.fromkeys(wanted, 1.0)
    for name in wanted:
        if name.endswith("_qw"):
            four = [part for part in (f"{name[:-1]}{axis}" for axis in "wxyz") if part in wanted]
            sign = np.sign(sum(found.final[part] * wanted[part] for part in four)) or 1.0
            signs |= dict.fromkeys(four, float(sign))
    return [(name, signs[name] * value) for name, value in wanted.items()]
