"""The coordinates and generalized velocities of a model, and what else formulas may refer to."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from derive.diagnostics import listed
from derive.expressions.linearity import Degree
from derive.expressions.tree import Expression
from derive.joints import JOINTS, PLANAR_JOINTS, joint_type
from derive.model.document import Items, Key, Scalar
from derive.model.language.entries import CoordinateEntry, JointEntry, OrientationEntry
from derive.model.motion.delays import Delay
from derive.model.reader import Reader, dimension_of
from derive.model.records import Coordinate, Input, Parameter, Span, Velocity
from derive.model.scope import COORDINATE, VELOCITY, Symbol

if TYPE_CHECKING:
    from derive.model.language.shape import Document

if TYPE_CHECKING:  # the joint tables bring casadi along
    from derive.joints.records import JointType

QUATERNION = "quaternion"
TURNING = ("free", "ball")  # joints whose orientation is a quaternion or Euler angles


@dataclass(frozen=True)
class Frame:
    """A joint of the file with its type's table and the names of its coordinates and velocities."""

    name: Key
    entry: JointEntry
    type: JointType
    orientation: str
    coordinates: tuple[Coordinate, ...]
    velocities: tuple[Velocity, ...]


@dataclass(frozen=True)
class Names:
    """Everything that formulas can refer to, in the order of the model."""

    parameters: tuple[Parameter, ...]
    coordinates: tuple[Coordinate, ...]
    velocities: tuple[Velocity, ...]
    inputs: tuple[Input, ...]
    definitions: tuple[tuple[str, Expression], ...]
    states: Mapping[str, str] = field(default_factory=dict[str, str])  # units by name
    delays: tuple[Delay, ...] = ()
    # generalized velocities, and rates of coordinates that are none
    rates: tuple[Velocity, ...] = ()

    def coordinate(self, name: str | None) -> Coordinate | None:
        """The coordinate of that name; None where there is none."""
        return self._coordinates.get(name)

    def of_joint(self, joint: str) -> tuple[tuple[Coordinate, ...], tuple[Velocity, ...]]:
        """Its coordinates and generalized velocities; none of what is no joint."""
        coordinates, velocities = self._owned.get(joint, ([], []))
        return tuple(coordinates), tuple(velocities)

    @functools.cached_property
    def _coordinates(self) -> dict[str | None, Coordinate]:
        return {x.name: x for x in self.coordinates}

    @functools.cached_property
    def _owned(self) -> dict[str, tuple[list[Coordinate], list[Velocity]]]:
        found: dict[str, tuple[list[Coordinate], list[Velocity]]] = {}
        for coordinate in self.coordinates:
            found.setdefault(coordinate.owner, ([], []))[0].append(coordinate)
        for velocity in self.velocities:
            found.setdefault(velocity.owner, ([], []))[1].append(velocity)
        return found

    def unit(self, name: str) -> str:
        """Of the coordinate, generalized velocity or state of that name, else ""."""
        units = {x.name: x.unit for x in (*self.velocities, *self.coordinates)}
        return units.get(name, "") or self.states.get(name, "")


def frame(reader: Reader, key: Key, entry: JointEntry) -> Frame | None:
    """Names and table of one joint; None after reporting that its type is unknown."""
    reader.name(key)
    kind = reader.word(entry.type, [joint.name for joint in JOINTS], "type of joint")
    if kind is None:
        return None
    if reader.space.plane and kind not in PLANAR_JOINTS:
        hint = "a planar joint moves freely in the plane" if kind == "free" else ""
        reader.report(
            entry.type.span, f"a {kind} joint in a planar model", listed(PLANAR_JOINTS), hint
        )
        return None
    orientation = _orientation(reader, entry) if kind in TURNING else ""
    table = joint_type(kind, orientation)
    coordinates = _coordinates(reader, key, entry, table)
    return Frame(key, entry, table, orientation, coordinates, _velocities(key, table, coordinates))


