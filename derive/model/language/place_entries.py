"""Where frames sit in bodies, as pydantic classes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from derive.model.language.keys import (
    Constant,
    Constants,
    Entry,
    Named,
    Nested,
    Text,
    is_list,
    is_mapping,
    is_pair,
    term,
    told_by,
)


class TurnedEntry(Entry):
    """How a frame is turned; one of the keys."""

    angle: Constant | None = Field(
        None,
        description="Planar models: how far the frame is turned.",
        json_schema_extra=term("R(angle) of the frame", "rad"),
    )
    rpy: Constants | None = Field(
        None,
        description="In space: roll, pitch, yaw of the frame, as in URDF.",
        json_schema_extra=term("R = Rz(yaw) Ry(pitch) Rx(roll)", "rad"),
    )
    axis_angle: Nested | None = Field(
        None,
        description="In space: [axis, angle].",
        json_schema_extra=term("R by Rodrigues' formula", "rad"),
    )
    matrix: Nested | None = Field(
        None,
        description="In space: the rotation matrix, three rows of numbers.",
        json_schema_extra=term("R itself, checked to be a rotation", "1"),
    )


class SideEntry(TurnedEntry):
    """Where a joint's frame sits in one of its bodies."""

    position: Constants | None = Field(
        None,
        description="The point.",
        json_schema_extra=term("r in p = r₀ + R r", "m", "the body's origin"),
    )


class FrameEntry(SideEntry):
    """A frame fixed to a body; functions on request tell where it is and how it moves."""

    body: Named = Field(
        description="The body, or ground.",
        json_schema_extra=term("the body whose motion the frame has"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


Side = Annotated[
    Annotated[Constants, Tag("<a point>")] | Annotated[SideEntry, Tag("<a placed frame>")],
    told_by(**{"a point": is_list, "a placed frame": is_mapping}),
]


Sides = Annotated[list[Side], Field(min_length=2, max_length=2)]


class SidesEntry(Entry):
    """Where a joint's frame sits in its parent and in its child."""

    parent: Side | None = Field(
        None,
        description="In the parent.",
        json_schema_extra=term("r and R of the joint's frame in the parent", "m", "its origin"),
    )
    child: Side | None = Field(
        None,
        description="In the child.",
        json_schema_extra=term("r and R of the joint's frame in the child", "m", "its origin"),
    )


JointPlace = Annotated[
    Annotated[SidesEntry, Tag("<parent and child>")]
    | Annotated[Sides, Tag("<a pair of points>")]
    | Annotated[Constants, Tag("<a point>")],
    told_by(**{"a pair of points": is_pair, "a point": is_list, "parent and child": is_mapping}),
]
