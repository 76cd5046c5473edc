"""A motion that targets with a `simulate` of their own are compared along: the module's, from an
admissible state, with the inputs held."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from hamel.verify.records import CheckResult
from hamel.verify.reference.vectors import Array
from hamel.verify.targets.records import Row, Subject

SPANS, ROWS = (1.0, 0.1, 0.01), 2  # s, the first that the motion comes to the end of; output times
TOLERANCE = 1e-10  # of both
SAME = 1e-7  # relative to the largest entry, in float64: other compilers round otherwise
COARSE, COARSE_SAME = 1e-5, 1e-2  # of float32


@dataclass(frozen=True)
class Motion:
    """x at the times, from x[0] on; `rtol` is that of both."""

    times: Array
    x: Array
    u: Array
    p: Array
    rtol: float
    same: float

    def check(self, name: str, rows: Array) -> CheckResult:
        """Rows of another motion from the same state."""
        size = max(1.0, float(np.max(np.abs(self.x))))
        error = np.abs(np.asarray(rows, dtype=float).reshape(self.x.shape) - self.x)
        value = float(np.max(error)) / size
        passed = bool(value <= self.same)
        return CheckResult(name, value, self.same, passed, "a motion of the module, inputs held")


def motion_of(subject: Subject) -> Motion | None:
    """None where the module has no motions, or none of the states starts one that ends well."""
    module = subject.module
    if not hasattr(module, "simulate"):
        return None
    double = module.defaults.dtype == np.float64
    rtol, same = (TOLERANCE, SAME) if double else (COARSE, COARSE_SAME)
    for span, (k, _) in itertools.product(SPANS, enumerate(subject.sizes("dynamics"))):
        row = subject.row("dynamics", k)
        times = row[0] + np.linspace(0.0, span, ROWS + 1)
        rows = _rows(subject, row, times, rtol)
        if rows is not None:
            return Motion(times, rows, row[2], row[3], rtol, same)
    return None


def _rows(subject: Subject, row: Row, times: Array, rtol: float) -> Array | None:
    t, x, u, p = row
    tight = {"rtol": rtol, "atol": rtol}
    start = subject.module.project(t, x, u, p) if hasattr(subject.module, "project") else x
    try:
        motion = subject.module.simulate((t, times[-1]), start, u, p, times=times, **tight)
    except subject.module.Stopped:
        return None
    return np.asarray(motion.x, dtype=float)
