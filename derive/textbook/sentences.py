"""What a constraint or a load of the model says, in a sentence each.

A kind without a sentence of its own is listed field by field.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any, cast

from sympy import Symbol

from derive.expressions.tree import ONE, Expression, Name, walk
from derive.model.constraint_records import Distance, Holonomic, Nonholonomic, NoSlip, Rolling
from derive.model.load_records import (
    Contact,
    Exhaust,
    Force,
    GeneralisedForce,
    JointDamper,
    JointSpring,
    PointSpring,
    Tension,
    Torque,
)
from derive.model.records import GROUND, Closure, Coordinate, Input, Placement, Velocity
from derive.textbook import names
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.prose import runs
from derive.textbook.records import Math, Run, Runs, Text

AXES = "xyz"
NAMES = ("body", "bodies", "velocity", "coordinate", "frame_body")  # fields that name something
UNSAID = ("surface",)  # formulas that stand in the constraint rows anyway


def constraint(doc: Manuscript, x: Any) -> Runs:
    """What a constraint says."""
    write = CONSTRAINTS.get(x.__class__, _listed)
    return write(doc, x)


def load(doc: Manuscript, x: Any) -> Runs:
    """What a load does."""
    write = LOADS.get(x.__class__)
    return write(doc, x) if write else (Text(f"{kind(x)} of "), *_listed(doc, x))


def kind(x: object) -> str:
    """NoSlip → no slip."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(x).__name__).lower()


def point(doc: Manuscript, entries: Sequence[Expression], about: str) -> Math:
    """Components in the plane, or all three."""
    axes = doc.system.model.plane or AXES
    return _vector(doc, [entries[AXES.index(axis)] for axis in axes], about)


def _vector(doc: Manuscript, entries: Sequence[Expression], about: str) -> Math:
    return Math("(" + r",\; ".join(doc.formula(x, about).latex for x in entries) + ")")


def place(doc: Manuscript, at: Placement) -> Math:
    """Where a joint or closure sits in a body."""
    return point(doc, at.position, "joint point")


def closure(doc: Manuscript, x: Closure) -> Runs:
    """What a closure says."""
    first, second = (place(doc, at) for at in x.placements)
    return runs(
        "a point of {one} at {first} stays on a point of {other} at {second}",
        one=words(x.bodies[0]),
        first=first,
        other=words(x.bodies[1]),
        second=second,
    )


def driven(doc: Manuscript, x: Input) -> Runs:
    """What an input acts along, with its gear where it has one."""
    unit = names.unit(x.unit)
    measured = "" if unit == "–" else f" in {unit}"
    where = "acts along {velocity}" if x.velocity else "occurs in the formulas"
    text = list(runs(f"input{measured}, {where}", velocity=_velocity(doc, x.velocity)))
    if x.gear != ONE:
        text += [Text(", times "), doc.formula(x.gear, x.name)]
    if x.about:
        text.append(Text(f": {x.about}"))
    return tuple(text)


def _velocity(doc: Manuscript, name: str) -> Math | str:
    """A generalized velocity by its symbol."""
    return _symbol(doc, name, doc.v, doc.system.model.velocity_index)


def _coordinate(doc: Manuscript, name: str) -> Math | str:
    return _symbol(doc, name, doc.q, doc.system.model.coordinate_index)


def _symbol(
    doc: Manuscript, name: str, symbols: Sequence[Symbol], place: Callable[[str], int]
) -> Math | str:
    """What the formulas write for it; the name itself where they have no symbol."""
    try:
        return Math(doc.notation.latex[symbols[place(name)]])
    except ValueError:
        return name


def _no_slip(doc: Manuscript, x: NoSlip) -> Runs:
    return runs(
        "the point of {body} at {point} has no velocity along its direction {direction}",
        body=words(x.body),
        point=point(doc, x.point, x.name),
        direction=point(doc, x.direction, x.name),
    )


def _rolling(doc: Manuscript, x: Rolling) -> Runs:
    radius, normal = _measured(doc, x.radius, x.name, "m"), point(doc, x.normal, x.name)
    axis = point(doc, x.axis, x.name)
    about = "" if x.shape == "sphere" else " about its axis {axis}"
    of = "" if x.carrier == GROUND else f"of {words(x.carrier)} "
    ground = (
        f"the plane {of}normal to {{normal}}" if x.surface is None else f"a surface {of}".strip()
    )
    return runs(
        "{body}, a {shape} of radius {radius}" + about + f", rolls without slip on {ground}",
        body=words(x.body),
        shape=x.shape,
        radius=radius,
        axis=axis,
        normal=normal,
    )


def _formula(doc: Manuscript, x: Holonomic | Nonholonomic) -> Runs:
    left = doc.formula(x.expression, x.name)
    if x.nonideal:
        return left, Math("=0"), Text("; the constraint does work of its own")
    return left, Math("=0")


def _distance(doc: Manuscript, x: Distance) -> Runs:
    first, second = (point(doc, entries, x.name) for entries in x.points)
    return runs(
        "the points of {one} at {first} and of {other} at {second} stay apart by {length}",
        one=words(x.bodies[0]),
        first=first,
        other=words(x.bodies[1]),
        second=second,
        length=_measured(doc, x.length, x.name, "m"),
    )


def _measured(doc: Manuscript, x: Expression, about: str, unit: str) -> Math:
    """A formula, and the unit (LaTeX, upright) of one that is a number."""
    formula = doc.formula(x, about)
    if not unit or any(isinstance(part, Name) for part in walk(x)):
        return formula
    return Math(rf"{formula.latex}\;\mathrm{{{unit}}}")


