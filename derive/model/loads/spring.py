"""Springs: at a joint or a coordinate, in a ball joint, or along the line between two points."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from derive.model.actuators import velocity_of
from derive.model.document import Items, Key, Scalar
from derive.model.language.entries import JointSpringEntry
from derive.model.language.keys import (
    Constant,
    ConstantOrList,
    Entry,
    Named,
    NameList,
    Pair,
    Text,
    Word,
    term,
)
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import BallSpring, JointSpring, PointSpring
from derive.model.loads.places import optional, per, refuse_keys, single, two_points
from derive.model.mechanism.frames import Names
from derive.model.mechanism.space import ORIGIN
from derive.model.reader import Reader, force_unit
from derive.model.records import Coordinate, Vector3, Velocity


class SpringEntry(Entry):
    """At a joint or a coordinate: -stiffness (q - rest). In a ball joint: -stiffness times the
    rotation vector, or a stiffness about each axis. Between two points: along their line."""

    type: Word = Field(
        description="Kind of entry.",
        json_schema_extra=term("V = ½ k (q − q₀)², ½ k φ² or ½ k (ℓ − ℓ₀)²"),
    )
    joint: Named | None = Field(
        None,
        description="A joint with one coordinate, or a ball joint.",
        json_schema_extra=term("q, or the rotation vector φ"),
    )
    coordinate: Named | None = Field(None, description="A coordinate.", json_schema_extra=term("q"))
    rest: Constant | None = Field(
        None,
        description="Where the joint's spring is slack.",
        json_schema_extra=term("q₀", "m | rad", "0"),
    )
    between: NameList | None = Field(
        None, description="Two bodies.", json_schema_extra=term("bodies of the line")
    )
    at: Pair | None = Field(
        None, description="A point of each.", json_schema_extra=term("ends of the line", "m")
    )
    stiffness: ConstantOrList = Field(
        description="Stiffness; of a ball joint one number, or one for each axis.",
        json_schema_extra=term("k", "N/m | N*m/rad"),
    )
    length: Constant | None = Field(
        None,
        description="Where the spring between points is slack.",
        json_schema_extra=term("ℓ₀", "m", "0"),
    )
    damping: Constant | None = Field(
        None,
        description="Force per velocity of stretching, for a spring between points.",
        json_schema_extra=term("d in −d ℓ̇ along the line", "N*s/m"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def spring(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: SpringEntry
) -> JointSpring | BallSpring | PointSpring | None:
    """The record; None after reporting."""
    if entry.between:
        return _between_points(reader, document, key, entry)
    if entry.joint is not None and entry.coordinate is None:
        own = names.of_joint(entry.joint.text)
        if is_quaternion(*own):
            refuse_keys(reader, key, entry, ("at", "length", "damping"), "between two points")
            return ball_spring(reader, key, str(key), entry.joint.text, entry, *own)
    return _at_joint(reader, names, key, entry)


def _at_joint(reader: Reader, names: Names, key: Key, entry: SpringEntry) -> JointSpring | None:
    refuse_keys(reader, key, entry, ("at", "length", "damping"), "between two points")
    if entry.coordinate is not None and entry.joint is None:
        name = reader.word(
            entry.coordinate, [coordinate.name for coordinate in names.coordinates], "coordinate"
        )
    else:
        target = velocity_of(reader, key, entry, names.velocities)
        name = target.rate_of if target else None
    result = names.coordinate(name)
    return None if result is None else spring_at(reader, key, str(key), entry, result)


def spring_at(
    reader: Reader,
    key: Key,
    name: str,
    entry: SpringEntry | JointSpringEntry,
    coordinate: Coordinate,
) -> JointSpring:
    """A spring on one coordinate, V = ½ k (q − q₀)²: k in N/m and q₀ in m, or k in N m and q₀ in
    rad."""
    unit = coordinate.unit
    stiffness = reader.formula(
        single(reader, entry.stiffness, "a stiffness"),
        "a stiffness",
        unit=per(force_unit(f"{unit or '1'}/s"), unit),
    )
    return JointSpring(
        name,
        coordinate.name,
        stiffness,
        optional(reader, entry.rest, "a rest position", unit),
        key.span,
    )


def is_quaternion(coordinates: Sequence[Coordinate], velocities: Sequence[Velocity]) -> bool:
    """Whether these are of a ball joint that turns by a unit quaternion."""
    return (len(coordinates), len(velocities)) == (4, 3)


def ball_spring(
    reader: Reader,
    key: Key,
    name: str,
    joint: str,
    entry: SpringEntry | JointSpringEntry,
    coordinates: Sequence[Coordinate],
    velocities: Sequence[Velocity],
) -> BallSpring:
    """A spring in a ball joint, V = ½ k φ², φ its rotation vector: k in N m."""
    if entry.rest is not None:
        message = (
            f"'rest' of the spring '{name}' in a ball joint, which is slack where it has not turned"
        )
        expected = (
            "nothing; the joint itself is placed turned by `rpy: [roll, pitch, yaw]` beside `at:`"
        )
        reader.report(entry.rest.span, message, expected)
    w, x, y, z = (coordinate.name for coordinate in coordinates)
    wx, wy, wz = (velocity.name for velocity in velocities)
    return BallSpring(
        name,
        joint,
        (w, x, y, z),
        (wx, wy, wz),
        _about_axes(reader, entry.stiffness),
        key.span,
    )


def _about_axes(reader: Reader, node: Scalar | Items) -> Vector3:
    """One number for all three, or three."""
    entries = list(node) if isinstance(node, Items) else [node] * 3
    if len(entries) != 3:
        message = f"a stiffness with {len(entries)} components"
        reader.report(node.span, message, "one number, or 3 in a list")
        return ORIGIN
    kx, ky, kz = (reader.formula(entry, "a stiffness", unit="N*m/rad") for entry in entries)
    return kx, ky, kz


def _between_points(reader: Reader, document: Bodies, key: Key, entry: SpringEntry) -> PointSpring:
    pair, points = two_points(reader, document, key, entry, ("joint", "coordinate", "rest"))
    given = single(reader, entry.stiffness, "a stiffness")
    stiffness = reader.formula(given, "a stiffness", unit="N/m")
    length = optional(reader, entry.length, "a length", "m")
    damping = optional(reader, entry.damping, "a damping coefficient", "N*s/m")
    return PointSpring(str(key), pair, points, stiffness, length, damping, key.span)


SPRING = Kind("spring", SpringEntry, spring)
