"""Integrators of other libraries over the same equations. To add one: a file with a Reference, and
its line here."""

from hamel.simulate.libraries.records import Problem, Reference, Refusal
from hamel.simulate.libraries.scipy_solvers import SCIPY
from hamel.simulate.libraries.sundials import CVODES, IDAS

REFERENCES: tuple[Reference, ...] = (*SCIPY, CVODES, IDAS)

__all__ = ["REFERENCES", "Problem", "Reference", "Refusal"]
