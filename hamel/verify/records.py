"""What verification says. The fields are the keys of `--json`."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class CheckResult:
    """One check at all states: `value` is the worst relative error met, `about` says against what
    and why the tolerance."""

    name: str
    value: float
    tolerance: float
    passed: bool
    about: str

    @property
    def failure(self) -> str:
        """What is told where it did not pass."""
        if not math.isfinite(self.value):
            return f"{self.name}: not finite"
        return f"{self.name}: {self.value:.2g} exceeds {self.tolerance:.2g}"


@dataclass(frozen=True)
class Verification:
    """All checks of one choice of quasi-velocities at `states` random admissible states.

    `rank` is that of A there, `region` the least and the largest value of whatever varied, `varied`
    the parameters among them.
    """

    model: str
    choice: str
    passed: bool
    checks: tuple[CheckResult, ...]
    states: int
    seed: int
    rank: int = 0
    region: tuple[tuple[str, float, float], ...] = ()
    varied: tuple[str, ...] = ()
    where: str = (
        ""  # of checks that fail: a result without a value, or the state nearest to singular
    )

    @property
    def failed(self) -> tuple[CheckResult, ...]:
        """The checks that did not pass, in the order of the suite."""
        return tuple(check for check in self.checks if not check.passed)

    def as_json(self) -> dict[str, Any]:
        """{"model", "choice", "passed", "checks": [{"name", "value", "tolerance", "passed",
        "about"}], "states", "seed"}."""
        return asdict(self)
