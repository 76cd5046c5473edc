"""A motion in NumPy, for machines without a compiler: what the loop of steps asks the model for.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ._events import Buffers, Inside, changes_across, changes_inside, located
from ._inputs import Callback, Pieces
from ._model_facts import Facts, Method
from ._runge_kutta import Step, Tableau
from ._simulation import Status

# rates of coordinates that change by more than this part of the speed, and by so many times what
# the state was moved by
OTHER_BRANCH, FAR_BEYOND = 0.1, 1e3


class Failed(Exception):
    """A function gave a status that is not 0."""

    def __init__(self, status: int) -> None:
        super().__init__(status)
        self.status = status


@dataclass
class Motion:
    """The simulation, inputs, parameters and tolerances.

    `state` is one entry of Facts.state. Tables of inputs are in the segment `segment`.
    """

    facts: Facts
    state: Any
    u: np.ndarray
    p: np.ndarray
    rtol: float
    atol: float
    pieces: Pieces | None = None
    callback: Callback | None = None
    buffers: Buffers | None = None  # of events
    segment: int = 0
    passing: bool = False  # by a singular position: stages are put on the constraints

    @property
    def chart(self) -> int:
        """The number of the chart that the state is in."""
        return int(self.state["choice"]) if self.facts.charts else 0

    @property
    def method(self) -> Method:
        return self.facts.methods[int(self.state["integrator"])]

    @property
    def tableau(self) -> Tableau:
        tableau = self.method.tableau
        assert tableau is not None  # the loop begins with no other
        return tableau

    # ---- functions of the model

    def function(self, name: str) -> Callable[..., Any]:
        """The function of the chart that the state is in; that of the model where all charts share
        it."""
        binding, charts = self.facts.numpy(), self.facts.charts
        suffix = charts.SUFFIXES[self.chart] if charts else ""
        return getattr(binding, f"_{name}{suffix}", None) or getattr(binding, f"_{name}")

    def call(self, name: str, t: Any, y: np.ndarray, out: np.ndarray) -> int:
        """The status of a function at t and y, the work behind the state."""
        return int(self.function(name)(np.asarray(t), y[:-1], self.u, self.p, out))

    def values(self, name: str, t: Any, y: np.ndarray) -> np.ndarray:
        """The result of a function. Raises Failed."""
        out = self.facts.array(self.facts.lengths[name])
        if status := self.call(name, t, y, out):
            raise Failed(status)
        return out

    def slope(self, t: Any, y: np.ndarray) -> np.ndarray:
        """Time derivative of the state and of the work. Raises Failed."""
        if self.passing:
            y[:-1] = self.values("project", t, y)
        self.state["calls"] += 1
        slope, u = self.facts.array(self.facts.size), self.inputs(t, y)
        t = np.asarray(t, self.facts.real)
        status = int(self.function("dynamics")(t, y[:-1], u, self.p, slope[:-1]))
        if self.facts.lengths["power"]:
            status = status or int(self.function("power")(t, y[:-1], u, self.p, slope[-1:]))
        if status:
            raise Failed(status)
        return slope

    def refresh(self) -> None:
        """The slope anew where the state is."""
        self.state["slope"] = self.slope(self.state["t"], self.state["x"])

    # ---- inputs

    def inputs(self, t: Any, y: np.ndarray) -> np.ndarray:
        """u at t and y. Raises Failed."""
        if self.pieces is None and self.callback is None:
            return self.u
        if self.callback is None:
            assert self.pieces is not None
            return self.pieces.on(self.segment, t)
        u = self.callback.values(float(t), self.row(t, y))
        if u is None or not np.isfinite(u).all():
            raise Failed(Status.NO_INPUT)
        return u

    def find_segment(self) -> None:
        """The segment that the state is in."""
        if self.pieces is not None:
            knots: Any = self.pieces.knots
            self.segment = max(0, int(knots.searchsorted(self.state["t"], "right")) - 1)

    def until(self, time: Any) -> Any:
        """The next knot, or `time` where that is sooner: the step ends there."""
        if self.pieces is None or self.segment + 1 >= len(self.pieces.knots):
            return time
        return min(time, self.pieces.knots[self.segment + 1])

    def go_behind_knot(self) -> None:
        """Goes on behind a knot that the state has come to."""
        if self.pieces is None:
            return
        knots, segment = self.pieces.knots, self.segment
        while self.segment + 1 < len(knots) and self.state["t"] >= knots[self.segment + 1]:
            self.segment += 1
        if segment != self.segment:
            self.refresh()

    # ---- sizes and rows

    def norm(self, values: Any, y: np.ndarray, z: np.ndarray) -> float:
        """In units of the tolerance, beside the states y and z."""
        extent = np.maximum(np.abs(y), np.abs(z))
        if self.facts.turning:
            q = extent[: self.facts.nq]
            turned = self.state["turns"] != 0
            q[turned] = np.maximum(self.facts.turn[0], q[turned])
        mean = cast(Any, np.mean((values / (self.atol + self.rtol * extent)) ** 2))
        return float(np.sqrt(mean))

    def row(self, t: Any, y: np.ndarray) -> np.ndarray:
        """The state as a row of the output."""
        row, charts = y[:-1].copy(), self.facts.charts
        if charts:
            row = charts.transform(self.facts.numpy(), self.chart, 0, t, row, self.u, self.p)
        return self.wound(row) if self.facts.turning else row

    def unwind(self) -> None:
        """Take whole turns out of angles beyond one."""
        state, (turn, rest) = self.state, self.facts.turn
        for i in self.facts.turning:
            whole = float(state["x"][i])
            if abs(whole) > turn:
                left = math.remainder(whole, turn)
                turns = round((whole - left) / turn)
                state["x"][i] = left - turns * rest
                state["turns"][i] += turns

    def wound(self, row: np.ndarray) -> np.ndarray:
        """The row with its whole turns."""
        nq, turns, (turn, rest) = self.facts.nq, self.state["turns"], self.facts.turn
        whole, q = row.copy(), row[: self.facts.nq]
        whole[:nq] = np.where(turns != 0, (q + turns * rest) + turns * turn, q)
        return whole

    def watch_constraints(self) -> None:
        """Remember the largest constraint violation."""
        size = self.facts.lengths["constraints"]
        if not size:
            return
        state, violation = self.state, self.facts.array(size)
        if self.call("constraints", state["t"], state["x"], violation):
            return
        sizes, positions = np.abs(violation), self.facts.positions
        for name, part in (("position", sizes[:positions]), ("velocity", sizes[positions:])):
            state[f"{name}_violation"] = max(state[f"{name}_violation"], *part, 0.0)

    # ---- a step

    def stepped(
        self, t: Any, h: Any, y: np.ndarray, own: np.ndarray
    ) -> tuple[Step, np.ndarray, float]:
        """A step from y, where the slope is `own`: its stages, where it arrives, and the error in
        units of the tolerance. Raises Failed."""
        step = Step(t, h, y, [own])
        z = step.arrival(self.tableau, self.slope)
        return step, z, step.error(self.tableau, z, self.norm)

    def settled(self, t: Any, z: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What the enforcement does with the state after a step that met the tolerance. Raises
        Failed."""
        facts = self.facts
        name = facts.enforcements[int(self.state["enforcement"])]
        if name != "projection" or not facts.lengths["project"]:
            return z, slope
        close = self.values("project", t, z)
        if (close != z[:-1]).any():
            move, before = np.abs(close - z[:-1]).max(), slope[: facts.nq]
            gone = np.abs(z - self.state["x"])[:-1].max()
            allowed = self.atol + self.rtol * np.abs(z[:-1]).max()
            begun = self.state["steps"] > 0  # the first step may begin off the constraints
            if begun and move > OTHER_BRANCH * gone > 0.0 and move > FAR_BEYOND * allowed:
                raise Failed(Status.JUMP)
            z[:-1] = close
            slope = self.slope(t, z)
            jump, speed = np.abs(slope[: facts.nq] - before).max(), np.abs(before).max()
            if jump > OTHER_BRANCH * speed and jump > FAR_BEYOND * move:
                raise Failed(Status.SINGULAR_POSITION)
        return z, slope

    def landed(
        self, t: Any, end: Any, y: np.ndarray, own: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """State and slope after a step from t to `end`, on the constraints. Raises Failed."""
        step, z, _ = self.stepped(t, end - t, y, own)
        return self.settled(end, z, step.stages[-1])

    # ---- events

    def events(self, t: Any, y: np.ndarray) -> np.ndarray:
        """The functions of all events. Raises Failed."""
        state = self.row(t, y)
        assert self.buffers is not None
        values: list[Any] = []
        callback = self.buffers.watch.callback
        if self.facts.events:
            own = self.facts.array(len(self.facts.events))
            given = (np.asarray(t), y[:-1], self.inputs(t, y), self.p, own)
            if int(self.function("events")(*given)):
                raise Failed(Status.NO_EVENT)
            values.append(own)
        if callback:
            values.append(callback.values(float(t), state))
        if any(value is None or not np.isfinite(value).all() for value in values):
            raise Failed(Status.NO_EVENT)
        return np.concatenate(values)

    def event_inside(
        self, step: Step, z: np.ndarray, slope: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray] | None:
        """What happens in a step to z goes into the record; time, state and slope of an event that
        stops the motion. Raises Failed."""
        buffers, t, h = self.buffers, step.t, step.h
        assert buffers is not None
        dense = step.continuous(self.tableau.dense, self.slope, z, slope)
        land = functools.partial(self._landed_inside, step)
        inside = Inside(t, h, dense, self.events, land)
        last, stop, signs = 1.0, None, buffers.sign[0].copy()
        for root, which, sign in changes_inside(inside, signs, z):
            if root - last > 4 * np.finfo(float).eps:  # it comes behind what stops the motion
                return stop
            buffers.sign[0, which] = sign
            if buffers.watch.direction[which] * sign < 0:
                continue
            if stop is not None:  # no step comes behind that would tell it
                self._record(stop[0], stop[1], which)
                continue
            theta, there, bend = located(inside, which, root)
            self._record(t + theta * h, there, which)
            if buffers.watch.stop[which]:
                last, stop = root, (t + theta * h, there, bend)
        if stop is None:
            buffers.sign[0] = signs
        return stop

    def event_across(self, t: Any, h: Any, carried: Callable[[float], np.ndarray]) -> float | None:
        """The same on the way of h across a kink from t; how far behind t it stops. Raises
        Failed."""
        buffers = self.buffers
        assert buffers is not None
        for later, which, sign in changes_across(self.events, (t, h), carried, buffers.sign[0]):
            if buffers.watch.direction[which] * sign < 0:
                continue
            self._record(t + later, carried(later), which)
            if buffers.watch.stop[which]:
                return later
        return None

    def _record(self, t: Any, z: np.ndarray, which: int) -> None:
        """An event into the record."""
        assert self.buffers is not None
        row = self.row(t, z)
        if self.facts.frame:
            row = np.concatenate([row, self.state["frame"]])
        self.buffers.add(0, t, row, which)

    def _landed_inside(self, step: Step, theta: float) -> tuple[np.ndarray, np.ndarray]:
        """State and slope after a part of the step."""
        if theta == 0:
            return step.y.copy(), step.stages[0]
        short, z, _ = self.stepped(step.t, theta * step.h, step.y, step.stages[0])
        return self.settled(step.t + theta * step.h, z, short.stages[-1])
