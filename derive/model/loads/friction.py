"""Viscous and dry friction of joints."""

from __future__ import annotations

from pydantic import Field

from derive.expressions.tree import ONE, Expression
from derive.model.actuators import velocity_of
from derive.model.document import Key
from derive.model.language.entries import LawOfFriction
from derive.model.language.keys import Named, Text, Word, term
from derive.model.language.kind import Bodies, Kind
from derive.model.load_records import JointFriction
from derive.model.loads.places import not_negative, per
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader, force_unit
from derive.model.records import Velocity
from derive.model.scope import NONIDEAL


class FrictionEntry(LawOfFriction):
    """Viscous and dry friction at a joint: -viscous v - coulomb tanh(v/smoothing)."""

    type: Word = Field(
        description="Kind of entry.", json_schema_extra=term("Q = −d v − C tanh(v/s)")
    )
    joint: Named | None = Field(
        None, description="A joint with one coordinate.", json_schema_extra=term("v")
    )
    coordinate: Named | None = Field(None, description="A coordinate.", json_schema_extra=term("v"))
    velocity: Named | None = Field(
        None, description="A generalized velocity, such as base.w.", json_schema_extra=term("v")
    )
    about: Text | None = Field(
        None, description="What it is, for readers.", json_schema_extra=term("nothing; for readers")
    )


def friction(
    reader: Reader, document: Bodies, names: Names, key: Key, entry: FrictionEntry
) -> JointFriction | None:
    """The record; None after reporting."""
    target = velocity_of(reader, key, entry, names.rates)
    return None if target is None else friction_at(reader, key, str(key), entry, target)


def friction_at(
    reader: Reader, key: Key, name: str, entry: LawOfFriction, target: Velocity
) -> JointFriction:
    """Viscous and Coulomb friction along a generalized velocity.

    Coulomb friction needs a smoothing velocity: a jump at v = 0 would leave f undefined there.
    Negative coefficients and a friction without either are reported.
    """
    force = force_unit(target.unit)
    per_rate = per(force, target.unit)
    if entry.viscous is None and entry.coulomb is None:
        reader.report(
            key.span, f"the friction of '{key}' is empty", "viscous, or coulomb with smoothing"
        )
    viscous = not_negative(
        reader,
        entry.viscous,
        f"the viscous friction of '{key}'",
        "viscous friction",
        per_rate,
        NONIDEAL,
    )
    coulomb = not_negative(
        reader,
        entry.coulomb,
        f"the Coulomb friction of '{key}'",
        "Coulomb friction",
        force,
        NONIDEAL,
    )
    smoothing = _smoothing(reader, key, entry, target)
    dry = entry.coulomb is not None or entry.smoothing is not None
    return JointFriction(name, target.name, viscous, coulomb, smoothing, key.span, dry)


def _smoothing(reader: Reader, key: Key, entry: LawOfFriction, target: Velocity) -> Expression:
    """There is no speed that is slow for every joint, so dry friction has to say its own."""
    if entry.smoothing is None:
        if entry.coulomb is not None:
            wanted = (
                f"smoothing: a velocity in {target.unit}, at which tanh(v/smoothing) is "
                "three quarters"
            )
            reader.report(
                entry.coulomb.span, f"Coulomb friction of '{key}' without smoothing", wanted
            )
        return ONE
    smoothing = reader.formula(entry.smoothing, "a velocity", unit=target.unit)
    value = reader.value(smoothing, entry.smoothing)
    if value is not None and value <= 0.0:
        reader.report(
            entry.smoothing.span, f"the smoothing of '{key}' is {value:g}", "more than zero"
        )
    return smoothing


FRICTION = Kind("friction", FrictionEntry, friction)
