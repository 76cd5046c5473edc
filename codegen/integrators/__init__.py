"""Integrators as data, the default first. To add one: a file with a record of records.py, and its
line here."""

from codegen.integrators.dop853 import DOP853
from codegen.integrators.dopri5 import DOPRI5
from codegen.integrators.implicit_midpoint import IMPLICIT_MIDPOINT
from codegen.integrators.radau import RADAU
from codegen.integrators.records import (
    Collocation,
    Dense,
    Integrator,
    Midpoint,
    Rosenbrock,
    Tableau,
    Taylor,
)
from codegen.integrators.rk4 import RK4
from codegen.integrators.rkf45 import RKF45
from codegen.integrators.rosenbrock import ROSENBROCK
from codegen.integrators.taylor import TAYLOR
from codegen.integrators.verner9 import VERNER9

INTEGRATORS: tuple[Integrator, ...] = (
    DOP853,
    VERNER9,
    DOPRI5,
    RKF45,
    RK4,
    RADAU,
    ROSENBROCK,
    IMPLICIT_MIDPOINT,
    TAYLOR,
)


def integrator_of(name: str) -> Integrator | None:
    """The integrator of that name; None where there is none."""
    return {integrator.name: integrator for integrator in INTEGRATORS}.get(name)


AUTO = "auto"  # the word that leaves the choice to the tolerance and the number of motions
AUTOMATIC = ("dop853", "verner9", "taylor")  # what it chooses from, where they fit the program
TIGHT = 1e-7  # rtol; from it on the pair of order 9 takes less time than that of order 8

__all__ = [
    "AUTO",
    "AUTOMATIC",
    "INTEGRATORS",
    "ROSENBROCK",
    "TIGHT",
    "Collocation",
    "Dense",
    "Integrator",
    "Midpoint",
    "Rosenbrock",
    "Tableau",
    "Taylor",
    "integrator_of",
]
