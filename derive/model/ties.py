"""Constraints: formulas that stay zero, and what is said about joints and bodies instead."""

from __future__ import annotations

import math

from derive.expressions.linearity import Degree, degree
from derive.expressions.tree import ZERO, Expression
from derive.model.contacts import contact
from derive.model.couplings import coupling, prescribed
from derive.model.document import Items, Key, Scalar
from derive.model.frames import Names
from derive.model.reader import Reader, force_unit
from derive.model.records import Constraint, Holonomic, Nonholonomic
from derive.model.rows import closure_parts, named, rolling_parts
from derive.model.scope import COORDINATE, MOTION, NONIDEAL, POSITION, REACTION, Symbol, used
from derive.model.shape import (
    CouplingEntry,
    Document,
    HolonomicEntry,
    NonholonomicEntry,
    PrescribedEntry,
    RollingEntry,
)


def constraint(
    reader: Reader, document: Document, names: Names, key: Key, entry: object
) -> Constraint:
    """One constraint of the file."""
    reader.name(key)
    match entry:
        case HolonomicEntry():
            formula = _holonomic(reader, entry.holonomic)
            return Holonomic(
                str(key), formula, _nonideal(reader, names, key, entry.nonideal), key.span
            )
        case NonholonomicEntry():
            formula = _nonholonomic(reader, entry.nonholonomic)
            return Nonholonomic(
                str(key), formula, _nonideal(reader, names, key, entry.nonideal), key.span
            )
        case CouplingEntry():
            return coupling(reader, names, key, entry)
        case PrescribedEntry():
            return prescribed(reader, names, key, entry)
    return contact(reader, document, key, entry)


def enter_reactions(reader: Reader, document: Document) -> None:
    """reaction.ROW is the multiplier of a row, with all nonideal forces left out: NAME where a
    constraint is one row, NAME.PART where it is several.
    """
    rows = [
        row
        for key, entry in document.closures.items()
        for row in named(key, closure_parts(entry.type.text, reader.space.plane))
    ]
    for key, entry in document.constraints.items():
        rows += (
            named(key, rolling_parts(reader.space.plane))
            if isinstance(entry, RollingEntry)
            else [str(key)]
        )
    for row in rows:
        reader.scope.add(f"reaction.{row}", Symbol(frozenset({REACTION}), None))


def _holonomic(reader: Reader, scalar: Scalar) -> Expression:
    before = len(reader.problems)
    formula = reader.formula(scalar, "a holonomic constraint", POSITION)
    if len(reader.problems) == before and COORDINATE not in used(formula, reader.scope):
        reader.report(
            scalar.span,
            "a holonomic constraint without coordinates",
            "a formula of coordinates that stays zero",
        )
    return formula


def _nonholonomic(reader: Reader, scalar: Scalar) -> Expression:
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


def velocity_degree(reader: Reader, formula: Expression) -> Degree:
    """Lowest and highest degree of a formula in rates and generalized velocities."""
    return degree(formula, definitions=reader.scope.degrees)


def _nonideal(
    reader: Reader, names: Names, key: Key, given: Items | dict[Key, Scalar] | None
) -> tuple[Expression, ...]:
    """The constraint's own generalised force, one formula per coordinate of the model."""
    if given is None:
        return ()
    units = {
        coordinate.name: force_unit(f"{coordinate.unit or '1'}/s")
        for coordinate in names.coordinates
    }
    if isinstance(given, Items):
        if len(given) != len(units):
            reader.report(
                given.span,
                f"{len(given)} nonideal forces of '{key}'",
                f"one for each of {', '.join(units)}",
            )
        given = dict(zip(map(_as_key, units, [key] * len(units)), given))
    for name in given:
        if name not in units:
            reader.word(Scalar(str(name), name.span, True, True), units, "coordinate")
    found = {
        str(n): reader.formula(s, "a generalised force", NONIDEAL, units[n])
        for n, s in given.items()
        if n in units
    }
    return tuple(found.get(name, ZERO) for name in units)


def _as_key(name: str, place: Key) -> Key:
    return Key(name, place.span)
