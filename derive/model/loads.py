"""Loads: springs, dampers, forces, torques and force laws."""

from __future__ import annotations

from dataclasses import dataclass

from derive.expressions.parser import unit as parsed_unit
from derive.expressions.tree import ONE, ZERO, Expression, Negative
from derive.expressions.units import pretty, quotient_of
from derive.model.actuators import per_acceleration, velocity_of
from derive.model.bushings import bushing
from derive.model.document import Items, Key, Scalar
from derive.model.frames import Frame, Names
from derive.model.mechanism import bodies, some_body
from derive.model.reader import Reader, force_unit
from derive.model.records import (
    Armature,
    Coordinate,
    Force,
    GeneralisedForce,
    JointDamper,
    JointFriction,
    JointSpring,
    Load,
    PointSpring,
    Torque,
    Vector3,
    Velocity,
)
from derive.model.scope import ANYTHING
from derive.model.shape import (
    ArmatureEntry,
    BushingEntry,
    DamperEntry,
    Document,
    ExpressionEntry,
    ForceEntry,
    FrictionEntry,
    JointSpringEntry,
    LawOfFriction,
    SpringEntry,
    TorqueEntry,
)

FRAMES = ("ground", "body")


def load(reader: Reader, document: Document, names: Names, key: Key, entry: object) -> Load | None:
    """One load of the file; None after reporting that it says too little."""
    reader.name(key)
    match entry:
        case SpringEntry():
            return (
                _point_spring(reader, document, key, entry)
                if entry.between
                else _spring(reader, names, key, entry)
            )
        case DamperEntry():
            return (
                _point_damper(reader, document, key, entry)
                if entry.between
                else _damper(reader, names, key, entry)
            )
        case ForceEntry():
            return _force(reader, document, key, entry)
        case TorqueEntry():
            return _torque(reader, document, key, entry)
        case ExpressionEntry():
            return _law(reader, names, key, entry)
        case BushingEntry():
            return bushing(reader, document, key, entry)
        case FrictionEntry():
            target = velocity_of(reader, key, entry, names.velocities)
            return None if target is None else _friction(reader, key, str(key), entry, target)
        case ArmatureEntry():
            target = velocity_of(reader, key, entry, names.velocities)
            return (
                None if target is None else _armature(reader, key, str(key), entry.inertia, target)
            )
    raise AssertionError(entry)


def in_joint(reader: Reader, names: Names, frame: Frame) -> list[Load]:
    """Spring, damper, friction and armature that the joint itself is given, named after it."""
    entry, key = frame.entry, frame.name
    given = [name for name in IN_JOINT if getattr(entry, name) is not None]
    if not given:
        return []
    if len(frame.velocities) != 1:
        velocity_of(
            reader, key, _At(joint=Scalar(str(key), key.span, True, True)), names.velocities
        )  # says what is wrong
        return []
    return [_in_joint(reader, frame, name) for name in given]


def _in_joint(reader: Reader, frame: Frame, kind: str) -> Load:
    key, target = frame.name, frame.velocities[0]
    name, given = f"{key}_{kind}", getattr(frame.entry, kind)
    if kind == "spring":
        return _spring_at(reader, key, name, given, frame.coordinates[0])
    if kind == "damper":
        return _damper_at(reader, key, name, given, target)
    if kind == "friction":
        return _friction(reader, key, name, given, target)
    return _armature(reader, key, name, given, target)


IN_JOINT = ("spring", "damper", "friction", "armature")


def generalised_force(
    reader: Reader, names: Names, key: Key, scalar: Scalar
) -> GeneralisedForce | None:
    """An entry of `forces:`, added to the force along one coordinate."""
    target = velocity_of(
        reader, key, _At(coordinate=Scalar(str(key), key.span, True, True)), names.velocities
    )
    if target is None:
        return None
    return GeneralisedForce(
        f"force_{key}", target.name, _conjugate(reader, scalar, target), key.span
    )


@dataclass(frozen=True)
class _At:
    joint: Scalar | None = None
    coordinate: Scalar | None = None


def _conjugate(reader: Reader, scalar: Scalar, target: Velocity) -> Expression:
    return reader.formula(scalar, "a force", ANYTHING, force_unit(target.unit))


