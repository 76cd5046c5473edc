"""What a formulation is: a name, where it comes from, why it may not fit a system, and how its
equations are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from derive.choices.survey import Survey
from derive.formulations.records import Equations
from derive.model.records import Choice


@dataclass(frozen=True)
class Formulation:
    """`misfit` says why the system of a survey has no equations of this form, or "" where it has;
    `build` makes them.

    `chooses`: the state is x = (q, w) with w of a choice of quasi-velocities. Without it x = (q,
    v), and no choice is made.
    """

    name: str
    about: str
    source: str
    chooses: bool
    misfit: Callable[[Survey], str]
    build: Callable[[Survey, Choice], Equations]
