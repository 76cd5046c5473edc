"""Points that stay on surfaces."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

from pydantic import Field

from derive.expressions import tree
from derive.expressions.tree import Expression
from derive.expressions.units import LENGTH
from derive.model.constraint_records import OnSurface
from derive.model.document import Key, Scalar
from derive.model.language.keys import Constants, Entry, Formula, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.records import GROUND
from derive.model.scope import COORDINATE, PARAMETER, TIME, Symbol


class OnSurfaceEntry(Entry):
    """A point of a body stays on a surface (a curve in a planar model) given by a formula of x, y,
    z."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("φ = f(p)"))
    body: Named = Field(description="The body.", json_schema_extra=term("the body of p"))
    at: Constants | None = Field(
        None,
        description="The point, in the body's frame.",
        json_schema_extra=term("p", "m", "its origin"),
    )
    surface: Formula = Field(
        description="Formula that is zero on the surface; x, y, z are coordinates in the frame "
        "of `of`.",
        json_schema_extra=term("f"),
    )
    of: Named | None = Field(
        None,
        description="The body the surface is fixed to.",
        json_schema_extra=term("the frame of x, y, z", otherwise="ground"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def on_surface(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: OnSurfaceEntry
) -> OnSurface:
    """A point of a body that stays on a surface of another, or of the ground where none is named. A
    body on its own surface is reported."""
    body = some_body(reader, document, entry.body, ground=False)
    carrier = GROUND if entry.of is None else some_body(reader, document, entry.of)
    if entry.of is not None and body == carrier:
        reader.report(entry.of.span, f"'{key}' is between '{body}' and itself", "two bodies")
    point = reader.point(entry.at, "a point")
    return OnSurface(str(key), body, point, carrier, surface(reader, entry.surface), key.span)


def surface(reader: Reader, scalar: Scalar) -> Expression:
    """A formula of x, y, z (two of them in a plane), parameters and t."""
    letters = reader.space.letters
    before = len(reader.problems)
    with _local(reader, letters):
        formula = reader.formula(scalar, "a surface", frozenset({PARAMETER, COORDINATE, TIME}))
        reader.refuse_tables(formula, scalar, "a surface")
    names = {node.name for node in tree.walk(formula) if isinstance(node, tree.Name)}
    if names & reader.measures.found.keys():
        reader.report(
            scalar.span,
            f"the motion of a body in a surface: {min(names & reader.measures.found.keys())}",
            f"a formula of {', '.join(letters)}, parameters and t",
            "a surface that moves with a body is one `of:` it",
        )
    if len(reader.problems) == before and not names & set(letters):
        wanted = f"a formula of {', '.join(letters)} that is zero on the surface"
        reader.report(scalar.span, f"a surface without {', '.join(letters)}", wanted)
    return formula


@contextmanager
def _local(reader: Reader, letters: str) -> Generator[None]:
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


POINT_ON_SURFACE = Kind("point_on_surface", OnSurfaceEntry, on_surface)
