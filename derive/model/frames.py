"""The names of a mechanism: parameters, coordinates, base velocities, inputs, definitions; everything formulas may refer to."""

from __future__ import annotations

from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from derive.diagnostics import listed
from derive.expressions import tree
from derive.expressions.dimensions import BARE, UNKNOWN, Inferred, infer
from derive.expressions.evaluate import number
from derive.expressions.linearity import Degree, degree
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression, quantity, unit
from derive.expressions.tree import Expression
from derive.expressions.units import NUMBER, pretty
from derive.joints.records import JointType
from derive.model.document import Items, Key, Scalar
from derive.model.names import identifier
from derive.model.reader import Reader, force_unit
from derive.model.records import Coordinate, Input, Parameter, Span, Velocity
from derive.model.schema import CoordinateEntry, Document, InputEntry, JointEntry, ParameterEntry
from derive.model.scope import ANYTHING, COORDINATE, INPUT, PARAMETER, TIME, VELOCITY, Symbol, used


@dataclass(frozen=True)
class Frame:
    """A joint of the file with its type's table and the names of its coordinates and velocities."""

    name: Key
    entry: JointEntry
    type: JointType
    orientation: str
    coordinates: tuple[Coordinate, ...]
    velocities: tuple[Velocity, ...]


@dataclass(frozen=True)
class Names:
    """Everything that formulas can refer to, in the order of the model."""

    parameters: tuple[Parameter, ...]
    coordinates: tuple[Coordinate, ...]
    velocities: tuple[Velocity, ...]
    inputs: tuple[Input, ...]
    definitions: tuple[tuple[str, Expression], ...]


def parameters(reader: Reader, document: Document) -> tuple[Parameter, ...]:
    """The parameters with their default values in SI."""
    return tuple(_parameter(reader, key, entry) for key, entry in document.parameters.items())


def _parameter(reader: Reader, key: Key, entry: Scalar | ParameterEntry) -> Parameter:
    scalar = entry if isinstance(entry, Scalar) else entry.value
    about = "" if isinstance(entry, Scalar) or entry.about is None else entry.about.text
    value, written, dimension = _number(reader, scalar)
    name = reader.name(key)
    reader.scope.symbols[name] = Symbol(frozenset({PARAMETER}), dimension)
    reader.values[name] = value
    return Parameter(name, value, written, about, key.span)


def _number(reader: Reader, scalar: Scalar) -> tuple[float, str, Inferred]:
    """Value, SI unit and dimension of a parameter."""
    plain = quantity(scalar.text)
    if plain is not None:
        return plain.value, plain.unit, unit(plain.unit).dimension if plain.unit else UNKNOWN
    try:
        parsed = expression(scalar.text)
        _no_names(parsed, scalar.text)
        dimension = infer(parsed, {}, scalar.text)
        value = number(parsed, {}, scalar.text)
    except FormulaError as error:
        reader.fault(scalar, error)
        return 1.0, "", UNKNOWN
    return value, pretty(dimension) if isinstance(dimension, tuple) else "", UNKNOWN if dimension == BARE else dimension


def _no_names(parsed: Expression, text: str) -> None:
    for node in tree.walk(parsed):
        if isinstance(node, tree.Name | tree.Rate):
            hint = "a formula of parameters goes under `where:`"
            raise FormulaError(f"'{node.name}' in the value of a parameter", text, node.at, "a number with its unit", hint)


def frame(reader: Reader, key: Key, entry: JointEntry) -> Frame | None:
    """Names and table of one joint; None after reporting that its type is unknown."""
    from derive.joints import JOINTS, joint_type

    reader.name(key)
    kind = reader.word(entry.type, [joint.name for joint in JOINTS], "type of joint")
    if kind is None:
        return None
    if reader.space.plane and kind == "free":
        reader.report(entry.type.span, "a free joint in a planar model", "planar", "a planar joint moves freely in the plane")
        return None
    orientation = _orientation(reader, entry) if kind == "free" else ""
    table = joint_type(kind, orientation)
    coordinates = _coordinates(reader, key, entry, table)
    return Frame(key, entry, table, orientation, coordinates, _velocities(key, table, coordinates))


def _orientation(reader: Reader, entry: JointEntry) -> str:
    if entry.orientation is None:
        return "zyx"
    given = entry.orientation.euler
    sequence = given.text
    if len(sequence) == 3 and set(sequence) <= set("xyz") and sequence[0] != sequence[1] != sequence[2]:
        return sequence
    reader.report(given.span, f"'{sequence}' is not a sequence of Euler angles", "three of x, y, z, no two neighbours alike, such as zxy")
    return "zyx"


