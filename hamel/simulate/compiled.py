"""A simulation: the module of a model is built, integrated from the consistent initial state, and
what it says of itself becomes a record."""

from __future__ import annotations

import contextlib
import functools
import math
import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from os import PathLike
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from codegen.integrators import AUTO, AUTOMATIC
from codegen.passes.taylor import SERIES
from codegen.reals import real_of
from derive.choices.redundancy import check_repeated, dependent_rows
from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError, HamelError, ModelError, VerificationError
from derive.enforcement import Enforcement, Options, kept_equations, usual_rate
from derive.formulations import equations
from derive.formulations.charts import charted
from derive.formulations.frames import based
from derive.formulations.limits import TOO_DENSE
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.model.kinks import pieces
from derive.robots.reading import load
from derive.states.closing import Kinematics
from derive.states.initial import Initial, initial_state
from hamel import charts
from hamel.build.assurance import assure
from hamel.build.clock import Clock
from hamel.build.files import write_text
from hamel.build.module import promised_module
from hamel.build.stages import mechanics_of
from hamel.records import Simulated
from hamel.settings import settings
from hamel.simulate import motion, stiffness
from hamel.simulate.automatic import explicit, picked
from hamel.simulate.exact import state_of
from hamel.simulate.files import check_page, writers
from hamel.simulate.inputs import Changes, Changing, changes
from hamel.simulate.kinks import warn_of_blows
from hamel.simulate.limits import LOOKS, MOST_ROWS, ROWS
from hamel.simulate.method import (
    Method,
    check_changes,
    check_events,
    check_method,
    check_numbers,
    check_options,
    check_positive,
    fitting_enforcement,
    own_integrator,
    tolerances,
)
from hamel.simulate.record import Source, simulated
from hamel.simulate.view import page, picture

# what a motion and its judgement call, beside what enforcement and integrator need
CALLED = ("dynamics", "constraints", "energy", "power", "velocity", "state", "outputs")

Progress = Callable[[float], None]


OFF_SERIES = "the motion could not go on along its series"
SINGULAR_START = (
    "another start: this one is a singular configuration, from which the mechanism may go on in "
    "more than one way, in any choice of quasi-velocities"
)


@dataclass(frozen=True)
class Rows:
    """The times of the output: start, start + step … and `time` itself, in seconds; about 500 rows
    when `step` is None."""

    time: float
    step: float | None = None
    start: float = 0.0


@dataclass(frozen=True)
class Feed:
    """Inputs that change as they were asked for, and when a function is asked; events beside those
    of the model."""

    inputs: Changing | None = None
    sample: Any = None
    events: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Places:
    """Files that the motion is written to, drawn in, and shown moving in."""

    out: str | Path | None = None
    plot: str | Path | None = None
    view: str | Path | None = None


@dataclass(frozen=True)
class Problem:
    """A model with its consistent initial state at time t, inputs u, what changes them, and
    parameters p; `plain` has no enforcement, `options` are those of the enforcement."""

    system: System
    initial: Initial
    u: np.ndarray
    p: np.ndarray
    plain: Equations
    enforcement: Enforcement
    options: Options
    t: float
    changes: Changes
    events: Mapping[str, Any]

    def equations(self, choice: str | None) -> Equations:
        """With the enforcement, in a choice of quasi-velocities."""
        formulation = self.plain.formulation
        return kept_equations(self.system, choice, formulation, self.enforcement, self.options)


