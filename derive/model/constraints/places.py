"""Coordinates that constraints name, directly or by their joint."""

from __future__ import annotations

from derive.diagnostics import listed
from derive.model.document import Scalar
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import Coordinate


def of_joint(reader: Reader, names: Names, scalar: Scalar) -> Coordinate | None:
    """The coordinate of a joint that has exactly one. A joint with several is reported, as which of
    them is meant cannot be told."""
    owned = [
        coordinate
        for coordinate in names.coordinates
        if coordinate.owner and coordinate.owner == scalar.text
    ]
    if len(owned) == 1:
        return owned[0]
    if owned:
        wanted = f"coordinates: with one of {listed(c.name for c in owned)}"
        reader.report(
            scalar.span, f"the joint '{scalar.text}' has {len(owned)} coordinates", wanted
        )
    else:
        reader.word(
            scalar, dict.fromkeys(c.owner for c in names.coordinates if c.owner), "moving joint"
        )
    return None


def of_name(reader: Reader, names: Names, scalar: Scalar) -> Coordinate | None:
    """The coordinate of that name; an unknown name is reported with the nearest known one, and the
    result is None."""
    word = reader.word(scalar, [coordinate.name for coordinate in names.coordinates], "coordinate")
    return names.coordinate(word)