def _joint_spring(doc: Manuscript, x: JointSpring) -> Runs:
    turns = _turns(doc.system.model.coordinates, x.coordinate, "rad")
    return runs(
        "spring on {coordinate}: stiffness {stiffness}, at rest at {rest}",
        coordinate=_coordinate(doc, x.coordinate),
        stiffness=_measured(doc, x.stiffness, x.name, r"N\,m/rad" if turns else "N/m"),
        rest=_measured(doc, x.rest, x.name, "rad" if turns else "m"),
    )


def _turns(declared: Sequence[Coordinate] | Sequence[Velocity], name: str, unit: str) -> bool:
    """Whether it is an angle, or an angular velocity."""
    return any(x.name == name and x.unit == unit for x in declared)


def _joint_damper(doc: Manuscript, x: JointDamper) -> Runs:
    turns = _turns(doc.system.model.velocities, x.velocity, "rad/s")
    unit = r"N\,m\,s/rad" if turns else r"N\,s/m"
    return runs(
        "damper on {velocity}: coefficient {coefficient}",
        velocity=_velocity(doc, x.velocity),
        coefficient=_measured(doc, x.coefficient, x.name, unit),
    )


def _point_spring(doc: Manuscript, x: PointSpring) -> Runs:
    return runs(
        "spring between {one} and {other}: stiffness {stiffness}, length {length}, damping "
        "{damping}",
        one=words(x.bodies[0]),
        other=words(x.bodies[1]),
        stiffness=_measured(doc, x.stiffness, x.name, "N/m"),
        length=_measured(doc, x.length, x.name, "m"),
        damping=_measured(doc, x.damping, x.name, r"N\,s/m"),
    )


def _tension(doc: Manuscript, x: Tension) -> Runs:
    return runs(
        "pull along the path {path}: {tension} N",
        path=words(x.path.name),
        tension=doc.formula(x.tension, x.name),
    )


def _contact(doc: Manuscript, x: Contact) -> Runs:
    return runs(
        "contact of {body}, a {shape}, with {what} of {carrier}: stiffness {stiffness}, damping "
        "{damping}, friction {friction}, smoothed below {smoothing} m/s",
        body=words(x.body),
        shape=x.shape,
        what="a plane" if x.surface is None else "a surface",
        carrier=words(x.carrier),
        stiffness=_measured(doc, x.stiffness, x.name, "N/m"),
        damping=_measured(doc, x.damping, x.name, "s/m"),
        friction=doc.formula(x.friction, x.name),
        smoothing=doc.formula(x.smoothing, x.name),
    )


def _force(doc: Manuscript, x: Force) -> Runs:
    return runs(
        "force on {body} at {point}: {force} N in {axes}",
        body=words(x.body),
        point=point(doc, x.point, x.name),
        force=point(doc, x.components, x.name),
        axes=_axes(x),
    )


def _torque(doc: Manuscript, x: Torque) -> Runs:
    return runs(
        "torque on {body}: {torque} N·m in {axes}",
        body=words(x.body),
        torque=_vector(doc, x.components, x.name),
        axes=_axes(x),
    )


def _exhaust(doc: Manuscript, x: Exhaust) -> Runs:
    return runs(
        "matter leaves {body} at {point} with {velocity} m/s relative to it, in its own axes",
        body=words(x.body),
        point=point(doc, x.point, x.name),
        velocity=point(doc, x.velocity, x.name),
    )


def _axes(x: Force | Torque) -> str:
    return "its own axes" if x.frame == "body" else "ground axes"


def _generalised(doc: Manuscript, x: GeneralisedForce) -> Runs:
    force = doc.formula(x.expression, x.name)
    velocity = _velocity(doc, x.velocity)
    return runs("generalised force along {velocity}: {force}", velocity=velocity, force=force)


def _listed(doc: Manuscript, x: Any) -> Runs:
    """Any other declaration: what it names, then every formula in it that is a quantity."""
    parts = [_field(doc, field.name, getattr(x, field.name)) for field in fields(x)]
    text: list[Run] = []
    for part in filter(None, parts):
        text += [Text("; ")] if text else []
        text += part
    return tuple(text)


def _field(doc: Manuscript, name: str, value: Any) -> Runs:
    """One field of a declaration; nothing where it is neither a name nor a quantity."""
    label = name.replace("_", " ")
    if name in NAMES:
        return (Text(words(value if isinstance(value, str) else ", ".join(value))),)
    if name in UNSAID:
        return ()
    if isinstance(value, Expression):
        return Text(f"{label} "), doc.formula(value, label)
    if _is_vector(value):
        return Text(f"{label} "), _vector(doc, value, label)
    return ()


def _is_vector(value: object) -> bool:
    if not isinstance(value, tuple):
        return False
    entries = cast(tuple[object, ...], value)
    return len(entries) == 3 and all(isinstance(x, Expression) for x in entries)


CONSTRAINTS: dict[type[Any], Callable[[Manuscript, Any], Runs]] = {
    NoSlip: _no_slip,
    Rolling: _rolling,
    Holonomic: _formula,
    Nonholonomic: _formula,
    Distance: _distance,
}
LOADS: dict[type[Any], Callable[[Manuscript, Any], Runs]] = {
    JointSpring: _joint_spring,
    JointDamper: _joint_damper,
    PointSpring: _point_spring,
    Tension: _tension,
    Contact: _contact,
    Force: _force,
    Torque: _torque,
    Exhaust: _exhaust,
    GeneralisedForce: _generalised,
}
