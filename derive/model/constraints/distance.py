"""Massless rods."""

from __future__ import annotations

from pydantic import Field

from derive.model.constraint_records import Distance
from derive.model.constraints.lengths import length
from derive.model.document import Key
from derive.model.language.keys import Constant, Entry, NameList, Pair, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import bodies
from derive.model.reader import Reader


class DistanceEntry(Entry):
    """Two points of two bodies keep their distance: a massless rod."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("φ = |p₂ − p₁| − ℓ"))
    between: NameList = Field(
        description="Two bodies.", json_schema_extra=term("bodies of p₁ and p₂")
    )
    at: Pair = Field(
        description="A point of each.", json_schema_extra=term("p₁ and p₂ in their bodies", "m")
    )
    length: Constant = Field(description="The distance.", json_schema_extra=term("ℓ", "m"))
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def distance(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: DistanceEntry
) -> Distance:
    """A massless rod of given length, in m, between points of two bodies, each in its body's frame.
    A length that is not positive is reported."""
    pair = bodies(reader, document, key, entry.between)
    points = (reader.point(entry.at[0], "a point"), reader.point(entry.at[1], "a point"))
    return Distance(
        str(key),
        pair,
        points,
        length(reader, entry.length, "a length", f"the length of '{key}'"),
        key.span,
    )


DISTANCE = Kind("distance", DistanceEntry, distance)
