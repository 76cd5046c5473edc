"""Integrators of other libraries, to compare the generated ones with: what they get and what they
give back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from derive.formulations.functions import positions

if TYPE_CHECKING:
    from derive.formulations.records import Equations


@dataclass(frozen=True)
class Problem:
    """A motion to compute: compiled functions, what they were made of, output times, state at the
    first, inputs, parameters.

    `compiled`: what the solver evaluates goes through the C compiler first, which pays where a run
    is repeated or long.
    """

    module: ModuleType
    equations: Equations
    times: np.ndarray
    x: np.ndarray
    u: np.ndarray
    p: np.ndarray
    rtol: float
    atol: float
    compiled: bool = False


@dataclass(frozen=True)
class Found:
    """As the module's own simulate() gives it. Violations are the largest at the output times."""

    t: np.ndarray
    x: np.ndarray
    work: np.ndarray
    steps: int
    rejected: int
    calls: int
    position_violation: float
    velocity_violation: float
    crossings: int = 0
    charts: int = 0


@dataclass(frozen=True)
class Reference:
    """`prepare` makes all that is no part of a run, and gives the run; `refusal` says why it does
    not fit some equations."""

    name: str
    about: str
    source: str
    prepare: Callable[[Problem], Callable[[], Found]]
    refusal: Callable[[Equations], str] = lambda found: ""


def found(
    problem: Problem, x: np.ndarray, work: np.ndarray, steps: int, rejected: int, calls: int
) -> Found:
    """With the violations that the module's own functions see."""
    module, closed = problem.module, positions(problem.equations.system)
    if not hasattr(module, "constraints"):
        return Found(problem.times, x, work, steps, rejected, calls, 0.0, 0.0)
    size = np.abs(module.constraints(problem.times, x, problem.u, problem.p))
    position, velocity = (
        float(np.max(part, initial=0.0)) for part in (size[:, :closed], size[:, closed:])
    )
    return Found(problem.times, x, work, steps, rejected, calls, position, velocity)
