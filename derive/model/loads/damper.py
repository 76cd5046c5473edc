"""Dampers: at a joint, a coordinate or a generalized velocity, or between two points."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ZERO
from derive.model.actuators import velocity_of
from derive.model.document import Key, Scalar
from derive.model.entries import Entry, Formula, Pair, Point
from derive.model.frames import Names
from derive.model.kind import Bodies, Kind
from derive.model.load_records import JointDamper, PointSpring
from derive.model.loads.places import per, refuse_keys, two_points
from derive.model.reader import Reader, force_unit
from derive.model.records import Velocity
from derive.model.scope import NONIDEAL


class DamperEntry(Entry):
    """At a joint, a coordinate or a generalized velocity, or between two points: -coefficient times
    the velocity."""

    type: Formula
    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    velocity: Formula | None = Field(None, description="A generalized velocity, such as base.w.")
    between: Point | None = Field(None, description="Two bodies.")
    at: Pair | None = Field(None, description="A point of each.")
    coefficient: Formula = Field(description="Force or torque per velocity.")
    about: Formula | None = None


def damper(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: DamperEntry
) -> JointDamper | PointSpring | None:
    """The record, between points a spring without stiffness; None after reporting."""
    if entry.between:
        pair, points = two_points(reader, document, key, entry, ("joint", "coordinate", "velocity"))
        damping = reader.formula(entry.coefficient, "a damping coefficient", unit="N*s/m")
        return PointSpring(str(key), pair, points, ZERO, ZERO, damping, key.span)
    refuse_keys(reader, key, entry, ("at",), "between two points")
    target = velocity_of(reader, key, entry, names.velocities)
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
