"""Events on the way of a motion: what is looked for, the room for what happens, and the search
inside a step for machines without a compiler.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .inputs import Callback
from .simulation import Status

EIGHTHS, MOST = 8, 64  # as in runtime_events.h
ROOM = 64  # steps' worth of events that compiled code keeps until they are taken out
MOST_EVENTS = 100_000  # of one motion
BISECTIONS = 60  # of a way across a kink: to the last digit
GOLDEN = 0.3819660112501051
# NAME_watch of NAME_simulate.h
EVENTS = np.dtype(
    [
        ("count", "i"),
        *((name, np.uintp) for name in ("call", "data", "direction", "stop", "sign")),
        *((name, np.uintp) for name in ("room", "n", "t", "x", "which")),
    ],
    align=True,
)
Values = Callable[[float, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Event:
    """Where `function`, f(t, x), changes its sign: `direction` 1 counts changes from − to +, −1
    those from + to −, 0 both; `stop` ends the motion there."""

    function: Any
    direction: int = 0
    stop: bool = False

    def __post_init__(self) -> None:
        if self.direction not in (-1, 0, 1):
            raise ValueError(f"the direction of an event is -1, 0 or 1, not {self.direction!r}")


Own = tuple[tuple[str, int, bool], ...]  # of the model: names, directions, stops


class Watch:
    """What is looked for: functions of the model (names, directions, stops), then those of a
    caller, and where what happens is written, for `rows` motions."""

    def __init__(self, own: Own, given: Mapping[str, Any] | None, width: int, real: Any) -> None:
        events = {n: e if isinstance(e, Event) else Event(e) for n, e in (given or {}).items()}
        self.names = (*(name for name, *_ in own), *events)
        self.functions = tuple(event.function for event in events.values())
        directions = [*(d for _, d, _ in own), *(event.direction for event in events.values())]
        stops = [*(s for *_, s in own), *(event.stop for event in events.values())]
        _check(self.names, events, own)
        self.direction, self.stop = np.array(directions, "i"), np.array(stops, "i")
        self.width, self.real = width, real
        self.callback: Callback | None = None

    def values(self, t: float, x: np.ndarray) -> list[float]:
        """Of the caller's functions, for compiled code."""
        return [float(function(t, x)) for function in self.functions]

    def rows(self, count: int) -> "Buffers":
        """Room for the events of so many motions."""
        return Buffers(self, count)


def _check(names: tuple[str, ...], events: Mapping[str, Event], own: Own) -> None:
    for name, event in events.items():
        if not callable(event.function):
            raise ValueError(f"simulate() needs a function f(t, x) for the event {name!r}")
        if name in [each for each, *_ in own]:
            raise ValueError(f"the model has an event {name!r} already")
    if len(names) > MOST:
        raise ValueError(f"simulate() looks for {MOST} events at most, here are {len(names)}")


