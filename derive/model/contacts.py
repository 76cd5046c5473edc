"""Constraints on points of bodies: no slip, rolling, rods and surfaces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from derive.diagnostics import listed
from derive.expressions import tree
from derive.expressions.tree import ZERO, Expression
from derive.expressions.units import LENGTH
from derive.model.document import Key, Scalar
from derive.model.mechanism import bodies, some_body
from derive.model.reader import Reader
from derive.model.records import GROUND, Constraint, Distance, NoSlip, OnSurface, Rolling, Vector3
from derive.model.scope import COORDINATE, PARAMETER, TIME, Symbol
from derive.model.shape import (
    DiskEntry,
    DistanceEntry,
    Document,
    NoSlipEntry,
    OnSurfaceEntry,
    RollingEntry,
    ShapeEntry,
    SphereEntry,
    TorusEntry,
)

SHAPES = {
    "disk": "disk",
    "wheel": "disk",
    "knife_edge": "disk",
    "sphere": "sphere",
    "torus": "torus",
}


def contact(reader: Reader, document: Document, key: Key, entry: object) -> Constraint:
    """One constraint that speaks of bodies."""
    match entry:
        case NoSlipEntry():
            return _no_slip(reader, document, key, entry)
        case RollingEntry():
            return _rolling(reader, document, key, entry)
        case DistanceEntry():
            return _distance(reader, document, key, entry)
        case OnSurfaceEntry():
            return _on_surface(reader, document, key, entry)
    raise AssertionError(entry)


def _no_slip(reader: Reader, document: Document, key: Key, entry: NoSlipEntry) -> NoSlip:
    body = some_body(reader, document, entry.body, ground=False)
    point = reader.point(entry.at, "a point")
    return NoSlip(
        str(key),
        body,
        point,
        reader.direction(entry.direction, "a direction", constant=False),
        key.span,
    )


def _rolling(reader: Reader, document: Document, key: Key, entry: RollingEntry) -> Rolling:
    kind, shape = _shape(reader, key, entry.shape)
    radius = (
        ZERO
        if shape is None
        else _length(reader, shape.radius, "a radius", f"the radius of '{key}'")
    )
    tube = (
        _length(reader, shape.tube, "a radius", f"the tube of '{key}'")
        if isinstance(shape, TorusEntry)
        else ZERO
    )
    return Rolling(
        name=str(key),
        body=some_body(reader, document, entry.body, ground=False),
        centre=reader.point(entry.at, "a point"),
        radius=radius,
        axis=_rolling_axis(reader, key, kind, shape),
        origin=reader.point(entry.plane.origin, "a point"),
        normal=reader.direction(entry.plane.normal, "a normal"),
        span=key.span,
        shape=SHAPES[kind],
        tube=tube,
    )


def _shape(
    reader: Reader, key: Key, entry: ShapeEntry
) -> tuple[str, DiskEntry | SphereEntry | None]:
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


def _rolling_axis(
    reader: Reader, key: Key, kind: str, shape: DiskEntry | SphereEntry | None
) -> Vector3:
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


def _length(reader: Reader, scalar: Scalar, where: str, what: str) -> Expression:
    """A length that has to be more than zero."""
    formula = reader.formula(scalar, where, unit="m")
    value = reader.value(formula, scalar)
    if value is not None and value <= 0.0:
        reader.report(scalar.span, f"{what} is {value:g} m", "more than zero")
    return formula


def _distance(reader: Reader, document: Document, key: Key, entry: DistanceEntry) -> Distance:
    pair = bodies(reader, document, key, entry.between)
    points = (reader.point(entry.at[0], "a point"), reader.point(entry.at[1], "a point"))
    return Distance(
        str(key),
        pair,
        points,
        _length(reader, entry.length, "a length", f"the length of '{key}'"),
        key.span,
    )


def _on_surface(reader: Reader, document: Document, key: Key, entry: OnSurfaceEntry) -> OnSurface:
    body = some_body(reader, document, entry.body, ground=False)
    carrier = GROUND if entry.of is None else some_body(reader, document, entry.of)
    if entry.of is not None and body == carrier:
        reader.report(entry.of.span, f"'{key}' is between '{body}' and itself", "two bodies")
    point = reader.point(entry.at, "a point")
    return OnSurface(str(key), body, point, carrier, _surface(reader, entry.surface), key.span)


def _surface(reader: Reader, scalar: Scalar) -> Expression:
    letters = reader.space.letters
    before = len(reader.problems)
    with _local(reader, letters):
        formula = reader.formula(scalar, "a surface", frozenset({PARAMETER, COORDINATE, TIME}))
    names = {node.name for node in tree.walk(formula) if isinstance(node, tree.Name)}
    if len(reader.problems) == before and not names & set(letters):
        wanted = f"a formula of {', '.join(letters)} that is zero on the surface"
        reader.report(scalar.span, f"a surface without {', '.join(letters)}", wanted)
    return formula


@contextmanager
def _local(reader: Reader, letters: str) -> Iterator[None]:
    """While a surface is read its letters are a point's coordinates, and the model's own
    coordinates are out of sight."""
    outside = reader.scope
    reader.scope = outside.only(frozenset({PARAMETER, TIME}))
    for letter in letters:
        reader.scope.put(letter, Symbol(frozenset({COORDINATE}), LENGTH, unit="m"))
    try:
        yield
    finally:
        reader.scope = outside
