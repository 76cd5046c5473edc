"""From a model and a file of measurements to values of the base and of all standard parameters."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from derive.formulations.evaluate import function_of
from derive.formulations.records import Equations
from hamel.identify.base import Base, base_parameters
from hamel.identify.estimate import (
    Estimate,
    Rows,
    consistent,
    ordinary,
    rows_of,
    weighted,
)
from hamel.identify.measured import Measured, measured, parameters_of

Array = np.ndarray


@dataclass(frozen=True)
class Fit:
    """`own` and `consistent`: all standard parameters, of the file and as fitted (None without a
    solver); `fresh`: the rows of a motion that was not fitted."""

    equations: Equations
    base: Base
    motion: Measured
    rows: Rows
    ordinary: Estimate
    weighted: Estimate
    own: Array
    consistent: Array | None
    fresh: Rows | None

    @property
    def values(self) -> Array:
        """The base parameters that predictions are made with: consistent where there are any."""
        if self.consistent is None:
            return self.weighted.values
        return self.base.combination @ self.consistent


def fit(
    equations: Equations,
    data: str | Path,
    cutoff: float | None,
    check: str | Path | None,
    solver: Any,
) -> Fit:
    """All estimates of a model's parameters. `solver` is the module clarabel, or None; raises as
    `measured` and `ordinary` do."""
    base = base_parameters(equations)
    motion = measured(equations, data, cutoff)
    rows = rows_of(equations, base, motion)
    first, second = ordinary(rows), weighted(rows)
    own = own_values(equations)
    physical = None if solver is None else consistent(rows, base, second.spread, own, solver)
    fresh = None if check is None else rows_of(equations, base, measured(equations, check, cutoff))
    return Fit(equations, base, motion, rows, first, second, own, physical, fresh)


def own_values(equations: Equations) -> Array:
    """The standard parameters of the file."""
    function = function_of(equations, equations.request("standard_parameters").function)
    state = np.zeros(equations.argument("x").symbols.numel())
    idle = np.zeros(equations.system.u.numel())
    return function(0.0, state, idle, np.array(parameters_of(equations))).full().ravel()


def residuals(rows: Rows, values: Array) -> Array:
    """What is left of each equation: states × nw."""
    return rows.y - rows.A @ values


def relative(rows: Rows, values: Array) -> Array:
    """Root mean square of what is left, of that of the forces."""
    size = np.sqrt(np.mean(rows.y**2, axis=0))
    left = np.sqrt(np.mean(residuals(rows, values) ** 2, axis=0))
    return left / np.where(size > 0.0, size, 1.0)