def _optional(reader: Reader, scalar: Scalar | None, where: str, unit: str) -> Expression:
    return ZERO if scalar is None else reader.formula(scalar, where, unit=unit)


def _spring(reader: Reader, names: Names, key: Key, entry: SpringEntry) -> JointSpring | None:
    _refuse(reader, key, entry, ("at", "length", "damping"), "between two points")
    if entry.coordinate is not None and entry.joint is None:
        name = reader.word(
            entry.coordinate, [coordinate.name for coordinate in names.coordinates], "coordinate"
        )
    else:
        target = velocity_of(reader, key, entry, names.velocities)
        name = target.rate_of if target else None
    found = next((coordinate for coordinate in names.coordinates if coordinate.name == name), None)
    return None if found is None else _spring_at(reader, key, str(key), entry, found)


def _spring_at(
    reader: Reader,
    key: Key,
    name: str,
    entry: SpringEntry | JointSpringEntry,
    coordinate: Coordinate,
) -> JointSpring:
    unit = coordinate.unit
    stiffness = reader.formula(
        entry.stiffness, "a stiffness", unit=_per(force_unit(f"{unit or '1'}/s"), unit)
    )
    return JointSpring(
        name,
        coordinate.name,
        stiffness,
        _optional(reader, entry.rest, "a rest position", unit),
        key.span,
    )


def _damper(reader: Reader, names: Names, key: Key, entry: DamperEntry) -> JointDamper | None:
    _refuse(reader, key, entry, ("at",), "between two points")
    target = velocity_of(reader, key, entry, names.velocities)
    return None if target is None else _damper_at(reader, key, str(key), entry.coefficient, target)


def _damper_at(
    reader: Reader, key: Key, name: str, coefficient: Scalar, target: Velocity
) -> JointDamper:
    unit = _per(force_unit(target.unit), target.unit)
    return JointDamper(
        name, target.name, reader.formula(coefficient, "a damping coefficient", unit=unit), key.span
    )


def _friction(
    reader: Reader, key: Key, name: str, entry: LawOfFriction, target: Velocity
) -> JointFriction:
    force = force_unit(target.unit)
    per_rate = _per(force, target.unit)
    if entry.viscous is None and entry.coulomb is None:
        reader.report(
            key.span, f"the friction of '{key}' is empty", "viscous, or coulomb with smoothing"
        )
    viscous = _not_negative(
        reader, entry.viscous, f"the viscous friction of '{key}'", "viscous friction", per_rate
    )
    coulomb = _not_negative(
        reader, entry.coulomb, f"the Coulomb friction of '{key}'", "Coulomb friction", force
    )
    return JointFriction(
        name, target.name, viscous, coulomb, _smoothing(reader, key, entry, target), key.span
    )


def _smoothing(reader: Reader, key: Key, entry: LawOfFriction, target: Velocity) -> Expression:
    """There is no speed that is slow for every joint, so dry friction has to say its own."""
    if entry.smoothing is None:
        if entry.coulomb is not None:
            wanted = f"smoothing: a velocity in {target.unit}, at which tanh(v/smoothing) is three quarters"
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


def _not_negative(
    reader: Reader, scalar: Scalar | None, what: str, where: str, unit: str
) -> Expression:
    if scalar is None:
        return ZERO
    formula = reader.formula(scalar, where, unit=unit)
    value = reader.value(formula, scalar)
    if value is not None and value < 0.0:
        reader.report(scalar.span, f"{what} is {value:g}", "zero or more")
    return formula


def _armature(reader: Reader, key: Key, name: str, inertia: Scalar, target: Velocity) -> Armature:
    unit = per_acceleration(target.unit)
    return Armature(
        name,
        target.name,
        _not_negative(reader, inertia, f"the armature of '{key}'", "an inertia", unit),
        key.span,
    )


def _per(force: str, motion: str) -> str:
    """The unit of force per motion, in words people use: N/m, N*s/m, N*m/rad, N*m*s/rad."""
    known = {
        "m": "N/m",
        "rad": "N*m/rad",
        "m/s": "N*s/m",
        "rad/s": "N*m*s/rad",
        "": "N*m",
        "1/s": "N*m*s",
    }
    if motion in known:
        return known[motion]
    return pretty(quotient_of(parsed_unit(force).dimension, parsed_unit(motion).dimension))