def simulation(
    path: str | PathLike[str],
    method: Method,
    rows: Rows,
    values: Mapping[str, float | str],
    places: Places = Places(),
    progress: Progress | None = None,
    feed: Feed = Feed(),
) -> Simulated:
    """Integrate from the consistent initial state, with steps as `method` says; where the choice
    fails on the way the other choices of the file take over.

    Raises ModelError where what is asked for cannot be, AssumptionError where it does not fit the
    model or the motion cannot go on.
    """
    automatic = method.integrator == AUTO
    if automatic:  # one that fits everything, until the equations are there
        method = replace(method, integrator=AUTOMATIC[0])
    check_method(method)
    times = _times(rows, method.step_size)
    writing = writers(places.out, places.plot)
    check_page(places.view)
    problem = problem_of(path, method, rows, values, feed)
    if automatic:
        method = replace(method, integrator=_picked(problem, method))
    why = ""
    try:
        record = _integrated(problem, method, times, progress, automatic)
    except stiffness.Stiff as stiff:
        why, method = str(stiff), replace(method, integrator=stiffness.IMPLICIT)
        record = _integrated(problem, method, times, progress)
    except motion.Final:
        raise
    except AssumptionError:
        if not automatic or method.integrator != SERIES:
            raise
        why, method = OFF_SERIES, replace(method, integrator=explicit(method))
        record = _integrated(problem, method, times, progress)
    for write in writing:
        write(record)
    if places.view:
        show = picture if Path(places.view).suffix.lower() == ".svg" else page
        write_text(Path(places.view), show(problem.system, record, problem.p))
    return replace(
        record,
        file=Path(places.out) if places.out else None,
        plot=Path(places.plot) if places.plot else None,
        view=Path(places.view) if places.view else None,
        automatic=automatic,
        why=why,
    )


def _picked(problem: Problem, method: Method) -> str:
    """The integrator of `auto`."""
    changes = problem.changes
    called = changes.function is not None and changes.sample is None
    whole = not called and not pieces(problem.system.model)
    smooth = problem.enforcement.level != "stages" and whole
    return picked(method, problem.equations(method.choice), smooth)


def problem_of(
    path: str | PathLike[str],
    method: Method,
    rows: Rows,
    values: Mapping[str, float | str],
    feed: Feed,
) -> Problem:
    real = real_of(method.real)
    finest, _ = tolerances(method, real)
    if method.rtol < finest:
        said = f"rtol {method.rtol:g} is finer than {real.name} can hold: {finest:.2g} is used"
        warnings.warn(said, RuntimeWarning, stacklevel=3)
    clock = Clock()
    with clock("mechanics", "file → System"):
        system = mechanics_of(load(path))
    warn_of_blows(method, system.model)
    given = settings(system.model, values)
    u, p = np.array([*given.inputs.values()]), np.array([*given.parameters.values()])
    t = rows.start
    changing = changes(system.model, feed.inputs, feed.sample, (t, rows.time))
    check_changes(method, changing, values)
    check_events(method, system.model, feed.events or {})
    with clock("start", "initial values → consistent state"):
        initial = initial_state(system, given.initial, p, t)
    with clock("formulation", "System → Equations"):
        plain = equations(system, method.choice, method.formulation)
        check_start(plain, initial, p, t)
    enforcement = fitting_enforcement(method, plain)
    check_options(method, enforcement)
    x = state_of(plain, initial, p, t)
    check_numbers(real, system, x, u, p)
    alpha = method.alpha
    if alpha is None and enforcement.level == "rates":
        alpha = usual_rate(plain, t, x, u, p, rows.time - t)
    active = np.ones_like(u) if changing else u  # an enforcement by energy asks whether any acts
    options = Options(alpha, method.conserve, tuple(active), tuple(p))
    return Problem(
        system, initial, u, p, plain, enforcement, options, t, changing, feed.events or {}
    )


def check_start(plain: Equations, initial: Initial, p: np.ndarray, t: float) -> None:
    """Raises AssumptionError where rows that were dropped, as the file's parameters make them
    repeat others, do not with these p: at single positions such a loop closes, and goes nowhere."""
    system = plain.system
    if len(plain.kept) == len(system.rows) or np.array_equal(p, system.own_parameters):
        return
    A = Kinematics(system).velocities(t, initial.q, np.append(p, initial.z))[0]
    if np.isfinite(A).all():
        check_repeated(system, A, plain.kept)


