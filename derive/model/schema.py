"""The shape of a model file as pydantic classes: which keys there are and what kind of thing each holds.

Formulas stay text with a place here; names, units and mechanics are checked afterwards. The same classes give the JSON Schema
that editors complete from.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler, Tag, model_validator
from pydantic_core import PydanticCustomError, core_schema

from derive.model.document import Entries, Items, Key, Scalar


class _Formula:
    """A scalar of the file: a formula, a name or a text."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.is_instance_schema(Scalar)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": ["string", "number"]}


class _Name:
    """A mapping's key."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.is_instance_schema(Key)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "string"}


class _Listed:
    """A list of scalars that remembers where it stands."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        inner = core_schema.list_schema(core_schema.is_instance_schema(Scalar))
        return core_schema.no_info_wrap_validator_function(_with_place, inner)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["string", "number"]}}


def _with_place(value: Any, handler: Callable[[Any], list[Any]]) -> Any:
    if not isinstance(value, Items):
        raise PydanticCustomError("not_a_list", "not a list")
    return Items(handler(value), value.span)


Formula = Annotated[Scalar, _Formula]
Name = Annotated[Key, _Name]
Point = Annotated[Items, _Listed]


def _kind(**tags: Callable[[Any], bool]) -> Discriminator:
    """A union told apart by the kind of node, not by trying one after the other: one message, and the right one."""

    def tag(value: Any) -> str | None:
        return next((f"<{name}>" for name, fits in tags.items() if fits(value)), None)

    return Discriminator(tag)


def _is_scalar(value: Any) -> bool:
    return isinstance(value, Scalar)


def _is_list(value: Any) -> bool:
    return isinstance(value, Items)


def _is_pair(value: Any) -> bool:
    return isinstance(value, Items) and any(isinstance(entry, Items) for entry in value)


def _is_mapping(value: Any) -> bool:
    return isinstance(value, Entries)


