"""Forces on points of bodies."""

from __future__ import annotations

from pydantic import Field

from derive.model.document import Key
from derive.model.language.keys import Constants, Entry, Formulas, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Force
from derive.model.loads.places import axes
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.scope import NONIDEAL


class ForceEntry(Entry):
    """A force on a point of a body."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("Q = Jᵀ F"))
    body: Named = Field(description="The body.", json_schema_extra=term("the body of J"))
    at: Constants | None = Field(
        None,
        description="The point, in the body's frame.",
        json_schema_extra=term("the point of J", "m", "its origin"),
    )
    components: Formulas = Field(
        description="The force's components; formulas of inputs, coordinates, velocities and t.",
        json_schema_extra=term("F", "N"),
    )
    frame: Named | None = Field(
        None,
        description="Axes of the components: ground, body, or a body, joint or frame by name.",
        json_schema_extra=term("axes of F", otherwise="ground"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def force(reader: Reader, document: Bodies, names: Names, key: Key, entry: ForceEntry) -> Force:
    """A force in N on a point of a body. The point is in the body's frame, the components in the
    frame that `frame` names."""
    body = some_body(reader, document, entry.body, ground=False)
    components = reader.point(entry.components, "a force", "N", NONIDEAL)
    return Force(
        str(key),
        body,
        reader.point(entry.at, "a point"),
        components,
        axes(reader, document, entry.frame, "body"),
        key.span,
    )


FORCE = Kind("force", ForceEntry, force)
