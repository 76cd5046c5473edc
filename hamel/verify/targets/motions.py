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

SPANS, ROWS = (1.0, 0.1, 0.01), 2  # s, the first that the motion comes to the end of; output times
TOLERANCE = 1e-10  # of both
SAME = 1e-7  # relative to the largest entry, in float64: other compilers round otherwise
COARSE, COARSE_SAME = 1e-5, 1e-2  # of float32
# Steps, relative: the error by which one is accepted is rounded otherwise; in float32 it is mostly
# rounding.
STEPS, COARSE_STEPS = 0.1, 0.5


@dataclass(frozen=True)
class Motion:
    """x at the times, from x[0] on, in so many steps; `rtol` is that of both."""

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
        same, few = (SAME, STEPS) if self.double else (COARSE_SAME, COARSE_STEPS)
        yield self._compared(f"simulate in {where}", self._error(rows), same)
        difference = abs(steps - self.steps) / self.steps
        yield self._compared(f"steps in {where}", difference, few)

    def _error(self, rows: Array) -> float:
        size = max(1.0, float(np.max(np.abs(self.x))))
        error = np.abs(np.asarray(rows, dtype=float).reshape(self.x.shape) - self.x)
        return float(np.max(error)) / size

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
        row = subject.row("dynamics", k)
        times = row[0] + np.linspace(0.0, span, ROWS + 1)
        motion = _motion(subject, row, times, rtol)
        if motion is not None:
            x = np.asarray(motion.x, dtype=float)
            return Motion(times, x, row[2], row[3], rtol, motion.steps)
    return None


def _motion(subject: Subject, row: Row, times: Array, rtol: float) -> Any | None:
    t, x, u, p = row
    tight = {"rtol": rtol, "atol": rtol}
    start = subject.module.project(t, x, u, p) if hasattr(subject.module, "project") else x
    try:
        return subject.module.simulate((t, times[-1]), start, u, p, times=times, **tight)
    except subject.module.Stopped:
        return None
