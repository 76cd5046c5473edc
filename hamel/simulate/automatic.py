"""The integrator of `auto`: by the tolerance, and by how short the series of the motion are."""

from __future__ import annotations

from codegen.integrators import AUTOMATIC, TIGHT
from codegen.passes.taylor import SERIES, faster_from
from derive.formulations.records import Equations
from hamel.build.stages import program_of
from hamel.simulate.method import Method


def picked(method: Method, by: Equations, smooth: bool) -> str:
    """The name of an integrator for one motion. `smooth`: nothing acts at every stage of a step,
    neither an enforcement nor a function that gives the inputs."""
    if smooth and method.step_size is None:
        rates = program_of(by, ("dynamics",), AUTOMATIC[:1])
        if method.rtol <= faster_from(rates):
            return SERIES
    return explicit(method)


def explicit(method: Method) -> str:
    """The name of a Runge-Kutta method for one motion."""
    return "verner9" if method.rtol <= TIGHT else "dop853"
