"""Steps that end where forces go on to another piece, in NumPy, as in runtime_kinks.h.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .numpy_motion import Failed, Motion
from .runge_kutta import Step

FOURTHS = 4  # of a step, at whose ends kinks are looked at
NEVER = 2.0  # more than the whole step
NEAREST = 1e-6  # share of a step: a kink before that is left to the error control
ATTEMPTS = 20  # steps to come near a kink
ROUGH, FINE = 8, 60  # iterations of a root that steps improve on, and of one that is the result
CLOSE = 1e-3  # share of the way to a kink that a step leaves at first
CLOSE_FIXED = 0.1  # the same of a step of given size, whose error nobody knows
NEARER, FARTHER, FARTHEST = 0.1, 8.0, 0.6  # factors of that share, and its limit
SAFE = 0.01  # error of what is carried on, in units of the tolerance
FAR = 0.5  # share of a step that is carried on at most: farther, its last slope says nothing
Values = Callable[[float], Any]


@dataclass
class Landing:
    """A step that ends before kink `number`, from 1 on, or a plain one where that is 0; how long
    it is from its end to the kink."""

    step: Step
    z: np.ndarray
    error: float
    number: int = 0
    left: Any = 0.0

    @property
    def end(self) -> Any:
        return self.step.t + self.step.h

    def carried(self, h: Any) -> np.ndarray:
        """The state by h behind the step, by its last slope, which changes as it did."""
        first, last = self.step.stages[0], self.step.stages[-1]
        return self.z + h * (last + 0.5 * h * (last - first) / self.step.h)


def kinks(motion: Motion, t: Any, y: np.ndarray) -> np.ndarray:
    """The functions that change their sign at kinks; NaN where they have no value."""
    values = motion.facts.array(motion.facts.lengths["kinks"])
    given = (np.asarray(t), y[:-1], motion.inputs(t, y), motion.p, values)
    if int(motion.function("kinks")(*given)):
        values[:] = np.nan
    return values


@dataclass
class Search:
    """Where on its way a step is to end, in shares of the whole step: `before` is the farthest end
    on this side of the kink, `beyond` the nearest on the other, `place` about where the kink is,
    and `off` how far before it a step is to end. `error` is that of the whole step."""

    place: float
    off: float
    error: float
    before: float = 0.0
    beyond: float = 1.0

    @property
    def end(self) -> float:
        return float(max(0.5 * (self.before + self.place), (1 - self.off) * self.place))


def landing(motion: Motion, step: Step, z: np.ndarray, error: float) -> Landing:
    """The step, or a shorter one that ends before the first kink on its way; one that ends earlier
    where forces jump. Raises Failed."""
    whole = Landing(step, z, error)
    place, k = _first(motion, step, z)
    if not NEAREST < place <= 1:
        return whole
    fixed = bool(motion.state["step_size"])
    start: Any = kinks(motion, step.t, step.y)[k]
    search = Search(place, CLOSE_FIXED if fixed else CLOSE, error)
    for _ in range(ATTEMPTS):
        try:
            short, z, error = motion.stepped(step.t, search.end * step.h, step.y, step.stages[0])
        except Failed:
            break
        trial = Landing(short, z, 0.0 if fixed else error, k + 1)
        g: Any = kinks(motion, trial.end, z)[k]
        if not g * start > 0:
            _came_beyond(motion, step, trial, (start, g), search)
        elif _is_near(motion, step, trial, g, search):
            return trial
        elif trial.number != k + 1:  # another one is nearer
            k = trial.number - 1
            start = kinks(motion, step.t, step.y)[k]
    return whole


def _came_beyond(
    motion: Motion, whole: Step, trial: Landing, values: tuple[Any, Any], search: Search
) -> None:
    """A step that ended beyond the kink says better where it is; one that erred across it may have
    ended anywhere, and halves the way at most."""
    least = 0.0 if trial.error <= 1 else 0.5 * search.place
    along = _along(motion, trial.step, trial.z, trial.number - 1)
    search.beyond = float(trial.step.h / whole.h)
    search.place = max(least, search.beyond * float(_root(along, 0.0, 1.0, *values, ROUGH)))
    if not search.place > search.before:
        search.place = 0.5 * (search.before + search.beyond)


def _is_near(motion: Motion, whole: Step, trial: Landing, g: Any, search: Search) -> bool:
    """Whether a step that ended before the kink will do. If not, the next one is to end nearer, or
    farther away where it erred: a stage of it may have been beyond."""
    theta, fixed = float(trial.step.h / whole.h), bool(motion.state["step_size"])
    if not trial.error <= 1:
        search.off *= FARTHER
        return not search.off < FARTHEST
    most = (search.beyond - theta) * whole.h
    left = _carried_root(motion, trial, g, most, trial.number - 1)
    if left is None and search.beyond == 1 and not (fixed or search.error <= 1):
        trial.number = 0  # a step that erred went across one, and nothing else says that there is
        return True  # any: the next step looks again
    trial.left = most if left is None else left
    _take_first_on_the_way(motion, trial)
    if trial.left <= FAR * trial.step.h and _carried_error(motion, trial) <= SAFE:
        return True
    if search.off > 2 * CLOSE and not fixed:
        trial.number = 0  # as near as it can come without error; the next step looks again
        return True
    search.before = theta
    search.place = min(theta + float(trial.left / whole.h), 0.5 * (theta + search.beyond))
    search.off *= NEARER
    return False


def _take_first_on_the_way(motion: Motion, trial: Landing) -> None:
    """Where another kink is on the way to the one that a step ended before, and would be gone
    across, it is that which the step ended before."""
    masked, own, left = int(motion.state["landed"]) - 1, trial.number - 1, trial.left
    before, found = kinks(motion, trial.end, trial.z), False
    for j in range(1, FOURTHS + 1):
        way = left * (j / FOURTHS)
        after = kinks(motion, trial.end + way, trial.carried(way))
        for k in np.flatnonzero(before * after < 0).tolist():
            if k in (masked, own):
                continue
            place = _carried_root(motion, trial, before[k], way, k)
            if place is not None and place < trial.left:
                trial.left, trial.number, found = place, k + 1, True
        if found:
            return


Place = tuple[Any, np.ndarray, np.ndarray]  # time, state and slope


def way_across(motion: Motion, trial: Landing, time: Any) -> tuple[Any, Any]:
    """How far it is from where a step ended to behind the kink, by no more than rounding; or to
    `time` where that is nearer, and then how far across what comes next is. 0 where no change of
    sign is near."""
    k = trial.number - 1
    start = kinks(motion, trial.end, trial.z)[k]
    more = 2 * np.finfo(motion.facts.real).eps * max(abs(trial.end), trial.left)
    left = time - trial.end
    if abs(left - trial.left) <= 4 * more:
        return max(left, 0.0), 4 * more
    for _ in range(ATTEMPTS):
        h = trial.left + more
        if not trial.end + h < time:
            break
        if start * kinks(motion, trial.end + h, trial.carried(h))[k] < 0:
            return h, 0.0
        more *= 2
    return 0.0, 0.0


def gone_on(motion: Motion, trial: Landing, h: Any, later: Any) -> Place:
    """By h on, with the slope at that state `later`. Raises Failed."""
    z = trial.carried(h)
    return trial.end + h, z, motion.slope(trial.end + h + later, z)


def is_blow(motion: Motion, trial: Landing) -> bool:
    """Whether what constraints allow jumps at the kink, and rates of the coordinates with it: that
    is a blow, and the quasi-velocities behind it are others. Or positions themselves, to which no
    motion leads."""
    positions = motion.facts.positions if motion.facts.lengths["constraints"] else 0
    return (positions > 0 and _jumps(motion, trial, _positions_apart)) or _jumps(
        motion, trial, _rates_apart
    )


def _jumps(
    motion: Motion, trial: Landing, measure: Callable[[Motion, Landing, Any], tuple[Any, Any]]
) -> bool:
    """What only begins there is the larger the farther behind it is; a jump is as large nearby."""
    eps = np.finfo(motion.facts.real).eps
    near = 4 * eps * max(abs(trial.end + trial.left), trial.left)
    try:
        apart, size = measure(motion, trial, near)
        begins = 0.5 * measure(motion, trial, 8 * near)[0]
    except Failed:
        return False
    return bool(apart > np.sqrt(eps) * size and apart > begins)


def _rates_apart(motion: Motion, trial: Landing, near: Any) -> tuple[Any, Any]:
    """By how much rates of the coordinates differ before and behind the kink, and the largest of
    them. Raises Failed."""
    before, after = (
        motion.slope(trial.end + h, trial.carried(h))[: motion.facts.nq]
        for h in (trial.left - near, trial.left + near)
    )
    return np.abs(after - before).max(), max(np.abs(before).max(), np.abs(after).max())


def _positions_apart(motion: Motion, trial: Landing, near: Any) -> tuple[Any, Any]:
    """The same of what positions are off the constraints, and the largest coordinate, or what it
    moves by in the step. Raises Failed."""
    before, after = (
        motion.values("constraints", trial.end + h, trial.carried(h))[: motion.facts.positions]
        for h in (trial.left - near, trial.left + near)
    )
    nq, last = motion.facts.nq, trial.step.stages[-1]
    large = np.abs(trial.z[:nq]) + np.abs(last[:nq]) * trial.step.h
    return np.abs(after - before).max(), large.max()


def _along(motion: Motion, step: Step, z: np.ndarray, k: int) -> Values:
    """Function k over the cubic through both ends."""
    state = step.continuous(None, motion.slope, z, step.stages[-1])
    return lambda theta: kinks(motion, step.t + theta * step.h, state(theta))[k]


def _first(motion: Motion, step: Step, z: np.ndarray) -> tuple[float, int]:
    """The share of the step at which one of the functions changes its sign first, or by rounding
    behind it, and which."""
    end = step.t + step.h
    rounding = 4 * np.finfo(motion.facts.real).eps * max(abs(end), step.h)
    state = step.continuous(None, motion.slope, z, step.stages[-1])
    before, masked = kinks(motion, step.t, step.y), int(motion.state["landed"]) - 1
    for j in range(1, FOURTHS + 1):
        a, b = (j - 1) / FOURTHS, j / FOURTHS
        if j < FOURTHS:
            after = kinks(motion, step.t + b * step.h, state(b))
        else:
            after = kinks(motion, end + rounding, z)
        changed = [int(k) for k in np.flatnonzero(before * after < 0) if k != masked]
        if changed:
            roots = [
                (float(_root(_along(motion, step, z, k), a, b, before[k], after[k], ROUGH)), k)
                for k in changed
            ]
            return min(roots)
        before = after
    return NEVER, -1


def _root(values: Values, a: Any, b: Any, ga: Any, gb: Any, most: int) -> Any:
    """About where the values are zero between a and b: false position with bisections, also where
    one end is a root. The end that stays counts half, so that it does not stay for ever."""
    side = 0
    for n in range(most):
        c = 0.5 * (a + b) if n % 3 == 2 else b - gb * (b - a) / (gb - ga)
        if not a < c < b:
            c = 0.5 * (a + b)
        g = values(c)
        if g * gb > 0:
            ga = 0.5 * ga if side > 0 else ga
            b, gb, side = c, g, 1
        else:
            gb = 0.5 * gb if side < 0 else gb
            a, ga, side = c, g, -1
        if b - a <= np.finfo(float).eps * abs(b):
            break
    return b


def _carried_root(motion: Motion, trial: Landing, g: Any, most: Any, k: int) -> Any:
    """How far behind the step kink k is, carried on; None where it is no nearer than `most`, or
    by rounding behind that."""

    def values(h: Any) -> Any:
        """Of the kink, so far behind the step."""
        return kinks(motion, trial.end + h, trial.carried(h))[k]

    last = values(most)
    if g * last < 0:
        return _root(values, 0.0, most, g, last, FINE)
    eps = np.finfo(motion.facts.real).eps
    behind = values(most + 4 * eps * max(abs(trial.end + most), most))
    return most if g * behind < 0 else None


def _carried_error(motion: Motion, trial: Landing) -> float:
    """What carrying on errs by, in units of the tolerance, about."""
    step, h = trial.step, trial.left
    bend = 0.5 * h * h * (step.stages[-1] - step.stages[0]) / step.h
    return motion.norm(bend, step.y, trial.z) * float(h / step.h)
