"""Initial values: what a motion starts from."""

from __future__ import annotations

import math

from derive.model.document import Key, Scalar, described
from derive.model.language.shape import Document
from derive.model.mechanism.frames import Frame
from derive.model.motion import quaternions
from derive.model.motion.speeds import Speeds, moving_name, unit
from derive.model.reader import Reader
from derive.model.records import InitialValue


def initial(
    reader: Reader, document: Document, joints: list[Frame], known: Speeds
) -> tuple[InitialValue, ...]:
    """Values at t = 0, held or, under `guess`, only a start: held ones are kept where the
    constraints let them, guesses move."""
    values: dict[str, InitialValue] = {}
    for key, entry in document.initial.items():
        if isinstance(entry, Scalar):
            _initial(reader, key, entry, True, known, values)
        elif key != "guess":
            reader.report(
                key.span, f"a mapping under '{key}'", "a number, or a mapping under `guess`"
            )
        else:
            for inner, scalar in entry.items():
                _initial(reader, inner, scalar, False, known, values)
    quaternions.normalise(reader, joints, values)
    return tuple(values.values())


def _initial(
    reader: Reader,
    key: Key,
    scalar: Scalar,
    held: bool,
    known: Speeds,
    found: dict[str, InitialValue],
) -> None:
    if key == "guess":
        reader.report(scalar.span, "text under 'guess'", "a mapping of names to numbers")
        return
    name = moving_name(reader, key, known)
    if name is None:
        return
    if name in found:
        first = found[name].span
        both = "" if found[name].held == held else ": held and guessed"
        reader.report(
            key.span,
            f"'{key}' is given twice{both}; first on line {first.line}, column {first.column}",
            "one of the two",
        )
        return
    unit_of_it = _unit(reader, name, known)
    value = reader.of_parameters(scalar, f"the initial {key}", unit=unit_of_it)
    number = reader.value(value, scalar)
    if number is not None and unit_of_it == "rad" and _looks_like_degrees(scalar, number):
        reader.notes.append(
            f"'{key}' starts at {number:g} rad, as no unit is said; degrees are {number:g} deg"
        )
    found[name] = InitialValue(name, value, held, key.span)


def _looks_like_degrees(scalar: Scalar, number: float) -> bool:
    """A round number beyond a whole turn, without a unit."""
    return described(scalar) == "a number" and abs(number) > 2.0 * math.pi and number % 5.0 == 0.0


def _unit(reader: Reader, name: str, known: Speeds) -> str | None:
    symbol = reader.scope.symbols.get(name)
    return unit(reader, name, known) if symbol is None else symbol.unit
