"""One motion: from its start to its last output time, with inputs that are given or asked for.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .events import Buffers, Log, Watch
from .inputs import Callback, Feed, sample_times
from .model_facts import Facts
from .simulation import Events, Simulation, Status, Stopped

BUDGET = {  # steps between two looks at progress and interrupts
    "extension": 5000,
    "ctypes": 5000,
    "numpy": 50,
}
# A motion that is held at a jump of forces: of so many steps more than this part is rejected or
# ends at a kink, and all cover less than that part of the time. The whole would take 10¹⁰ steps.
LOOKED_AT, BROKEN, COVERED = 200_000, 0.1, 2e-5
Rows = dict[str, np.ndarray]


@dataclass(frozen=True)
class Backend:
    """What integrates: its name in BUDGET, advance() for one motion, and for many the module with
    simulate_batch(). The loop in Python takes inputs and events themselves."""

    name: str
    advance: Callable[..., int]
    batch: Any = None
    in_python: bool = False


@dataclass(frozen=True)
class Integration:
    """How motions are integrated, and what there is to say afterwards."""

    facts: Facts
    backend: Backend
    how: Mapping[str, Any]  # entries of a simulation at its start
    tolerances: tuple[float, float]
    max_steps: int
    progress: Any = None
    feed: Feed | None = None
    threads: int = 1
    watch: Watch | None = None
    remarks: list[str] = field(default_factory=list[str])

    @property
    def integrator(self) -> str:
        """Its name."""
        number: int = self.how["integrator"]
        return self.facts.integrators[number]

    def states(self, start: Any, x: Any, rows: int = 1) -> np.ndarray:
        """Simulations at their start."""
        states = np.zeros(rows, self.facts.state)
        for name, value in self.how.items():
            states[name] = value
        states["t"], states["x"][:, : self.facts.nx] = start, x
        return states

    def control(self, function: Any) -> Callback:
        """A function of the inputs, f(t, x), as it is called."""
        return Callback(function, self.facts.nx, len(self.facts.inputs), self.facts.real)


@dataclass
class Course:
    """A motion on its way: the simulation, its inputs and parameters, which one of many it is, and
    the room for what happens."""

    by: Integration
    state: np.ndarray
    u: np.ndarray
    p: np.ndarray
    row: int = 0
    buffers: Buffers | None = None
    place: int = 0  # of the buffer

    def __post_init__(self) -> None:
        if self.buffers is not None:
            structure = self.buffers.structures[self.place : self.place + 1]
            self.state["events"] = structure.ctypes.data

    @property
    def tried(self) -> int:
        """Steps, accepted or not."""
        return int(self.state["steps"][0] + self.state["rejected"][0])

    @property
    def time(self) -> float:
        return float(self.state["t"][0])

    def go(self, times: np.ndarray, budget: int, out: Rows) -> Status:
        """Goes on to the times, for at most `budget` steps."""
        by, further = self.by, {}
        if by.backend.in_python:
            further = {"fed": by.feed and by.feed.of(self.row), "buffers": self.buffers}
        given = (self.state, times, self.u, self.p, *by.tolerances, budget)
        return Status(by.backend.advance(*given, *out.values(), **further))

    @property
    def reached(self) -> tuple[int, int, float]:
        """Steps, those that were rejected or end at a kink, and the time."""
        broken = self.state["rejected"][0] + self.state["landings"][0]
        return self.tried, int(broken), self.time

    def here(self) -> Rows:
        """The row of where it is."""
        row = self.by.facts.rows_to_come(1)
        self.state["done"] = 0
        self.go(self.state["t"].copy(), 1, row)
        return row


class Single:
    """A motion alone, and what happened on it."""

    def __init__(self, by: Integration, start: Any, x: Any, p: np.ndarray) -> None:
        buffers = by.watch.rows(1) if by.watch else None
        u = by.facts.array(len(by.facts.inputs))
        self.by, self.log, self.start = by, Log(), float(start)
        self.course = Course(by, by.states(start, x), u, p, buffers=buffers)
        self.before = self.course.reached  # at the last look at its pace
        if by.facts.inputs:
            self.course.state["inputs"] = by.feed.address if by.feed else 0

    def stretch(self, times: np.ndarray, u: np.ndarray, out: Rows) -> Status:
        """Goes on to the last of the times, looking at progress and interrupts on the way."""
        by, course, status = self.by, self.course, Status.MORE
        course.u = u
        while status == Status.MORE and course.tried < by.max_steps:
            budget = min(BUDGET[by.backend.name], by.max_steps - course.tried)
            status = course.go(times, budget, out)
            if course.buffers is not None:
                status = self.log.emptied(course.buffers, 0, 0, status)
            if by.progress is not None:
                by.progress(course.time - self.start)
            if status == Status.MORE and self.is_held(float(times[-1]) - self.start):
                return Status.HELD
        return status

    def is_held(self, span: float) -> bool:
        """Whether the motion stands still at a jump of forces, looked at now and then."""
        tried, broken, t = (now - before for now, before in zip(self.course.reached, self.before))
        if not self.by.facts.lengths["kinks"] or tried < LOOKED_AT:
            return False
        self.before = self.course.reached
        return broken > BROKEN * tried and t < COVERED * span

    def ended(self, t: np.ndarray, out: Rows, status: Status) -> tuple[np.ndarray, Rows]:
        """Rows up to an event that stopped the motion, and one there."""
        if status != Status.EVENT:
            return t, out
        state, last = self.course.state, self.course.here()
        reached = t < state["t"][0]
        rows = {name: np.concatenate([value[reached], last[name]]) for name, value in out.items()}
        return np.append(t[reached], state["t"]), rows

    def events(self) -> Events | None:
        """What happened, as the result holds it."""
        watch = self.by.watch
        if watch is None:
            return None
        t, x, which, _ = self.log.arrays(watch.width)
        return Events(watch.names, t, x[:, : self.by.facts.nx], which)

    def result(
        self, t: np.ndarray, out: Rows, status: Status, inputs: Any, callback: Callback | None
    ) -> Simulation:
        """What came out. Raises Stopped where the motion could not go on."""
        facts, state = self.by.facts, self.course.state
        counts: dict[str, Any] = {name: state[name][0].item() for name in facts.counted}
        rows: dict[str, Any] = dict(out)
        if facts.charts:
            rows["chart"] = out["chart"].astype(int)
        if facts.frame:
            own = np.tile(self.course.p[: -facts.frame], (t.size, 1))
            rows["p"] = np.hstack([own, rows.pop("frame")])
        rows |= {"u": inputs, "events": self.events(), "integrator": self.by.integrator}
        found = Simulation(t, **rows, **counts, status=status)
        if status and status != Status.EVENT:
            self._raise(found, callback)
        return found

    def _raise(self, found: Simulation, callback: Callback | None) -> None:
        if found.status == Status.NO_EVENT and self.by.watch:
            callback = self.by.watch.callback
        error = callback.error if callback else None
        where = f"{self.by.facts.name}.simulate stopped at t = {self.course.time!r}"
        cause = self.by.facts.cause(found.status, int(self.course.state["enforcement"][0]))
        if found.status == Status.FULL and found.events is not None:
            name, count = found.events.most
            cause += f" ({name!r} happened {count} times, of {found.events.t.size} in all)"
        raise Stopped(f"{where}: {cause}{because(error)}", found) from error


def because(error: Any) -> str:
    """Of what a function raised."""
    return "" if error is None else f" ({error!r})"


def follow(by: Integration, start: Any, x: Any, t: np.ndarray, given: Any) -> Simulation:
    """One motion to its end; `given` are u and p."""
    u, p = given
    single, out = Single(by, start, x, p), by.facts.rows_to_come(t.size)
    status = single.stretch(t, u, out)
    t, out = single.ended(t, out, status)
    inputs = by.feed.rows(t, out["x"]) if by.feed else None
    return single.result(t, out, status, inputs, by.feed.callback if by.feed else None)


class Samples:
    """Times at which a function is asked, among the output times t: `every` time there is, and
    where each sample ends among these."""

    def __init__(self, sample: Any, start: float, t: np.ndarray) -> None:
        self.times = sample_times(sample, start, float(t[-1]))
        self.every = np.union1d(self.times[1:], t).astype(t.dtype)
        self.ends = [*np.searchsorted(self.every, self.times[1:], "right"), self.every.size]
        self.rows = np.searchsorted(self.every, t)


def controlled(
    by: Integration, start: Any, x: Any, t: np.ndarray, p: np.ndarray, asked: tuple[Any, Any]
) -> Simulation:
    """One motion with inputs that a function gives at sample times, constant from one to the next;
    `asked` are the function and the samples."""
    facts, (function, sample) = by.facts, asked
    single, control = Single(by, start, x, p), by.control(function)
    samples = Samples(sample, single.start, t)
    count = samples.every.size
    out, used = facts.rows_to_come(count), np.full((count, len(facts.inputs)), np.nan, facts.real)
    here, status, first = single.course.state["x"][0, : facts.nx].copy(), Status.OK, 0
    u = facts.array(len(facts.inputs))
    for time, end in zip(samples.times, samples.ends):
        given = control.values(float(time), here)
        if given is None or not np.isfinite(given).all():
            status = Status.NO_INPUT
            break
        u = given
        single.course.state["stale"], used[first:end] = 1, u
        part = {name: value[:end] for name, value in out.items()}
        status = single.stretch(samples.every[:end], u, part)
        if status:
            break
        here, first = out["x"][end - 1].copy(), end - 1
    t, out = single.ended(t, {name: value[samples.rows] for name, value in out.items()}, status)
    used = used[samples.rows][: len(t)]
    if len(used) < len(t) or status == Status.EVENT:
        used = np.concatenate([used[: len(t) - 1], u[np.newaxis]])
    return single.result(t, out, status, used, control)