def _coordinates(reader: Reader, key: Key, entry: JointEntry, table: JointType) -> tuple[Coordinate, ...]:
    given = _given_names(reader, key, entry, table)
    names = given or [Scalar(f"{key}_{slot.suffix}" if slot.suffix else key, key.span, False, True) for slot in table.coordinates]
    return tuple(
        Coordinate(reader.name(name) if given else name.text, slot.unit, str(key), name.span)
        for name, slot in zip(names, table.coordinates)
    )


def _given_names(reader: Reader, key: Key, entry: JointEntry, table: JointType) -> list[Scalar]:
    """The names the file gives to the coordinates, in the order of the table; [] where it leaves them to us."""
    free = table.name == "free"
    for wrong in [] if free else [name for name in ("position", "orientation") if getattr(entry, name) is not None]:
        reader.report(key.span, f"'{wrong}' of a {table.name} joint", "coordinate or coordinates")
    if entry.coordinate is not None:
        return _counted(reader, key, [entry.coordinate], table, entry.coordinate.span)
    if entry.coordinates is not None:
        return _counted(reader, key, list(entry.coordinates), table, entry.coordinates.span)
    return _free_names(reader, key, entry) if free else []


def _counted(reader: Reader, key: Key, names: list[Scalar], table: JointType, span: Span) -> list[Scalar]:
    if len(names) == len(table.coordinates):
        return names
    slots = [slot.suffix or slot.unit for slot in table.coordinates]
    wanted = f"{len(slots)}: [{', '.join(slots)}]" if slots else "none"
    reader.report(span, f"{len(names)} coordinate{'s' * (len(names) != 1)} of the {table.name} joint '{key}'", wanted)
    return []


def _free_names(reader: Reader, key: Key, entry: JointEntry) -> list[Scalar]:
    angles = entry.orientation.angles if entry.orientation else None
    return _three(reader, key, entry.position, "xyz", "position") + _three(
        reader, key, angles, ("angle1", "angle2", "angle3"), "orientation"
    )


def _three(reader: Reader, key: Key, names: Items | None, suffixes: str | tuple[str, ...], what: str) -> list[Scalar]:
    if names is not None and len(names) != 3:
        reader.report(names.span, f"{len(names)} names for the {what} of '{key}'", "three names")
    if names is not None and len(names) == 3:
        return list(names)
    return [Scalar(f"{key}_{suffix}", key.span, False, True) for suffix in suffixes]


def _velocities(key: Key, table: JointType, coordinates: tuple[Coordinate, ...]) -> tuple[Velocity, ...]:
    found = []
    for index, slot in enumerate(table.velocities):
        rate_of = "" if slot.suffix else coordinates[index].name
        name = f"der({rate_of})" if rate_of else f"{key}.{slot.suffix}"
        found.append(Velocity(name, slot.unit, str(key), rate_of, key.span))
    return tuple(found)


def analytic_coordinates(reader: Reader, document: Document) -> tuple[tuple[Coordinate, ...], tuple[Velocity, ...]]:
    """Coordinates of the analytic form and their rates."""
    coordinates, velocities = [], []
    for key, entry in document.coordinates.items():
        given = reader.unit(entry.unit if isinstance(entry, CoordinateEntry) else entry)
        name = reader.name(key)
        coordinates.append(Coordinate(name, given, "", key.span))
        velocities.append(Velocity(f"der({name})", f"{given or '1'}/s", "", name, key.span))
    return tuple(coordinates), tuple(velocities)


def enter(reader: Reader, coordinates: tuple[Coordinate, ...], velocities: tuple[Velocity, ...]) -> None:
    """Put coordinates, rates and base velocities into the scope, with J.w and J.v for joints that have one rate."""
    symbols = reader.scope.symbols
    for coordinate in coordinates:
        symbols.setdefault(coordinate.name, Symbol(frozenset({COORDINATE}), _dimension(coordinate.unit)))
        rate = unit(f"{coordinate.unit or '1'}/s").dimension
        symbols.setdefault(f"der({coordinate.name})", Symbol(frozenset({VELOCITY}), rate, Degree(1, 1)))
    for velocity in velocities:
        symbols.setdefault(velocity.name, Symbol(frozenset({VELOCITY}), _dimension(velocity.unit), Degree(1, 1)))
        if velocity.rate_of and velocity.owner:
            letter = "w" if velocity.unit == "rad/s" else "v"
            reader.scope.aliases[f"{velocity.owner}.{letter}"] = velocity.rate_of


def _dimension(written: str) -> Inferred:
    return unit(written).dimension if written else NUMBER


