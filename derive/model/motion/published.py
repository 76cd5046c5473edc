"""Published values: numbers from elsewhere that `verify` holds the model to, with their source and
tolerance."""

from __future__ import annotations

import re

from derive.diagnostics import did_you_mean, listed
from derive.expressions.tree import Expression
from derive.model.document import Key, Scalar
from derive.model.language.study_entries import ReferenceEntry
from derive.model.motion.motions import state_name
from derive.model.reader import Reader
from derive.model.records import Published
from derive.model.scope import VELOCITY

ENERGIES = ("T", "V")
_OUTPUT = re.compile(r"([A-Za-z_]\w*)(\[\d+\])?")


def published(
    reader: Reader, outputs: tuple[str, ...], key: Key, entry: ReferenceEntry
) -> Published:
    """One entry of `reference:`; values without a time are those of the consistent initial
    state."""
    reader.name(key)
    time = _number(reader, entry.time, "the time of a reference", "s") if entry.time else 0.0
    if time is not None and time < 0 and entry.time:
        reader.report(
            entry.time.span,
            f"a reference at {time:g} s",
            "a time that is not negative: motions start at 0",
        )
    tolerance = _number(reader, entry.tolerance, "the tolerance of a reference", "1")
    if tolerance is not None and not tolerance > 0:
        reader.report(
            entry.tolerance.span,
            f"a tolerance of {tolerance:g}",
            "a positive number, relative to each value",
        )
    if not (entry.values or entry.accelerations):
        reader.report(
            key.span,
            f"reference '{key}' holds no value",
            "values: or accelerations: with names and numbers",
        )
    values = [_value(reader, outputs, name, scalar) for name, scalar in entry.values.items()]
    rates = [_acceleration(reader, name, scalar) for name, scalar in entry.accelerations.items()]
    pairs = tuple(pair for pair in (*values, *rates) if pair is not None)
    return Published(str(key), entry.source.text, time or 0.0, tolerance or 0.0, pairs, key.span)


def _number(reader: Reader, scalar: Scalar, where: str, unit: str) -> float | None:
    formula = reader.of_parameters(scalar, where, unit=unit)
    return reader.value(formula, scalar)


def _value(
    reader: Reader, outputs: tuple[str, ...], key: Key, scalar: Scalar
) -> tuple[str, Expression] | None:
    """A coordinate, velocity, energy, output or entry of an output."""
    output = _OUTPUT.fullmatch(key)
    if output and output[1] in outputs:
        return str(key), reader.of_parameters(scalar, f"the published {key}", unit=None)
    if key in ENERGIES and key not in reader.scope.symbols:
        return str(key), reader.of_parameters(scalar, f"the published {key}", unit="J")
    name = state_name(reader, key)
    if name is None:
        return None
    return name, reader.of_parameters(
        scalar, f"the published {name}", unit=reader.scope.symbols[name].unit
    )


def _acceleration(reader: Reader, key: Key, scalar: Scalar) -> tuple[str, Expression] | None:
    """The rate of a generalized velocity."""
    known = reader.scope.of_kind(VELOCITY)
    name = str(key).replace(" ", "")
    if name not in known:
        reader.report(
            key.span,
            f"unknown generalized velocity '{key}'",
            listed(known),
            did_you_mean(name, known),
        )
        return None
    return f"der({name})", reader.of_parameters(scalar, f"the published rate of {name}", unit=None)
