"""What a model file is composed of beside its own entries: repetitions and submodels. Both are
written out when the file is read, and nothing after that knows of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from derive.model.language.keys import (
    Constant,
    ConstantOrList,
    Entry,
    Name,
    Named,
    Text,
    by_node,
    term,
)
from derive.model.language.place_entries import FrameEntry


class SubmodelEntry(Entry):
    """Another model file as a part of this one; its names get the entry's name before them."""

    use: Text = Field(
        description="The file, in the folder of this one or below.",
        json_schema_extra=term("all its entries, renamed"),
    )
    parameters: dict[Name, Constant] = Field(
        {},
        description="Values for parameters of that file: formulas of this one.",
        json_schema_extra=term("the values, or formulas, of its parameters"),
    )
    ground: (
        Annotated[
            Annotated[Named, Tag("<a body>")] | Annotated[FrameEntry, Tag("<a frame on a body>")],
            by_node(scalar="a body", mapping="a frame on a body"),
        ]
        | None
    ) = Field(
        None,
        description="What the ground of that file is here: a body, or a frame on one (body:, "
        "position:, rpy:).",
        json_schema_extra=term(
            "the body that its ground becomes, and a frame on it", otherwise="ground"
        ),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class Composition(Entry):
    """The keys of a model file that are gone once it is written out."""

    repeat: dict[Name, ConstantOrList] = Field(
        {},
        description="Indices: whole numbers 1..40, or a list of numbers or words. Entries with "
        "{i} in their names stand once for each.",
        json_schema_extra=term("entries, once for each value"),
    )
    submodels: dict[Name, SubmodelEntry] = Field(
        {},
        description="Other model files as parts of this one.",
        json_schema_extra=term("entries of another file"),
    )
