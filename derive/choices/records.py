"""What a choice of quasi-velocities leaves to the code that runs: pivots to watch, and a frame that
is given at run time."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.choices.limits import SINGULAR


@dataclass(frozen=True)
class Frame:
    """Directions E that are data of the generated module: its last parameters, column by column.

    The choice is regular where the projection of E on the motions that the constraints allow is;
    before it degenerates, the frame is based anew.
    """

    symbols: ca.SX
    labels: tuple[str, ...]
    values: tuple[float, ...]  # what counts unless others are given


@dataclass(frozen=True)
class Guard:
    """A pivot that must stay away from zero: |value| ≥ tolerance, else the function returns status
    SINGULAR.

    `part` is what the tolerance is of the pivot's usual size; code of fewer digits raises it.
    """

    name: str
    value: ca.SX
    tolerance: float
    part: float = SINGULAR
