"""Forces of nonideal constraints, and the degree of a formula in the rates."""

from __future__ import annotations

from derive.expressions.linearity import Degree, degree
from derive.expressions.tree import ZERO, Expression
from derive.model.document import Items, Key, Scalar
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader, force_unit
from derive.model.scope import NONIDEAL


def velocity_degree(reader: Reader, formula: Expression) -> Degree:
    """Lowest and highest degree of a formula in rates and generalized velocities."""
    return degree(formula, definitions=reader.scope.degrees)


def nonideal(
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
    entries = {
        str(n): reader.formula(s, "a generalised force", NONIDEAL, units[n])
        for n, s in given.items()
        if n in units
    }
    return tuple(entries.get(name, ZERO) for name in units)


def _as_key(name: str, place: Key) -> Key:
    return Key(name, place.span)