def _refuse(reader: Reader, key: Key, entry: object, fields: tuple[str, ...], where: str) -> None:
    """Keys that belong to the other form of a spring or damper."""
    for name in fields:
        value = getattr(entry, name)
        if value is not None:
            span = value.span if isinstance(value, Scalar | Items) else value[0].span
            reader.report(
                span,
                f"'{name}' of '{key}' belongs to a load {where}",
                "between: [body, body] with at: [[…], […]], or a joint",
            )


def _two_points(
    reader: Reader, document: Document, key: Key, entry: SpringEntry | DamperEntry
) -> tuple[tuple[str, str], tuple[Vector3, Vector3]]:
    names = (
        ("joint", "coordinate", "rest")
        if isinstance(entry, SpringEntry)
        else ("joint", "coordinate", "velocity")
    )
    _refuse(reader, key, entry, names, "at a joint")
    assert entry.between is not None
    pair = bodies(reader, document, key, entry.between)
    if entry.at is None:
        reader.report(
            key.span,
            f"'{key}' does not say which points it joins",
            "at: [[…], […]], a point of each body",
        )
        return pair, (reader.point(None, ""), reader.point(None, ""))
    return pair, (reader.point(entry.at[0], "a point"), reader.point(entry.at[1], "a point"))


def _point_spring(reader: Reader, document: Document, key: Key, entry: SpringEntry) -> PointSpring:
    pair, points = _two_points(reader, document, key, entry)
    stiffness = reader.formula(entry.stiffness, "a stiffness", unit="N/m")
    length = _optional(reader, entry.length, "a length", "m")
    damping = _optional(reader, entry.damping, "a damping coefficient", "N*s/m")
    return PointSpring(str(key), pair, points, stiffness, length, damping, key.span)


def _point_damper(reader: Reader, document: Document, key: Key, entry: DamperEntry) -> PointSpring:
    pair, points = _two_points(reader, document, key, entry)
    damping = reader.formula(entry.coefficient, "a damping coefficient", unit="N*s/m")
    return PointSpring(str(key), pair, points, ZERO, ZERO, damping, key.span)


def _frame(reader: Reader, scalar: Scalar | None) -> str:
    return FRAMES[0] if scalar is None else reader.word(scalar, FRAMES, "frame") or FRAMES[0]


def _force(reader: Reader, document: Document, key: Key, entry: ForceEntry) -> Force:
    body = some_body(reader, document, entry.body, ground=False)
    components = reader.point(entry.components, "a force", "N", ANYTHING)
    return Force(
        str(key),
        body,
        reader.point(entry.at, "a point"),
        components,
        _frame(reader, entry.frame),
        key.span,
    )


def _torque(reader: Reader, document: Document, key: Key, entry: TorqueEntry) -> Torque:
    body = some_body(reader, document, entry.body, ground=False)
    return Torque(
        str(key),
        body,
        _torque_components(reader, entry.components),
        _frame(reader, entry.frame),
        key.span,
    )


def _torque_components(reader: Reader, node: Scalar | Items) -> Vector3:
    """One number about the normal in a planar model (its sign in the normal's sense), three
    components in space."""
    entries = [node] if isinstance(node, Scalar) else list(node)
    size = 1 if reader.space.plane else 3
    if len(entries) != size:
        reader.report(
            node.span,
            f"a torque with {len(entries)} component{'s' * (len(entries) != 1)}",
            f"{size}",
        )
        return reader.point(None, "")
    formulas = [reader.formula(entry, "a torque", ANYTHING, "N*m") for entry in entries]
    if size == 3:
        return (formulas[0], formulas[1], formulas[2])
    return _about_normal(reader, formulas[0])


def _about_normal(reader: Reader, formula: Expression) -> Vector3:
    signed = Negative(formula) if reader.space.plane == "xz" else formula
    found = [signed if index == reader.space.normal_index else ZERO for index in range(3)]
    return (found[0], found[1], found[2])


def _law(reader: Reader, names: Names, key: Key, entry: ExpressionEntry) -> GeneralisedForce | None:
    target = velocity_of(reader, key, entry, names.velocities)
    if target is None:
        return None
    return GeneralisedForce(
        str(key), target.name, _conjugate(reader, entry.expression, target), key.span
    )
