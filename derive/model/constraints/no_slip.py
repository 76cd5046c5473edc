"""Knife edges and wheel pairs."""

from __future__ import annotations

from pydantic import Field

from derive.model.constraint_records import NoSlip
from derive.model.document import Key
from derive.model.language.keys import Constants, Direction, Entry, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader


class NoSlipEntry(Entry):
    """A point of a body does not move along a direction of the body: a knife edge, a wheel pair."""

    type: Word = Field(
        description="Kind of entry.", json_schema_extra=term("a row e·ṗ = 0 of A v = c")
    )
    body: Named = Field(description="The body.", json_schema_extra=term("the body of p"))
    at: Constants | None = Field(
        None,
        description="The point, in the body's frame.",
        json_schema_extra=term("p", "m", "its origin"),
    )
    direction: Direction = Field(
        description="The direction in which it does not slip, in the body's frame.",
        json_schema_extra=term("e", "1"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def no_slip(reader: Reader, document: Bodies, names: Names, key: Key, entry: NoSlipEntry) -> NoSlip:
    """A knife edge: point and direction in the frame of a body, which must not be the ground. The
    direction must not be zero."""
    body = some_body(reader, document, entry.body, ground=False)
    point = reader.point(entry.at, "a point")
    return NoSlip(
        str(key),
        body,
        point,
        reader.direction(entry.direction, "a direction", constant=False),
        key.span,
    )


NO_SLIP = Kind("no_slip", NoSlipEntry, no_slip)
