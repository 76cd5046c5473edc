"""What a model file says of each constraint."""

from __future__ import annotations

from dataclasses import dataclass

from derive.expressions.tree import ZERO, Expression
from derive.model.records import GROUND, Span, Vector3


@dataclass(frozen=True)
class Holonomic:
    """expression(q, t) = 0. `nonideal`: the constraint's own generalised force per coordinate, or
    () when ideal. `follower`: of a coupling the coordinate that is said by the other, else ""."""

    name: str
    expression: Expression
    nonideal: tuple[Expression, ...]
    span: Span
    follower: str = ""


@dataclass(frozen=True)
class Nonholonomic:
    """expression(q, der(q), t) = 0, linear in the rates (checked when loaded)."""

    name: str
    expression: Expression
    nonideal: tuple[Expression, ...]
    span: Span


@dataclass(frozen=True)
class NoSlip:
    """The body's material point `point` does not move along `direction` (both in body
    coordinates)."""

    name: str
    body: str
    point: Vector3
    direction: Vector3
    span: Span


@dataclass(frozen=True)
class Rolling:
    """A body rolls without slip on the plane through `origin`, normal to `normal` (in the frame of
    `carrier`; in the body's: centre, axis).

    `shape`: "disk" (thin: wheel, knife edge), "sphere" (its axis means nothing) or "torus", whose
    circle of `radius` about the axis carries a tube of the smaller radius `tube`. In a planar model
    the plane is a line and the disk a circle. `surface`, where given, stands for the plane: a
    formula of x, y, z in the carrier's frame, positive on the body's side.
    """

    name: str
    body: str
    centre: Vector3
    radius: Expression
    axis: Vector3
    origin: Vector3
    normal: Vector3
    span: Span
    carrier: str = GROUND
    shape: str = "disk"
    tube: Expression = ZERO
    surface: Expression | None = None


@dataclass(frozen=True)
class Distance:
    """Two points of two bodies (one may be the ground) stay `length` apart: a massless rod."""

    name: str
    bodies: tuple[str, str]
    points: tuple[Vector3, Vector3]
    length: Expression
    span: Span


@dataclass(frozen=True)
class OnSurface:
    """`surface` vanishes at the body's `point`; its names x, y, z are the point's coordinates in
    the frame of `frame_body`.

    The three names shadow whatever the model calls x, y or z.
    """

    name: str
    body: str
    point: Vector3
    frame_body: str
    surface: Expression
    span: Span
