"""Extreme cases: what is set, how long the motion lasts, and where it ends or why it is refused."""

from __future__ import annotations

import re

from derive.expressions.tree import Expression
from derive.model.document import Key, Scalar
from derive.model.language.study_entries import ExtremeEntry
from derive.model.limits import RTOL
from derive.model.motion.motions import state_name
from derive.model.names import cut
from derive.model.reader import Reader
from derive.model.records import Extreme

NAME = re.compile(r"\w[\w.-]{0,79}")  # nothing is generated from it: any name of a file will do
INTEGRATOR, REAL = "dop853", "float64"  # where a case says nothing


def extremes(reader: Reader, key: Key, entry: ExtremeEntry) -> Extreme:
    """One entry of `extremes:`."""
    if not NAME.fullmatch(key):
        reader.report(
            key.span,
            f"{cut(key)!r} is no name of a case",
            "letters, digits, and dots, hyphens and underscores after the first of them",
        )
    if entry.refused and (entry.end or entry.tolerance):
        reader.report(
            entry.refused.span,
            f"the case '{key}' is refused and ends",
            "refused: or tolerance: and end:",
        )
    real = _text(entry.real) or REAL
    if entry.real and real not in RTOL:
        reader.report(
            entry.real.span, f"the case '{key}' is to be computed in '{real}'", " or ".join(RTOL)
        )
    if entry.spoiled:
        _check_spoiled(reader, key, entry, entry.spoiled)
    elif not entry.time:
        reader.report(key.span, f"the case '{key}' lasts no time", "time: 1 s, or spoiled: all")
    ends = [_end(reader, name, scalar) for name, scalar in entry.end.items()]
    return Extreme(
        name=str(key),
        about=_text(entry.about),
        values=tuple((str(name), scalar.text) for name, scalar in entry.set.items()),
        time=_positive(reader, entry.time, "the time of a case", "s") or 0.0,
        spoiled=entry.spoiled is not None,
        integrator=_text(entry.integrator) or INTEGRATOR,
        enforcement=_text(entry.enforcement),
        real=real,
        choice=_text(entry.choice),
        rtol=_positive(reader, entry.rtol, "the tolerance of a step", "1") or RTOL.get(real, 0.0),
        tolerance=_positive(reader, entry.tolerance, "the tolerance of a case", "1"),
        end=tuple(pair for pair in ends if pair is not None),
        refused=_text(entry.refused),
        span=key.span,
    )


def _check_spoiled(reader: Reader, key: Key, entry: ExtremeEntry, spoiled: Scalar) -> None:
    if spoiled.text != "all":
        reader.report(
            spoiled.span, f"in the case '{key}' {spoiled.text} arguments are to be spoiled", "all"
        )
    of_motions = (
        entry.set,
        entry.time,
        entry.end,
        entry.tolerance,
        entry.refused,
        entry.integrator,
        entry.enforcement,
        entry.rtol,
    )
    if any(of_motions):
        reader.report(
            spoiled.span,
            f"the case '{key}' is no motion",
            "besides spoiled: only about, choice and real",
        )


def _text(scalar: Scalar | None) -> str:
    return scalar.text if scalar else ""


def _positive(reader: Reader, scalar: Scalar | None, where: str, unit: str) -> float | None:
    if scalar is None:
        return None
    number = reader.value(reader.of_parameters(scalar, where, unit=unit), scalar)
    if number is not None and not number > 0:
        reader.report(scalar.span, f"{where} is {number:g}", "a number above zero")
    return number


def _end(reader: Reader, key: Key, scalar: Scalar) -> tuple[str, Expression] | None:
    name = state_name(reader, key)
    if name is None:
        return None
    return name, reader.of_parameters(
        scalar, f"the end of {name}", unit=reader.scope.symbols[name].unit
    )
