"""Dampers: at a joint, a coordinate or a generalized velocity, or between two points."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO
from derive.model.actuators import velocity_of
from derive.model.document import Key, Scalar
from derive.model.language.keys import Entry, Formula, Named, NameList, Pair, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import JointDamper, PointSpring
from derive.model.loads.places import per, refuse_keys, two_points
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader, force_unit
from derive.model.records import Velocity
from derive.model.scope import NONIDEAL


class DamperEntry(Entry):
    """At a joint, a coordinate or a generalized velocity, or between two points: -coefficient times
    the velocity."""

    type: Word = Field(
        description="Kind of entry.", json_schema_extra=term("Q = −d v, or −d ℓ̇ along a line")
    )
    joint: Named | None = Field(
        None, description="A joint with one coordinate.", json_schema_extra=term("v")
    )
    coordinate: Named | None = Field(None, description="A coordinate.", json_schema_extra=term("v"))
    velocity: Named | None = Field(
        None, description="A generalized velocity, such as base.w.", json_schema_extra=term("v")
    )
    between: NameList | None = Field(
        None, description="Two bodies.", json_schema_extra=term("bodies of the line")
    )
    at: Pair | None = Field(
        None, description="A point of each.", json_schema_extra=term("ends of the line", "m")
    )
    coefficient: Formula = Field(
        description="Force or torque per velocity.",
        json_schema_extra=term("d", "N*s/m | N*m*s/rad"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def damper(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: DamperEntry
) -> JointDamper | PointSpring | None:
    """The record, between points a spring without stiffness; None after reporting."""
    if entry.between:
        pair, points = two_points(reader, document, key, entry, ("joint", "coordinate", "velocity"))
        damping = reader.formula(entry.coefficient, "a damping coefficient", unit="N*s/m")
        return PointSpring(str(key), pair, points, ZERO, ZERO, damping, key.span)
    refuse_keys(reader, key, entry, ("at",), "between two points")
    target = velocity_of(reader, key, entry, names.rates)
    return None if target is None else damper_at(reader, key, str(key), entry.coefficient, target)


def damper_at(
    reader: Reader, key: Key, name: str, coefficient: Scalar, target: Velocity
) -> JointDamper:
    """A damper, force −d v on one generalized velocity: d in N s/m, or in N m s for an angular
    velocity."""
    unit = per(force_unit(target.unit), target.unit)
    formula = reader.formula(coefficient, "a damping coefficient", NONIDEAL, unit)
    return JointDamper(name, target.name, formula, key.span)


DAMPER = Kind("damper", DamperEntry, damper)
