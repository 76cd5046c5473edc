"""Constraints between coordinates: gears, couplings and prescribed motion, all of them formulas
that stay zero."""

from __future__ import annotations

from derive.diagnostics import listed
from derive.expressions.parser import unit as parsed_unit
from derive.expressions.tree import ZERO, Expression, Name, Product, Sum
from derive.expressions.units import pretty, quotient_of
from derive.model.algebra import minus, negated, plus
from derive.model.document import Items, Key, Scalar
from derive.model.frames import Names
from derive.model.reader import Reader
from derive.model.records import Coordinate, Holonomic
from derive.model.scope import PARAMETER, TIME
from derive.model.shape import CouplingEntry, GearEntry, PrescribedEntry


def coupling(reader: Reader, names: Names, key: Key, entry: CouplingEntry) -> Holonomic:
    """first − ratio · second − offset = 0."""
    pair = _pair(reader, names, key, entry)
    if pair is None:
        return Holonomic(str(key), ZERO, (), key.span)
    first, second = pair
    if isinstance(entry, GearEntry):
        _check_turning(reader, key, pair)
    ratio = reader.formula(entry.ratio, "a ratio", unit=_per(first.unit, second.unit))
    if reader.value(ratio, entry.ratio) == 0.0:
        reader.report(
            entry.ratio.span, f"the ratio of '{key}' is zero", "a number, positive or negative"
        )
    offset = (
        ZERO if entry.offset is None else reader.formula(entry.offset, "an offset", unit=first.unit)
    )
    followed = Product((ratio, Name(second.name)))
    formula = minus(plus(Name(first.name), negated(followed)), offset)
    # a gear has no leader, unless an input says so: that is for the choice to see
    follower = "" if isinstance(entry, GearEntry) else first.name
    return Holonomic(str(key), formula, (), key.span, follower)


def _per(first: str, second: str) -> str:
    above, below = (parsed_unit(unit).dimension for unit in (first, second))
    return pretty(quotient_of(above, below))


def _check_turning(reader: Reader, key: Key, pair: tuple[Coordinate, Coordinate]) -> None:
    for coordinate in pair:
        if coordinate.unit != "rad":
            problem = f"the gear '{key}' at '{coordinate.name}', which is in {coordinate.unit or 'plain numbers'}"
            reader.report(
                key.span, problem, "two turning joints", "type: coupling takes any two coordinates"
            )


def _pair(
    reader: Reader, names: Names, key: Key, entry: CouplingEntry
) -> tuple[Coordinate, Coordinate] | None:
    given = [items for items in (entry.joints, entry.coordinates) if items is not None]
    if len(given) != 1:
        how = "does not say what it couples" if not given else "names joints and coordinates"
        reader.report(key.span, f"'{key}' {how}", "joints: [A, B] or coordinates: [a, b]")
        return None
    return _two(reader, names, key, given[0], of_joints=entry.joints is not None)


def _two(
    reader: Reader, names: Names, key: Key, items: Items, of_joints: bool
) -> tuple[Coordinate, Coordinate] | None:
    if len(items) != 2:
        reader.report(items.span, f"'{key}' couples {len(items)}", "two joints or coordinates")
        return None
    first, second = (
        _of_joint(reader, names, s) if of_joints else _of_name(reader, names, s) for s in items
    )
    if first is None or second is None:
        return None
    if first == second:
        reader.report(
            items.span, f"'{key}' couples '{first.name}' with itself", "two joints or coordinates"
        )
        return None
    return first, second


def _of_joint(reader: Reader, names: Names, scalar: Scalar) -> Coordinate | None:
    owned = [
        coordinate
        for coordinate in names.coordinates
        if coordinate.owner and coordinate.owner == scalar.text
    ]
    if len(owned) == 1:
        return owned[0]
    if owned:
        wanted = f"coordinates: with one of {listed(c.name for c in owned)}"
        reader.report(
            scalar.span, f"the joint '{scalar.text}' has {len(owned)} coordinates", wanted
        )
    else:
        reader.word(
            scalar, dict.fromkeys(c.owner for c in names.coordinates if c.owner), "moving joint"
        )
    return None


def _of_name(reader: Reader, names: Names, scalar: Scalar) -> Coordinate | None:
    found = reader.word(scalar, [coordinate.name for coordinate in names.coordinates], "coordinate")
    return next((coordinate for coordinate in names.coordinates if coordinate.name == found), None)


def prescribed(reader: Reader, names: Names, key: Key, entry: PrescribedEntry) -> Holonomic:
    """coordinate − motion(t) = 0."""
    target = _target(reader, names, key, entry)
    if target is None:
        return Holonomic(str(key), ZERO, (), key.span)
    motion = reader.formula(
        entry.motion, "a prescribed motion", frozenset({PARAMETER, TIME}), target.unit
    )
    return Holonomic(str(key), _difference(target.name, motion), (), key.span)


def _difference(name: str, motion: Expression) -> Expression:
    return Name(name) if motion == ZERO else Sum((Name(name), negated(motion)))


def _target(reader: Reader, names: Names, key: Key, entry: PrescribedEntry) -> Coordinate | None:
    if (entry.joint is None) == (entry.coordinate is None):
        reader.report(key.span, f"'{key}' does not say what it moves", "one of joint, coordinate")
        return None
    if entry.joint is not None:
        return _of_joint(reader, names, entry.joint)
    return _of_name(reader, names, entry.coordinate) if entry.coordinate is not None else None
