"""Where inputs and loads act: the generalized velocity that `joint:`, `coordinate:` or `velocity:`
names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING

from derive.diagnostics import listed
from derive.expressions.dimensions import UNKNOWN, infer
from derive.expressions.mistakes import FormulaError
from derive.expressions.tables import Table
from derive.expressions.tree import ONE, Call, Expression, Name
from derive.expressions.units import NUMBER, TIME, Dimension, pretty, product_of, quotient_of
from derive.model import algebra
from derive.model.document import Key, Scalar
from derive.model.language.entries import InputEntry
from derive.model.load_records import Armature, GeneralisedForce
from derive.model.mechanism.frames import Names
from derive.model.reader import Reader, dimension_of, force_unit
from derive.model.records import Input, Model, Velocity
from derive.model.scope import INPUT, Symbol

if TYPE_CHECKING:
    from derive.model.language.shape import Document


def inputs(
    reader: Reader, document: Document, velocities: tuple[Velocity, ...]
) -> tuple[Input, ...]:
    """The actuators, each with the generalized velocity it drives."""
    return tuple(_input(reader, key, entry, velocities) for key, entry in document.inputs.items())


def _input(reader: Reader, key: Key, entry: InputEntry, velocities: tuple[Velocity, ...]) -> Input:
    name = reader.name(key)
    target = velocity_of(reader, key, entry, velocities, needed=False)
    gear, written = _gear(reader, key, entry, target)
    if entry.unit is not None:
        written = _checked_unit(reader, entry.unit, written)
    table = reader.word(entry.table, reader.curves, "table") if entry.table else None
    if entry.table and table:
        written = _unit_by_table(reader, entry.table, reader.curves[table], written)
    known = dimension_of(written) if target or written or entry.unit is not None else UNKNOWN
    reader.scope.add(name, Symbol(frozenset({INPUT}), known))
    about = entry.about.text if entry.about else ""
    velocity = target.name if target else ""
    return Input(name, velocity, written, about, key.span, gear, table or "")


def _unit_by_table(reader: Reader, scalar: Scalar, table: Table, written: str) -> str:
    """The unit of an input that follows a table: that of its values, unless another is known."""
    x, y = table.units
    if dimension_of(x) != TIME:
        message = f"the table '{table.name}' over {x or 'plain numbers'} for an input"
        reader.report(scalar.span, message, "a table over time: units: [s, …]")
    if written and dimension_of(y) != dimension_of(written):
        message = f"the table '{table.name}' of {y or 'plain numbers'} for an input in {written}"
        reader.report(scalar.span, message, f"units: [s, {written}]")
    return written or y


def check_held(reader: Reader, model: Model) -> None:
    """Report steady motions that hold an input which follows a table."""
    tables = {x.name: x.table for x in model.inputs if x.table}
    for motion in model.steady_motions:
        for name in (*dict(motion.values), *motion.free):
            if name in tables:
                message = f"the steady motion '{motion.name}' holds '{name}'"
                expected = f"an input that does not follow a table, as '{name}' does"
                reader.report(motion.span, message, expected)


def with_courses(model: Model) -> Model:
    """The model without the inputs that follow tables: they are definitions, and forces where they
    drive a velocity."""
    following = [x for x in model.inputs if x.table]
    if not following:
        return model
    courses = {x.name: Call(x.table, (Name("t"),)) for x in following}
    forces = (
        GeneralisedForce(x.name, x.velocity, algebra.times(x.gear, courses[x.name]), x.span)
        for x in following
        if x.velocity
    )
    return replace(
        model,
        inputs=tuple(x for x in model.inputs if not x.table),
        definitions=(*courses.items(), *model.definitions),
        loads=(*model.loads, *forces),
    )


def _gear(
    reader: Reader, key: Key, entry: InputEntry, target: Velocity | None
) -> tuple[Expression, str]:
    """Force at the joint per input, and the unit of the input; a drive from turning to sliding has
    a gear in 1/m."""
    if target is None:
        for name in ("gear", "rotor_inertia"):
            if (given := getattr(entry, name)) is not None and not _names_a_place(entry):
                reader.report(
                    given.span,
                    f"'{name}' of the input '{key}', which drives no joint",
                    "a joint, coordinate or velocity",
                )
        return ONE, ""
    force = force_unit(target.unit)
    if entry.gear is None:
        return ONE, force
    gear = reader.formula(entry.gear, "a gear")
    if reader.value(gear, entry.gear) == 0.0:
        reader.report(
            entry.gear.span, f"the gear of '{key}' is zero", "a number, positive or negative"
        )
    dimension = _dimension(reader, gear, entry.gear)
    return gear, force if dimension == NUMBER else pretty(
        quotient_of(dimension_of(force), dimension)
    )


def _names_a_place(entry: InputEntry) -> bool:
    return any(getattr(entry, way) is not None for way in ("joint", "coordinate", "velocity"))


def _dimension(reader: Reader, formula: Expression, scalar: Scalar) -> Dimension:
    try:
        dimension = infer(formula, reader.scope.dimensions, scalar.text)
    except FormulaError:
        return NUMBER  # reported by `formula`
    return dimension if isinstance(dimension, tuple) else NUMBER


def rotors(reader: Reader, document: Document, names: Names) -> list[Armature]:
    """Inertias of the actuators' rotors as the joints feel them: rotor inertia times gear
    squared."""
    armatures: list[Armature] = []
    units = {velocity.name: velocity.unit for velocity in names.velocities}
    for entry, given in zip(document.inputs.values(), names.inputs):
        if entry.rotor_inertia is None or not given.velocity:
            continue
        inertia = per_acceleration(units[given.velocity])
        gear = _dimension(reader, given.gear, entry.gear or entry.rotor_inertia)
        own = quotient_of(dimension_of(inertia), product_of(gear, gear))
        rotor = reader.formula(entry.rotor_inertia, "a rotor's inertia", unit=pretty(own))
        value = reader.value(rotor, entry.rotor_inertia)
        if value is not None and value < 0.0:
            reader.report(
                entry.rotor_inertia.span,
                f"the rotor of '{given.name}' has the inertia {value:g}",
                "zero or more",
            )
        felt = algebra.times(rotor, given.gear, given.gear)
        armatures.append(Armature(f"{given.name}_rotor", given.velocity, felt, given.span))
    return armatures


@cache
def per_acceleration(velocity: str) -> str:
    """The unit of the inertia conjugate to a velocity: kg for m/s, kg*m^2 for rad/s."""
    force, rate = dimension_of(force_unit(velocity)), dimension_of(velocity)
    return pretty(product_of(quotient_of(force, rate), TIME))


def _checked_unit(reader: Reader, scalar: Scalar, wanted: str) -> str:
    given = reader.unit(scalar)
    if wanted and dimension_of(given) != dimension_of(wanted):
        reader.report(
            scalar.span,
            f"an input in {given or 'plain numbers'} at a place that takes {wanted}",
            wanted,
        )
    return given or wanted


def velocity_of(
    reader: Reader, key: Key, entry: object, velocities: tuple[Velocity, ...], needed: bool = True
) -> Velocity | None:
    """The generalized velocity that an entry's `joint:`, `coordinate:` or `velocity:` names; None
    where it names none or a wrong one."""
    ways = ("joint", "coordinate", "velocity")
    given = [(way, value) for way in ways if isinstance(value := getattr(entry, way, None), Scalar)]
    allowed = [way for way in ways if hasattr(entry, way)]
    if len(given) > 1 or (needed and not given):
        problem = (
            f"'{key}' acts in {len(given)} places"
            if given
            else f"'{key}' does not say where it acts"
        )
        reader.report(key.span, problem, f"one of {', '.join(allowed)}")
    if len(given) != 1:
        return None
    way, scalar = given[0]
    if way == "velocity":
        return _of_name(reader, scalar, velocities)
    return {"joint": _of_joint, "coordinate": _of_coordinate}[way](
        reader, scalar, velocities, allowed
    )


@dataclass(frozen=True)
class _Tables:
    """Velocities by their joint, by the coordinate whose rate they are, and by name."""

    owned: dict[str, list[Velocity]]
    rates: dict[str, Velocity]
    names: dict[str, Velocity]


class _Same:
    """The velocities of a model, told apart by identity: thousands of them are not compared."""

    def __init__(self, velocities: tuple[Velocity, ...]) -> None:
        self.velocities = velocities

    def __hash__(self) -> int:
        return id(self.velocities)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.velocities is other.velocities


@lru_cache(maxsize=1)
def _tables(same: _Same) -> _Tables:
    owned: dict[str, list[Velocity]] = {}
    rates: dict[str, Velocity] = {}
    names: dict[str, Velocity] = {}
    for velocity in same.velocities:
        if velocity.owner:
            owned.setdefault(velocity.owner, []).append(velocity)
        if velocity.rate_of:
            rates.setdefault(velocity.rate_of, velocity)
        names.setdefault(velocity.name, velocity)
    return _Tables(owned, rates, names)


def _of_joint(
    reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...], allowed: list[str]
) -> Velocity | None:
    owned = _tables(_Same(velocities)).owned.get(scalar.text, [])
    if len(owned) == 1:
        return owned[0]
    if owned:
        reader.report(
            scalar.span,
            f"the joint '{scalar.text}' has {len(owned)} velocities",
            _instead(owned, allowed),
        )
        return None
    reader.word(
        scalar,
        dict.fromkeys(velocity.owner for velocity in velocities if velocity.owner),
        "moving joint",
    )
    return None


def _instead(velocities: Sequence[Velocity], allowed: list[str]) -> str:
    """How to name one of several velocities with the keys that the entry has."""
    rates = [velocity.rate_of for velocity in velocities if velocity.rate_of]
    if "velocity" in allowed:
        return f"velocity: one of {listed(velocity.name for velocity in velocities)}"
    if rates and "coordinate" in allowed:
        return f"coordinate: one of {listed(rates)}"
    return "a joint with one velocity, which is the rate of its coordinate"


def _of_coordinate(
    reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...], allowed: list[str]
) -> Velocity | None:
    rate = _tables(_Same(velocities)).rates.get(scalar.text)
    if rate is not None:
        return rate
    if scalar.text in reader.scope.coordinates():
        reader.report(
            scalar.span,
            f"der({scalar.text}) is not a generalized velocity of its joint",
            _instead(velocities, allowed),
        )
        return None
    reader.word(scalar, reader.scope.coordinates(), "coordinate")
    return None


def _of_name(reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...]) -> Velocity | None:
    name = reader.scope.aliases.get(scalar.text)
    wanted = f"der({name})" if name else scalar.text.replace(" ", "")
    named = _tables(_Same(velocities)).names.get(wanted)
    if named is not None:
        return named
    reader.word(scalar, [velocity.name for velocity in velocities], "generalized velocity")
    return None
