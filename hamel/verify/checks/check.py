"""What a check is: a worst error over the states, a tolerance and a line that says why it is that
large."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hamel.verify.checks.evidence import Evidence


@dataclass(frozen=True)
class Check:
    """`error` gives the worst relative error, or None where the check does not apply to the
    choice."""

    name: str
    tolerance: float
    about: str
    error: Callable[[Evidence], float | None]
    rounding: bool = (
        False  # the tolerance counts in units of rounding of the module, and is given for double
    )
