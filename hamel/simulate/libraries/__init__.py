"""Integrators of other libraries over the same equations. To add one: a file with a Reference, and
its line here."""

from hamel.simulate.libraries.records import Problem, Reference, Refusal
from hamel.simulate.libraries.scipy_solvers import SCIPY
from hamel.simulate.libraries.sundials import CVODES, IDAS

REFERENCES: tuple[Reference, ...] = (*SCIPY, CVODES, IDAS)


def library_of(name: str) -> Reference | None:
    """The library solver of that name; None where there is none."""
    return {reference.name: reference for reference in REFERENCES}.get(name)


__all__ = ["REFERENCES", "Problem", "Reference", "Refusal", "library_of"]
