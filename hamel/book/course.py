"""The motion of a chapter: one module, from the model's initial state, and what its accuracy
costs."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from codegen.runtime.simulation import Simulation
from derive.choices.survey import survey_of
from derive.diagnostics import AssumptionError
from derive.formulations.charts import charted
from derive.formulations.records import Equations
from derive.robots import File
from hamel import charts
from hamel.book.limits import (
    LEAST,
    LIMIT,
    MOST_STEPS,
    ROWS,
    SHARE,
    SPANS,
    TIGHT,
    TOLERANCES,
)
from hamel.build.assurance import assure
from hamel.build.module import temporary_module
from hamel.draw import Series, chart
from hamel.records import Simulated
from hamel.simulate import motion
from hamel.simulate.compiled import CALLED, Feed, Problem, Rows, others, problem_of
from hamel.simulate.exact import state_of
from hamel.simulate.method import Method
from hamel.simulate.record import Source, simulated

METHODS = ("dop853", "dopri5", "radau")  # whose errors are drawn
CALLS = (*CALLED, "mass", "bias", "reactions")
METHOD = Method("quasi_velocities", None, None, METHODS[0], None, 1e-10, None)


class _TooLong(Exception):
    """A motion takes more than its time."""


@dataclass(frozen=True)
class Course:
    """A motion, its record, and how to make it again with other steps; `span` (s) is as long as
    it went on, which an event may have ended."""

    problem: Problem
    equations: Equations
    module: ModuleType
    start: motion.Start
    span: float
    record: Simulated

    def again(self, integrator: str, rtol: float) -> Simulation:
        """The same motion, whose only row is its end."""
        ends = self.start.times[[0, -1]]
        return _integrated(self, replace(self.start, times=ends), integrator, rtol)

    def value(self, name: str, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """A function of the module at the start, in the chart of the start. Raises
        FloatingPointError where it has none there."""
        plain = getattr(self.module, name)
        function = getattr(self.module, f"{name}_chart{self.start.chart}", plain)
        return np.asarray(function(0.0, self.x, u, p))

    @property
    def x(self) -> np.ndarray:
        """The state at the start."""
        return self.start.x


@contextlib.contextmanager
def course_of(path: File) -> Iterator[Course]:
    """The motion of a model file in its first choice, or in charts of all where that one comes to a
    singular position. Raises AssumptionError where neither goes on."""
    problem = problem_of(path, METHOD, Rows(SPANS[0]), {}, Feed())
    chosen = problem.equations(None)
    with contextlib.ExitStack() as stack:
        try:
            yield stack.enter_context(_made(problem, chosen))
            return
        except _Singular as singular:
            more = others(problem, chosen)
            if not more:
                raise AssumptionError(str(singular)) from None
        several = charted([chosen, *more], survey_of(problem.system))
        yield stack.enter_context(_made(problem, several))


class _Singular(Exception):
    """The motion cannot go on in these equations."""


@contextlib.contextmanager
def _made(problem: Problem, by: Equations) -> Iterator[Course]:
    names = tuple(function.name for function in by.functions if function.name in CALLS)
    enforcement = problem.enforcement.name
    with temporary_module(by, METHODS, (enforcement,), names) as module:
        assure(problem.plain, by, lambda: module)
        try:
            made = _first(problem, by, module)
        except AssumptionError as error:
            raise _Singular(str(error)) from None
        yield made


def _first(problem: Problem, by: Equations, module: ModuleType) -> Course:
    """The longest motion that does not take too long."""
    u, p, initial = problem.u, problem.p, problem.initial
    if by.charts or by.frame:
        x, chart_, p = charts.start(module, initial, u, p, problem.t)
    else:
        x, chart_ = state_of(problem.plain, initial, p, problem.t), 0
    for span in SPANS:
        times = np.linspace(0.0, span, ROWS + 1)
        start = motion.Start(times, x, u, p, chart_)
        try:
            simulation = _integrated_by(module, by, problem, start, METHODS[0], METHOD.rtol)
        except _TooLong:
            continue
        if simulation.steps > MOST_STEPS and span != SPANS[-1]:
            continue
        used = replace(METHOD, enforcement=problem.enforcement.name)
        source = Source(by, module, u, p, used, initial)
        record = simulated(source, simulation, 0.0)
        return Course(problem, by, module, start, record.time, record)
    raise AssumptionError(f"{SPANS[-1]:g} s of motion take longer than {LIMIT:g} s")


def _integrated(course: Course, start: motion.Start, integrator: str, rtol: float) -> Simulation:
    return _integrated_by(course.module, course.equations, course.problem, start, integrator, rtol)


def _integrated_by(
    module: ModuleType,
    by: Equations,
    problem: Problem,
    start: motion.Start,
    integrator: str,
    rtol: float,
) -> Simulation:
    stepping = motion.Stepping(integrator, problem.enforcement.name, None, rtol, rtol / 100)
    end = time.process_time() + LIMIT

    def watch(_: float) -> None:
        if time.process_time() > end:
            raise _TooLong

    return motion.integrated(module, by, start, stepping, watch)


# ---- what accuracy costs


@dataclass(frozen=True)
class Errors:
    """A chart (SVG) of the error at the end against run time, and what it was compared with."""

    figure: str
    doubt: float  # how far two tight runs are apart


def errors_of(course: Course) -> Errors | None:
    """Errors of coordinates at the end, against the least processor time of a run; None where no
    two tight runs come to the end."""
    count = course.problem.system.q.numel()
    try:
        first, second = (
            course.again(name, TIGHT * factor).x[-1, :count]
            for name, factor in zip(METHODS, (1.0, 3.0))
        )
    except (_TooLong, AssumptionError, motion.Unfinished):
        return None
    scale = max(1.0, float(np.max(np.abs(first))))
    series = [Series(name, _points(course, name, first, scale)) for name in METHODS]
    title = f"{course.record.model}: error at the end of {course.span:g} s"
    figure = chart(title, "run time (ms) →", "largest error of a coordinate", series)
    return Errors(figure, float(np.max(np.abs(first - second))) / scale)


def _points(
    course: Course, integrator: str, end: np.ndarray, scale: float
) -> Sequence[tuple[float, float]]:
    """Run time (ms) and error for every tolerance that is reached in time."""
    points = []
    for rtol in TOLERANCES:
        try:
            ms, made = _timed(course, integrator, rtol)
        except (_TooLong, AssumptionError, motion.Unfinished):
            break
        error = float(np.max(np.abs(made.x[-1, : end.size] - end))) / scale
        points.append((ms, max(error, LEAST)))
    return points


def _timed(course: Course, integrator: str, rtol: float) -> tuple[float, Simulation]:
    """The least milliseconds of as many runs as fit into their share."""
    least, spent = np.inf, 0.0
    while True:
        before = time.process_time()
        made = course.again(integrator, rtol)
        took = time.process_time() - before
        least, spent = min(least, took), spent + took
        if spent + took > SHARE:
            return max(1e3 * least, 1e-3), made
