"""What a model file is composed of beside its own entries: repetitions and submodels. Both are
written out when the file is read, and nothing after that knows of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from derive.model.entries import Entry, Formula, FormulaOrList, FrameEntry, Name, by_node


class SubmodelEntry(Entry):
    """Another model file as a part of this one; its names get the entry's name before them."""

    use: Formula = Field(description="The file, in the folder of this one or below.")
    parameters: dict[Name, Formula] = Field(
        {}, description="Values for parameters of that file: formulas of this one."
    )
    ground: (
        Annotated[
            Annotated[Formula, Tag("<a body>")] | Annotated[FrameEntry, Tag("<a frame on a body>")],
            by_node(scalar="a body", mapping="a frame on a body"),
        ]
        | None
    ) = Field(
        None,
        description="What the ground of that file is here: a body, or a frame on one (body:, "
        "position:, rpy:). The ground when left out.",
    )
    about: Formula | None = Field(None, description="What it is, for readers.")


class Composition(Entry):
    """The keys of a model file that are gone once it is written out."""

    repeat: dict[Name, FormulaOrList] = Field(
        {},
        description="Indices: whole numbers 1..40, or a list of numbers or words. Entries with "
        "{i} in their names stand once for each.",
    )
    submodels: dict[Name, SubmodelEntry] = Field(
        {}, description="Other model files as parts of this one."
    )
