"""Every choice of quasi-velocities by name: those of the file, the kinds that fit any model, and
every partition.

A partition is named by the generalized velocities that stay free, as `hamel choices` prints them:
`q1_dot q4_dot`, or `q1,q4`.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from derive.choices.frozen import frozen
from derive.choices.momenta import mass_orthogonal
from derive.choices.resolution import Resolved, resolved
from derive.choices.survey import Survey, speed_name
from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions.tree import Name, Rate
from derive.mechanics.records import System
from derive.model.records import CHOICE_KINDS, Choice, Span, Velocity

OF_THE_COMMAND = Span(0, 0)


def declared(system: System, name: str | None) -> Choice:
    """The choice of that name; the first of the file when None. Raises ModelError for a name that
    is none."""
    known = {choice.name: choice for choice in system.model.choices}
    if name is None:
        return system.model.choices[0]
    if name in known:
        return known[name]
    if name in CHOICE_KINDS:
        return Choice(name, name, (), OF_THE_COMMAND)
    return _partition(system, name) or _unknown(system, name, [*known, *CHOICE_KINDS])


def _unknown(system: System, name: str, offered: list[str]) -> Choice:
    velocities = [speed_name(system, j) for j in range(system.v.numel())]
    free = f"or one free velocity per degree of freedom, with commas, of {listed(velocities)}"
    hint = did_you_mean(name, offered) or f"known: {listed(offered)}, {free}"
    raise ModelError(f"unknown choice of quasi-velocities '{name}'", hint)


def _partition(system: System, name: str) -> Choice | None:
    """The velocities that are named, separated by commas or blanks, as rows; None where one is
    unknown or named twice."""
    places = {
        word: j
        for j, velocity in enumerate(system.model.velocities)
        for word in _words(system, j, velocity)
    }
    parts = [part for part in re.split(r"[\s,]+", name.strip()) if part]
    columns = [places[part] for part in parts if part in places]
    if not parts or len(columns) < len(parts) or len(set(columns)) < len(columns):
        return None
    rows = tuple((speed_name(system, j), _expression(system.model.velocities[j])) for j in columns)
    return Choice(" ".join(row for row, _ in rows), "rows", rows, OF_THE_COMMAND)


def _words(system: System, j: int, velocity: Velocity) -> tuple[str, ...]:
    return (
        speed_name(system, j),
        velocity.name,
        *((velocity.rate_of,) if velocity.rate_of else ()),
    )


def _expression(velocity: Velocity) -> Name | Rate:
    return Rate(velocity.rate_of) if velocity.rate_of else Name(velocity.name)


CARRIED: dict[str, Callable[[Survey, Choice], Resolved]] = {
    "frozen": frozen,
    "mass_orthogonal": mass_orthogonal,
}


def carried_through(survey: Survey, choice: Choice) -> Resolved:
    """The choice with its reduction v = S w + v₀, v̇ = S ẇ + σ and its explicit equations. Raises
    AssumptionError where it is no choice of this system."""
    return CARRIED.get(choice.kind, resolved)(survey, choice)
