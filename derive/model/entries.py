"""The shape of a model file as pydantic classes: which keys there are and what kind of thing each
holds.

Formulas stay text with a place here; names, units and mechanics are checked afterwards. The same
classes give the JSON Schema that editors complete from.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Tag,
    model_validator,
)
from pydantic_core import PydanticCustomError, core_schema

from derive.model.document import Entries, Items, Key, Scalar


class _Formula:
    """A scalar of the file: a formula, a name or a text."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.is_instance_schema(Scalar)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": ["string", "number"]}


class _Name:
    """A mapping's key."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.is_instance_schema(Key)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string"}


class _Listed:
    """A list of scalars that remembers where it stands."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        inner = core_schema.list_schema(core_schema.is_instance_schema(Scalar))
        return core_schema.no_info_wrap_validator_function(_with_place, inner)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["string", "number"]}}


class _Nested:
    """A list that may hold lists; what is in it is checked where it is read."""

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(_as_list)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "array"}


def _as_list(value: Any) -> Any:
    if not isinstance(value, Items):
        raise PydanticCustomError("not_a_list", "not a list")
    return value


def _with_place(value: Any, handler: Callable[[Any], list[Any]]) -> Any:
    return Items(handler(_as_list(value)), value.span)


Formula = Annotated[Scalar, _Formula]
Name = Annotated[Key, _Name]
Point = Annotated[Items, _Listed]
Nested = Annotated[Items, _Nested]


def _kind(**tags: Callable[[Any], bool]) -> Discriminator:
    """A union told apart by the kind of node, not by trying one after the other: one message, and
    the right one."""

    def tag(value: Any) -> str | None:
        """The tag of the first class whose form fits the value; None where none does."""
        return next((f"<{name}>" for name, fits in tags.items() if fits(value)), None)

    return Discriminator(tag)


def _is_scalar(value: Any) -> bool:
    return isinstance(value, Scalar)


def _is_list(value: Any) -> bool:
    return isinstance(value, Items)


def _is_pair(value: Any) -> bool:
    return isinstance(value, Items) and any(isinstance(entry, Items | Entries) for entry in value)


def _is_mapping(value: Any) -> bool:
    return isinstance(value, Entries)


def by_node(scalar: str, mapping: str) -> Discriminator:
    """A union of a text and a mapping; what each is called in messages."""
    return _kind(**{scalar: _is_scalar, mapping: _is_mapping})


Pair = Annotated[list[Point], Field(min_length=2, max_length=2)]
Direction = Annotated[
    Annotated[Formula, Tag("<x, y or z>")] | Annotated[Point, Tag("<a list>")],
    _kind(**{"x, y or z": _is_scalar, "a list": _is_list}),
]
FormulaOrList = Annotated[
    Annotated[Formula, Tag("<a formula>")] | Annotated[Point, Tag("<a list>")],
    _kind(**{"a formula": _is_scalar, "a list": _is_list}),
]
PerCoordinate = Annotated[
    Annotated[Point, Tag("<a list>")] | Annotated[dict[Name, Formula], Tag("<a mapping>")],
    _kind(**{"a list": _is_list, "a mapping": _is_mapping}),
]


class Entry(BaseModel):
    """A mapping with known keys. Unknown keys are reported before missing ones: the second is often
    the first misspelt."""

    model_config = ConfigDict(
        extra="forbid",
        allow_inf_nan=False,
        arbitrary_types_allowed=True,
        frozen=True,
        defer_build=True,
    )
    ignored: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def known_keys(cls, value: Any) -> Any:
        """Refuses unknown keys with the known ones, before pydantic looks at values: a misspelt key
        is told as such and not as a missing one."""
        if not isinstance(value, Entries):
            raise PydanticCustomError(
                "not_a_mapping", "not a mapping", {"keys": list(cls.model_fields)}
            )
        unknown = [key for key in value if key not in cls.model_fields]
        if unknown:
            raise PydanticCustomError(
                "unknown_key", "unknown key", {"unknown": unknown, "keys": list(cls.model_fields)}
            )
        return value


class ReferenceEntry(Entry):
    """Published values that `hamel verify` holds the model to."""

    source: Formula = Field(description="Where the numbers are from.")
    time: Formula | None = Field(
        None, description="When, in seconds after the initial state (default: there)."
    )
    tolerance: Formula = Field(description="Relative error that is allowed.")
    values: dict[Name, Formula] = Field(
        {}, description="Coordinates, velocities, outputs (tip[0]) and the energies T and V."
    )
    accelerations: dict[Name, Formula] = Field(
        {}, description="Rates of the generalized velocities, such as der(q1)."
    )


