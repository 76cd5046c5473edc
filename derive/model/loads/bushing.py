"""Bushings: soft welds between frames on two bodies."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO, Expression
from derive.model.document import Items, Key, Scalar
from derive.model.language.keys import ConstantOrList, Entry, NameList, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.language.place_entries import Sides
from derive.model.load_records import Bushing
from derive.model.mechanism.frames import Names
from derive.model.mechanism.placements import placements
from derive.model.mechanism.space import ORIGIN
from derive.model.mechanism.tree import bodies
from derive.model.reader import Reader
from derive.model.records import Vector3


class BushingEntry(Entry):
    """A soft weld: springs and dampers along and about the three axes of a frame placed on two
    bodies, for small turns: θ = ½ Σ aᵢ × bᵢ of the two frames' axes. About one axis by an angle φ
    that is sin φ, so that the torque is ½ c sin 2φ: it is largest at 45 degrees, zero at 90 and
    pushes away beyond. For large turns a `spring` in the joint keeps its stiffness."""

    type: Word = Field(
        description="Kind of entry.",
        json_schema_extra=term("V = ½ Σ kᵢ dᵢ² + ½ Σ cᵢ θᵢ², and dampers"),
    )
    between: NameList = Field(
        description="Two bodies; the axes are the first one's.",
        json_schema_extra=term("the two frames"),
    )
    at: Sides | None = Field(
        None,
        description="Where the frame sits in each of the two.",
        json_schema_extra=term("r and R of the frames", "m", "their origins"),
    )
    stiffness: ConstantOrList | None = Field(
        None,
        description="Force per displacement, one number or one for each axis.",
        json_schema_extra=term("kᵢ along the axes", "N/m"),
    )
    torsion: ConstantOrList | None = Field(
        None,
        description="Torque per small angle, one number or one for each axis.",
        json_schema_extra=term("cᵢ about the axes", "N*m/rad"),
    )
    damping: ConstantOrList | None = Field(
        None,
        description="Force per velocity, one number or one for each axis.",
        json_schema_extra=term("force per ḋᵢ", "N*s/m"),
    )
    torsion_damping: ConstantOrList | None = Field(
        None,
        description="Torque per rate, one number or one for each axis.",
        json_schema_extra=term("torque per θ̇ᵢ", "N*m*s/rad"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


_COEFFICIENTS = (
    ("stiffness", "a stiffness", "N/m"),
    ("torsion", "a stiffness", "N*m/rad"),
    ("damping", "a damping coefficient", "N*s/m"),
    ("torsion_damping", "a damping coefficient", "N*m*s/rad"),
)


def bushing(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: BushingEntry
) -> Bushing:
    """Four sets of coefficients, each one number for all axes or a list of one for each."""
    if all(getattr(entry, name) is None for name, _, _ in _COEFFICIENTS):
        reader.report(
            key.span,
            f"the bushing '{key}' is empty",
            "stiffness, torsion, damping or torsion_damping",
        )
    laws = {
        name: _along_axes(reader, getattr(entry, name), where, unit)
        for name, where, unit in _COEFFICIENTS
    }
    return Bushing(
        name=str(key),
        bodies=bodies(reader, document, key, entry.between),
        placements=placements(reader, key, entry.at),
        span=key.span,
        **laws,
    )


def _along_axes(reader: Reader, node: Scalar | Items | None, where: str, unit: str) -> Vector3:
    if node is None:
        return ORIGIN
    turns = unit.startswith("N*m")
    size = (1 if turns else 2) if reader.space.plane else 3
    entries = list(node) if isinstance(node, Items) else [node]
    if len(entries) not in (1, size):
        reader.report(
            node.span, f"{where} with {len(entries)} components", f"one number, or {size} in a list"
        )
        return ORIGIN
    entries = entries * size if len(entries) == 1 else entries
    formulas = [reader.formula(entry, where, unit=unit) for entry in entries]
    return (
        _about_normal(reader, formulas[0])
        if turns and reader.space.plane
        else reader.space.embedded(formulas)
    )


def _about_normal(reader: Reader, formula: Expression) -> Vector3:
    components = [formula if index == reader.space.normal_index else ZERO for index in range(3)]
    return (components[0], components[1], components[2])


BUSHING = Kind("bushing", BushingEntry, bushing)
