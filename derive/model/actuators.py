"""Where inputs and loads act: the base velocity that `joint:`, `coordinate:` or `velocity:` names."""

from __future__ import annotations

from derive.diagnostics import listed
from derive.expressions.dimensions import UNKNOWN
from derive.model.document import Key, Scalar
from derive.model.reader import Reader, dimension_of, force_unit
from derive.model.records import Input, Velocity
from derive.model.schema import Document
from derive.model.scope import INPUT, Symbol


def inputs(reader: Reader, document: Document, velocities: tuple[Velocity, ...]) -> tuple[Input, ...]:
    """The actuators, each with the base velocity it drives."""
    found = []
    for key, entry in document.inputs.items():
        name = reader.name(key)
        target = velocity_of(reader, key, entry, velocities, needed=False)
        written = force_unit(target.unit) if target else ""
        if entry.unit is not None:
            written = _checked_unit(reader, entry.unit, written)
        known = dimension_of(written) if target or entry.unit is not None else UNKNOWN
        reader.scope.add(name, Symbol(frozenset({INPUT}), known))
        found.append(Input(name, target.name if target else "", written, entry.about.text if entry.about else "", key.span))
    return tuple(found)


def _checked_unit(reader: Reader, scalar: Scalar, wanted: str) -> str:
    given = reader.unit(scalar)
    if wanted and dimension_of(given) != dimension_of(wanted):
        reader.report(scalar.span, f"an input in {given or 'plain numbers'} at a place that takes {wanted}", wanted)
    return given or wanted


def velocity_of(
    reader: Reader, key: Key, entry: object, velocities: tuple[Velocity, ...], needed: bool = True
) -> Velocity | None:
    """The base velocity that an entry's `joint:`, `coordinate:` or `velocity:` names; None where it names none or a wrong one."""
    ways = ("joint", "coordinate", "velocity")
    given = [(way, value) for way in ways if isinstance(value := getattr(entry, way, None), Scalar)]
    allowed = [way for way in ways if hasattr(entry, way)]
    if len(given) > 1 or (needed and not given):
        problem = f"'{key}' acts in {len(given)} places" if given else f"'{key}' does not say where it acts"
        reader.report(key.span, problem, f"one of {', '.join(allowed)}")
    if len(given) != 1:
        return None
    way, scalar = given[0]
    return {"joint": _of_joint, "coordinate": _of_coordinate, "velocity": _of_name}[way](reader, scalar, velocities)


def _of_joint(reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...]) -> Velocity | None:
    owned = [velocity for velocity in velocities if velocity.owner and velocity.owner == scalar.text]
    if len(owned) == 1:
        return owned[0]
    if owned:
        names = listed(velocity.name for velocity in owned)
        reader.report(scalar.span, f"the joint '{scalar.text}' has {len(owned)} velocities", f"velocity: one of {names}")
        return None
    reader.word(scalar, dict.fromkeys(velocity.owner for velocity in velocities if velocity.owner), "moving joint")
    return None


def _of_coordinate(reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...]) -> Velocity | None:
    for velocity in velocities:
        if velocity.rate_of and velocity.rate_of == scalar.text:
            return velocity
    if scalar.text in reader.scope.coordinates():
        names = listed(velocity.name for velocity in velocities)
        reader.report(scalar.span, f"der({scalar.text}) is not a base velocity of its joint", f"velocity: one of {names}")
        return None
    reader.word(scalar, reader.scope.coordinates(), "coordinate")
    return None


def _of_name(reader: Reader, scalar: Scalar, velocities: tuple[Velocity, ...]) -> Velocity | None:
    name = reader.scope.aliases.get(scalar.text)
    wanted = f"der({name})" if name else scalar.text.replace(" ", "")
    for velocity in velocities:
        if velocity.name == wanted:
            return velocity
    reader.word(scalar, [velocity.name for velocity in velocities], "base velocity")
    return None
