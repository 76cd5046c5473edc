"""Guards on the way of a motion in NumPy: what must not vanish, and whether a motion across a
singular position may be believed, as in runtime_enforcements.h and runtime_simulate.h.

The same file in every generated folder. No claim of licence is made on it: 0BSD, see LICENSE.txt.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from .numpy_motion import Failed, Motion
from .runge_kutta import Step
from .simulation import Status

CUTS = (0.37, 0.61, 0.23, 0.5, 0.78, 0.44, 0.69, 0.3)  # of a step that is made again in two
FIRST = 3  # of the cuts: the others where stages are on the constraints
FOLLOWED = 0.8  # of the speed: a jump of the rates that no step follows
NEAR = 0.1  # of the largest: a guard that positions off the constraints may mislead


def guards(motion: Motion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Last values, largest sizes and rates of the guards there are here."""
    state, count = motion.state, motion.facts.guards[motion.chart]
    return state["guard"][:count], state["guard_size"][:count], state["guard_rate"][:count]


def looked(motion: Motion, t: Any, h: Any, z: np.ndarray) -> tuple[np.ndarray, bool]:
    """Guards at z and whether one was crossed. Raises Failed at a singular position."""
    last, size, rate = guards(motion)
    values, limits = motion.facts.array(last.size), motion.facts.limits
    if last.size and motion.call("guards", t, z, values):
        raise Failed(Status.SINGULAR_POSITION)
    drift = _drift(motion, t, z)
    left = np.abs(values) / np.maximum(size, np.abs(values))
    misled = (left < NEAR) & (drift > limits.drift * left * left)
    if not (left > limits.pivot).all() or misled.any():
        raise Failed(Status.SINGULAR_POSITION)
    before = np.abs(last) + 1.2 * h * np.minimum(rate, 0.0)
    return values, bool(((size > 0) & ((values * last < 0) | (before < 0))).any())


def _drift(motion: Motion, t: Any, z: np.ndarray) -> Any:
    """How far positions are off the constraints."""
    if not motion.facts.positions:
        return 0.0
    violation = motion.values("constraints", t, z)
    return np.abs(violation[: motion.facts.positions]).max()


def remember(motion: Motion, h: Any, values: np.ndarray) -> None:
    """The guards after a step of length h."""
    last, size, rate = guards(motion)
    change = np.abs(values) - np.abs(last)
    rate[:] = np.where(values * last > 0, change / h, 0.0) if h > 0 else 0.0
    last[:], size[:] = values, np.maximum(size, np.abs(values))


def forget(motion: Motion) -> None:
    """Begin anew with the guards where the state is. Raises Failed."""
    state = motion.state
    state["guard"], state["guard_size"], state["guard_rate"] = 0.0, 0.0, 0.0
    begin(motion)


def begin(motion: Motion) -> None:
    """With the guards where the state is. Raises Failed."""
    remember(motion, 0.0, looked(motion, motion.state["t"], 0.0, motion.state["x"])[0])


def is_passing(motion: Motion, h: Any) -> bool:
    """Whether a guard would vanish within h if it went on as in the last step. Rates of coordinates
    are quotients there whose parts vanish together: stages have to be on the constraints."""
    facts = motion.facts
    projects = facts.enforcements[int(motion.state["enforcement"])] == "projection"
    if not projects or not facts.lengths["project"] or not any(facts.guards):
        return False
    last, size, rate = guards(motion)
    before = np.abs(last) + 1.2 * h * np.minimum(rate, 0.0)
    return bool(((size > 0) & (before < 0)).any())


def passed(motion: Motion, step: Step, end: Any, z: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """The guards at z, if the step to there may be believed. Raises Failed."""
    values, crossed = looked(motion, end, step.h, z)
    if crossed and not _believed(motion, step, end, z, slope):
        raise Failed(Status.SINGULAR_POSITION)
    motion.state["crossings"] += crossed
    return values


def _believed(motion: Motion, step: Step, end: Any, z: np.ndarray, slope: np.ndarray) -> bool:
    """Whether the rates of the coordinates do not jump, and a step back or other steps agree."""
    nq, own = motion.facts.nq, step.stages[0]
    jump, speed = np.abs((slope - own)[:nq]).max(), np.abs(own[:nq]).max()
    if jump > FOLLOWED * speed:
        return False
    cuts = (step.t + cut * step.h for cut in (CUTS if motion.passing else CUTS[:FIRST]))
    ways = ([step.t, cut, end] for cut in cuts)
    if any(_leads(motion, way, (step.y, own), (z, slope), speed) for way in ways):
        return True
    back = [end, step.t]
    return motion.passing and _leads(motion, back, (z, slope), (step.y, own), speed)


Place = tuple[np.ndarray, np.ndarray]  # a state and its slope


def _leads(motion: Motion, way: Sequence[Any], start: Place, goal: Place, speed: Any) -> bool:
    """Whether steps between the times of the way lead from the start to the goal: the state within
    the tolerance, rates of the coordinates nearly so."""
    (first, _), (z, slope) = start, goal
    y, own = start
    try:
        for t, end in pairwise(way):
            y, own = motion.landed(t, end, y, own)
    except Failed:
        return False
    differ = np.abs((own - slope)[: motion.facts.nq]).max()
    within = min(10 * motion.rtol, motion.facts.limits.agreement) * speed
    return motion.norm(y - z, first, z) <= 1 and bool(differ <= within)
