"""Rotors as the joints feel them."""

from __future__ import annotations

from pydantic import Field

from derive.model.actuators import per_acceleration, velocity_of
from derive.model.document import Key, Scalar
from derive.model.language.keys import Constant, Entry, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Armature
from derive.model.loads.places import not_negative
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import Velocity


class ArmatureEntry(Entry):
    """Inertia of a rotor as the joint feels it: of a body of its own that turns with the velocity
    and takes part in nothing else. Where the velocity is no rate of a coordinate, as `base.vy` is
    not, J v̇ is all it adds; masses of water that a hull carries along have gyroscopic terms too."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("T = ½ J v²; M = J"))
    joint: Named | None = Field(
        None, description="A joint with one coordinate.", json_schema_extra=term("v")
    )
    coordinate: Named | None = Field(None, description="A coordinate.", json_schema_extra=term("v"))
    velocity: Named | None = Field(
        None, description="A generalized velocity, such as base.w.", json_schema_extra=term("v")
    )
    inertia: Constant = Field(
        description="Inertia of the rotor times the square of the gear ratio.",
        json_schema_extra=term("J", "kg | kg*m^2"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def armature(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: ArmatureEntry
) -> Armature | None:
    """The record; None after reporting."""
    target = velocity_of(reader, key, entry, names.velocities)
    return None if target is None else armature_at(reader, key, str(key), entry.inertia, target)


def armature_at(reader: Reader, key: Key, name: str, inertia: Scalar, target: Velocity) -> Armature:
    """The inertia of a rotor, reflected through its gear, that a generalized velocity carries: kg
    m² where that is an angular velocity, kg where it is a linear one. A negative number is
    reported."""
    unit = per_acceleration(target.unit)
    return Armature(
        name,
        target.name,
        not_negative(reader, inertia, f"the armature of '{key}'", "an inertia", unit),
        key.span,
    )


ARMATURE = Kind("armature", ArmatureEntry, armature)
