"""Ways through points and round pulleys."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from derive.expressions.tree import ZERO
from derive.model.constraints.lengths import length
from derive.model.document import Key, Scalar
from derive.model.language.entries import PulleyEntry, WaypointEntry
from derive.model.language.kind import Bodies
from derive.model.loads.tension import TensionEntry
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.records import Path, Vector3, Waypoint

if TYPE_CHECKING:
    from derive.model.language.shape import Document

SIDES = {"left": 1, "right": -1}
MOST = 1000  # points of one path
MOST_TURNS = 1000


def names(document: Document) -> tuple[str, ...]:
    """What has a length: paths, and loads along the line between two points."""
    lines = [
        str(key)
        for key, entry in document.loads.items()
        if isinstance(entry, TensionEntry) and entry.between is not None
    ]
    return (*map(str, document.paths), *lines)


def path(reader: Reader, document: Bodies, key: Key, entries: Sequence[WaypointEntry]) -> Path:
    """One entry of `paths:`. A path of less than two points, one that begins or ends on a pulley
    and, in space, one with two pulleys in a row are reported."""
    reader.name(key)
    if not 2 <= len(entries) <= MOST:
        reader.report(key.span, f"a path of {len(entries)} points", f"2 to {MOST}")
        return Path(str(key), (), key.span)
    for entry in (entries[0], entries[-1]):
        if entry.pulley is not None:
            reader.report(
                entry.pulley.radius.span,
                f"the path '{key}' begins or ends on a pulley",
                "a point of a body at either end",
            )
    for first, second in pairwise(entries):
        if first.pulley and second.pulley and not reader.space.plane:
            reader.report(
                second.pulley.radius.span,
                f"two pulleys in a row on the path '{key}' in space",
                "a point between them, or a planar model",
            )
    return Path(
        str(key), tuple(_waypoint(reader, document, key, entry) for entry in entries), key.span
    )


def _waypoint(reader: Reader, document: Bodies, key: Key, entry: WaypointEntry) -> Waypoint:
    body = some_body(reader, document, entry.body)
    point = reader.point(entry.at, "a point")
    if entry.pulley is None:
        return Waypoint(body, point, ZERO, 1, reader.space.normal, 0)
    pulley = entry.pulley
    return Waypoint(
        body,
        point,
        length(reader, pulley.radius, "a radius", f"the radius of a pulley of '{key}'"),
        SIDES.get(reader.word(pulley.side, SIDES, "side") or "", 1),
        _axis(reader, pulley),
        _turns(reader, pulley.turns),
    )


def _axis(reader: Reader, pulley: PulleyEntry) -> Vector3:
    """Its axis; the normal in a planar model, where it has no other."""
    if pulley.axis is None and not reader.space.plane:
        reader.report(pulley.radius.span, "a pulley in space without an axis", "axis: x, y or z")
    if pulley.axis is None:
        return reader.space.normal
    if reader.space.plane:
        reader.report(pulley.axis.span, "an axis of a pulley in a planar model", "no axis")
        return reader.space.normal
    return reader.direction(pulley.axis, "an axis")


def _turns(reader: Reader, scalar: Scalar | None) -> int:
    if scalar is None:
        return 0
    if not scalar.text.isdigit() or int(scalar.text) > MOST_TURNS:
        reader.report(scalar.span, f"'{scalar.text}' turns", f"0 to {MOST_TURNS}")
        return 0
    return int(scalar.text)
