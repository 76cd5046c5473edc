"""A road: one way from the shared first half to the equations without multipliers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from derive.textbook.formulas.terms import Terms
from derive.textbook.manuscript import Manuscript


@dataclass(frozen=True)
class Road:
    """`left(terms, ẇ)` are its nw equations as left side minus right side at any ẇ (None where it
    finds accelerations and multipliers at once); `accelerations(terms)` is ẇ by this road alone,
    which is compared with the module's. `misfit` says why a system cannot take it, "" where it
    can."""

    name: str
    title: str
    about: str
    source: str
    write: Callable[[Manuscript], None]
    accelerations: Callable[[Terms], ca.SX]
    unknowns: Callable[[Terms], int]
    needs: str
    fails: str
    left: Callable[[Terms, ca.SX], ca.SX] | None = None
    misfit: Callable[[Terms], str] = lambda terms: ""
