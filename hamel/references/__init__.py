"""Integrators of other libraries over the same equations. To add one: a file with a Reference, and its line here."""

from hamel.references.records import Problem, Reference
from hamel.references.scipy_solvers import SCIPY
from hamel.references.sundials import CVODES, IDAS

REFERENCES: tuple[Reference, ...] = (*SCIPY, CVODES, IDAS)

__all__ = ["REFERENCES", "Problem", "Reference"]
