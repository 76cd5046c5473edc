"""Equations to linearise, of a system that is at hand."""

from __future__ import annotations

from derive.formulations import equations
from derive.formulations.records import Equations
from derive.linearize.minimal import with_linearization
from derive.mechanics.records import System


def equations_in(system: System, choice: str | None) -> Equations:
    """System → Equations in a choice of quasi-velocities, ready to be linearised."""
    return with_linearization(
        equations(system, choice, "quasi_velocities", charts=True, moving=True)
    )
