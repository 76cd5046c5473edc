"""Stages of work: each is timed, and said in the log with what goes in and what comes out."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

LOG = logging.getLogger("hamel")
LINE = "%-12s %-44s %8.3f s"  # stage, what goes in and comes out, seconds


@dataclass
class Clock:
    """Seconds per stage, in the order the stages ran."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, stage: str, about: str = "") -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            took = time.perf_counter() - start
            self.seconds[stage] = self.seconds.get(stage, 0.0) + took
            LOG.info(LINE, stage, about, took)
