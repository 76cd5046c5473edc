"""Integrators of other libraries, to compare the generated ones with: what they get and what they
give back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from codegen.runtime.simulation import Simulation, Status, Stopped
from derive.formulations.projection import positions

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
class Reference:
    """`prepare` makes all that is no part of a run, and gives the run; `refusal` says why it does
    not fit some equations."""

    name: str
    about: str
    source: str
    prepare: Callable[[Problem], Callable[[], Simulation]]
    refusal: Callable[[Equations], str] = lambda found: ""


def simulation(
    problem: Problem, x: np.ndarray, work: np.ndarray, steps: int, rejected: int, calls: int
) -> Simulation:
    """As the module's own simulate() gives it, with the violations that the module's own functions
    see at the output times."""
    module, closed = problem.module, positions(problem.equations.system)
    if not hasattr(module, "constraints"):
        return Simulation(problem.times, x, work, steps, rejected, calls, 0.0, 0.0)
    size = np.abs(module.constraints(problem.times, x, problem.u, problem.p))
    position, velocity = (
        float(np.max(part, initial=0.0)) for part in (size[:, :closed], size[:, closed:])
    )
    return Simulation(problem.times, x, work, steps, rejected, calls, position, velocity)


class Refusal(Stopped):
    """A solver that could not go on: why, in its own words."""

    def __init__(self, message: str, partial: Simulation, cause: str) -> None:
        super().__init__(message, partial)
        self.cause = cause


def refusal(
    problem: Problem, why: str, status: Status = Status.STEP_TOO_SMALL, cause: str = ""
) -> Refusal:
    """What to raise where a solver cannot go on; it has no rows then. `cause` is `why` in fewer
    words, where there are any."""
    rows = np.full((problem.times.size, problem.x.size + 1), np.nan)
    nothing = Simulation(problem.times, rows[:, 1:], rows[:, 0], 0, 0, 0, 0.0, 0.0, status=status)
    return Refusal(f"{problem.module.name}: {why}", nothing, cause or why)