def _orientation(reader: Reader, entry: JointEntry) -> str:
    """ "quaternion", also where the file does not say, or a sequence of Euler angles."""
    given = entry.orientation
    if given is None:
        return QUATERNION
    if isinstance(given, Scalar):
        if given.text == "euler":
            expected = "quaternion, or {euler: zxy, angles: [yaw, lean, spin]}"
            reader.report(given.span, "an orientation by Euler angles without names", expected)
        else:
            reader.word(given, [QUATERNION], "orientation")
        return QUATERNION
    if given.quaternion is not None:
        for wrong in (given.euler, given.angles):
            if wrong is not None:
                reader.report(wrong.span, "Euler angles beside a quaternion", "one of the two")
        return QUATERNION
    if given.euler is None:
        span = given.angles.span if given.angles is not None else entry.type.span
        reader.report(
            span,
            "an orientation without a sequence",
            "euler: a sequence such as zxy, or quaternion",
        )
        return "zyx"
    return _sequence(reader, given.euler)


def _sequence(reader: Reader, given: Scalar) -> str:
    sequence = given.text
    if (
        len(sequence) == 3
        and set(sequence) <= set("xyz")
        and sequence[0] != sequence[1] != sequence[2]
    ):
        return sequence
    reader.report(
        given.span,
        f"'{sequence}' is not a sequence of Euler angles",
        "three of x, y, z, no two neighbours alike, such as zxy",
    )
    return "zyx"


def _coordinates(
    reader: Reader, key: Key, entry: JointEntry, table: JointType
) -> tuple[Coordinate, ...]:
    given = _given_names(reader, key, entry, table)
    names = given or [
        Scalar(f"{key}_{slot.suffix}" if slot.suffix else key, key.span, False, True)
        for slot in table.coordinates
    ]
    return tuple(
        Coordinate(reader.name(name) if given else name.text, slot.unit, str(key), name.span)
        for name, slot in zip(names, table.coordinates)
    )


# what other joints have in the place of a key, and where else one may look
_INSTEAD = {
    "position": ("coordinate or coordinates", "where the joint is stands under `at:`"),
    "orientation": (
        "coordinate or coordinates",
        "free and ball joints alone have quaternions or Euler angles",
    ),
}


def _misplaced(entry: JointEntry, table: JointType) -> Iterator[str]:
    """The keys of other joints that it has: free ones alone have a position, free and ball joints
    an orientation."""
    if entry.position is not None and table.name != "free":
        yield "position"
    if entry.orientation is not None and table.name not in TURNING:
        yield "orientation"


def _given_names(reader: Reader, key: Key, entry: JointEntry, table: JointType) -> list[Scalar]:
    """The names the file gives to the coordinates, in the order of the table; [] where it leaves
    them to us."""
    for wrong in _misplaced(entry, table):
        given = getattr(entry, wrong)
        reader.report(
            key.span if isinstance(given, OrientationEntry) else given.span,
            f"'{wrong}' of a {table.name} joint",
            *_INSTEAD[wrong],
        )
    if entry.coordinate is not None:
        return _counted(reader, key, [entry.coordinate], table, entry.coordinate.span)
    free = table.name == "free"
    places = entry.position
    if free and places is None and entry.coordinates is not None and len(entry.coordinates) == 3:
        places = entry.coordinates
    elif entry.coordinates is not None:
        return _counted(reader, key, list(entry.coordinates), table, entry.coordinates.span)
    if free:
        return _free_names(reader, key, entry, table, places)
    return _turning_names(reader, key, entry, table) if table.name in TURNING else []


def _counted(
    reader: Reader, key: Key, names: list[Scalar], table: JointType, span: Span
) -> list[Scalar]:
    if len(names) == len(table.coordinates):
        return names
    slots = [slot.suffix or slot.unit for slot in table.coordinates]
    wanted = f"{len(slots)}: [{', '.join(slots)}]" if slots else "none"
    angles = len(names) == {"free": 6, "ball": 3}.get(table.name)
    reader.report(
        span,
        f"{len(names)} coordinate{'s' * (len(names) != 1)} of the {table.name} joint '{key}'",
        wanted,
        "angles take a sequence of axes: orientation: {euler: zyx}" if angles else "",
    )
    return []


def _free_names(
    reader: Reader, key: Key, entry: JointEntry, table: JointType, places: Items | None
) -> list[Scalar]:
    """Position first, then the angles or the entries of the quaternion."""
    suffixes = [slot.suffix for slot in table.coordinates[:3]]
    return _named(reader, key, places, suffixes, "position") + _turning_names(
        reader, key, entry, table
    )


