"""What a choice of quasi-velocities leaves to the code that runs: pivots to watch."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Guard:
    """A pivot that must stay away from zero: |value| ≥ tolerance, else the function returns status
    SINGULAR.

    `part` is what the tolerance is of the pivot's usual size; code of fewer digits raises it.
    """

    name: str
    value: ca.SX
    tolerance: float
    part: float = 1e-9
