"""Lengths that have to be more than zero."""

from __future__ import annotations

from derive.expressions.tree import Expression
from derive.model.document import Scalar
from derive.model.reader import Reader


def length(reader: Reader, scalar: Scalar, where: str, what: str) -> Expression:
    """A length that has to be more than zero."""
    formula = reader.formula(scalar, where, unit="m")
    value = reader.value(formula, scalar)
    if value is not None and value <= 0.0:
        reader.report(scalar.span, f"{what} is {value:g} m", "more than zero")
    return formula
