"""Integrators as data. To add one: a file with a Tableau, and its line here."""

from codegen.integrators.dopri5 import DOPRI5
from codegen.integrators.records import Tableau

INTEGRATORS: tuple[Tableau, ...] = (DOPRI5,)

__all__ = ["INTEGRATORS", "Tableau"]
