"""The loop of steps in NumPy, for machines without a compiler: the same as in runtime_simulate.h,
with explicit integrators only.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._numpy_changes import (
    RESTART,
    enter_best,
    independence,
    is_based_anew,
    is_rescued,
    take_frame,
)
from ._numpy_guards import begin, is_passing, looked, passed, remember
from ._numpy_kinks import Landing, gone_on, is_blow, landing, way_across
from ._numpy_motion import Failed, Motion
from ._simulation import Status

WITHOUT_COMPILER = ("projection", "none")  # enforcements
LONGEST, SHORTEST = 5.0, 0.1  # factors between a step and the next
HESITANT = 1.15  # one by a singular position: much shorter steps would end there


@dataclass
class Course:
    """How far a call may go: output times, steps that are left, and the status of the last
    one that failed."""

    times: np.ndarray
    budget: int
    failed: int = 0


def advance(motion: Motion, times: np.ndarray, budget: int, out: Sequence[np.ndarray]) -> int:
    """Goes on to the output times for at most `budget` steps and writes the rows of Facts.rows.
    Returns a status; the state always is the last good one."""
    facts, state = motion.facts, motion.state
    enforcement = facts.enforcements[int(state["enforcement"])]
    if motion.method.tableau is None or enforcement not in WITHOUT_COMPILER:
        return Status.NO_METHOD
    take_frame(motion)
    motion.find_segment()
    with np.errstate(all="ignore"):
        try:
            status = _through(motion, Course(times, budget), dict(zip(facts.rows, out)))
        except Failed as failure:
            status = failure.status
        return _told(motion, status)


def _told(motion: Motion, status: int) -> int:
    """A status with more to say: whether the choice alone is singular where the motion stopped, or
    the constraints as well."""
    nullspace = motion.facts.nullspace
    if status not in (Status.SINGULAR, Status.SINGULAR_POSITION):
        return status
    if not np.isfinite(motion.state["x"]).all():
        return Status.NOT_FINITE
    if not nullspace:
        return status
    found, least = independence(motion, nullspace), motion.facts.limits.independent
    if found > least:
        return Status.SINGULAR_CHOICE
    return Status.SINGULAR_POSITION if found <= least else status


def _through(motion: Motion, course: Course, out: dict[str, np.ndarray]) -> int:
    """From each output time to the next."""
    motion.unwind()
    for done in range(int(motion.state["done"]), len(course.times)):
        status = _reach(motion, course, course.times[done])
        if status:
            return status
        try:
            _write(motion, done, out)
        except FloatingPointError:
            return Status.SINGULAR
        motion.state["done"] = done + 1
    return Status.OK


def _reach(motion: Motion, course: Course, time: Any) -> int:
    """Steps up to an output time. Raises Failed."""
    while motion.state["t"] < time:
        _make_ready(motion, course.times[-1])
        if motion.buffers is not None and not motion.buffers.has_room(0):
            return Status.FULL
        if course.budget <= 0:
            return Status.MORE
        course.budget -= 1
        status = _go(motion, course, motion.until(time))
        if status:
            return status
        motion.go_behind_knot()
    return Status.OK


def _make_ready(motion: Motion, end: Any) -> None:
    """The slope at the state, which at the start and with other inputs is not known."""
    state = motion.state
    if state["next_step"] == 0:
        _start(motion, end - state["t"])
    elif motion.facts.inputs and state["stale"]:
        motion.refresh()
    if motion.facts.inputs:
        state["stale"] = 0


def _go(motion: Motion, course: Course, end: Any) -> int:
    """One step; a status that ends the motion, or OK though it was not accepted. Raises Failed."""
    state, facts = motion.state, motion.facts
    left = end - state["t"]
    h = _next_size(motion, left)
    rounding = facts.limits.least_step * np.finfo(facts.real).eps * abs(state["t"])
    if h < left and h < max(rounding, 1e-30 * abs(course.times[-1])):
        return course.failed or Status.STEP_TOO_SMALL
    course.failed = _try(motion, end, h)
    if course.failed == Status.EVENT:
        return Status.EVENT
    if motion.callback is not None and motion.callback.error is not None:
        return Status.NO_INPUT
    return Status.OK


def _write(motion: Motion, done: int, out: dict[str, np.ndarray]) -> None:
    """The row of an output time. Raises FloatingPointError."""
    facts, state = motion.facts, motion.state
    x, charts = state["x"][:-1], facts.charts
    if charts:
        binding, at = facts.numpy(), (state["t"], x.copy(), motion.u, motion.p)
        out["v"][done] = getattr(binding, "velocity" + charts.SUFFIXES[motion.chart])(*at)
        x = charts.transform(binding, motion.chart, 0, *at)
        out["chart"][done] = motion.chart
    out["x"][done], out["work"][done] = x, state["x"][-1]
    if facts.turning:
        out["reduced"][done] = out["x"][done]
        out["x"][done] = motion.wound(out["x"][done])
    if facts.frame:
        out["frame"][done] = state["frame"]


# ---- the start


def _start(motion: Motion, span: Any) -> None:
    """Guards, frame, slope and the first step. Raises Failed."""
    state = motion.state
    if any(motion.facts.guards):
        begin(motion)
    is_based_anew(motion)
    at = state["t"]
    if motion.facts.lengths["kinks"]:  # a motion that begins at one goes on with what is behind it
        at = at + 64 * np.finfo(motion.facts.real).eps * max(abs(at), span)
    state["slope"] = motion.slope(at, state["x"])
    state["next_step"] = state["step_size"] or _first_step(motion, span)
    state["error"] = RESTART
    if motion.facts.lengths["kinks"]:
        state["landed"] = 0
    motion.watch_constraints()
    if motion.buffers is not None:
        motion.buffers.sign[0] = np.sign(motion.events(state["t"], state["x"]))


def _first_step(motion: Motion, span: Any) -> Any:
    """Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, II.4."""
    t, y, k = motion.state["t"], motion.state["x"], motion.state["slope"]
    size, speed = motion.norm(y, y, y), motion.norm(k, y, y)
    h = 1e-6 if size < 1e-5 or speed < 1e-5 else 0.01 * size / speed
    moves = 64 * np.finfo(motion.facts.real).eps * abs(t)  # time, where y passes zero, too
    h = min(max(h, moves), span)
    try:
        change = motion.slope(t + h, y + h * k) - k
    except Failed:
        return h
    bend = max(motion.norm(change, y, y) / h, speed)
    longest = max(1e-6, 1e-3 * h) if bend <= 1e-15 else (0.01 / bend) ** (1 / motion.method.order)
    return min(span, 100 * h, longest)


# ---- a step


@dataclass
class Trial:
    """A step of length h towards the time `goal`, which is its end where it is the `last` one;
    `guards`, z and slope there once it is made, `error` in units of the tolerance."""

    goal: Any
    h: Any
    last: bool
    error: Any = 0.0
    end: Any = None
    z: Any = None
    slope: Any = None
    guards: Any = None
    stops: bool = False
    blow: bool = False  # just behind the end
    passes: bool = False  # by a singular position
    landing: Landing | None = None  # where forces are in pieces


def _next_size(motion: Motion, left: Any) -> Any:
    state = motion.state
    whole = left * (1 - motion.facts.limits.whole)  # no rounding decides about a step
    if state["step_size"]:
        return left / max(1.0, np.ceil(whole / state["step_size"]))
    h = state["next_step"]
    if h >= whole:
        return left
    return 0.5 * left if h > 0.5 * whole else h


def _try(motion: Motion, time: Any, h: Any) -> int:
    """One step towards a time, accepted or not; the status of a step that failed. Raises Failed."""
    state = motion.state
    t, left = state["t"], time - state["t"]
    trial = Trial(time, h, bool(h >= left))
    if motion.facts.is_narrow and not trial.last:
        trial.h = (t + h) - t  # what time moves by: its last digit may be no small part of h
    trial.passes = motion.passing = is_passing(motion, trial.h)
    try:
        _make(motion, trial)
    except Failed as failure:
        motion.passing = False
        return _failed(motion, trial, failure)
    motion.passing = False
    if not trial.error <= 1:
        return _reject(motion, trial, 0)
    return _accept(motion, trial)


def _make(motion: Motion, trial: Trial) -> None:
    """The step, what the enforcement does with it, and whether it may be believed. Raises
    Failed."""
    state, guarded = motion.state, any(motion.facts.guards)
    t, h = state["t"], trial.h
    trial.end = trial.goal if trial.last else t + h
    step, z, error = motion.stepped(t, h, state["x"], state["slope"].copy())
    if motion.facts.lengths["kinks"]:
        trial.landing = landing(motion, step, z, error)
        if trial.landing.step is not step:
            step, z, error = trial.landing.step, trial.landing.z, trial.landing.error
            trial.h, trial.end = step.h, trial.landing.end
            # before a kink what was wanted is the size of the next one; else this one says it
            trial.last = trial.landing.number > 0
    trial.error = 0.0 if state["step_size"] else error
    if not trial.error <= 1:
        return
    trial.z, trial.slope = motion.settled(trial.end, z, step.stages[-1])
    if guarded:
        trial.guards = passed(motion, step, trial.end, trial.z, trial.slope)
    stop = motion.event_inside(step, trial.z, trial.slope) if motion.buffers else None
    if stop is not None:
        trial.stops, (trial.end, trial.z, trial.slope) = True, stop
        if guarded:
            trial.guards, _ = looked(motion, trial.end, trial.end - t, trial.z)
    else:
        _go_across(motion, trial)
        if guarded and trial.stops:
            trial.guards, _ = looked(motion, trial.end, trial.end - t, trial.z)


def _go_across(motion: Motion, trial: Trial) -> None:
    """Behind the kink that the step ends before, or to an event on the way that stops the motion.
    Raises Failed."""
    before = trial.landing
    if before is None or not before.number:
        return
    before.z, before.step.stages[-1] = trial.z, trial.slope  # as the enforcement left them
    trial.blow = is_blow(motion, before)
    if trial.blow:
        return
    h, later = way_across(motion, before, trial.goal)
    if not h > 0:
        return
    stop = motion.event_across(before.end, h, before.carried) if motion.buffers else None
    if stop is not None:
        trial.stops, h, later = True, stop, 0.0
    trial.end, trial.z, trial.slope = gone_on(motion, before, h, later)
    trial.h = trial.end - motion.state["t"]


def _failed(motion: Motion, trial: Trial, failure: Failed) -> int:
    """Other coordinates, or a shorter step. Raises Failed where neither helps."""
    state = motion.state
    if failure.status == Status.NO_EVENT:
        raise failure
    if is_based_anew(motion, motion.facts.limits.nearly_based) or is_rescued(motion):
        state["rejected"] += 1
        return Status.OK
    if state["step_size"]:
        raise failure
    return _reject(motion, trial, failure.status)


def _reject(motion: Motion, trial: Trial, status: int) -> int:
    state, tableau = motion.state, motion.tableau
    factor = 4.0 if status else trial.error**tableau.grow / tableau.safety
    most = HESITANT if trial.passes else LONGEST
    state["next_step"] = trial.h / (factor if factor < most else most)
    state["rejected"] += 1
    state["error"] = -abs(state["error"])
    return status


def _accept(motion: Motion, trial: Trial) -> int:
    state = motion.state
    if not state["step_size"]:
        _control(motion, trial)
    if any(motion.facts.guards):
        remember(motion, trial.h, trial.guards)
    state["steps"] += 1
    state["t"] = trial.end
    state["x"], state["slope"] = trial.z, trial.slope
    motion.unwind()
    motion.watch_constraints()
    is_based_anew(motion)
    enter_best(motion)
    if motion.facts.lengths["kinks"]:
        _land(motion, trial)
    if trial.blow:
        raise Failed(Status.JUMP)
    return Status.EVENT if trial.stops else Status.OK


def _land(motion: Motion, trial: Trial) -> None:
    """Behind a kink the size of the next step is another one."""
    state = motion.state
    state["landed"] = trial.landing.number if trial.landing and not trial.stops else 0
    if not state["landed"]:
        return
    state["landings"] += 1
    if not state["step_size"]:
        state["next_step"] = _first_step(motion, state["next_step"])


def _control(motion: Motion, trial: Trial) -> None:
    """The size of the next step: proportional–integral, as Hairer & Wanner have it in II, IV.2."""
    state, tableau = motion.state, motion.tableau
    factor = trial.error**tableau.grow / abs(state["error"]) ** tableau.damp / tableau.safety
    factor = max(1.0 if state["error"] < 0 else SHORTEST, min(LONGEST, factor))
    if not trial.last or trial.h / factor > state["next_step"]:
        state["next_step"] = trial.h / factor
    state["error"] = max(trial.error, RESTART)
