"""From what was asked for to jobs: a verified module for every method, and all that is the same for
its motions. What is wrong is said here, before anything runs."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any

import numpy as np

import hamel
from codegen.integrators import AUTO
from codegen.reals import real_of
from derive.diagnostics import AssumptionError, ModelError, did_you_mean, listed
from derive.expressions.limits import objection
from derive.formulations.frames import based
from derive.formulations.records import Equations
from derive.linearize.steady import motion_of
from derive.linearize.study import study
from derive.mechanics.records import System
from derive.model.records import Model, SteadyMotion
from derive.model.rows import components, is_reaction
from derive.robots.reading import load
from derive.states.many import least_of_bodies, starter
from hamel.build.assurance import assure
from hamel.build.stages import mechanics_of
from hamel.build.store import digest
from hamel.settings import parsed, settings, units
from hamel.simulate.compiled import Feed, Problem, Rows, problem_of
from hamel.simulate.measures import measures
from hamel.simulate.method import Method, check_method, own_integrator, tolerances
from hamel.simulate.motion import Stepping
from hamel.sweep.artefact import Artefact, packed
from hamel.sweep.axes import METHODS, Design, Sampling, design
from hamel.sweep.job import Job, Modes, Motions
from hamel.sweep.kept import Kept, Names, kept, told_apart
from hamel.sweep.limits import MOST_METHODS, ROWS, WORTH
from hamel.sweep.linear import equations_in
from hamel.sweep.modes import in_lanes

MOTIONS, POINTS = 1024, 16_384  # of a chunk: motions, and eigenvalues without motions


@dataclass(frozen=True)
class Asked:
    """A sweep as it was asked for. `vary`, `files`, `keep`: see axes.py and kept.py; `at` is a
    steady motion."""

    vary: Mapping[str, Any]
    files: Sequence[str]
    keep: Sequence[str]
    sampling: Sampling
    method: Method
    rows: Rows
    values: Mapping[str, float | str] = field(default_factory=dict)
    inputs: Mapping[str, Any] = field(default_factory=dict)
    at: str | None = None
    reduce: bool = False
    chunk: int | None = None


@dataclass(frozen=True)
class Plan:
    """A sweep that can be run: `about` says what it is, and is the same for the same sweep."""

    model: Model
    asked: Asked
    design: Design
    kept: tuple[Kept, ...]
    chunk: int
    jobs: tuple[Job, ...]
    about: Mapping[str, Any]
    units: Mapping[str, str]

    @property
    def chunks(self) -> int:
        """How many, of all methods."""
        return len(self.jobs) * self.per_job

    @property
    def per_job(self) -> int:
        """Chunks of one method."""
        return -(-self.design.per_method // self.chunk)


def planned(path: str | PathLike[str], asked: Asked) -> Plan:
    """The plan, its modules built and verified. Raises ModelError for what cannot be, and whatever
    a build raises."""
    model = load(path)
    system = mechanics_of(model)
    of_modes = _is_of_modes(asked.keep)
    known = _names(system)
    columns = kept(asked.keep, known)
    if not columns:
        raise ModelError("nothing is kept", "a name or formula, such as --keep state")
    result = design(asked.vary, asked.files, asked.sampling, _values(path, system, asked, of_modes))
    _check_names(system, asked, result, of_modes)
    columns = told_apart(columns, (*result.taken, *result.names))
    chunk = (POINTS if of_modes else MOTIONS) if asked.chunk is None else asked.chunk
    if chunk < 1 or chunk != int(chunk):
        raise ModelError(f"chunks of {chunk} motions", "a whole number, one or more")
    count = math.prod(axis.size for axis in result.methods)
    if count > MOST_METHODS:
        raise ModelError(f"{count} methods are swept over", f"at most {MOST_METHODS}")
    jobs = []
    for number in range(count):
        method = _method(asked.method, result.method(number))
        if of_modes:
            work: Motions | Modes = _modes(model, asked, result, method)
        else:
            work = _motions(path, asked, method, result, columns, known)
        rows = not asked.reduce
        jobs.append(Job(hamel.__version__, result, number, columns, chunk, rows, work))
    every = {**known.units, **units(model)}
    return Plan(
        model,
        asked,
        result,
        columns,
        chunk,
        tuple(jobs),
        _about(model, asked, result, chunk),
        every,
    )


def _is_of_modes(keep: Sequence[str]) -> bool:
    last = [text.rpartition("=")[2].strip() for text in keep]
    return any(name in ("growth", "frequency") for name in last)


def _about(model: Model, asked: Asked, made: Design, chunk: int) -> dict[str, Any]:
    """All that the numbers depend on."""
    method = {name: value for name, value in vars(asked.method).items() if name not in made.methods}
    return {
        "hamel": hamel.__version__,
        "model": model.name,
        "text": digest(model.text),
        "vary": made.about(),
        "keep": list(asked.keep),
        "method": {name: str(value) for name, value in method.items()},
        "set": {name: str(value) for name, value in sorted(asked.values.items())},
        "inputs": {name: digest(repr(value)) for name, value in sorted(asked.inputs.items())},
        "time": [asked.rows.start, asked.rows.time, asked.rows.step],
        "at": asked.at,
        "reduce": asked.reduce,
        "chunk": chunk,
        "motions": made.size,
    }


# ---- names


def _names(system: System) -> Names:
    """What formulas of kept columns may use."""
    model = system.model
    known = units(model)
    outputs: dict[str, str] = {}
    letters = model.plane or "xyz"
    for output in model.outputs:
        for name in components(output.name, output.expression, letters):
            outputs[name] = output.unit
    called = measures(model)
    energies = {called[name]: "J" for name in ("T", "V", "work")}
    starts = {x.name for x in model.speeds}  # declared quasi-velocities: only where motions begin
    known = {name: unit for name, unit in known.items() if name not in starts}
    every = {**known, **outputs, **energies, "t": "s"}
    moving = (*model.coordinates, *model.velocities, *model.states)
    states = tuple(item.name for item in moving)
    reactions = tuple(x.name for x in model.outputs if is_reaction(x.expression))
    events = tuple(event.name for event in model.events)
    return Names(every, states, (called["T"], called["V"]), events, reactions)


def _values(path: str | PathLike[str], system: System, asked: Asked, of_modes: bool) -> Any:
    """(name, text) → number in SI, for what may vary."""
    model = system.model
    known = units(model)
    parameters = settings(model, _own(model, asked.values)).parameters
    free = (
        motion_of(equations_in(system, asked.method.choice), asked.at).sweepable if of_modes else ()
    )

    def value(name: str, text: str) -> float:
        if name not in known and name not in free:
            names = [*known, *METHODS, *free]
            near = did_you_mean(name, names) or f"it has {listed(names)}"
            raise ModelError(f"'{name}' is to vary, but {model.name} has no such value; {near}")
        return parsed(name, text, known.get(name), parameters)

    return value


def _own(model: Model, values: Mapping[str, float | str]) -> dict[str, float | str]:
    """What is set of the model itself; the rest are free names of a steady motion."""
    known = units(model)
    return {name: value for name, value in values.items() if "".join(name.split()) in known}


def _check_names(system: System, asked: Asked, made: Design, of_modes: bool) -> None:
    """Refuse names that are none, and ends of ranges that no model can have."""
    model = system.model
    known = units(model)
    parameters = {p.name for p in model.parameters}
    for name in made.names:
        if name not in known and not of_modes:
            near = did_you_mean(name, [*known, *METHODS]) or f"it has {listed(known)}"
            raise ModelError(f"'{name}' is to vary, but {model.name} has no such value; {near}")
        _check_free(name, asked, made)
        if of_modes and name in known and name not in parameters:
            free = motion_of(equations_in(system, None), asked.at).sweepable
            if name not in free:
                raise ModelError(
                    f"'{name}' is to vary, but is no parameter and not free in the steady motion",
                    f"known: {listed((*free, *parameters))}",
                )
    if made.kind == "saltelli":
        _check_indices(asked, made)
    for grid in made.grids:
        for end in {min(grid.values), max(grid.values)}:
            if problem := objection(end):
                raise ModelError(f"{grid.name} varies to {end:g}: {problem[0]}", problem[1])
    if asked.inputs and any(name in {i.name for i in model.inputs} for name in made.names):
        raise ModelError("inputs over time and inputs that vary do not go together")


def _check_free(name: str, asked: Asked, made: Design) -> None:
    """Nothing else has, or is called by, the name of what varies."""
    if name in made.taken:
        raise ModelError(
            f"'{name}' is to vary, but a column or an axis of every such sweep is called so",
            f"another name in the model; taken are {listed(made.taken)}",
        )
    if name in asked.values:
        raise ModelError(f"'{name}' is set, and is to vary")
    if name in asked.inputs:
        raise ModelError(f"'{name}' is an input over time, and is to vary")


def _check_indices(asked: Asked, made: Design) -> None:
    """Sobol indices are known of all rows of one design."""
    alone = made.distributions and made.size == made.samples
    if alone and not asked.reduce:
        return
    what = "--reduce keeps none" if alone else "grids, files or methods vary, too"
    raise ModelError(
        f"Sobol indices need all rows of what is drawn, and {what}",
        "another --design, or only distributions to vary and no --reduce",
    )


def _method(usual: Method, by: Mapping[str, Any]) -> Method:
    return replace(usual, **by)


# ---- jobs


def _modes(model: Model, asked: Asked, made: Design, method: Method) -> Modes:
    if any(axis.name != "choice" for axis in made.methods):
        raise ModelError("eigenvalues depend on no method but the choice of quasi-velocities")
    system = mechanics_of(model)
    equations = based(equations_in(system, method.choice))
    motion = motion_of(equations, asked.at)
    given = settings(model, _own(model, asked.values))
    values = {n: given.parameters[n] for n in asked.values if n in given.parameters}
    for name, text in asked.values.items():
        if name in motion.sweepable:
            values[name] = parsed(name, str(text), None, {})
        elif name not in values:
            raise ModelError(
                f"'{name}' is set, but is no parameter and not free in '{motion.name}'"
            )
    first = {name: float(column[0]) for name, column in made.values(0, 1).items()}
    bodies = least_of_bodies(system)
    at = _followed_from(equations, motion, values, first)
    work = Modes(model.text, model.file, method.choice, asked.at, at, bodies)
    return replace(work, artefact=in_lanes(work)) if made.per_method >= WORTH else work


def _followed_from(
    equations: Equations,
    motion: SteadyMotion,
    values: dict[str, float],
    first: dict[str, float],
) -> dict[str, float]:
    """The values whose motion the others are followed from: those of the file, whatever the order
    of a range; the first of each range where the file has none, or no motion is steady there."""
    missing = {name: x for name, x in first.items() if name in motion.sweepable}
    try:
        study(equations, motion, missing | values)
    except AssumptionError:
        return values | first
    return missing | values


def _motions(
    path: str | PathLike[str],
    asked: Asked,
    method: Method,
    made: Design,
    columns: tuple[Kept, ...],
    known: Names,
) -> Motions:
    method = _checked(method)
    first = {n: float(column[0]) for n, column in made.values(0, 1).items()}
    problem = _problem(path, asked, method, first)
    chosen = problem.equations(method.choice)
    if chosen.charts or chosen.frame:
        raise AssumptionError(
            f"{problem.system.model.name}: motions of a sweep go in one choice of "
            f"quasi-velocities, and '{chosen.choice}' is of several or changes on the way",
            "--choice with a name that `hamel choices` lists as a partition",
        )
    artefact = _artefact(problem, method)
    system, model = problem.system, problem.system.model
    initial = [n for n in made.names if n in units(model) and n not in _fixed_names(model)]
    held = _initial(model, asked)
    start = starter(system, (*initial, *held), asked.rows.start)
    accuracy = tolerances(method, real_of(method.real))
    name = problem.enforcement.name
    outputs = [
        part for output in model.outputs for part in _entries(output, model.plane or "xyz", system)
    ]
    return Motions(
        artefact,
        start,
        least_of_bodies(system),
        Stepping(method.integrator, name, method.step_size, *accuracy),
        _times(asked, columns, method),
        problem.u,
        problem.p,
        tuple(x.name for x in model.parameters),
        tuple(x.name for x in model.inputs),
        chosen.argument("x").labels,
        tuple(outputs),
        tuple(x.name for x in model.velocities),
        tuple(c.name for c in model.coordinates),
        held,
        measures(model),
        {n: (t.times, t.values, t.kind) for n, t in problem.changes.tables.items()},
        error=any(each.text == "error" and each.how == "counted" for each in columns),
    )


def _entries(output: Any, letters: str, system: System) -> list[str]:
    """The names of an output's entries in y; those of reactions cannot be named."""
    parts = components(output.name, output.expression, letters)
    if parts:
        return parts
    size = next(value.numel() for name, value, _ in system.outputs if name == output.name)
    return [f"{output.name}[{k}]" for k in range(size)]