def _turning_names(reader: Reader, key: Key, entry: JointEntry, table: JointType) -> list[Scalar]:
    """The angles, or the entries of the quaternion: the last coordinates of the joint."""
    given = entry.orientation if isinstance(entry.orientation, OrientationEntry) else None
    names = (
        None
        if given is None
        else given.quaternion
        if given.quaternion is not None
        else given.angles
    )
    suffixes = [slot.suffix for slot in table.coordinates if slot.suffix not in tuple("xyz")]
    return _named(reader, key, names, suffixes, "orientation")


def _named(
    reader: Reader, key: Key, names: Items | None, suffixes: list[str], what: str
) -> list[Scalar]:
    if names is not None and len(names) != len(suffixes):
        wanted = {3: "three names", 4: "four names: w, x, y, z"}[len(suffixes)]
        reader.report(names.span, f"{len(names)} names for the {what} of '{key}'", wanted)
    if names is not None and len(names) == len(suffixes):
        return list(names)
    return [Scalar(f"{key}_{suffix}", key.span, False, True) for suffix in suffixes]


def _velocities(
    key: Key, table: JointType, coordinates: tuple[Coordinate, ...]
) -> tuple[Velocity, ...]:
    velocities: list[Velocity] = []
    for index, slot in enumerate(table.velocities):
        rate_of = "" if slot.suffix else coordinates[index].name
        name = f"der({rate_of})" if rate_of else f"{key}.{slot.suffix}"
        velocities.append(Velocity(name, slot.unit, str(key), rate_of, key.span))
    return tuple(velocities)


def rates(joints: list[Frame], velocities: tuple[Velocity, ...]) -> tuple[Velocity, ...]:
    """All that a force can be conjugate to: the generalized velocities, and of joints whose
    coordinates have other rates these, but for quaternions, whose four entries are not free."""
    others = (
        Velocity(f"der({x.name})", f"{x.unit or '1'}/s", "", x.name, x.span)
        for frame in joints
        for x in _free_to_change(frame)
    )
    return velocities + tuple(others)


def _free_to_change(frame: Frame) -> tuple[Coordinate, ...]:
    first, own = frame.type.unit_from, {velocity.rate_of for velocity in frame.velocities}
    found = frame.coordinates if first < 0 else frame.coordinates[:first]
    return tuple(x for x in found if x.name not in own)


def analytic_coordinates(
    reader: Reader, document: Document
) -> tuple[tuple[Coordinate, ...], tuple[Velocity, ...]]:
    """Coordinates of the analytic form and their rates."""
    coordinates: list[Coordinate] = []
    velocities: list[Velocity] = []
    for key, entry in document.coordinates.items():
        given = reader.unit(entry.unit if isinstance(entry, CoordinateEntry) else entry)
        name = reader.name(key)
        coordinates.append(Coordinate(name, given, "", key.span))
        velocities.append(Velocity(f"der({name})", f"{given or '1'}/s", "", name, key.span))
    return tuple(coordinates), tuple(velocities)


def enter(
    reader: Reader, coordinates: tuple[Coordinate, ...], velocities: tuple[Velocity, ...]
) -> None:
    """Put coordinates, rates and generalized velocities into the scope, with J.w and J.v for joints
    that have one rate."""
    scope = reader.scope
    for coordinate in coordinates:
        scope.add(
            coordinate.name,
            Symbol(frozenset({COORDINATE}), dimension_of(coordinate.unit), unit=coordinate.unit),
        )
        rate = f"{coordinate.unit or '1'}/s"
        scope.add(f"der({coordinate.name})", _moving(rate))
    for velocity in velocities:
        scope.add(velocity.name, _moving(velocity.unit))
        if velocity.rate_of and velocity.owner:
            letter = "w" if velocity.unit == "rad/s" else "v"
            scope.aliases[f"{velocity.owner}.{letter}"] = velocity.rate_of


def _moving(unit: str) -> Symbol:
    return Symbol(frozenset({VELOCITY}), dimension_of(unit), Degree(1, 1), unit=unit)