Pair = Annotated[list[Point], Field(min_length=2, max_length=2)]
PointOrPair = Annotated[
    Annotated[Pair, Tag("<a pair of points>")] | Annotated[Point, Tag("<a point>")],
    _kind(**{"a pair of points": _is_pair, "a point": _is_list}),
]
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
    """A mapping with known keys. Unknown keys are reported before missing ones: the second is often the first misspelt."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True, frozen=True)
    ignored: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def known_keys(cls, value: Any) -> Any:
        if not isinstance(value, Entries):
            raise PydanticCustomError("not_a_mapping", "not a mapping", {"keys": list(cls.model_fields)})
        unknown = [key for key in value if key not in cls.model_fields]
        if unknown:
            raise PydanticCustomError("unknown_key", "unknown key", {"unknown": unknown, "keys": list(cls.model_fields)})
        return value


class ParameterEntry(Entry):
    value: Formula = Field(description="Number with its unit, such as 0.2 m.")
    about: Formula | None = Field(None, description="What it is, for readers.")


class CoordinateEntry(Entry):
    unit: Formula = Field(description="Unit of the coordinate, such as m or rad.")
    about: Formula | None = Field(None, description="What it is, for readers.")


class BodyEntry(Entry):
    """A rigid body."""

    mass: Formula = Field(description="Mass; 0 for a body without mass.")
    com: Point | None = Field(None, description="Centre of mass in the body's frame; its origin when left out.")
    inertia: FormulaOrList | None = Field(
        None,
        description="About the centre of mass: one moment in a planar model; in space one (a sphere), three (xx, yy, zz) or six "
        "(xx, yy, zz, xy, xz, yz, tensor entries). A point mass when left out.",
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


class OrientationEntry(Entry):
    euler: Formula = Field(description="Intrinsic sequence of axes, such as zxy.")
    angles: Point | None = Field(None, description="Names of the three angles.")


class JointEntry(Entry):
    """A joint of the tree: it says where the child is in the parent."""

    type: Formula = Field(description="Kind of joint.")
    parent: Formula = Field(description="A body, or ground.")
    child: Formula = Field(description="A body; each is the child of one joint.")
    at: PointOrPair | None = Field(
        None, description="Where the joint is: a point of the parent, or one of the parent and one of the child."
    )
    angle: Formula | None = Field(None, description="Planar models: how far the joint's frame is turned in the parent.")
    rpy: Point | None = Field(None, description="In space: roll, pitch, yaw of the joint's frame in the parent.")
    axis: Direction | None = Field(None, description="Direction in the joint's frame: x, y, z or a list of numbers.")
    coordinate: Formula | None = Field(
        None, description="Name of the joint's one coordinate; the joint's own name when left out."
    )
    coordinates: Point | None = Field(None, description="Names of the joint's coordinates.")
    position: Point | None = Field(None, description="Free joint: names of the three position coordinates.")
    orientation: OrientationEntry | None = Field(None, description="Free joint: Euler sequence and names of the angles.")
    about: Formula | None = Field(None, description="What it is, for readers.")


class ClosureEntry(Entry):
    """A joint that closes a loop."""

    type: Formula = Field(description="Kind of joint.")
    between: Point = Field(description="The two bodies.")
    at: Pair = Field(description="Where the joint is in each of the two.")
    axis: Direction | None = Field(None, description="Direction in the first body's joint frame.")
    angle: Formula | None = Field(None, description="Planar models: how far the joint's frame is turned in the first body.")
    rpy: Point | None = Field(None, description="In space: roll, pitch, yaw of the joint's frame in the first body.")
    about: Formula | None = Field(None, description="What it is, for readers.")


class HolonomicEntry(Entry):
    """A formula of the coordinates and t that stays zero."""

    holonomic: Formula = Field(description="Formula of coordinates and t that is zero.")
    nonideal: PerCoordinate | None = Field(None, description="The constraint's own generalised force, per coordinate.")
    about: Formula | None = None


class NonholonomicEntry(Entry):
    """A formula, linear in the rates, that stays zero."""

    nonholonomic: Formula = Field(description="Formula that is zero, linear in the rates der(q).")
    nonideal: PerCoordinate | None = Field(None, description="The constraint's own generalised force, per coordinate.")
    about: Formula | None = None


class NoSlipEntry(Entry):
    """A point of a body does not move along a direction of the body: a knife edge, a wheel pair."""

    type: Formula
    body: Formula = Field(description="The body.")
    at: Point | None = Field(None, description="The point, in the body's frame; its origin when left out.")
    direction: Direction = Field(description="The direction in which it does not slip, in the body's frame.")
    about: Formula | None = None


class DiskEntry(Entry):
    radius: Formula = Field(description="Radius of the disk.")
    axis: Direction | None = Field(None, description="Its axis in the body's frame.")


class ShapeEntry(Entry):
    disk: DiskEntry = Field(description="A thin disk.")


class PlaneEntry(Entry):
    normal: Direction = Field(description="Normal of the plane, in the ground frame.")
    origin: Point | None = Field(None, description="A point of the plane, in the ground frame.")


class RollingEntry(Entry):
    """A disk that rolls without slip on a plane."""

    type: Formula
    body: Formula = Field(description="The body.")
    at: Point | None = Field(None, description="Centre of the disk, in the body's frame; its origin when left out.")
    shape: ShapeEntry = Field(description="What rolls.")
    plane: PlaneEntry = Field(description="What it rolls on.")
    about: Formula | None = None


def _typed(*kinds: str, by_key: tuple[str, ...] = ()) -> Discriminator:
    """A union told apart by the entry `type`, or by the key that is there."""

    def tag(value: Any) -> str | None:
        if not isinstance(value, Entries):
            return f"<{kinds[0]}>"  # let that class say that it wants a mapping
        for key in by_key:
            if key in value:
                return f"<{key}>"
        kind = value.get("type")
        return f"<{kind.text}>" if isinstance(kind, Scalar) else None

    return Discriminator(tag)


Constraint = Annotated[
    Annotated[HolonomicEntry, Tag("<holonomic>")]
    | Annotated[NonholonomicEntry, Tag("<nonholonomic>")]
    | Annotated[NoSlipEntry, Tag("<no_slip>")]
    | Annotated[RollingEntry, Tag("<rolling>")],
    _typed("no_slip", by_key=("holonomic", "nonholonomic")),
]


class SpringEntry(Entry):
    """At a joint or a coordinate: -stiffness (q - rest). Between two points: along their line."""

    type: Formula
    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    rest: Formula | None = Field(None, description="Where the joint's spring is slack; 0 when left out.")
    between: Point | None = Field(None, description="Two bodies.")
    at: Pair | None = Field(None, description="A point of each.")
    stiffness: Formula = Field(description="Stiffness.")
    length: Formula | None = Field(None, description="Where the spring between points is slack; 0 when left out.")
    damping: Formula | None = Field(None, description="Force per velocity of stretching, for a spring between points.")
    about: Formula | None = None


class DamperEntry(Entry):
    """At a joint, a coordinate or a base velocity, or between two points: -coefficient times the velocity."""

    type: Formula
    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    velocity: Formula | None = Field(None, description="A base velocity, such as base.w.")
    between: Point | None = Field(None, description="Two bodies.")
    at: Pair | None = Field(None, description="A point of each.")
    coefficient: Formula = Field(description="Force or torque per velocity.")
    about: Formula | None = None


class ForceEntry(Entry):
    """A force on a point of a body."""

    type: Formula
    body: Formula = Field(description="The body.")
    at: Point | None = Field(None, description="The point, in the body's frame; its origin when left out.")
    components: Point = Field(description="The force's components; formulas of inputs, coordinates, velocities and t.")
    frame: Formula | None = Field(None, description="Frame of the components: ground (when left out) or body.")
    about: Formula | None = None


class TorqueEntry(Entry):
    """A torque on a body."""

    type: Formula
    body: Formula = Field(description="The body.")
    components: FormulaOrList = Field(description="The torque: one formula in a planar model, three in space.")
    frame: Formula | None = Field(None, description="Frame of the components: ground (when left out) or body.")
    about: Formula | None = None


class ExpressionEntry(Entry):
    """A formula added to the force of one joint, coordinate or base velocity."""

    type: Formula
    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    velocity: Formula | None = Field(None, description="A base velocity, such as base.vx.")
    expression: Formula = Field(description="The force or torque.")
    about: Formula | None = None


Load = Annotated[
    Annotated[SpringEntry, Tag("<spring>")]
    | Annotated[DamperEntry, Tag("<damper>")]
    | Annotated[ForceEntry, Tag("<force>")]
    | Annotated[TorqueEntry, Tag("<torque>")]
    | Annotated[ExpressionEntry, Tag("<expression>")],
    _typed("spring"),
]


class InputEntry(Entry):
    """An actuator at a joint, a coordinate or a base velocity; with none of these a name for formulas."""

    joint: Formula | None = Field(None, description="A joint with one coordinate.")
    coordinate: Formula | None = Field(None, description="A coordinate.")
    velocity: Formula | None = Field(None, description="A base velocity, such as base.vx.")
    unit: Formula | None = Field(None, description="Unit of the input.")
    about: Formula | None = Field(None, description="What it is, for readers.")


Parameter = Annotated[
    Annotated[Formula, Tag("<a number>")] | Annotated[ParameterEntry, Tag("<a mapping>")],
    _kind(**{"a number": _is_scalar, "a mapping": _is_mapping}),
]
Coordinate = Annotated[
    Annotated[Formula, Tag("<a unit>")] | Annotated[CoordinateEntry, Tag("<a mapping>")],
    _kind(**{"a unit": _is_scalar, "a mapping": _is_mapping}),
]
Choice = Annotated[
    Annotated[Formula, Tag("<orthonormal or auto>")]
    | Annotated[Point, Tag("<a list of formulas>")]
    | Annotated[dict[Name, Formula], Tag("<a mapping of names to formulas>")],
    _kind(**{"orthonormal or auto": _is_scalar, "a list of formulas": _is_list, "a mapping of names to formulas": _is_mapping}),
]
Initial = Annotated[
    Annotated[Formula, Tag("<a number>")] | Annotated[dict[Name, Formula], Tag("<a mapping>")],
    _kind(**{"a number": _is_scalar, "a mapping": _is_mapping}),
]


class Document(Entry):
    """A mechanical system: bodies, joints and closures, or coordinates and energies, or both."""

    model: Formula = Field(description="Name of the model; the generated module and its functions carry it.")
    description: Formula | None = Field(None, description="One or two sentences for readers.")
    plane: Literal["xy", "xz", "yz"] | None = Field(
        None, description="For planar models: the plane. Points have two components then."
    )
    gravity: Point | None = Field(None, description="Acceleration of gravity in the ground frame.")
    parameters: dict[Name, Parameter] = Field({}, description="Names for numbers, with units.")
    coordinates: dict[Name, Coordinate] = Field({}, description="Coordinates of the analytic form, with units.")
    where: dict[Name, Formula] = Field({}, description="Names for formulas used in several places.")
    bodies: dict[Name, BodyEntry] = Field({}, description="Rigid bodies.")
    joints: dict[Name, JointEntry] = Field({}, description="The tree of joints from the ground.")
    closures: dict[Name, ClosureEntry] = Field({}, description="Joints that close loops.")
    constraints: dict[Name, Constraint] = Field({}, description="Holonomic and nonholonomic constraints.")
    kinetic: Formula | None = Field(None, description="Kinetic energy of the analytic form.")
    potential: Formula | None = Field(None, description="Potential energy of the analytic form.")
    forces: dict[Name, Formula] = Field({}, description="Generalised forces of the analytic form, per coordinate.")
    loads: dict[Name, Load] = Field({}, description="Springs, dampers, forces, torques and force laws.")
    inputs: dict[Name, InputEntry] = Field({}, description="Actuators.")
    outputs: dict[Name, Formula] = Field(
        {}, description="Formulas, position(body, point), velocity(body, point), angle(body), reaction(name)."
    )
    quasi_velocities: dict[Name, Choice] = Field(
        {},
        description="Choices of quasi-velocities: a list or mapping of formulas linear in the velocities, orthonormal, or auto.",
    )
    initial: dict[Name, Initial] = Field({}, description="State at t = 0; values under `guess` may move to make it consistent.")
    steady_motion: dict[Name, dict[Name, Formula]] = Field({}, description="What is held along a steady motion.")

    @model_validator(mode="before")
    @classmethod
    def plane_word(cls, value: Any) -> Any:
        if isinstance(value, Entries) and isinstance(value.get("plane"), Scalar):
            return Entries({**value, "plane": value["plane"].text}, value.span)
        return value


def json_schema(joint_types: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema of a model file, for editors."""
    schema = Document.model_json_schema()
    definitions = schema["$defs"]
    for owner in ("JointEntry", "ClosureEntry"):
        definitions[owner]["properties"]["type"] |= {"type": "string", "enum": list(joint_types)}
    for kind, owner in (("no_slip", "NoSlipEntry"), ("rolling", "RollingEntry"), *_LOADS):
        definitions[owner]["properties"]["type"] = {"const": kind, "description": "Kind of entry."}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "hamel model"}


_LOADS = (
    ("spring", "SpringEntry"),
    ("damper", "DamperEntry"),
    ("force", "ForceEntry"),
    ("torque", "TorqueEntry"),
    ("expression", "ExpressionEntry"),
)
