"""Many motions: in rows, by the compiled code on threads, or one by one.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from threading import Lock
from typing import Any

import numpy as np

from ._events import Buffers, Log
from ._inputs import Feed
from ._inputs import given as shaped
from ._one_motion import Course, Integration, Samples, because
from ._simulation import Events, Simulation, Status

PACE = 0.1  # seconds between two looks at progress and interrupts
LEAST = 64  # motions between two looks
FASTER = 16  # times as many as before, at most
Lead = tuple[int, ...]


def many(
    by: Integration,
    arrays: Mapping[str, Any],
    lead: Lead,
    asked: tuple[Any, Any],
) -> Simulation:
    """Motions of the leading axes `lead`, over which t0, times, x, u and p broadcast; `asked` are
    the function of the inputs and its samples, None where it is called on the way."""
    t, rows = arrays["times"], int(np.prod(lead))
    flat = {name: _flat(value, lead, name != "t0") for name, value in arrays.items()}
    if asked[1] is not None:
        return _controlled(by, flat, t, lead, asked)
    queue = Queue(by, flat, rows)
    queue.run()
    inputs, feed = None, by.feed
    if feed is not None and feed.callback is None and t.ndim == 1:
        inputs = _shaped(_fed(queue, feed, t), lead)
    callback = feed.callback if feed else None
    return _gathered(queue, t, lead, inputs, callback.error if callback else None)


def _fed(queue: Queue, feed: Feed, t: np.ndarray) -> np.ndarray:
    """Inputs of tables at the rows of every motion; behind the event that stopped it those of
    then."""
    each = np.stack([pieces.at(t) for pieces in feed.each])
    stopped = np.flatnonzero(queue.ends["status"] == Status.EVENT)
    every = np.broadcast_to(each, (queue.rows, *each.shape[1:]))
    if not stopped.size:
        return every
    every = every.copy()
    for row in stopped.tolist():
        end = queue.ends["t"][row]
        every[row, t > end] = feed.each[row if len(feed.each) > 1 else 0].at(end)
    return every


def _flat(value: np.ndarray, lead: Lead, vector: bool) -> np.ndarray:
    """Rows without gaps; a single one where all motions share it."""
    width = value.shape[-1:] if vector else ()
    if value.ndim == len(width):
        return np.ascontiguousarray(value).reshape(1, *width)
    return np.ascontiguousarray(np.broadcast_to(value, (*lead, *width))).reshape(-1, *width)


def _address(value: np.ndarray) -> int:
    """Of an array without gaps; 0 of an empty one."""
    return value.__array_interface__["data"][0] if value.size else 0


def _part(value: np.ndarray, first: int, last: int) -> np.ndarray:
    """Rows first to last; the single one that all motions share."""
    return value if len(value) == 1 else value[first:last]


class Queue:
    """Motions in rows, and what comes out of them.

    `arrays` are t0, times, x, u and p in rows, or a single one for all; `simulations` those that
    are on their way already.
    """

    def __init__(
        self,
        by: Integration,
        arrays: Mapping[str, np.ndarray],
        rows: int,
        simulations: np.ndarray | None = None,
    ) -> None:
        facts = by.facts
        self.by, self.rows, self.inputs, self.simulations = by, rows, arrays, simulations
        self.rows_out = facts.rows_to_come(rows, arrays["times"].shape[-1])
        self.ends = np.zeros(rows, facts.end)
        self.ends["status"] = Status.MORE
        self.interrupted = False
        self.log, self.numbers = Log(), np.arange(rows)
        self.signs = np.zeros((rows, len(by.watch.names) if by.watch else 0), "i")

    def compiled(self, room: np.ndarray, first: int, last: int) -> None:
        """Rows first to last by the compiled code."""
        simulations = None if self.simulations is None else self.simulations[first:last]
        buffers = self.by.watch.rows(last - first) if self.by.watch else None
        if buffers:
            simulations = self._states(first, last)
            buffers.sign[:] = self.signs[first:last]
        motions = self._motions(first, last)
        if simulations is not None:
            motions["simulations"] = _address(simulations)
        if buffers:
            motions["events"] = _address(buffers.structures)
        if self.by.backend.batch.simulate_batch(motions, room):
            raise ValueError(Status.NO_METHOD.cause)
        if buffers and simulations is not None:
            self._empty(buffers, simulations, first)
            self.signs[first:last] = buffers.sign

    def _motions(self, first: int, last: int) -> np.ndarray:
        """The structure of the compiled code for these rows."""
        by, motions = self.by, np.zeros(1, self.by.facts.motions)
        motions["rows"], motions["n"] = last - first, self.inputs["times"].shape[-1]
        for name, value in self.inputs.items():
            width = value.shape[-1] if name != "t0" else 1
            motions[name] = _address(_part(value, first, last))
            motions[f"{name}_stride"] = 0 if len(value) == 1 else width
        for name, value in by.how.items():
            motions[name] = value
        motions["rtol"], motions["atol"] = by.tolerances
        motions["budget"] = by.max_steps
        for name, value in self.rows_out.items():
            motions[f"{name}_out"] = _address(value[first:last])
        motions["ends"] = _address(self.ends[first:last])
        if by.feed:
            structures = by.feed.structures
            motions["inputs"] = _address(_part(structures, first, last))
            motions["inputs_stride"] = 0 if len(structures) == 1 else 1
        return motions

    def _empty(self, buffers: Buffers, simulations: np.ndarray, first: int) -> None:
        """Takes events out; a motion whose room ended goes on by itself."""
        ended = self.ends["status"][first : first + len(simulations)] == Status.FULL
        others = np.flatnonzero(~ended)
        self.log.take_many(buffers, others, self.numbers[first + others])
        for place in np.flatnonzero(ended).tolist():
            row = first + place
            status = self.ends["status"][row]
            if self.log.emptied(buffers, place, self.numbers[row], status) != status:
                self.one(row, self._course(row, simulations[place : place + 1], buffers, place))

    def _states(self, first: int, last: int) -> np.ndarray:
        """Simulations of the rows at their start, or where they are."""
        if self.simulations is not None:
            return self.simulations[first:last]
        t0, x = self.inputs["t0"].ravel(), self.inputs["x"]
        return self.by.states(_part(t0, first, last), _part(x, first, last), last - first)

    def _course(
        self, row: int, state: np.ndarray, buffers: Buffers | None, place: int = 0
    ) -> Course:
        """A row on its way."""
        u, p = (_part(self.inputs[name], row, row + 1)[0] for name in ("u", "p"))
        if self.by.facts.inputs:
            feed = self.by.feed
            structures = _part(feed.structures, row, row + 1) if feed else None
            state["inputs"] = 0 if structures is None else structures.ctypes.data
        return Course(self.by, state, u, p, row, buffers, place)

    def _begun(self, row: int) -> Course:
        """A row at its start, or where it is."""
        buffers = self.by.watch.rows(1) if self.by.watch else None
        if buffers:
            buffers.sign[:] = self.signs[row]
        return self._course(row, self._states(row, row + 1), buffers)

    def one(self, row: int, course: Course) -> None:
        """A row by the loop of one motion."""
        times = np.ascontiguousarray(_part(self.inputs["times"], row, row + 1)[0])
        out = {name: value[row] for name, value in self.rows_out.items()}
        buffers, status = course.buffers, Status.MORE
        while status == Status.MORE:
            status = course.go(times, self.by.max_steps - course.tried, out)
            if status == Status.MORE or buffers is None:
                break
            status = self.log.emptied(buffers, course.place, self.numbers[row], status)
        if status == Status.EVENT:  # it stays there
            left, last = slice(int(course.state["done"][0]), None), course.here()
            for name, value in out.items():
                value[left] = last[name]
        if buffers:
            self.signs[row] = buffers.sign[course.place]
        end = self.ends[row]
        end["status"], end["t"] = status, course.state["t"][0]
        for name in self.by.facts.counted:
            end[name] = course.state[name][0]

    def run(self) -> int:
        """All of them; returns how many are done, fewer after an interrupt."""
        by, done = self.by, 0
        try:
            for rows in self._done():
                done += rows
                if by.progress is not None:
                    by.progress(done)
        except KeyboardInterrupt:
            self.interrupted = True
            done = int(np.count_nonzero(self.ends["status"] != Status.MORE))
            part = f"{done} of {self.rows} motions"
            by.remarks.append(f"{by.facts.name}.simulate: interrupted after {part}")
        return done

    def _done(self) -> Iterator[int]:
        """How many rows more are done, each time some are."""
        batch = self.by.backend.batch
        if batch is None:
            return self._one_by_one()
        count = max(1, self.by.threads)
        parts = Parts(self.rows, count)
        rooms = [np.empty(batch.workspace, np.uint8) for _ in range(count)]
        if count == 1:
            return self._part_by_part(parts, rooms[0])
        return self._on_threads(parts, rooms)

    def _one_by_one(self) -> Iterator[int]:
        for row in range(self.rows):
            self.one(row, self._begun(row))
            yield 1

    def _part_by_part(self, parts: Parts, room: np.ndarray) -> Iterator[int]:
        """Rows by the compiled code, in parts that take about as long as PACE."""
        size = LEAST
        while part := parts.taken(size):
            before = time.perf_counter()
            self.compiled(room, *part)
            size = paced(size, time.perf_counter() - before)
            yield part[1] - part[0]

    def _on_threads(self, parts: Parts, rooms: list[np.ndarray]) -> Iterator[int]:
        """Each thread takes the next part when it is done with one: none waits for another."""
        done: SimpleQueue[int] = SimpleQueue()  # 0 says that a thread ends

        def work(room: np.ndarray) -> None:
            try:
                for rows in self._part_by_part(parts, room):
                    done.put(rows)
            except BaseException:  # the others end, too
                parts.stopped = True
                raise
            finally:
                done.put(0)

        with ThreadPoolExecutor(len(rooms)) as pool:
            jobs, going = [pool.submit(work, room) for room in rooms], len(rooms)
            try:
                while going:
                    rows = done.get()
                    going -= not rows
                    if rows:
                        yield rows
            finally:
                parts.stopped = True
            for job in jobs:
                job.result()


class Parts:
    """Rows in the order in which they are taken, by several threads."""

    def __init__(self, rows: int, threads: int) -> None:
        self.rows, self.threads, self.first = rows, threads, 0
        self.stopped, self.lock = False, Lock()

    def taken(self, size: int) -> tuple[int, int] | None:
        """First and last of `size` rows, of fewer near the end, so that threads end together."""
        with self.lock:
            left = self.rows - self.first
            if self.stopped or left == 0:
                return None
            if self.threads > 1:
                size = min(size, max(LEAST, left // (2 * self.threads)))
            first = self.first
            self.first += min(size, left)
            return first, self.first


def paced(size: int, seconds: float) -> int:
    """How many rows come next, where so many took so long."""
    most, least = size * FASTER, max(LEAST, size // 2)
    wanted = size * PACE / max(seconds, 1e-9)
    return int(min(most, max(least, wanted)))


# ---- inputs at sample times


def _controlled(
    by: Integration,
    arrays: Mapping[str, np.ndarray],
    t: np.ndarray,
    lead: Lead,
    asked: tuple[Any, Any],
) -> Simulation:
    """Motions with inputs that a function gives at sample times to all at once: f(t, x) with x of
    all."""
    if len(arrays["t0"]) > 1 or len(arrays["times"]) > 1:
        raise ValueError(
            "simulate() needs the same times for all motions where a function is asked at sample "
            "times"
        )
    facts, rows, (function, sample) = by.facts, int(np.prod(lead)), asked
    start = float(arrays["t0"].ravel()[0])
    samples = Samples(sample, start, t)
    states = by.states(start, arrays["x"], rows)
    whole = Queue(by, {**arrays, "times": samples.every[np.newaxis]}, rows, states)
    whole.ends["status"], whole.ends["t"] = Status.OK, start
    used = np.full((rows, samples.every.size, len(facts.inputs)), np.nan, facts.real)
    x, error, first = np.broadcast_to(arrays["x"], (rows, facts.nx)), None, 0
    for moment, end in zip(samples.times, samples.ends):
        going = np.flatnonzero(whole.ends["status"] == Status.OK)
        u, error = _asked(by, function, float(moment), x.reshape(*lead, facts.nx).copy())
        lost = going[~np.isfinite(u[going]).all(axis=1)]
        whole.ends["status"][lost] = Status.NO_INPUT
        going = np.setdiff1d(going, lost)
        used[going, first:end] = u[going, np.newaxis]
        went = _went_on(whole, going, u, slice(first and first + 1, end))
        stopped = going[whole.ends["status"][going] == Status.EVENT]
        for value in (used, *whole.rows_out.values()):
            value[stopped, end:] = value[stopped, end - 1 : end]
        if not went or error is not None:
            break
        x, first = whole.rows_out["x"][:, end - 1], end - 1
    whole.rows_out = {name: value[:, samples.rows] for name, value in whole.rows_out.items()}
    used = used[:, samples.rows]
    return _gathered(whole, t, lead, used.reshape(*lead, *used.shape[1:]), error)


def _asked(
    by: Integration, function: Any, moment: float, x: np.ndarray
) -> tuple[np.ndarray, Exception | None]:
    """What a function gives for all motions, NaN where it fails, and what it raised."""
    count = len(by.facts.inputs)
    rows = int(np.prod(x.shape[:-1]))
    try:
        u = shaped(function(moment, x), (*x.shape[:-1], count), by.facts.real)
    except Exception as error:  # it belongs to whoever gave the function
        return np.full((rows, count), np.nan), error
    return u.reshape(rows, count), None


def _went_on(whole: Queue, going: np.ndarray, u: np.ndarray, place: slice) -> bool:
    """Rows `going` to the times of this place, with inputs u. False where it was interrupted."""
    arrays = {
        name: value if len(value) == 1 or name == "times" else value[going]
        for name, value in whole.inputs.items()
    }
    arrays["times"] = whole.inputs["times"][:, place]
    arrays["u"] = np.ascontiguousarray(u[going])
    assert whole.simulations is not None
    states = whole.simulations[going]
    states["done"], states["stale"] = 0, 1
    part = Queue(whole.by, arrays, going.size, states)
    part.log, part.numbers, part.signs = whole.log, going, whole.signs[going]
    done = part.run()
    whole.signs[going] = part.signs
    whole.simulations[going], whole.ends[going] = states, part.ends
    for name, value in part.rows_out.items():
        whole.rows_out[name][going, place] = value
    return done == going.size


# ---- the result


def _gathered(queue: Queue, t: np.ndarray, lead: Lead, inputs: Any, error: Any) -> Simulation:
    """Everything in the shape of the leading axes; a remark where motions ended early, with what a
    function raised."""
    facts, watch = queue.by.facts, queue.by.watch
    rows: dict[str, Any] = {name: _shaped(value, lead) for name, value in queue.rows_out.items()}
    counts: dict[str, Any] = {
        name: queue.ends[name].reshape(lead) for name in ("status", *facts.counted)
    }
    if facts.charts:
        rows["chart"] = rows["chart"].astype(int)
    _remark(queue, error)
    if facts.frame:
        own = queue.inputs["p"][:, np.newaxis, : -facts.frame]
        every = np.broadcast_to(own, (queue.rows, t.shape[-1], own.shape[-1]))
        rows["p"] = np.concatenate([_shaped(every, lead), rows.pop("frame")], axis=-1)
    happened = None
    if watch:
        times, states, which, row = queue.log.arrays(watch.width)
        happened = Events(watch.names, times, states[:, : facts.nx], which, row)
    rows |= {"u": inputs, "events": happened, "integrator": queue.by.integrator}
    return Simulation(t=t, **rows, **counts)


def _shaped(value: np.ndarray, lead: Lead) -> np.ndarray:
    return value.reshape(*lead, *value.shape[1:])


def _remark(queue: Queue, error: Any) -> None:
    """How many motions ended early, and why the first of them did."""
    ends = queue.ends
    failed = np.flatnonzero(~np.isin(ends["status"], (Status.OK, Status.EVENT)))
    if queue.interrupted:  # those that were never begun are counted elsewhere
        failed = failed[(ends["steps"] + ends["rejected"])[failed] > 0]
    if not failed.size:
        return
    facts, watch = queue.by.facts, queue.by.watch
    first = Status(int(queue.ends["status"][failed[0]]))
    if first == Status.NO_EVENT and watch and watch.callback:
        error = watch.callback.error
    elif first != Status.NO_INPUT:
        error = None
    cause = facts.cause(first, queue.by.how["enforcement"])
    queue.by.remarks.append(
        f"{facts.name}.simulate: {failed.size} of {queue.rows} motions ended early, their rows "
        f"from there are NaN; motion {failed[0]}: {cause}{because(error)}"
    )
