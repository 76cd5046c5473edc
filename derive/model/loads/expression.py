"""Force laws by formula: entries of `loads:` and of `forces:`."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from derive.expressions.tree import Expression
from derive.model.actuators import velocity_of
from derive.model.document import Key, Scalar
from derive.model.language.keys import Entry, Formula, Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import GeneralisedForce
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader, force_unit
from derive.model.records import Velocity
from derive.model.scope import NONIDEAL


class ExpressionEntry(Entry):
    """A formula added to the force of one joint, coordinate or generalized velocity."""

    type: Word = Field(description="Kind of entry.", json_schema_extra=term("an entry of Q"))
    joint: Named | None = Field(
        None, description="A joint with one coordinate.", json_schema_extra=term("which entry of Q")
    )
    coordinate: Named | None = Field(
        None, description="A coordinate.", json_schema_extra=term("which entry of Q")
    )
    velocity: Named | None = Field(
        None,
        description="A generalized velocity, such as base.vx.",
        json_schema_extra=term("which entry of Q"),
    )
    expression: Formula = Field(
        description="The force or torque.", json_schema_extra=term("the entry of Q", "N | N*m")
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


@dataclass(frozen=True)
class At:
    """Where something acts that the file says by its place instead of by a key."""

    joint: Scalar | None = None
    coordinate: Scalar | None = None


def law(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: ExpressionEntry
) -> GeneralisedForce | None:
    """A force by formula along a generalized velocity or the rate of a coordinate, in the unit
    conjugate to it: N for m/s, N m for rad/s. None where the target is not known, which is
    reported."""
    target = velocity_of(reader, key, entry, names.rates)
    if target is None:
        return None
    return GeneralisedForce(
        str(key), target.name, _conjugate(reader, entry.expression, target), key.span
    )


def generalised_force(
    reader: Reader, names: Names, key: Key, scalar: Scalar
) -> GeneralisedForce | None:
    """An entry of `forces:`, added to the force along one coordinate."""
    target = velocity_of(
        reader, key, At(coordinate=Scalar(str(key), key.span, True, True)), names.rates
    )
    if target is None:
        return None
    return GeneralisedForce(
        f"force_{key}", target.name, _conjugate(reader, scalar, target), key.span
    )


def _conjugate(reader: Reader, scalar: Scalar, target: Velocity) -> Expression:
    return reader.formula(scalar, "a force", NONIDEAL, force_unit(target.unit))


EXPRESSION = Kind("expression", ExpressionEntry, law)
