"""`--sweep speed=0:10:11` and `--set speed=5`: values of a motion's free names and of parameters,
with units where known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions.tree import Expression, Name, Number
from hamel.linear.limits import COUNT, MOST, TRIED
from hamel.settings import parsed, settings, units

if TYPE_CHECKING:
    from derive.model.records import Model, SteadyMotion


@dataclass(frozen=True)
class Range:
    name: str
    values: np.ndarray

    def beside(self, value: float) -> list[float]:
        """Some of the values, over all of the range, the nearest to this one first."""
        picked = np.linspace(0, len(self.values) - 1, min(TRIED, len(self.values))).round()
        found = self.values[picked.astype(int)]
        return found[np.argsort(np.abs(found - value), kind="stable")].tolist()


def value(model: Model, motion: SteadyMotion, name: str, given: float | str) -> float:
    """One value by name, in SI. Raises ModelError."""
    if name in {parameter.name for parameter in model.parameters}:
        return settings(model, {name: given}).parameters[name]
    if name not in motion.sweepable:
        known = (*motion.sweepable, *(parameter.name for parameter in model.parameters))
        near = did_you_mean(name, known) or (f"known: {listed(known)}" if known else "")
        raise ModelError(_not_given(model, motion, name), near)
    if isinstance(given, str):
        return parsed(name, given, _unit(model, motion, name), {})
    if not math.isfinite(given):
        raise ModelError(f"{name} is set to {given}, which is not a finite number")
    return float(given)


def _not_given(model: Model, motion: SteadyMotion, name: str) -> str:
    """Why the name can have no value."""
    if name in motion.free:
        return f"'{name}' is found, not given, along the steady motion '{motion.name}'"
    if name in dict(motion.values):
        return f"the steady motion '{motion.name}' holds '{name}' where the file says"
    return (
        f"'{name}' is neither free in the steady motion '{motion.name}' nor a parameter of "
        f"{model.name}"
    )


def _unit(model: Model, motion: SteadyMotion, name: str) -> str | None:
    """Of a free name: that of what is held at its value; None where it stands in a formula."""
    known = units(model)
    return next((known.get(held) for held, formula in motion.values if formula == Name(name)), None)


def values(
    model: Model, motion: SteadyMotion, given: Mapping[str, float | str]
) -> dict[str, float]:
    """All of them by name, in SI. Raises ModelError for a name that is neither free in the motion
    nor a parameter, and for what is no finite number."""
    return {name: value(model, motion, name, text) for name, text in given.items()}


def started(
    model: Model, motion: SteadyMotion, given: Mapping[str, float | str]
) -> tuple[SteadyMotion, dict[str, float | str]]:
    """The motion with its search started from the initial values among those `given`, and the
    others of these. What the motion holds is no start. Raises ModelError."""
    moving = (*model.coordinates, *model.velocities, *model.speeds, *model.states)
    names = {x.name for x in moving} | {f"der({c.name})" for c in model.coordinates}
    names -= {*motion.sweepable, *dict(motion.values), *motion.free}
    starts = {name: text for name, text in given.items() if "".join(name.split()) in names}
    if not starts:
        return motion, dict(given)
    guesses: dict[str, Expression] = dict(motion.guesses)
    guesses |= {name: Number(x) for name, x in settings(model, starts).initial.items()}
    others = {name: text for name, text in given.items() if name not in starts}
    return replace(motion, guesses=tuple(guesses.items())), others


def ranges(model: Model, motion: SteadyMotion, given: Mapping[str, str]) -> tuple[Range, ...]:
    """The ranges asked for, or else the first of the file's own."""
    if given:
        return tuple(_range(model, motion, name, text) for name, text in given.items())
    return tuple(own_ranges(motion)[:1])


def own_ranges(motion: SteadyMotion) -> list[Range]:
    """The ranges that the file gives for a steady motion."""
    return [
        Range(name, np.linspace(first, last, count)) for name, first, last, count in motion.ranges
    ]


def _range(model: Model, motion: SteadyMotion, name: str, text: str) -> Range:
    parts = text.split(":")
    if len(parts) not in (2, 3):
        raise ModelError(
            f"the sweep of {name} is '{text}'",
            "give first:last or first:last:count, such as 0:10:101",
        )
    first, last = (value(model, motion, name, part.strip()) for part in parts[:2])
    return Range(
        name, np.linspace(first, last, _count(name, parts[2]) if len(parts) == 3 else COUNT)
    )


def _count(name: str, text: str) -> int:
    count = int(text) if text.strip().isdecimal() else 0
    if not 1 <= count <= MOST:
        raise ModelError(
            f"the sweep of {name} has '{text}' values", f"a whole count from 1 to {MOST}"
        )
    return count
