"""A motion that targets with a `simulate` of their own are compared along: the module's, from an
admissible state, with the inputs held."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.records import Row, Subject

# s, the first at whose end the motion arrives in so many steps, the same if it begins beside;
# output times
SPANS, MOST, ROWS = (1.0, 0.1, 0.01, 1e-3, 1e-4), 2_000, 2
TOLERANCE = 1e-10  # of both
SAME = 1e-7  # relative to the largest entry, in float64: other compilers round otherwise
COARSE, COARSE_SAME = 1e-5, 1e-2  # of float32
# Steps, relative: the error by which one is accepted is rounded otherwise; in float32 it is mostly
# rounding.
STEPS, COARSE_STEPS = 0.1, 0.5
# A motion that begins this part of its tolerance beside, and ends farther apart than the same part
# of what is asked of targets, is chaos: it magnifies any rounding a thousand times and more.
BESIDE = 0.01


@dataclass(frozen=True)
class Motion:
    """x at the times, from x[0] on, in so many steps; `rtol` is that of both. Rows behind an event
    that stops the motion are as it was there."""

    times: Array
    x: Array
    u: Array
    p: Array
    rtol: float
    steps: int

    @property
    def double(self) -> bool:
        return self.rtol == TOLERANCE

    def checks(self, where: str, rows: Array, steps: float) -> Iterator[CheckResult]:
        """Another motion from the same state: its rows; and its steps, which tell whether tolerance
        and step size are those that were asked for."""
        few = STEPS if self.double else COARSE_STEPS
        yield self._compared(f"simulate in {where}", self.error(rows), self.same)
        difference = abs(steps - self.steps) / self.steps
        yield self._compared(f"steps in {where}", difference, few)

    @property
    def same(self) -> float:
        """What another compiler's motion may differ by, relative to the largest entry."""
        return SAME if self.double else COARSE_SAME

    def error(self, rows: Array) -> float:
        """Of the rows of another motion, relative to the largest entry of this one."""
        size = max(1.0, float(np.nanmax(np.abs(self.x))))
        given = np.asarray(rows, dtype=float).reshape(self.x.shape)
        reached = np.isfinite(self.x)
        if not np.array_equal(np.isfinite(given), reached):
            return np.inf
        return float(np.max(np.abs(given - self.x)[reached])) / size

    def _compared(self, name: str, value: float, limit: float) -> CheckResult:
        about = f"a motion of the module in {self.steps} steps, inputs held"
        return CheckResult(name, value, limit, bool(value <= limit), about)


def motion_of(subject: Subject) -> Motion | None:
    """None where the module has no motions, or none of the states starts one that ends well."""
    module = subject.module
    if not hasattr(module, "simulate"):
        return None
    double = module.defaults.dtype == np.float64
    rtol = TOLERANCE if double else COARSE
    for span, (k, _) in itertools.product(SPANS, enumerate(subject.sizes("dynamics"))):
        t, x, u, p = subject.row("dynamics", k)
        times = t + np.linspace(0.0, span, ROWS + 1)
        motion = _motion(subject, (t, x, u, p), times, rtol)
        if motion is not None and _is_tame(subject, motion):
            return motion
    return None


def _is_tame(subject: Subject, motion: Motion) -> bool:
    """Whether motions from beside stay there."""
    start = motion.x[0]
    size = max(1.0, float(np.max(np.abs(start), initial=0.0)))
    aside = BESIDE * motion.rtol * size * np.where(np.arange(len(start)) % 2, -1.0, 1.0)
    row = (float(motion.times[0]), start + aside, motion.u, motion.p)
    other = _motion(subject, row, motion.times, motion.rtol)
    return other is not None and motion.error(other.x) <= BESIDE * motion.same


def _motion(subject: Subject, row: Row, times: Array, rtol: float) -> Motion | None:
    t, x, u, p = row
    tight: dict[str, Any] = {"rtol": rtol, "atol": rtol, "max_steps": MOST}
    start = subject.module.project(t, x, u, p) if hasattr(subject.module, "project") else x
    try:
        rows = subject.module.simulate((t, times[-1]), start, u, p, times=times, **tight)
    except subject.module.Stopped:
        return None
    states = np.asarray(rows.x, dtype=float)
    motion = np.tile(states[-1], (len(times), 1))
    reached = np.isin(times, rows.t)
    motion[reached] = states[: np.count_nonzero(reached)]
    return Motion(times, motion, u, p, rtol, rows.steps)
