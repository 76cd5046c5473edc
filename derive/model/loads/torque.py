"""Torques on bodies."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO, Expression, Negative
from derive.model.document import Items, Key, Scalar
from derive.model.language.keys import Entry, FormulaOrList, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Torque
from derive.model.loads.places import axes
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.records import Vector3
from derive.model.scope import NONIDEAL


class TorqueEntry(Entry):
    """A torque on a body."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("Q = Jωᵀ M"))
    body: Named = Field(description="The body.", json_schema_extra=term("the body of Jω"))
    components: FormulaOrList = Field(
        description="The torque: one formula in a planar model, three in space.",
        json_schema_extra=term("M", "N*m"),
    )
    frame: Named | None = Field(
        None,
        description="Axes of the components: ground, body, or a body, joint or frame by name.",
        json_schema_extra=term("axes of M", otherwise="ground"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def torque(reader: Reader, document: Bodies, names: Names, key: Key, entry: TorqueEntry) -> Torque:
    """A torque in N m on a body that must not be the ground: three components, or one about the
    normal of a planar model."""
    body = some_body(reader, document, entry.body, ground=False)
    return Torque(
        str(key),
        body,
        torque_components(reader, entry.components),
        axes(reader, document, entry.frame, "body"),
        key.span,
    )


def torque_components(reader: Reader, node: Scalar | Items) -> Vector3:
    """N m: one number about the normal in a planar model (its sign in the normal's sense), three
    components in space."""
    entries = [node] if isinstance(node, Scalar) else list(node)
    size = 1 if reader.space.plane else 3
    if len(entries) != size:
        reader.report(
            node.span,
            f"a torque with {len(entries)} component{'s' * (len(entries) != 1)}",
            f"{size}",
        )
        return reader.point(None, "")
    formulas = [reader.formula(entry, "a torque", NONIDEAL, "N*m") for entry in entries]
    if size == 3:
        return (formulas[0], formulas[1], formulas[2])
    return _about_normal(reader, formulas[0])


def _about_normal(reader: Reader, formula: Expression) -> Vector3:
    signed = Negative(formula) if reader.space.plane == "xz" else formula
    components = [signed if index == reader.space.normal_index else ZERO for index in range(3)]
    return (components[0], components[1], components[2])


TORQUE = Kind("torque", TorqueEntry, torque)