def _integrated(
    problem: Problem,
    method: Method,
    times: np.ndarray,
    progress: Progress | None,
    automatic: bool = False,
) -> Simulated:
    """The motion in the choice, or in charts of all choices where that one comes to a singular
    position.

    Raises Stiff where the integrator was picked and turns out to be the wrong one.
    """
    chosen = problem.equations(method.choice)
    either = (partitions, others) if own_integrator(method) else ()
    ways = (found for way in either if (found := way(problem, chosen)))
    more = functools.cache(lambda: next(ways, []))
    try:
        return _motion(problem, chosen, method, times, progress, automatic, more)
    except motion.Final:
        raise
    except VerificationError as error:
        raise _explained(error, problem) from None
    except AssumptionError as error:
        if not more():
            raise _explained(error, problem) from None
        last: HamelError = error
    for further in chain([more()], ways):
        several = charted([chosen, *further], survey_of(problem.system))
        try:
            return _motion(problem, several, method, times, progress, automatic)
        except motion.Final as final:
            raise _explained(final, problem) from None
        except (AssumptionError, VerificationError) as end:
            last = end  # where all charts together come to an end
    raise _explained(last, problem) from None


def _motion(
    problem: Problem,
    by: Equations,
    method: Method,
    times: np.ndarray,
    progress: Progress | None,
    automatic: bool,
    more: Callable[[], list[Equations]] = list,
) -> Simulated:
    """Built as a module that is dropped afterwards, and integrated.

    What the module has to agree with is worked out while the compiler is at work, and nothing is
    told before it agrees. The motion comes in between: where it fails and there are `more` choices
    to go on with, this module need not be right.
    """
    enforcement = problem.enforcement.name
    used = replace(method, enforcement=enforcement, alpha=problem.options.alpha)
    integrators = (method.integrator,) if own_integrator(method) else ()
    functions = _functions(by, method)
    clock = Clock()
    with contextlib.ExitStack() as stack:
        with clock("module", "Equations → texts of a module"):
            building = promised_module(by, integrators, (enforcement,), functions, method.real)
            promised = stack.enter_context(building)

        @functools.cache
        def tried() -> _Trial:
            with clock("compile", "texts → binaries, waited for"):
                module = promised()
            with clock("integrate", "start → motion"):
                return _trial(problem, by, used, module, times, progress, automatic)

        def module() -> ModuleType:
            trial = tried()
            if trial.failure and more():
                raise trial.failure
            return trial.module

        with clock("verify", "module → verified, or known to be"):
            assure(problem.plain, by, module, method.real, functions)
        trial = tried()
        if trial.simulation is None:
            raise trial.failure or AssertionError
        source = Source(trial.equations, trial.module, problem.u, trial.p, used, problem.initial)
        return simulated(source, trial.simulation, trial.seconds)


@dataclass(frozen=True)
class _Trial:
    """A motion by a module, or why it could not go on; the equations that its state belongs to, and
    its parameters."""

    module: ModuleType
    equations: Equations
    p: np.ndarray
    simulation: motion.Simulation | None
    failure: AssumptionError | None
    seconds: float


def _trial(
    problem: Problem,
    by: Equations,
    method: Method,
    module: ModuleType,
    times: np.ndarray,
    progress: Progress | None,
    automatic: bool,
) -> _Trial:
    """From the consistent start. Raises Stiff where an integrator that was picked is the wrong one,
    Final where a function of the user fails."""
    u, p, initial = problem.u, problem.p, problem.initial
    accuracy = tolerances(method, real_of(method.real))
    enforced = problem.enforcement.name
    stepping = motion.Stepping(method.integrator, enforced, method.step_size, *accuracy)
    seen = by if own_integrator(method) else based(by)
    if by.charts or by.frame:
        try:
            x, chart, p = charts.start(module, initial, u, p, problem.t)
        except FloatingPointError as error:
            raise AssumptionError(str(error), SINGULAR_START) from None
    else:
        x, chart = state_of(problem.plain, initial, p, problem.t), 0
    start = motion.Start(times, x, u, p, chart, problem.changes, problem.events)
    # who asks a function twice may get two answers
    looking = automatic and method.step_size is None and problem.changes.function is None
    begin = time.perf_counter()
    simulation, failure = None, None
    try:
        simulation = _course_of(module, seen, start, stepping, progress, looking)
    except motion.Final:
        raise
    except AssumptionError as error:
        failure = error
    return _Trial(module, seen, p, simulation, failure, time.perf_counter() - begin)


