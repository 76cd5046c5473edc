"""Penalty contact with friction."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ONE, ZERO, Expression
from derive.model.constraints.lengths import length
from derive.model.constraints.point_on_surface import surface
from derive.model.constraints.rolling import (
    SHAPES,
    PlaneEntry,
    ShapeEntry,
    axis_of,
    carrier_of,
    shape_of,
)
from derive.model.document import Key, Scalar
from derive.model.language.keys import Constant, Constants, Entry, Formula, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import Contact
from derive.model.loads.places import not_negative
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader


class CurveEntry(Entry):
    """Force per pressure over slip: linear, or D sin(C atan(B x - E (B x - atan(B x))))."""

    linear: Constant | None = Field(
        None,
        description="Slope: force per pressure and slip.",
        json_schema_extra=term("B in B s", "1"),
    )
    pacejka: Constants | None = Field(
        None,
        description="[B, C, D, E] of the magic formula.",
        json_schema_extra=term("D sin(C atan(B s − E (B s − atan(B s))))", "1"),
    )


class TyreEntry(Entry):
    """A tyre: forces by slip, longitudinal and lateral apart from each other."""

    longitudinal: CurveEntry | None = Field(
        None,
        description="Over the slip (r w - v)/|v|.",
        json_schema_extra=term("force per N over s = (r ω − v)/|v|", otherwise="none"),
    )
    lateral: CurveEntry | None = Field(
        None,
        description="Over the slip angle.",
        json_schema_extra=term("force per N over the slip angle", otherwise="none"),
    )


class ContactEntry(Entry):
    """A point, sphere or wheel presses on a plane or surface: Hunt-Crossley, smooth friction."""

    type: Word = Field(
        description="Kind of entry.", json_schema_extra=term("N = k δ max(0, 1 + d δ̇), V = ½ k δ²")
    )
    body: Named = Field(description="The body.", json_schema_extra=term("the body pressed"))
    at: Constants | None = Field(
        None,
        description="The point, or the shape's centre, in the body's frame.",
        json_schema_extra=term("r of the centre", "m", "its origin"),
    )
    shape: ShapeEntry | None = Field(
        None,
        description="What touches.",
        json_schema_extra=term("where the point of contact is", otherwise="a point"),
    )
    plane: PlaneEntry | None = Field(
        None,
        description="What it touches: the side of the normal.",
        json_schema_extra=term("δ = r − n·p"),
    )
    surface: Formula | None = Field(
        None,
        description="Or a formula of x, y, z in the frame of `of`, positive outside; its value "
        "over its slope counts as the height.",
        json_schema_extra=term("δ = r − f/|∇f|"),
    )
    of: Named | None = Field(
        None,
        description="The body of the surface.",
        json_schema_extra=term("the frame of x, y, z", otherwise="ground"),
    )
    stiffness: Constant = Field(
        description="Pressure per depth.", json_schema_extra=term("k", "N/m")
    )
    damping: Constant | None = Field(
        None,
        description="d of pressure = stiffness*depth*max(0, 1 + d*rate of the depth).",
        json_schema_extra=term("d", "s/m", "0"),
    )
    friction: Constant | None = Field(
        None,
        description="Coefficient of friction.",
        json_schema_extra=term("μ in −μ N v/√(v² + ε²)", "1", "0"),
    )
    tyre: TyreEntry | None = Field(
        None,
        description="Slip of a tyre, instead of friction.",
        json_schema_extra=term("forces per N over slips"),
    )
    smoothing: Constant | None = Field(
        None,
        description="Speed of slip at which friction is 1/sqrt(2) of what it is at last; of a tyre "
        "the speed below which slip is not divided by less.",
        json_schema_extra=term("ε", "m/s"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def contact(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: ContactEntry
) -> Contact:
    """The record; what is missing or cannot be is reported."""
    if (entry.plane is None) == (entry.surface is None):
        reader.report(key.span, f"'{key}' does not say what it touches", "one of plane, surface")
    kind, shape = ("point", None)
    if entry.shape is not None:
        kind, shape = shape_of(reader, key, entry.shape)
    edged = SHAPES.get(kind) in ("disk", "torus") and not reader.space.plane
    if entry.surface is not None and edged:
        reader.report(key.span, f"a {kind} on a surface, '{key}'", "a point or a sphere")
    if kind == "torus":
        reader.report(key.span, f"the shape of '{key}' is a torus", "a point, sphere or wheel")
    plane = entry.plane
    return Contact(
        name=str(key),
        body=some_body(reader, document, entry.body, ground=False),
        centre=reader.point(entry.at, "a point"),
        shape=SHAPES.get(kind, "point"),
        radius=ZERO
        if shape is None
        else length(reader, shape.radius, "a radius", f"the radius of '{key}'"),
        axis=axis_of(reader, key, kind, shape),
        carrier=carrier_of(reader, document, key, entry.body, plane, entry.of),
        origin=reader.point(None if plane is None else plane.origin, "a point"),
        normal=reader.space.normal if plane is None else reader.direction(plane.normal, "a normal"),
        surface=None if entry.surface is None else surface(reader, entry.surface),
        stiffness=not_negative(
            reader, entry.stiffness, f"the stiffness of '{key}'", "a stiffness", "N/m"
        ),
        damping=not_negative(reader, entry.damping, f"the damping of '{key}'", "a damping", "s/m"),
        friction=not_negative(
            reader, entry.friction, f"the friction of '{key}'", "a friction coefficient", ""
        ),
        smoothing=_smoothing(reader, key, entry),
        span=key.span,
        tyre=() if entry.tyre is None else _tyre(reader, key, kind, entry, entry.tyre),
    )


def _tyre(
    reader: Reader, key: Key, kind: str, entry: ContactEntry, tyre: TyreEntry
) -> tuple[tuple[Expression, ...], ...]:
    if SHAPES.get(kind) != "disk":
        reader.report(key.span, f"a tyre on a {kind}, '{key}'", "shape: {wheel: …}")
    if entry.friction is not None:
        reader.report(
            entry.friction.span, f"friction and a tyre of '{key}'", "one of friction, tyre"
        )
    if entry.smoothing is None:
        reader.report(key.span, f"the tyre of '{key}' without smoothing", "smoothing: in m/s")
    return tuple(_curve(reader, key, curve) for curve in (tyre.longitudinal, tyre.lateral))


def _curve(reader: Reader, key: Key, curve: CurveEntry | None) -> tuple[Expression, ...]:
    """(B,) or (B, C, D, E), plain numbers."""
    if curve is None:
        return (ZERO,)
    if (curve.linear is None) == (curve.pacejka is None):
        reader.report(key.span, f"a curve of '{key}' without a law", "one of linear, pacejka")
        return (ZERO,)
    if curve.linear is not None:
        return (reader.formula(curve.linear, "a slope", unit=""),)
    entries = curve.pacejka
    if entries is None or len(entries) != 4:
        count = 0 if entries is None else len(entries)
        reader.report(key.span, f"{count} numbers of a curve of '{key}'", "[B, C, D, E]")
        return (ZERO,)
    return tuple(reader.formula(x, "a number of the curve", unit="") for x in entries)


def _smoothing(reader: Reader, key: Key, entry: ContactEntry) -> Expression:
    if entry.smoothing is None:
        if entry.friction is not None:
            reader.report(
                entry.friction.span,
                f"the friction of '{key}' without smoothing",
                "smoothing: a velocity in m/s, far below which it creeps",
            )
        return ONE
    return _speed(reader, key, entry.smoothing)


def _speed(reader: Reader, key: Key, scalar: Scalar) -> Expression:
    """A speed that is more than zero."""
    formula = reader.formula(scalar, "a velocity", unit="m/s")
    value = reader.value(formula, scalar)
    if value is not None and value <= 0.0:
        reader.report(scalar.span, f"the smoothing of '{key}' is {value:g}", "more than zero")
    return formula


CONTACT = Kind("contact", ContactEntry, contact)