class Buffers:
    """Structures of compiled code, one for each motion, with what they point to."""

    def __init__(self, watch: Watch, count: int) -> None:
        self.watch = watch
        room = max(ROOM * 4, 2 * EIGHTHS * len(watch.names) * 4)
        self.sign = np.zeros((count, len(watch.names)), "i")
        self.t = np.empty((count, room), watch.real)
        self.x = np.empty((count, room, watch.width), watch.real)
        self.which = np.empty((count, room), "i")
        self.structures = np.zeros(count, EVENTS)
        self.structures["count"], self.structures["room"] = len(watch.functions), room
        self.structures["call"] = watch.callback.address if watch.callback else 0
        for name in ("direction", "stop"):
            self.structures[name] = getattr(watch, name).ctypes.data
        for name in ("sign", "t", "x", "which"):
            array = getattr(self, name)
            strides = array.strides[0] * np.arange(count, dtype=np.uintp)
            self.structures[name] = np.uintp(array.ctypes.data) + strides

    def taken(self, row: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """t, x and which of a motion; there is room again afterwards."""
        n = int(self.structures["n"][row])
        self.structures["n"][row] = 0
        return self.t[row, :n].copy(), self.x[row, :n].copy(), self.which[row, :n].copy()

    def add(self, row: int, t: float, x: np.ndarray, which: int) -> None:
        """An event of the search below."""
        n = int(self.structures["n"][row])
        self.t[row, n], self.x[row, n], self.which[row, n] = t, x, which
        self.structures["n"][row] = n + 1

    def has_room(self, row: int) -> bool:
        """For all events that a step may have."""
        left = self.t.shape[1] - int(self.structures["n"][row])
        return left >= 2 * EIGHTHS * len(self.watch.names)


class Log:
    """What happened to many motions, piece by piece."""

    def __init__(self) -> None:
        self.parts: list[tuple[np.ndarray, ...]] = []
        self.counts: dict[int, int] = {}

    def take(self, buffers: Buffers, place: int, row: int) -> int:
        """The events of a motion out of its buffer; returns how many there are so far."""
        t, x, which = buffers.taken(place)
        if t.size:
            self.parts.append((t, x, which, np.full(t.size, row)))
        self.counts[row] = self.counts.get(row, 0) + t.size
        return self.counts[row]

    def take_many(self, buffers: Buffers, places: np.ndarray, rows: np.ndarray) -> None:
        """The events of motions whose room did not end, all at once."""
        counts = buffers.structures["n"][places].astype(int)
        met = counts > 0
        places, rows, counts = places[met], rows[met], counts[met]
        if not rows.size:
            return
        here, which = np.nonzero(np.arange(int(counts.max())) < counts[:, np.newaxis])
        arrays = (buffers.t, buffers.x, buffers.which)
        self.parts.append((*(each[places[here], which] for each in arrays), rows[here]))
        buffers.structures["n"][places] = 0
        for row, count in zip(rows.tolist(), counts.tolist()):
            self.counts[row] = self.counts.get(row, 0) + count

    def emptied(self, buffers: Buffers, place: int, row: int, status: int) -> Status:
        """Takes out what happened; MORE where it was only the room that ended."""
        count = self.take(buffers, place, row)
        more = status == Status.FULL and count < MOST_EVENTS
        return Status.MORE if more else Status(status)

    def arrays(self, width: int) -> list[np.ndarray]:
        """t, x, which and row of all, motion by motion."""
        empty = (np.zeros(0), np.zeros((0, width)), np.zeros(0, int), np.zeros(0, int))
        arrays = [np.concatenate(part) for part in zip(empty, *self.parts)]
        order = np.lexsort((arrays[0], arrays[3]))
        return [array[order] for array in arrays]


# ---- the search inside a step, as runtime_events.h does it


@dataclass
class Inside:
    """A step of length h from t, and its continuous output."""

    t: float
    h: float
    dense: Callable[[float], np.ndarray]
    values: Values  # of all functions
    land: Callable[[float], tuple[np.ndarray, np.ndarray]]  # state and slope by a shorter step

    def at(self, theta: float) -> np.ndarray:
        return self.values(self.t + theta * self.h, self.dense(theta))


def signs(g: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Of the values; a zero keeps the sign from before."""
    return np.where(g == 0, before, np.sign(g)).astype(before.dtype)


def changes_inside(step: Inside, sign: np.ndarray, end: np.ndarray) -> Any:
    """(theta, function, new sign) of every change in the order of time; `sign` goes with it."""
    values = [step.at(j / EIGHTHS) for j in range(EIGHTHS)]
    values.append(step.values(step.t + step.h, end))
    g = np.array(values)
    for j in range(1, EIGHTHS + 1):
        crossings = [one for k in range(len(sign)) for one in _changes(step, j, k, int(sign[k]), g)]
        for theta, k, new in sorted(crossings):
            sign[k] = new
            yield theta, k, new
        sign[:] = signs(g[j], sign)


def changes_across(
    values: Values, way: tuple[float, float], carried: Callable[[float], np.ndarray], sign: Any
) -> Any:
    """(how far behind t, function, new sign) of every change on the short way (t, h) that a motion
    is `carried` across a kink, in the order of time; `sign` goes with it."""
    t, h = way
    after = signs(values(t + h, carried(h)), sign)
    found: list[tuple[float, int, int]] = []
    for k in np.flatnonzero((sign != 0) & (after != sign)).tolist():
        a, b = 0.0, h
        for _ in range(BISECTIONS):
            c = 0.5 * (a + b)
            if signs(values(t + c, carried(c)), sign)[k] == after[k]:
                b = c
            else:
                a = c
        found.append((b, k, int(after[k])))
    for later, k, new in sorted(found):
        sign[k] = new
        yield later, k, new


def _changes(
    step: Inside, j: int, k: int, before: int, g: np.ndarray
) -> list[tuple[float, int, int]]:
    a, b, ga, gb = (j - 1) / EIGHTHS, j / EIGHTHS, g[j - 1, k], g[j, k]
    after = int(np.sign(gb)) or before
    if not before:
        return []
    if after != before:
        crossed = (int(np.sign(ga)) or before) != before
        return [(a if crossed else _root(step, k, a, b, ga, gb), k, after)]
    size = before * g[:, k]
    first, last = max(j - 2, 0), min(j + 1, EIGHTHS)
    near = _suspects(size[first : first + 3], first + 1 == j)
    if not (near or _suspects(size[last - 2 : last + 1], last - 1 == j)):
        return []
    place, value = _dip(step, k, a, b, before)
    if before * value >= 0:
        return []
    left, right = _root(step, k, a, place, ga, value), _root(step, k, place, b, value, gb)
    return [(left, k, -before), (right, k, before)]


def _suspects(values: np.ndarray, early: bool) -> bool:
    """Whether the smallest value of a parabola through three is near zero or beyond, between the
    first two (`early`) or the last two."""
    first, middle, last = values
    bend, tilt = first - 2 * middle + last, 0.5 * (last - first)
    if not bend > 0:
        return False
    place = -tilt / bend
    inside = -1 <= place <= 0 if early else 0 <= place <= 1
    return inside and middle - 0.5 * tilt * tilt / bend < 0.2 * max(first, middle, last)


def _dip(step: Inside, k: int, a: float, b: float, s: int) -> tuple[float, float]:
    """The smallest size between a and b by golden section, or where it is beyond zero."""
    c, d = a + GOLDEN * (b - a), b - GOLDEN * (b - a)
    gc, gd = s * step.at(c)[k], s * step.at(d)[k]
    for _ in range(40):
        if min(gc, gd) < 0:
            break
        if gc < gd:
            b, d, gd = d, c, gc
            c = a + GOLDEN * (b - a)
            gc = s * step.at(c)[k]
        else:
            a, c, gc = c, d, gd
            d = b - GOLDEN * (b - a)
            gd = s * step.at(d)[k]
    return (c, s * gc) if gc < gd else (d, s * gd)


def _root(step: Inside, k: int, a: float, b: float, ga: float, gb: float) -> float:
    """Illinois, with a bisection where that is slow."""
    side = 0
    for n in range(100):
        if b - a <= 2 * np.finfo(float).eps:
            break
        c = 0.5 * (a + b) if n % 8 == 7 or ga == gb else b - gb * (b - a) / (gb - ga)
        c = c if a < c < b else 0.5 * (a + b)
        g = step.at(c)[k]
        if g == 0:
            return c
        if (g > 0) == (gb > 0):
            b, gb, ga, side = c, g, 0.5 * ga if side == 1 else ga, 1
        else:
            a, ga, gb, side = c, g, 0.5 * gb if side == -1 else gb, -1
    return 0.5 * (a + b)


def located(step: Inside, k: int, theta: float) -> tuple[float, np.ndarray, np.ndarray]:
    """From a root of the continuous output to that of the motion: theta, state and slope."""
    low, high = max(theta - 1e-4, 0.0), min(theta + 1e-4, 1.0)
    tilt, first = (step.at(high)[k] - step.at(low)[k]) / (high - low), theta
    best = np.inf
    z, slope = step.land(theta)
    for _ in range(6):
        g = step.values(step.t + theta * step.h, z)[k]
        if not abs(g) < 0.5 * best or tilt == 0:
            break
        best, further = abs(g), min(max(theta - g / tilt, 0.0), 1.0)
        if not abs(further - first) < 0.02 or abs(further - theta) <= 2 * np.finfo(float).eps:
            break
        theta = further
        z, slope = step.land(theta)
    return theta, z, slope