class ExtremeEntry(Entry):
    """An extreme case of the model, which `hamel extremes` simulates and judges."""

    about: Formula | None = Field(None, description="What is extreme about it.")
    set: dict[Name, Formula] = Field(
        {}, description="Initial values, parameters and inputs, as with `hamel simulate --set`."
    )
    time: Formula | None = Field(None, description="The end of the motion, in seconds.")
    spoiled: Formula | None = Field(
        None,
        description="`all`, instead of a motion: NaN, ±Inf, the least denormal and 1e300 in "
        "every argument of every function.",
    )
    integrator: Formula | None = Field(None, description="How to step (default: dop853).")
    enforcement: Formula | None = Field(
        None, description="How to stay on the constraints (default: projection)."
    )
    choice: Formula | None = Field(
        None, description="The choice of quasi-velocities (default: the file's first)."
    )
    real: Formula | None = Field(
        None, description="What the code computes in: float64 or float32 (default: float64)."
    )
    rtol: Formula | None = Field(
        None, description="Relative tolerance of a step (default: 1e-11, in float32 1e-6)."
    )
    tolerance: Formula | None = Field(
        None, description="Relative error that is allowed; when left out it is only reported."
    )
    end: dict[Name, Formula] = Field(
        {},
        description="Coordinates and velocities at the end, in closed form; when left out, many "
        "digits are computed.",
    )
    refused: Formula | None = Field(
        None, description="For a case that must be refused: words of the message."
    )


class EventEntry(Entry):
    formula: Formula = Field(
        description="What changes its sign: of coordinates, velocities, outputs and t."
    )
    direction: Formula | None = Field(None, description="rising, falling, or both (when left out).")
    stop: Formula | None = Field(
        None, description="true: the motion ends there; false (when left out): it is counted."
    )


class ParameterEntry(Entry):
    value: Formula = Field(description="Number with its unit, such as 0.2 m.")
    about: Formula | None = Field(None, description="What it is, for readers.")
    symbol: Formula | None = Field(
        None, description="How its name is typeset, such as \\delta_{1}."
    )


