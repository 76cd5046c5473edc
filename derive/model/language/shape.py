"""The whole of a model file: the Document, with the kinds of constraints and loads from their
tables,
and the JSON Schema that editors complete from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import Discriminator, Field, Tag, model_validator

from derive.model.composing.composition import Composition
from derive.model.constraints import CONSTRAINTS
from derive.model.document import Entries, Scalar
from derive.model.language.entries import (
    BodyEntry,
    ClosureEntry,
    Coordinate,
    InputEntry,
    JointEntry,
    Parameter,
    StateEntry,
    TableEntry,
    WaypointEntry,
)
from derive.model.language.keys import Constants, Entry, Formula, Name, Text, term
from derive.model.language.kind import Kind
from derive.model.language.place_entries import FrameEntry
from derive.model.language.study_entries import (
    Choice,
    EventOrFormula,
    ExtremeEntry,
    Held,
    Initial,
    ReferenceEntry,
)
from derive.model.loads import LOADS

SECTIONS: dict[str, Sequence[Kind[Any]]] = {"constraints": CONSTRAINTS, "loads": LOADS}


def _of_kinds(kinds: Sequence[Kind[Any]], otherwise: str) -> Any:
    """A union told apart by the entry `type`, or by the key that is there. What is no mapping goes
    to the kind `otherwise`, which says that it wants one."""
    keys = [kind.name for kind in kinds if kind.by_key]

    def tag(value: Any) -> str | None:
        """The tag of an entry's kind: the first key that stands for a kind, else what `type:` says;
        `otherwise` for a plain text."""
        if not isinstance(value, Entries):
            return f"<{otherwise}>"
        for key in keys:
            if key in value:
                return f"<{key}>"
        kind = value.get("type")
        return f"<{kind.text}>" if isinstance(kind, Scalar) else None

    members = tuple(Annotated[kind.entry, Tag(f"<{kind.name}>")] for kind in kinds)
    return Annotated[Union[members], Discriminator(tag)]  # noqa: UP007


if TYPE_CHECKING:  # the tables are not known before they run
    Constraint = Load = Entry
else:
    Constraint = _of_kinds(CONSTRAINTS, "no_slip")
    Load = _of_kinds(LOADS, "spring")


class Document(Entry):
    """A mechanical system: bodies, joints and closures, or coordinates and energies, or both."""

    model: Text = Field(
        description="Name of the model; the generated module and its functions carry it.",
        json_schema_extra=term("prefix of every name in the code"),
    )
    description: Text | None = Field(
        None,
        description="One or two sentences for readers.",
        json_schema_extra=term("nothing; for readers"),
    )
    plane: Literal["xy", "xz", "yz"] | None = Field(
        None,
        description="For planar models: the plane. Points have two components then.",
        json_schema_extra=term("the normal that angles turn about"),
    )
    gravity: Constants | None = Field(
        None,
        description="Acceleration of gravity in the ground frame.",
        json_schema_extra=term("g in V = −Σ m g·r", "m/s^2"),
    )
    parameters: dict[Name, Parameter] = Field(
        {}, description="Names for numbers, with units.", json_schema_extra=term("p")
    )
    coordinates: dict[Name, Coordinate] = Field(
        {},
        description="Coordinates of the analytic form, with units.",
        json_schema_extra=term("entries of q and v"),
    )
    where: dict[Name, Formula] = Field(
        {},
        description="Names for formulas used in several places.",
        json_schema_extra=term("the formulas themselves, wherever the names stand"),
    )
    tables: dict[Name, TableEntry] = Field(
        {},
        description="Functions of one number by points, for formulas.",
        json_schema_extra=term("functions of one number"),
    )
    bodies: dict[Name, BodyEntry] = Field(
        {}, description="Rigid bodies.", json_schema_extra=term("terms of T and V")
    )
    joints: dict[Name, JointEntry] = Field(
        {},
        description="The tree of joints from the ground.",
        json_schema_extra=term("q, v, q̇ = N v"),
    )
    closures: dict[Name, ClosureEntry] = Field(
        {}, description="Joints that close loops.", json_schema_extra=term("rows of φ = 0")
    )
    frames: dict[Name, FrameEntry] = Field(
        {},
        description="Frames fixed to bodies, for functions on request (pose_NAME, jacobian_NAME …) "
        "and wrenches; every body and joint is one of its own name.",
        json_schema_extra=term("R, p and J of functions on request"),
    )
    paths: dict[Name, list[WaypointEntry]] = Field(
        {},
        description="Ways of ropes, muscles and cylinders through points and round pulleys; "
        "length(NAME) in formulas.",
        json_schema_extra=term("lengths ℓ(q)"),
    )
    constraints: dict[Name, Constraint] = Field(
        {},
        description="Holonomic and nonholonomic constraints.",
        json_schema_extra=term("rows of φ = 0 and A v = c"),
    )
    redundant: Literal["drop", "keep"] = Field(
        "drop",
        description="Constraint rows that repeat others: drop them, or keep all and give the "
        "least reactions.",
        json_schema_extra=term("which rows of A are kept"),
    )
    kinetic: Formula | None = Field(
        None,
        description="Kinetic energy of the analytic form, or of what bodies carry along besides.",
        json_schema_extra=term("a part of T, quadratic in rates and velocities", "J"),
    )
    potential: Formula | None = Field(
        None,
        description="Potential energy of the analytic form.",
        json_schema_extra=term("a part of V", "J"),
    )
    forces: dict[Name, Formula] = Field(
        {},
        description="Generalised forces per coordinate, of joints too; their work is F·dq.",
        json_schema_extra=term("parts of Q, per coordinate", "N | N*m"),
    )
    loads: dict[Name, Load] = Field(
        {},
        description="Springs, dampers, forces, torques and force laws.",
        json_schema_extra=term("parts of Q and V"),
    )
    inputs: dict[Name, InputEntry] = Field(
        {}, description="Actuators.", json_schema_extra=term("u")
    )
    states: dict[Name, StateEntry] = Field(
        {},
        description="First-order states: numbers whose rates are formulas, which loads, outputs, "
        "events and other rates may use.",
        json_schema_extra=term("z"),
    )
    outputs: dict[Name, Formula] = Field(
        {},
        description="Formulas, of vectors with all components: position(body, point, frame), "
        "velocity(body, point); alone angle(body), reaction(name). Accelerations stand here alone.",
        json_schema_extra=term("y"),
    )
    events: dict[Name, EventOrFormula] = Field(
        {},
        description="Where a formula of coordinates, velocities, outputs (tip.x) and t changes its "
        "sign: counted, or the end of the motion.",
        json_schema_extra=term("what is looked for along a motion"),
    )
    quasi_velocities: dict[Name, Choice] = Field(
        {},
        description="Choices of quasi-velocities: a list or mapping of formulas linear in the "
        "velocities, or one of "
        "auto, orthonormal, frozen, mass_orthogonal.",
        json_schema_extra=term("rows of B in w = B v"),
    )
    initial: dict[Name, Initial] = Field(
        {},
        description="State at t = 0; values under `guess` may move to make it consistent.",
        json_schema_extra=term("q, v at t = 0, in their units"),
    )
    steady_motion: dict[Name, dict[Name, Held]] = Field(
        {},
        description="What is held along a steady motion: coordinates, velocities and inputs "
        "(`free` for one to be found); "
        "`guess`: where the search for the rest starts; `sweep`: ranges [first, last, count] of "
        "names free to choose or "
        "of parameters; `cyclic`: the coordinates to leave out.",
        json_schema_extra=term("the point of a linearisation"),
    )

    reference: dict[Name, ReferenceEntry] = Field(
        {},
        description="Published values that `hamel verify` holds the model to.",
        json_schema_extra=term("nothing; numbers that verify compares"),
    )

    extremes: dict[Name, ExtremeEntry] = Field(
        {},
        description="Extreme cases and what is expected of each, for `hamel extremes`.",
        json_schema_extra=term("nothing; cases that `hamel extremes` runs"),
    )

    @model_validator(mode="before")
    @classmethod
    def words(cls, value: Any) -> Any:
        """Gives pydantic plain texts for `plane` and `redundant`, which it checks against their few
        allowed words."""
        if not isinstance(value, Entries):
            return value
        words = {
            key: node.text
            for key, node in value.items()
            if key in ("plane", "redundant") and isinstance(node, Scalar)
        }
        return Entries({**value, **words}, value.span) if words else value


def kinds(section: str) -> Iterator[tuple[str, type[Entry]]]:
    """The kinds of entry of `constraints` or `loads`: the word or key that tells each, and its
    class."""
    return ((kind.name, kind.entry) for kind in SECTIONS[section])


def kind_of(section: str, entry: Entry) -> Kind[Any]:
    """The kind of an entry of `constraints` or `loads`."""
    return next(kind for kind in SECTIONS[section] if kind.entry is type(entry))


def about(entry: type[Entry]) -> str:
    """What a class of entries says of itself, on one line."""
    return " ".join((entry.__doc__ or "").split())


def json_schema(joints: tuple[str, ...], closures: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema of a model file, for editors; the names of the types of joints and closures."""
    schema = Document.model_json_schema()
    composed = Composition.model_json_schema()
    schema["properties"] |= composed["properties"]
    definitions = schema["$defs"] | composed["$defs"]
    schema["$defs"] = definitions
    for owner, types in (
        ("JointEntry", joints),
        ("ClosureEntry", closures),
    ):
        definitions[owner]["properties"]["type"] |= {"type": "string", "enum": list(types)}
    for kind, entry in (*kinds("constraints"), *kinds("loads")):
        if "type" in entry.model_fields:
            definitions[entry.__name__]["properties"]["type"] = {
                "const": kind,
                "description": "Kind of entry.",
            }
    for owner in (schema, *definitions.values()):
        _say_defaults(owner.get("properties", {}))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "hamel model",
    }


def _say_defaults(properties: dict[str, dict[str, Any]]) -> None:
    """Editors show the description and nothing else: what holds where a key is left out goes
    there."""
    for said in properties.values():
        if "otherwise" in said:
            said["description"] += f" When left out: {said['otherwise']}."
