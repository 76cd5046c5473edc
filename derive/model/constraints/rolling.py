"""Disks, spheres and tori that roll without slip."""

from __future__ import annotations

from pydantic import Field

from derive.diagnostics import listed
from derive.expressions.tree import ZERO
from derive.model.constraint_records import Rolling
from derive.model.constraints.lengths import length
from derive.model.constraints.point_on_surface import surface
from derive.model.document import Key, Scalar
from derive.model.language.keys import (
    Constant,
    Constants,
    Direction,
    Entry,
    Formula,
    Named,
    Text,
    Word,
    term,
)
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.records import GROUND, Vector3


class DiskEntry(Entry):
    """A thin disk, a wheel."""

    radius: Constant = Field(description="Radius.", json_schema_extra=term("r", "m"))
    axis: Direction | None = Field(
        None,
        description="Its axis in the body's frame.",
        json_schema_extra=term("e of the spin", "1"),
    )


class SphereEntry(Entry):
    """A sphere."""

    radius: Constant = Field(description="Radius.", json_schema_extra=term("r", "m"))


class TorusEntry(DiskEntry):
    """A torus: a tube about a circle, such as a tyre."""

    radius: Constant = Field(
        description="Radius of the circle in the middle of the tube.",
        json_schema_extra=term("r of the middle circle", "m"),
    )
    tube: Constant = Field(
        description="Radius of the tube.", json_schema_extra=term("radius of the tube", "m")
    )


class ShapeEntry(Entry):
    """One of the keys."""

    disk: DiskEntry | None = Field(
        None, description="A thin disk.", json_schema_extra=term("the lowest point of a circle")
    )
    wheel: DiskEntry | None = Field(
        None, description="The same as a disk.", json_schema_extra=term("the same")
    )
    knife_edge: DiskEntry | None = Field(
        None,
        description="The same as a disk: a wheel with a sharp rim.",
        json_schema_extra=term("the same"),
    )
    sphere: SphereEntry | None = Field(
        None, description="A sphere.", json_schema_extra=term("the point r n below the centre")
    )
    torus: TorusEntry | None = Field(
        None,
        description="A torus.",
        json_schema_extra=term("the lowest point of a tube about a circle"),
    )


class PlaneEntry(Entry):
    normal: Direction = Field(
        description="Normal of the plane (in a planar model of the line), in the frame of `of`: "
        "numbers without parameters.",
        json_schema_extra=term("n", "1"),
    )
    origin: Constants | None = Field(
        None,
        description="A point of the plane, in the frame of `of`.",
        json_schema_extra=term("a point of the plane", "m"),
    )
    of: Named | None = Field(
        None,
        description="The body the plane is fixed to.",
        json_schema_extra=term("the frame of n", otherwise="ground"),
    )


