"""Motions that targets are compared along are no longer than rounding lets them be the same.

Of hamel.verify.targets: motions.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hamel.verify.targets.motions import MOST, Motion, motion_of

START = np.array([0.5, -0.25])
RATE = 50.0  # 1/s, of what grows; a second magnifies by e⁵⁰


class Stopped(Exception):
    """What a module raises where a motion does not end well."""


def subject(rate: float, steps_per_second: float) -> Any:
    """ẋ = rate (x − START), which rests where it begins, as a module of so many steps."""

    def simulate(span, x, u, p, times, rtol, atol, max_steps):
        steps = int(steps_per_second * (span[1] - span[0])) + 1
        if steps > max_steps:
            raise Stopped
        growth = np.exp(np.minimum(rate * (times - times[0]), 300.0))
        rows = START + growth[:, np.newaxis] * (x - START)
        return SimpleNamespace(t=times, x=rows, steps=steps)

    row = (0.0, START, np.zeros(0), np.zeros(0))
    module = SimpleNamespace(defaults=np.zeros(0), simulate=simulate, Stopped=Stopped)
    return SimpleNamespace(module=module, row=lambda *_: row, sizes=lambda _: [1.0])


@pytest.mark.parametrize(
    ("rate", "steps", "span"),
    [(0.0, 100, 1.0), (RATE, 100, 0.1), (-RATE, 100, 1.0), (0.0, 3 * MOST, 0.1), (1e6, 1, None)],
)
def test_the_span_is_the_longest_at_whose_end_motions_from_beside_agree(rate, steps, span):
    motion = motion_of(subject(rate, steps))
    assert (motion and motion.times[-1]) == span


def test_chaos_would_have_been_an_error_of_the_target():
    """Rounding of the start alone fails the check over a second of what grows so."""
    motion = motion_of(subject(0.0, 100))
    assert isinstance(motion, Motion)
    grown = motion.x.copy()
    grown[-1] += 2.0**-53 * np.exp(RATE)
    checks = list(motion.checks("", grown, motion.steps))
    assert [check.passed for check in checks] == [False, True]
