"""What linearising gives: δẋ = A δx + B δu, δy = C δx + D δu in minimal states."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca
import numpy as np

from derive.choices.records import Guard
from derive.formulations.records import Equations


class Kink(Enum):
    """What a motion on a kink has on both sides: the same slopes,
    others, or other forces."""

    NONE = "none"
    BENDS = "bends"
    JUMPS = "jumps"


@dataclass(frozen=True)
class Linear:
    """The equations linearised about any state on the constraints, over (t, x, u, p).

    The states are the independent coordinates and all quasi-velocities, 2n − 2m_h − m_n of them:
    x's perturbation is T times theirs. The dependent coordinates follow from φ_q δq = 0. As the
    states are entries of x, the equations hold along every motion, not only along steady ones; what
    the constraints exert is in them, for ẋ = f(x) has no multipliers left.
    """

    equations: Equations
    states: tuple[str, ...]
    units: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    independent: tuple[int, ...]  # where in x the states are
    dependent: tuple[int, ...]
    T: ca.SX  # nx × n
    A: ca.SX
    B: ca.SX
    C: ca.SX
    D: ca.SX
    guards: tuple[Guard, ...]  # pivots of the dependent coordinates
    across: np.ndarray | None = None  # a way in x across kinks: A to D are the mean of both sides
    kink: Kink = Kink.NONE


@dataclass(frozen=True)
class Steady:
    """A steady motion: state and inputs, one row for each of N sets of values; `residual` is the
    worst of each row. `breaks` are rows on another branch than the row before, `absent` rows for
    which no steady motion was found: theirs are not numbers."""

    x: np.ndarray  # N × nx
    u: np.ndarray  # N × nu
    p: np.ndarray  # N × np
    residual: np.ndarray
    breaks: tuple[int, ...] = ()
    absent: tuple[int, ...] = ()
