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
NEAREST = 1e-6  # share of a step: a kink before that is left to the error control
ATTEMPTS = 20
CLOSE = 1e-3  # share of a step that is left to the kink at first
SAFE = 0.01  # in units of the tolerance
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


def landing(motion: Motion, step: Step, z: np.ndarray, error: float) -> Landing:
    """The step, or a shorter one that ends before the first kink on its way; one that ends earlier
    where forces jump. Raises Failed."""
    whole = Landing(step, z, error)
    place, k = _first(motion, step, z)
    if not NEAREST < place < 1:
        return whole
    fixed = bool(motion.state["step_size"])
    start: Any = kinks(motion, step.t, step.y)[k]
    a, b = 0.0, 1.0
    off = 0.1 if fixed else CLOSE
    for _ in range(ATTEMPTS):
        theta = float(max(0.5 * (a + place), (1 - off) * place))
        try:
            short, z, error = motion.stepped(step.t, theta * step.h, step.y, step.stages[0])
        except Failed:
            break
        trial = Landing(short, z, 0.0 if fixed else error, k + 1)
        g: Any = kinks(motion, trial.end, z)[k]
        if not g * start > 0:
            b = theta
            place = theta * float(_root(_along(motion, short, z, k), 0.0, 1.0, start, g, 8))
            place = place if place > a else 0.5 * (a + b)
        elif not trial.error <= 1:
            off *= 8
            if not off < 0.6:
                return trial
        else:
            trial.left = _carried_root(motion, trial, g, (b - theta) * step.h)
            if _carried_error(motion, trial) <= SAFE:
                return trial
            if off > 2 * CLOSE and not fixed:
                trial.number = 0
                return trial
            a, place = theta, min(theta + float(trial.left / step.h), 0.5 * (theta + b))
            off *= 0.1
    return whole


def crossed(motion: Motion, trial: Landing, time: Any) -> tuple[Any, np.ndarray, np.ndarray] | None:
    """Time, state and slope behind the kink, by no more than rounding; None where `time` is nearer
    or no change of sign is near. Raises Failed."""
    k = trial.number - 1
    start = kinks(motion, trial.end, trial.z)[k]
    more = 2 * np.finfo(motion.facts.real).eps * max(abs(trial.end), trial.left)
    for _ in range(ATTEMPTS):
        h = trial.left + more
        if not trial.end + h < time:
            return None
        z = trial.carried(h)
        if start * kinks(motion, trial.end + h, z)[k] < 0:
            return trial.end + h, z, motion.slope(trial.end + h, z)
        more *= 2
    return None


def _along(motion: Motion, step: Step, z: np.ndarray, k: int) -> Values:
    """Function k over the cubic through both ends."""
    state = step.continuous(None, motion.slope, z, step.stages[-1])
    return lambda theta: kinks(motion, step.t + theta * step.h, state(theta))[k]


def _first(motion: Motion, step: Step, z: np.ndarray) -> tuple[float, int]:
    """The share of the step at which one of the functions changes its sign first, and which."""
    state = step.continuous(None, motion.slope, z, step.stages[-1])
    before, masked = kinks(motion, step.t, step.y), int(motion.state["landed"]) - 1
    for j in range(1, FOURTHS + 1):
        a, b = (j - 1) / FOURTHS, j / FOURTHS
        at = state(b) if j < FOURTHS else z
        after = kinks(motion, step.t + b * step.h, at)
        changed = [int(k) for k in np.flatnonzero(before * after < 0) if k != masked]
        if changed:
            roots = [
                (float(_root(_along(motion, step, z, k), a, b, before[k], after[k], 8)), k)
                for k in changed
            ]
            return min(roots)
        before = after
    return 1.0, -1


def _root(values: Values, a: Any, b: Any, ga: Any, gb: Any, most: int) -> Any:
    """About where the values are zero between a and b: false position with bisections."""
    for n in range(most):
        c = 0.5 * (a + b) if n % 3 == 2 else b - gb * (b - a) / (gb - ga)
        g = values(c)
        if g * gb > 0:
            b, gb = c, g
        else:
            a, ga = c, g
        if b - a <= np.finfo(float).eps * abs(b):
            break
    return b


def _carried_root(motion: Motion, trial: Landing, g: Any, most: Any) -> Any:
    """How far behind the step the kink is, carried on; `most` where it is no nearer."""
    k = trial.number - 1

    def values(h: Any) -> Any:
        return kinks(motion, trial.end + h, trial.carried(h))[k]

    last = values(most)
    return _root(values, 0.0, most, g, last, 60) if g * last < 0 else most


def _carried_error(motion: Motion, trial: Landing) -> float:
    """What carrying on errs by, in units of the tolerance, about."""
    step, h = trial.step, trial.left
    bend = 0.5 * h * h * (step.stages[-1] - step.stages[0]) / step.h
    return motion.norm(bend, step.y, trial.z) * float(h / step.h)