class RollingEntry(Entry):
    """A disk, sphere or torus rolls without slip on a plane, a wheel on a line in a planar model;
    spheres and planar wheels on surfaces."""

    type: Word = Field(
        description="Kind of entry.",
        json_schema_extra=term(
            "φ of the height, and rows of A v = c: the velocity at the contact is zero"
        ),
    )
    body: Named = Field(description="The body.", json_schema_extra=term("the body that rolls"))
    at: Constants | None = Field(
        None,
        description="Centre of the shape, in the body's frame.",
        json_schema_extra=term("centre of the shape", "m", "its origin"),
    )
    shape: ShapeEntry = Field(
        description="What rolls.", json_schema_extra=term("where the point of contact is")
    )
    plane: PlaneEntry | None = Field(
        None, description="What it rolls on.", json_schema_extra=term("n and the height in φ")
    )
    surface: Formula | None = Field(
        None,
        description="Or a formula of x, y, z in the frame of `of`, zero on the surface and "
        "positive on the body's side; for spheres, and wheels of planar models.",
        json_schema_extra=term("n and the height, by the nearest point"),
    )
    of: Named | None = Field(
        None,
        description="The body of the surface.",
        json_schema_extra=term("the frame of x, y, z", otherwise="ground"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


SHAPES = {
    "disk": "disk",
    "wheel": "disk",
    "knife_edge": "disk",
    "sphere": "sphere",
    "torus": "torus",
}


def rolling(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: RollingEntry
) -> Rolling:
    """A disk, sphere or torus of a body on a plane of the ground; lengths in m.

    The tube is zero for all but the torus, so that one record serves every shape; so is the radius
    where the shape was reported as none.
    """
    kind, shape = shape_of(reader, key, entry.shape)
    radius = (
        ZERO
        if shape is None
        else length(reader, shape.radius, "a radius", f"the radius of '{key}'")
    )
    tube = (
        length(reader, shape.tube, "a radius", f"the tube of '{key}'")
        if isinstance(shape, TorusEntry)
        else ZERO
    )
    plane = entry.plane
    if (plane is None) == (entry.surface is None):
        reader.report(key.span, f"'{key}' does not say what it rolls on", "one of plane, surface")
    if entry.surface is not None and not reader.space.plane and SHAPES[kind] != "sphere":
        reader.report(
            key.span,
            f"a {kind} on a surface, '{key}'",
            "a sphere, a plane, or a planar model",
            "where a disk touches a curved surface has no formula",
        )
    return Rolling(
        name=str(key),
        body=some_body(reader, document, entry.body, ground=False),
        centre=reader.point(entry.at, "a point"),
        radius=radius,
        axis=axis_of(reader, key, kind, shape),
        origin=reader.point(None if plane is None else plane.origin, "a point"),
        normal=reader.space.normal if plane is None else reader.direction(plane.normal, "a normal"),
        span=key.span,
        carrier=carrier_of(reader, document, key, entry.body, plane, entry.of),
        surface=None if entry.surface is None else surface(reader, entry.surface),
        shape=SHAPES[kind],
        tube=tube,
    )


def carrier_of(
    reader: Reader,
    document: Bodies,
    key: Key,
    body: Scalar,
    plane: PlaneEntry | None,
    of: Scalar | None,
) -> str:
    """The body that a plane (where it says so) or a surface (`of`) is fixed to; the ground where
    none is named."""
    if plane is not None and of is not None:
        reader.report(
            of.span, f"'of' beside the plane of '{key}'", f"plane: {{..., of: {of.text}}}"
        )
    carrier = of if plane is None else plane.of
    if carrier is None:
        return GROUND
    result = some_body(reader, document, carrier)
    if carrier.text == body.text:
        reader.report(carrier.span, f"'{key}' is between '{body.text}' and itself", "two bodies")
    return result


def shape_of(
    reader: Reader, key: Key, entry: ShapeEntry
) -> tuple[str, DiskEntry | SphereEntry | None]:
    """The key of the shape and its entry; None after reporting that it is none or several."""
    given = [(name, getattr(entry, name)) for name in SHAPES if getattr(entry, name) is not None]
    if len(given) != 1:
        reader.report(
            key.span, f"the shape of '{key}' is {len(given)} shapes", f"one of {listed(SHAPES)}"
        )
        return "disk", None
    kind, shape = given[0]
    if reader.space.plane and kind == "torus":
        reader.report(key.span, f"the shape of '{key}' is a torus in a planar model", "wheel")
    return kind, shape


def axis_of(reader: Reader, key: Key, kind: str, shape: DiskEntry | SphereEntry | None) -> Vector3:
    """The axis of a disk; the normal where a shape has none."""
    axis = shape.axis if isinstance(shape, DiskEntry) else None
    if axis is not None and reader.space.plane:
        reader.report(axis.span, f"an axis of the {kind} '{key}' in a planar model", "no axis")
    elif axis is not None:
        return reader.direction(axis, "an axis")
    elif isinstance(shape, DiskEntry) and not reader.space.plane:
        reader.report(
            key.span, f"the {kind} of '{key}' has no axis", "axis: x, y, z or a list of numbers"
        )
    return reader.space.normal


ROLLING = Kind("rolling", RollingEntry, rolling)
