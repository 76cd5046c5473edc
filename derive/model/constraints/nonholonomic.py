"""Formulas, linear in the rates, that stay zero."""

from __future__ import annotations

import math

from pydantic import Field

from derive.expressions.tree import Expression
from derive.model.constraint_records import Nonholonomic
from derive.model.constraints.nonideal import nonideal, velocity_degree
from derive.model.document import Key, Scalar
from derive.model.language.keys import Entry, Formula, PerCoordinate, Text, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.scope import MOTION


class NonholonomicEntry(Entry):
    """A formula, linear in the rates, that stays zero."""

    nonholonomic: Formula = Field(
        description="Formula that is zero, linear in the rates der(q).",
        json_schema_extra=term("a row of A v = c"),
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


def nonholonomic(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: NonholonomicEntry
) -> Nonholonomic:
    """A(q, t) q̇ = c(q, t)."""
    formula = _formula(reader, entry.nonholonomic)
    return Nonholonomic(str(key), formula, nonideal(reader, names, key, entry.nonideal), key.span)


def _formula(reader: Reader, scalar: Scalar) -> Expression:
    before = len(reader.problems)
    formula = reader.formula(scalar, "a nonholonomic constraint", MOTION)
    highest = velocity_degree(reader, formula).highest
    if len(reader.problems) > before:
        return formula
    if highest <= 0:
        hint = "a formula without rates goes under `holonomic:`"
        reader.report(
            scalar.span,
            "a nonholonomic constraint without rates",
            "a formula linear in the rates der(q)",
            hint,
        )
    elif highest > 1:
        how = "not linear" if math.isinf(highest) else f"of degree {highest:g}"
        reader.report(
            scalar.span,
            f"the constraint is {how} in the rates",
            "a formula linear in the rates der(q)",
        )
    return formula


NONHOLONOMIC = Kind("nonholonomic", NonholonomicEntry, nonholonomic, by_key=True)