def _fixed_names(model: Model) -> set[str]:
    return {x.name for x in (*model.parameters, *model.inputs)}


def _initial(model: Model, asked: Asked) -> dict[str, float]:
    """Initial values that are set for all motions."""
    return settings(model, asked.values).initial


def _checked(method: Method) -> Method:
    if method.integrator == AUTO:
        method = replace(method, integrator="verner9" if method.rtol <= 1e-7 else "dop853")
    check_method(method)
    if own_integrator(method) is None:
        raise ModelError(
            f"{method.integrator} is a library's solver, which makes one motion at a time",
            "an integrator of generated code: see `hamel list`",
        )
    return method


def _problem(
    path: str | PathLike[str], asked: Asked, method: Method, first: Mapping[str, float]
) -> Problem:
    """With the values of the first motion; where that cannot be assembled, those of the file."""
    feed = Feed(dict(asked.inputs) or None)
    with contextlib.suppress(ModelError):
        known = units(load(path))
        values = {**asked.values, **{n: v for n, v in first.items() if n in known}}
        return problem_of(path, method, asked.rows, values, feed)
    return problem_of(path, method, asked.rows, asked.values, feed)


def _artefact(problem: Problem, method: Method) -> Artefact:
    by = problem.equations(method.choice)
    enforcement = problem.enforcement.name
    with packed(by, (method.integrator,), (enforcement,), method.real) as (artefact, module):
        assure(problem.plain, by, lambda: module, method.real)
    return artefact


def _times(asked: Asked, columns: Sequence[Kept], method: Method) -> np.ndarray:
    """The start, the times that are asked for, the end; and rows between where something of the
    whole motion is kept."""
    start, end = asked.rows.start, asked.rows.time
    if not (math.isfinite(start) and math.isfinite(end) and end > start):
        raise ModelError(f"time is {end:g}, which is not after the start, {start:g}")
    times = {start, end}
    for each in columns:
        if each.time is not None:
            if not start <= each.time <= end:
                raise ModelError(f"'{each.text}' is kept at {each.time:g} s, outside the motion")
            times.add(each.time)
    if any(each.whole for each in columns):
        step = asked.rows.step or (end - start) / ROWS
        if not (step > 0 and (end - start) / step <= 10_000):
            raise ModelError(f"a step of {step:g} s makes too many rows", "at most 10000 a motion")
        times |= set((start + step * np.arange(1, math.ceil((end - start) / step))).tolist())
    return np.array(sorted(times))
