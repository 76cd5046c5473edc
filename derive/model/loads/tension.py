"""Pulls along paths: ropes, muscles, cylinders, elastic bands."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO
from derive.model.document import Key
from derive.model.language.keys import Entry, Formula, Named, NameList, Pair, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Tension
from derive.model.loads.places import two_points
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import Path, Vector3, Waypoint
from derive.model.scope import NONIDEAL


class TensionEntry(Entry):
    """A pull along a path, or the line between two points, by formula: rope, muscle, cylinder."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("Q = −F ∂ℓ̇/∂v"))
    path: Named | None = Field(None, description="A path of `paths:`.", json_schema_extra=term("ℓ"))
    between: NameList | None = Field(
        None,
        description="Two bodies, instead of a path.",
        json_schema_extra=term("bodies of a straight ℓ"),
    )
    at: Pair | None = Field(
        None, description="A point of each.", json_schema_extra=term("ends of a straight ℓ", "m")
    )
    tension: Formula = Field(
        description="The pull: formulas of length(NAME), der(length(NAME)), inputs, …",
        json_schema_extra=term("F, positive where it pulls", "N"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def tension(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: TensionEntry
) -> Tension | None:
    """A tension in N, positive where it pulls; None after reporting."""
    path = _path(reader, document, key, entry)
    pull = reader.formula(entry.tension, "a tension", NONIDEAL, "N")
    return None if path is None else Tension(str(key), path, pull, key.span)


def _path(reader: Reader, document: Bodies, key: Key, entry: TensionEntry) -> Path | None:
    if (entry.path is None) == (entry.between is None):
        reader.report(
            key.span, f"'{key}' does not say where it pulls", "path: NAME, or between: with at:"
        )
        return None
    if entry.path is not None:
        name = reader.word(entry.path, reader.paths, "path")
        return None if name is None else reader.paths[name]
    pair, points = two_points(reader, document, key, entry, ())
    ends = [_end(reader, body, point) for body, point in zip(pair, points)]
    reader.paths[str(key)] = Path(str(key), tuple(ends), key.span)
    return reader.paths[str(key)]


def _end(reader: Reader, body: str, point: Vector3) -> Waypoint:
    return Waypoint(body, point, ZERO, 1, reader.space.normal, 0)


TENSION = Kind("tension", TensionEntry, tension)