def inputs(reader: Reader, document: Document, velocities: tuple[Velocity, ...]) -> tuple[Input, ...]:
    """The actuators, each with the base velocity it drives."""
    found = []
    for key, entry in document.inputs.items():
        name = reader.name(key)
        target = velocity_of(reader, key, entry, velocities, needed=False)
        written = force_unit(target.unit) if target else ""
        if entry.unit is not None:
            written = _checked_unit(reader, entry.unit, written)
        known = _dimension(written) if target or entry.unit is not None else UNKNOWN
        reader.scope.symbols[name] = Symbol(frozenset({INPUT}), known)
        found.append(Input(name, target.name if target else "", written, entry.about.text if entry.about else "", key.span))
    return tuple(found)


def _checked_unit(reader: Reader, scalar: Scalar, wanted: str) -> str:
    given = reader.unit(scalar)
    if wanted and _dimension(given) != _dimension(wanted):
        reader.report(scalar.span, f"an input in {given or 'plain numbers'} at a place that takes {wanted}", wanted)
    return given or wanted


def velocity_of(
    reader: Reader, key: Key, entry: object, velocities: tuple[Velocity, ...], needed: bool = True
) -> Velocity | None:
    """The base velocity that `joint:`, `coordinate:` or `velocity:` of an entry names; None after reporting, or where none is given."""
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


def definitions(reader: Reader, document: Document) -> tuple[tuple[str, Expression], ...]:
    """`where:` in dependency order."""
    reader.scope.symbols["t"] = Symbol(frozenset({TIME}), unit("s").dimension)
    entries = {str(key): (key, scalar) for key, scalar in document.where.items()}
    parsed = {reader.name(key): _parsed(reader, scalar, entries) for key, scalar in document.where.items()}
    order = _order(reader, parsed, entries)
    return tuple((name, _definition(reader, name, entries[name][1])) for name in order)


def _parsed(reader: Reader, scalar: Scalar, entries: dict[str, tuple[Key, Scalar]]) -> set[str]:
    """The definitions a definition uses; errors are reported when it is read in its turn."""
    try:
        nodes = tree.walk(expression(scalar.text, names=[*reader.scope.symbols, *entries]))
    except FormulaError:
        return set()
    return {node.name for node in nodes if isinstance(node, tree.Name) and node.name in entries}


def _order(reader: Reader, uses: dict[str, set[str]], entries: dict[str, tuple[Key, Scalar]]) -> list[str]:
    try:
        return list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        circle: list[str] = list(reversed(error.args[1]))
        reader.report(entries[circle[0]][0].span, f"'{circle[0]}' is defined by itself: {' → '.join(circle[:10])}", "formulas without a circle")
        reader.finish()
        raise AssertionError("unreachable") from None


def _definition(reader: Reader, name: str, scalar: Scalar) -> Expression:
    formula = reader.formula(scalar, "a definition", ANYTHING)
    scope = reader.scope
    kinds = used(formula, scope)
    try:
        dimension = infer(formula, scope.dimensions, scalar.text)
    except FormulaError:
        dimension = UNKNOWN  # reported by `formula`
    velocities = [known for known, symbol in scope.symbols.items() if symbol.kinds == {VELOCITY}]
    high = degree(formula, velocities, scope.degrees)
    scope.symbols[name] = Symbol(frozenset(kinds), UNKNOWN if dimension == BARE else dimension, high, tuple(kinds.items()))
    if kinds.keys() <= {PARAMETER} and (value := reader.value(formula, scalar)) is not None:
        reader.values[name] = value
    return formula


def check_collisions(reader: Reader, document: Document, names: Names) -> None:
    """Two things with one name, or names that become one identifier in C."""
    places = [("parameter", p.name, p.span) for p in names.parameters]
    places += [("coordinate", c.name, c.span) for c in names.coordinates]
    places += [("input", u.name, u.span) for u in names.inputs]
    places += [("definition", str(key), key.span) for key in document.where]
    places += [("velocity", v.name, v.span) for v in names.velocities if not v.rate_of]
    _check_distinct(reader, places)
    ties = [("joint", key, key.span) for key in document.joints] + [("closure", key, key.span) for key in document.closures]
    _check_distinct(reader, ties + [("constraint", key, key.span) for key in document.constraints])


def _check_distinct(reader: Reader, places: list[tuple[str, str, Span]]) -> None:
    seen: dict[str, tuple[str, str, Span]] = {}
    for kind, name, span in places:
        mapped = identifier(name)
        if mapped in seen:
            other, first, place = seen[mapped]
            same = f"the name of a {other}" if first == name else f"like the {other} '{first}' in generated code"
            reader.report(span, f"the {kind} '{name}' is {same}, line {place.line}, column {place.column}", "another name")
        seen.setdefault(mapped, (kind, name, span))