class TableEntry(Entry):
    """A function of one number by points, joined by a cubic spline."""

    file: Formula | None = Field(
        None, description="A CSV file of two columns, in the folder of the model or below."
    )
    points: Nested | None = Field(None, description="Or the points: [[x, y], …].")
    units: Point | None = Field(None, description="Units of x and y; plain numbers if left out.")
    smooth: Formula | None = Field(
        None,
        description="C2, the natural spline (when left out), or C1, which keeps rising rising.",
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


class CoordinateEntry(Entry):
    unit: Formula = Field(description="Unit of the coordinate, such as m or rad.")
    about: Formula | None = Field(None, description="What it is, for readers.")
    symbol: Formula | None = Field(
        None, description="How its name is typeset, such as \\delta_{1}."
    )


class TurnedEntry(Entry):
    """How a frame is turned; one of the keys."""

    angle: Formula | None = Field(None, description="Planar models: how far the frame is turned.")
    rpy: Point | None = Field(
        None, description="In space: roll, pitch, yaw of the frame, as in URDF."
    )
    axis_angle: Nested | None = Field(None, description="In space: [axis, angle].")
    matrix: Nested | None = Field(
        None, description="In space: the rotation matrix, three rows of numbers."
    )


class SideEntry(TurnedEntry):
    """Where a joint's frame sits in one of its bodies."""

    position: Point | None = Field(None, description="The point; the body's origin when left out.")


class FrameEntry(SideEntry):
    """A frame fixed to a body; functions on request tell where it is and how it moves."""

    body: Formula = Field(description="The body, or ground.")
    about: Formula | None = None


Side = Annotated[
    Annotated[Point, Tag("<a point>")] | Annotated[SideEntry, Tag("<a placed frame>")],
    _kind(**{"a point": _is_list, "a placed frame": _is_mapping}),
]
Sides = Annotated[list[Side], Field(min_length=2, max_length=2)]


class SidesEntry(Entry):
    """Where a joint's frame sits in its parent and in its child."""

    parent: Side | None = Field(None, description="In the parent; its origin when left out.")
    child: Side | None = Field(None, description="In the child; its origin when left out.")


JointPlace = Annotated[
    Annotated[Sides, Tag("<a pair of points>")]
    | Annotated[Point, Tag("<a point>")]
    | Annotated[SidesEntry, Tag("<parent and child>")],
    _kind(**{"a pair of points": _is_pair, "a point": _is_list, "parent and child": _is_mapping}),
]


class InertiaEntry(Entry):
    """An inertia tensor with the point and the frame it refers to."""

    tensor: FormulaOrList = Field(
        description="One, three (xx, yy, zz) or six (xx, yy, zz, xy, xz, yz) entries."
    )
    about: Formula | None = Field(
        None, description="com (when left out) or origin: the point the tensor is about."
    )
    frame: TurnedEntry | None = Field(
        None, description="How the tensor's axes are turned in the body."
    )


Inertia = Annotated[
    Annotated[Formula, Tag("<a formula>")]
    | Annotated[Point, Tag("<a list>")]
    | Annotated[InertiaEntry, Tag("<a mapping>")],
    _kind(**{"a formula": _is_scalar, "a list": _is_list, "a mapping": _is_mapping}),
]


class BodyEntry(Entry):
    """A rigid body."""

    mass: Formula = Field(description="Mass; 0 for a body without mass.")
    com: Point | None = Field(
        None, description="Centre of mass in the body's frame; its origin when left out."
    )
    first_moment: Point | None = Field(
        None,
        description="Mass times centre of mass, in kg m, in the place of `com`: with `inertia: "
        "{tensor: …, about: origin}` the form in which equations are linear.",
    )
    inertia: Inertia | None = Field(
        None,
        description="About the centre of mass: one moment in a planar model; in space one (a "
        "sphere), three (xx, yy, zz) or six "
        "(xx, yy, zz, xy, xz, yz, tensor entries); or a mapping that says which point and frame "
        "it refers to. A point mass when "
        "left out.",
    )
    physical: Formula | None = Field(
        None,
        description="false: the inertia is taken as it is, though no body can have it (identified "
        "sets); true when left out.",
    )
    about: Formula | None = Field(None, description="What it is, for readers.")
    symbol: Formula | None = Field(
        None, description="How its name is typeset, such as \\delta_{1}."
    )


class OrientationEntry(Entry):
    """Euler angles or a quaternion."""

    euler: Formula | None = Field(None, description="Intrinsic sequence of axes, such as zxy.")
    angles: Point | None = Field(None, description="Names of the three angles.")
    quaternion: Point | None = Field(None, description="Names of the four entries w, x, y, z.")


Orientation = Annotated[
    Annotated[Formula, Tag("<quaternion>")] | Annotated[OrientationEntry, Tag("<a mapping>")],
    _kind(**{"quaternion": _is_scalar, "a mapping": _is_mapping}),
]


class JointSpringEntry(Entry):
    """A spring in the joint: -stiffness (q - rest)."""

    stiffness: Formula = Field(description="Stiffness.")
    rest: Formula | None = Field(None, description="Where it is slack; 0 when left out.")


class LawOfFriction(Entry):
    """-viscous v - coulomb tanh(v/smoothing)."""

    viscous: Formula | None = Field(None, description="Force or torque per velocity.")
    coulomb: Formula | None = Field(None, description="Force or torque of dry friction.")
    smoothing: Formula | None = Field(
        None, description="Velocity at which dry friction is three quarters there."
    )


class JointEntry(TurnedEntry):
    """A joint of the tree: it says where the child is in the parent."""

    type: Formula = Field(description="Kind of joint.")
    parent: Formula = Field(description="A body, or ground.")
    child: Formula = Field(description="A body; each is the child of one joint.")
    symbol: Formula | None = Field(
        None, description="How the name of its first coordinate is typeset, such as \\delta_{1}."
    )
    at: JointPlace | None = Field(
        None,
        description="Where the joint is: a point of the parent, one of the parent and one of "
        "the child, or a mapping with parent "
        "and child. Keys beside it turn the joint's frame in the parent.",
    )
    axis: Direction | None = Field(
        None, description="Direction in the joint's frame: x, y, z or a list of numbers."
    )
    axis2: Direction | None = Field(
        None,
        description="Universal joint: the second axis, at right angles to the first, fixed in "
        "the child.",
    )
    pitch: Formula | None = Field(
        None, description="Screw: advance along the axis per turn, such as 5 mm."
    )
    coordinate: Formula | None = Field(
        None, description="Name of the joint's one coordinate; the joint's own name when left out."
    )
    coordinates: Point | None = Field(None, description="Names of the joint's coordinates.")
    position: Point | None = Field(
        None, description="Free joint: names of the three position coordinates."
    )
    orientation: Orientation | None = Field(
        None,
        description="Free joint: quaternion (when left out), or a mapping with an Euler "
        "sequence and names of the angles.",
    )
    limits: Point | None = Field(
        None, description="Lowest and highest value of the coordinate, for readers; no force."
    )
    spring: JointSpringEntry | None = Field(None, description="A spring in the joint.")
    damper: Formula | None = Field(
        None, description="Force or torque per velocity of a damper in the joint."
    )
    friction: LawOfFriction | None = Field(None, description="Friction in the joint.")
    armature: Formula | None = Field(
        None, description="Inertia of what turns with the joint's motor, as the joint feels it."
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


class ClosureEntry(TurnedEntry):
    """A joint that closes a loop."""

    type: Formula = Field(description="Kind of joint.")
    between: Point = Field(description="The two bodies.")
    at: Sides = Field(
        description="Where the joint is in each of the two. Keys beside it turn its frame in "
        "the first body."
    )
    axis: Direction | None = Field(None, description="Direction in the joint's frame.")
    axis2: Direction | None = Field(
        None,
        description="Universal joint: the second axis, at right angles to the first, fixed in "
        "the second body.",
    )
    pitch: Formula | None = Field(
        None, description="Screw: advance along the axis per turn, such as 5 mm."
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


class InputEntry(Entry):
    """An actuator at a joint, a coordinate or a generalized velocity; with none of these a name for
    formulas."""

    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    velocity: Formula | None = Field(None, description="A generalized velocity, such as base.vx.")
    gear: Formula | None = Field(
        None, description="Force or torque at the joint per input; 1 when left out."
    )
    rotor_inertia: Formula | None = Field(
        None, description="Of the actuator's rotor, which turns `gear` times as fast."
    )
    unit: Formula | None = Field(None, description="Unit of the input.")
    about: Formula | None = Field(None, description="What it is, for readers.")


class StateEntry(Entry):
    """A number with a first-order equation of its own: a current, a pressure, an activation."""

    rate: Formula = Field(
        description="Its rate: a formula of t, coordinates, velocities, inputs and states."
    )
    initial: Formula | None = Field(None, description="Its value at t = 0; 0 when left out.")
    unit: Formula | None = Field(None, description="Its unit; that of `initial` when left out.")
    energy: Formula | None = Field(
        None, description="Energy that it stores, of states and parameters."
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


Parameter = Annotated[
    Annotated[Formula, Tag("<a number>")] | Annotated[ParameterEntry, Tag("<a mapping>")],
    _kind(**{"a number": _is_scalar, "a mapping": _is_mapping}),
]
EventOrFormula = Annotated[
    Annotated[Formula, Tag("<a formula>")] | Annotated[EventEntry, Tag("<a mapping>")],
    _kind(**{"a formula": _is_scalar, "a mapping": _is_mapping}),
]
Coordinate = Annotated[
    Annotated[Formula, Tag("<a unit>")] | Annotated[CoordinateEntry, Tag("<a mapping>")],
    _kind(**{"a unit": _is_scalar, "a mapping": _is_mapping}),
]
Choice = Annotated[
    Annotated[Formula, Tag("<a kind>")]
    | Annotated[Point, Tag("<a list of formulas>")]
    | Annotated[dict[Name, Formula], Tag("<a mapping of names to formulas>")],
    _kind(
        **{
            "a kind": _is_scalar,
            "a list of formulas": _is_list,
            "a mapping of names to formulas": _is_mapping,
        }
    ),
]
Initial = Annotated[
    Annotated[Formula, Tag("<a number>")] | Annotated[dict[Name, Formula], Tag("<a mapping>")],
    _kind(**{"a number": _is_scalar, "a mapping": _is_mapping}),
]


Held = Annotated[
    Annotated[Formula, Tag("<a formula>")]
    | Annotated[Point, Tag("<a list of names>")]
    | Annotated[dict[Name, FormulaOrList], Tag("<a mapping>")],
    _kind(**{"a formula": _is_scalar, "a list of names": _is_list, "a mapping": _is_mapping}),
]


class PulleyEntry(Entry):
    """A round body that a path goes round: a pulley, a sheave, a cylinder, a bone."""

    radius: Formula = Field(description="Radius, to the middle of the rope.")
    side: Formula = Field(
        description="left or right: on which side of the path it lies; seen against the axis."
    )
    axis: Direction | None = Field(
        None, description="Its axis in the body's frame; the normal of a planar model."
    )
    turns: Formula | None = Field(None, description="Whole turns besides; 0 when left out.")


class WaypointEntry(Entry):
    """A point that a path goes through, or a pulley that it goes round."""

    body: Formula = Field(description="The body, or ground.")
    at: Point | None = Field(
        None, description="The point, or the pulley's centre, in the body's frame; its origin."
    )
    pulley: PulleyEntry | None = Field(None, description="What it goes round there.")
