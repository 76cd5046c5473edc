"""The seconds of one model: so many for its runs, and as many for the modules that they need."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from hamel.engines import Engine
from hamel.study.series import Outcome, Task, outcomes

LEAST_MODULES = 2  # that are built whatever it takes: with fewer nothing is compared


@dataclass
class Budget:
    """What is left of `seconds`; less than nothing where what is needed took more."""

    seconds: float
    runs: float
    modules: float

    def ran(
        self,
        by: Engine,
        series: Iterable[Iterable[Task]],
        is_last: Callable[[Outcome], bool] = lambda outcome: False,
        share: float = 1.0,
    ) -> Generator[Outcome, None, None]:
        """Outcomes of runs, until this share of the seconds that are left for them is over: 0 for
        those that are made in any case."""
        end = time.monotonic() + share * self.runs if share else math.inf
        with self._counted("runs"):
            yield from outcomes(by, series, is_last, lambda: end)

    def built(
        self, by: Engine, series: Iterable[Iterable[Task]], ready: Callable[[], float]
    ) -> Generator[Outcome, None, None]:
        """Outcomes of builds, until the seconds for them are over and enough modules are `ready`:
        as many as nothing can be compared without."""
        end = time.monotonic() + self.modules
        with self._counted("modules"):
            yield from outcomes(
                by, series, until=lambda: end if ready() >= LEAST_MODULES else math.inf
            )

    @contextmanager
    def _counted(self, name: str) -> Iterator[None]:
        """Takes the seconds that pass from those that are left."""
        begin = time.monotonic()
        try:
            yield
        finally:
            setattr(self, name, getattr(self, name) - (time.monotonic() - begin))


def budget_of(seconds: float) -> Budget:
    """Of which nothing is used up."""
    return Budget(seconds, seconds, seconds)
