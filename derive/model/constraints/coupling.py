"""Couplings and gears: two coordinates in proportion."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.quantities import unit as parsed_unit
from derive.expressions.tree import ZERO, Name, Product
from derive.expressions.units import pretty, quotient_of
from derive.model.algebra import minus, negated, plus
from derive.model.constraint_records import Holonomic
from derive.model.constraints.places import of_joint, of_name
from derive.model.document import Items, Key
from derive.model.language.keys import Constant, Entry, NameList, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader
from derive.model.records import Coordinate


class CouplingEntry(Entry):
    """Two coordinates move in proportion, first = ratio * second + offset: belt, rack and pinion,
    mimic joint."""

    type: Word = Field(
        description="Kind of entry.", json_schema_extra=term("φ = q₁ − ratio q₂ − offset")
    )
    joints: NameList | None = Field(
        None,
        description="Two joints with one coordinate each.",
        json_schema_extra=term("q₁ and q₂"),
    )
    coordinates: NameList | None = Field(
        None, description="Two coordinates.", json_schema_extra=term("q₁ and q₂")
    )
    ratio: Constant = Field(
        description="Rate of the first per rate of the second.",
        json_schema_extra=term("ratio", "1 | m/rad | rad/m"),
    )
    offset: Constant | None = Field(
        None,
        description="The first coordinate where the second is zero.",
        json_schema_extra=term("offset", "m | rad"),
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


class GearEntry(CouplingEntry):
    """Two turning joints in gear, first angle = ratio * second + offset; the ratio of external
    gears is negative."""


def coupling(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: CouplingEntry
) -> Holonomic:
    """first − ratio · second − offset = 0."""
    pair = _pair(reader, names, key, entry)
    if pair is None:
        return Holonomic(str(key), ZERO, (), key.span)
    first, second = pair
    if isinstance(entry, GearEntry):
        _check_turning(reader, key, pair)
        _note_carrier(reader, document, key, pair)
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
            problem = (
                f"the gear '{key}' at '{coordinate.name}', which is in "
                f"{coordinate.unit or 'plain numbers'}"
            )
            reader.report(
                key.span, problem, "two turning joints", "type: coupling takes any two coordinates"
            )


def _note_carrier(
    reader: Reader, document: Bodies, key: Key, pair: tuple[Coordinate, Coordinate]
) -> None:
    """Of wheels on different bodies the angles are against different ones, and what carries one is
    easily forgotten. Where the other wheel is the carrier itself, nothing is missing."""
    joints = [document.joints[x.owner] for x in pair if x.owner in document.joints]
    parents = [joint.parent.text for joint in joints]
    if len(set(parents)) < 2 or {joint.child.text for joint in joints} & {*parents}:
        return
    sides = " and ".join(f"{x.owner} against {body}" for x, body in zip(pair, parents))
    reader.notes.append(
        f"'{key}' ties the angles of {sides} as they are: of wheels that mesh, both are to be "
        "against the body that carries them"
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
        of_joint(reader, names, s) if of_joints else of_name(reader, names, s) for s in items
    )
    if first is None or second is None:
        return None
    if first == second:
        reader.report(
            items.span, f"'{key}' couples '{first.name}' with itself", "two joints or coordinates"
        )
        return None
    return first, second


COUPLING = Kind("coupling", CouplingEntry, coupling)
GEAR = Kind("gear", GearEntry, coupling)