def _course_of(
    module: ModuleType,
    seen: Equations,
    start: motion.Start,
    stepping: motion.Stepping,
    progress: Progress | None,
    looking: bool,
) -> motion.Simulation:
    """The motion; `looking` whether it is stiff where it takes many steps."""
    for most in LOOKS if looking else ():
        try:
            return motion.integrated(module, seen, start, stepping, progress, most)
        except motion.Unfinished as far:
            if why := stiffness.reason(module, start, far):
                raise stiffness.Stiff(why) from None
    return motion.integrated(module, seen, start, stepping, progress)


def _functions(by: Equations, method: Method) -> tuple[str, ...] | None:
    """The functions that a motion calls; all of them where a library integrates."""
    if not own_integrator(method):
        return None
    return tuple(function.name for function in by.functions if function.name in CALLED)


def _explained(error: HamelError, problem: Problem) -> HamelError:
    """The error, or what is behind it: constraint rows that depend on each other at the start and
    with these parameters. From there states on several branches are verified, and no choice need
    be right on all of them."""
    system = problem.system
    if not system.rows:
        return error
    survey = survey_of(system)
    A = survey.solver.velocities(
        problem.t, problem.initial.q, np.append(problem.p, problem.initial.z)
    )[0]
    repeats = dependent_rows(system, A, survey.kept, survey.sizes) if np.isfinite(A).all() else ""
    if not repeats:
        return error
    if np.array_equal(problem.p, system.own_parameters):
        start, hint = "at the start", SINGULAR_START
    else:
        start = "at the start, with these parameters"
        hint = "another start, or these values in the file: what repeats is found and dropped there"
    why = error.diagnostics[0].message
    if isinstance(error, VerificationError):
        why = "no motion from it is determined"
    return AssumptionError(f"{system.model.name}: {start}, {repeats}: {why}", hint)


def partitions(problem: Problem, chosen: Equations) -> list[Equations]:
    """Of many quasi-velocities, whose orthonormal choice takes many times the operations: the
    partitions that a module of the same choice gets as further charts."""
    system = problem.system
    first = chosen.choice == system.model.choices[0].name and len(chosen.w) > TOO_DENSE
    if not system.rows or chosen.generalized_velocities or chosen.charts or not first:
        return []
    formulation = problem.plain.formulation
    further = equations(system, None, formulation, charts=True, moving=True).charts
    return [problem.equations(chart.choice) for chart in further]


def others(problem: Problem, equations: Equations) -> list[Equations]:
    """Other choices that can take over where the chosen one is singular."""
    system = problem.system
    alone = equations.generalized_velocities or equations.charts
    if alone or not (system.rows or equations.pivots):
        return []
    names = dict.fromkeys((*(choice.name for choice in system.model.choices), "orthonormal"))
    found = []
    for name in names:
        if name != equations.choice:
            with contextlib.suppress(AssumptionError):
                found.append(problem.equations(name))
    return found


def _times(rows: Rows, step_size: float | None) -> np.ndarray:
    """The start, a step later, two … and the last time itself. Rows do not shorten equal steps
    unless asked for."""
    if not math.isfinite(rows.start):
        raise ModelError(f"start is {rows.start}, which is not a finite number")
    if math.isfinite(rows.time) and not rows.time > rows.start:
        raise ModelError(f"time is {rows.time:g}, which is not after the start, {rows.start:g}")
    time, step = rows.time - rows.start, rows.step
    check_positive("time", time)
    usual = time / ROWS if step_size is None else math.ceil(time / ROWS / step_size) * step_size
    step = usual if step is None else step
    check_positive("step", step)
    if time / step > MOST_ROWS:
        raise ModelError(f"a step of {step:g} s makes more than {MOST_ROWS} rows in {time:g} s")
    count = math.floor(time / step * (1 + 1e-12))
    inner = np.arange(count + 1) * step
    return np.append(rows.start + inner[inner < time * (1 - 1e-12)], rows.time)
