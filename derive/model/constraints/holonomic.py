"""Formulas of the coordinates that stay zero."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import Expression
from derive.model.constraint_records import Holonomic
from derive.model.constraints.nonideal import nonideal
from derive.model.document import Key, Scalar
from derive.model.language.keys import Entry, Formula, PerCoordinate, Text, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.scope import COORDINATE, POSITION, used


class HolonomicEntry(Entry):
    """A formula of the coordinates and t that stays zero."""

    holonomic: Formula = Field(
        description="Formula of coordinates and t that is zero.",
        json_schema_extra=term("φ(q, t); A = ∂φ̇/∂v, c = −∂φ/∂t"),
    )
    nonideal: PerCoordinate | None = Field(
        None,
        description="The constraint's own generalised force, per coordinate; reaction.NAME is "
        "an ideal multiplier.",
        json_schema_extra=term("a part of Q, per entry of q"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def holonomic(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: HolonomicEntry
) -> Holonomic:
    """φ(q, t) = 0."""
    formula = _formula(reader, entry.holonomic)
    return Holonomic(str(key), formula, nonideal(reader, names, key, entry.nonideal), key.span)


def _formula(reader: Reader, scalar: Scalar) -> Expression:
    before = len(reader.problems)
    formula = reader.formula(scalar, "a holonomic constraint", POSITION)
    if len(reader.problems) == before and COORDINATE not in used(formula, reader.scope):
        reader.report(
            scalar.span,
            "a holonomic constraint without coordinates",
            "a formula of coordinates that stays zero",
        )
    return formula


HOLONOMIC = Kind("holonomic", HolonomicEntry, holonomic, by_key=True)
