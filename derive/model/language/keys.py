"""What can stand under a key of a model file, as types for pydantic, the JSON Schema and the
language reference: texts, names, numbers, formulas, lists of them, and mappings with known keys.

Formulas stay text with a place here; names, units and mechanics are checked afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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


@dataclass(frozen=True)
class ScalarKind:
    """A scalar of the file; `word` is what the reference calls it."""

    word: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.is_instance_schema(Scalar)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": ["string", "number"]}


@dataclass(frozen=True)
class ListKind:
    """A list of scalars that remembers where it stands; `word` is what one of them is."""

    word: str

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        inner = core_schema.list_schema(core_schema.is_instance_schema(Scalar))
        return core_schema.no_info_wrap_validator_function(_with_place, inner)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "array", "items": {"type": ["string", "number"]}}


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


Formula = Annotated[Scalar, ScalarKind("formula")]  # of whatever moves
Constant = Annotated[Scalar, ScalarKind("number")]  # a formula of numbers and parameters
Named = Annotated[Scalar, ScalarKind("name")]  # of something in the model
Word = Annotated[Scalar, ScalarKind("word")]  # one of a few
Unit = Annotated[Scalar, ScalarKind("unit")]
Text = Annotated[Scalar, ScalarKind("text")]
Name = Annotated[Key, _Name]
Formulas = Annotated[Items, ListKind("formula")]
Constants = Annotated[Items, ListKind("number")]
Texts = Annotated[Items, ListKind("text")]
NameList = Annotated[Items, ListKind("name")]
Units = Annotated[Items, ListKind("unit")]
Nested = Annotated[Items, _Nested]


def term(equations: str, unit: str = "", otherwise: str = "") -> dict[str, Any]:
    """For `json_schema_extra` of a key: what becomes of it in the equations; its unit in SI, with
    `|` between units where it depends on what the entry acts on; what holds where it is left
    out."""
    given = {"equations": equations, "unit": unit, "otherwise": otherwise}
    return {name: text for name, text in given.items() if text}


def told_by(**tags: Callable[[Any], bool]) -> Discriminator:
    """A union told apart by the kind of node, not by trying one after the other: one message, and
    the right one."""

    def tag(value: Any) -> str | None:
        """The tag of the first class whose form fits the value; None where none does."""
        return next((f"<{name}>" for name, fits in tags.items() if fits(value)), None)

    return Discriminator(tag)


def is_scalar(value: Any) -> bool:
    return isinstance(value, Scalar)


def is_list(value: Any) -> bool:
    return isinstance(value, Items)


def is_pair(value: Any) -> bool:
    return isinstance(value, Items) and any(isinstance(entry, Items | Entries) for entry in value)


def is_mapping(value: Any) -> bool:
    return isinstance(value, Entries)


def by_node(scalar: str, mapping: str) -> Discriminator:
    """A union of a text and a mapping; what each is called in messages."""
    return told_by(**{scalar: is_scalar, mapping: is_mapping})


Pair = Annotated[list[Constants], Field(min_length=2, max_length=2)]
Direction = Annotated[
    Annotated[Constant, Tag("<x, y or z>")] | Annotated[Constants, Tag("<a list>")],
    told_by(**{"x, y or z": is_scalar, "a list": is_list}),
]
FormulaOrList = Annotated[
    Annotated[Formula, Tag("<a formula>")] | Annotated[Formulas, Tag("<a list>")],
    told_by(**{"a formula": is_scalar, "a list": is_list}),
]
ConstantOrList = Annotated[
    Annotated[Constant, Tag("<a formula>")] | Annotated[Constants, Tag("<a list>")],
    told_by(**{"a formula": is_scalar, "a list": is_list}),
]
Moments = Annotated[
    Annotated[Constant, Tag("<a formula>")]
    | Annotated[Constants, Tag("<a list>")]
    | Annotated[Nested, Tag("<a matrix>")],
    told_by(**{"a formula": is_scalar, "a matrix": is_pair, "a list": is_list}),
]
TextOrList = Annotated[
    Annotated[Text, Tag("<a text>")] | Annotated[Texts, Tag("<a list>")],
    told_by(**{"a text": is_scalar, "a list": is_list}),
]
PerCoordinate = Annotated[
    Annotated[Formulas, Tag("<a list>")] | Annotated[dict[Name, Formula], Tag("<a mapping>")],
    told_by(**{"a list": is_list, "a mapping": is_mapping}),
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
