"""Forces and moments at named frames."""

from __future__ import annotations

from pydantic import Field

from derive.diagnostics import did_you_mean, listed
from derive.model.document import Key, Scalar
from derive.model.language.keys import Entry, FormulaOrList, Formulas, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Wrench
from derive.model.loads.places import axes
from derive.model.loads.torque import torque_components
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import GROUND
from derive.model.scope import NONIDEAL


class WrenchEntry(Entry):
    """A force and a moment at a named frame."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("Q = Jᵀ F + Jωᵀ M"))
    frame: Named = Field(
        description="A frame of `frames:`, a body or a joint.",
        json_schema_extra=term("the frame of J"),
    )
    force: Formulas | None = Field(
        None,
        description="The force at the frame's origin; formulas of inputs, coordinates, …",
        json_schema_extra=term("F", "N"),
    )
    moment: FormulaOrList | None = Field(
        None,
        description="The moment: one formula in a planar model, three in space.",
        json_schema_extra=term("M", "N*m"),
    )
    axes: Named | None = Field(
        None,
        description="Axes of the components: ground, frame, or a body, joint or frame by name.",
        json_schema_extra=term("axes of F and M", otherwise="ground"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def wrench(reader: Reader, document: Bodies, names: Names, key: Key, entry: WrenchEntry) -> Wrench:
    """A force in N at the origin of a frame and a moment in N m, along the axes that `axes`
    names."""
    if entry.force is None and entry.moment is None:
        reader.report(key.span, f"the wrench '{key}' has no components", "force: or moment:")
    moment = entry.moment
    return Wrench(
        str(key),
        _frame(reader, document, entry.frame),
        reader.point(entry.force, "a force", "N", NONIDEAL),
        reader.point(None, "") if moment is None else torque_components(reader, moment),
        axes(reader, document, entry.axes, "frame"),
        key.span,
    )


def _frame(reader: Reader, document: Bodies, name: Scalar) -> str:
    """The name of a frame that exists and can move."""
    known = [*document.frames, *document.bodies, *document.joints]
    if name.text == GROUND:
        reader.report(name.span, "a wrench on the ground", "a frame of a body")
    elif name.text not in known:
        reader.report(
            name.span, f"unknown frame '{name.text}'", listed(known), did_you_mean(name.text, known)
        )
    return name.text


WRENCH = Kind("wrench", WrenchEntry, wrench)
