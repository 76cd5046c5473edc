"""Coordinates that follow formulas of t."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO, Expression, Name, Sum
from derive.model.algebra import negated
from derive.model.constraint_records import Holonomic
from derive.model.constraints.places import of_joint, of_name
from derive.model.document import Key
from derive.model.language.keys import Entry, Formula, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import Coordinate
from derive.model.scope import PARAMETER, TIME


class PrescribedEntry(Entry):
    """A coordinate follows a formula of t."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("φ = q − f(t)"))
    joint: Named | None = Field(
        None, description="A joint with one coordinate.", json_schema_extra=term("q")
    )
    coordinate: Named | None = Field(None, description="A coordinate.", json_schema_extra=term("q"))
    motion: Formula = Field(
        description="The coordinate as a formula of t and parameters.",
        json_schema_extra=term("f(t)", "m | rad"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def prescribed(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: PrescribedEntry
) -> Holonomic:
    """coordinate − motion(t) = 0."""
    target = _target(reader, names, key, entry)
    if target is None:
        return Holonomic(str(key), ZERO, (), key.span)
    motion = reader.formula(
        entry.motion, "a prescribed motion", frozenset({PARAMETER, TIME}), target.unit
    )
    return Holonomic(str(key), _difference(target.name, motion), (), key.span)


def _difference(name: str, motion: Expression) -> Expression:
    return Name(name) if motion == ZERO else Sum((Name(name), negated(motion)))


def _target(reader: Reader, names: Names, key: Key, entry: PrescribedEntry) -> Coordinate | None:
    if (entry.joint is None) == (entry.coordinate is None):
        reader.report(key.span, f"'{key}' does not say what it moves", "one of joint, coordinate")
        return None
    if entry.joint is not None:
        return of_joint(reader, names, entry.joint)
    return of_name(reader, names, entry.coordinate) if entry.coordinate is not None else None


PRESCRIBED = Kind("prescribed", PrescribedEntry, prescribed)
