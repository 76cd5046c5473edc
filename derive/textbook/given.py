"""What the model file says: parameters, bodies, joints, closures, constraints, loads, inputs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import fields

from derive.expressions.tree import ONE, Expression
from derive.mechanics.scene import IN_PLANE
from derive.model.records import (
    Body,
    Constraint,
    Distance,
    Force,
    GeneralisedForce,
    Holonomic,
    Input,
    Joint,
    JointDamper,
    JointSpring,
    Load,
    Nonholonomic,
    NoSlip,
    Parameter,
    Placement,
    PointSpring,
    Rolling,
    Torque,
)
from derive.textbook import names
from derive.textbook.author import Author
from derive.textbook.records import Math, Run, Runs, Text


def given(a: Author) -> None:
    """The section, one table per kind of thing that is there."""
    model = a.system.model
    a.section("Given")
    if model.description:
        a.say("{text}", text=model.description)
    _scene(a)
    if model.parameters:
        _parameters(a)
    if model.bodies:
        a.say(
            "The bodies, with centres of mass in body coordinates and moments of inertia about them, are"
        )
        a.table(
            ("body", "mass / kg", "centre of mass / m", "moment of inertia / kg·m²"),
            [_body(a, x) for x in model.bodies],
        )
        a.say("They are connected by joints, parents first:")
        a.table(
            ("joint", "type", "from → to", "at, in each body / m", "coordinates"),
            [_joint(a, x) for x in model.joints],
        )
    if model.kinetic is not None:
        energies = a.formula(model.kinetic, "given T"), a.formula(model.potential or 0.0, "given V")
        a.say(
            "The kinetic and the potential energy are given as $T=$ {T} and $V=$ {V}.",
            T=energies[0],
            V=energies[1],
        )
    _tied(a)
    _driven(a)


def _scene(a: Author) -> None:
    model = a.system.model
    if model.bodies:
        where = (
            f"moves in the {model.plane[0]}, {model.plane[1]} plane"
            if model.plane
            else "moves in space"
        )
        a.say(f"The mechanism {where}.")
    if model.gravity is not None:
        a.say("Gravity is $!g=$ {g} m/s².", g=_point(a, model.gravity, "gravity"))
        a.mean(r"!g", "gravity", "m/s^2")


def _point(a: Author, entries: Sequence[Expression], about: str) -> Math:
    """Components in the plane, or all three."""
    axes = IN_PLANE[a.system.model.plane]
    return Math("(" + r",\; ".join(a.formula(entries[k], about).latex for k in axes) + ")")


def _parameters(a: Author) -> None:
    model = a.system.model
    constant = [x for x in model.parameters if x.name in a.system.constants]
    a.say(
        "The parameters and their values are"
        + (" (numbers in all formulas below)" if constant and not a.p else "")
    )
    a.table(("symbol", "value", "unit", "meaning"), [_parameter(x) for x in model.parameters])
    for x, symbol in zip([x for x in model.parameters if x.name not in a.system.constants], a.p):
        a.mean(a.names[symbol], x.about or f"parameter {x.name}", x.unit)


def _parameter(x: Parameter) -> tuple[Runs, ...]:
    return (
        (Math(names.symbol(x.name)),),
        (Text(f"{x.value:.15g}"),),
        (Text(names.unit(x.unit)),),
        (Text(x.about),),
    )


def _body(a: Author, x: Body) -> tuple[Runs, ...]:
    about = f"body {x.name}"
    return (
        (Text(x.name),),
        (a.formula(x.mass, about),),
        (_point(a, x.com, about),),
        (_inertia(a, x, about),),
    )


def _inertia(a: Author, x: Body, about: str) -> Math:
    """One moment in the plane; in space the three principal ones, and the products where there are
    some."""
    axis = {"xy": 2, "xz": 1, "yz": 0}.get(a.system.model.plane)
    if axis is not None:
        return a.formula(x.inertia[axis], about)
    found = [
        f"I_{{{label}}}={a.formula(e, about).latex}"
        for label, e in zip(("xx", "yy", "zz", "xy", "xz", "yz"), x.inertia)
    ]
    shown = [f for k, f in enumerate(found) if k < 3 or not f.endswith("=0")]
    return Math(r",\; ".join(shown))


def _joint(a: Author, x: Joint) -> tuple[Runs, ...]:
    kind = f"{x.type}, {x.orientation}" if x.orientation else x.type
    where = (_place(a, x.at_parent), Text("; "), _place(a, x.at_child))
    own = [a.names[a.q[i]] for i, c in enumerate(a.system.model.coordinates) if c.owner == x.name]
    coordinates = Math(r",\; ".join(own)) if own else Text("none")
    return (Text(x.name),), (Text(kind),), (Text(f"{x.parent} → {x.child}"),), where, (coordinates,)


def _place(a: Author, at: Placement) -> Math:
    return _point(a, at.position, "joint point")


def _tied(a: Author) -> None:
    """Closures and constraints."""
    model = a.system.model
    rows = []
    for x in model.closures:
        first, second = (_place(a, at) for at in x.placements)
        about = (
            Text(f"a point of {x.bodies[0]} at "),
            first,
            Text(f" stays on a point of {x.bodies[1]} at "),
            second,
        )
        rows.append(((Text(x.name),), (Text(f"{x.type} closure"),), about))
    rows += [((Text(x.name),), (Text(_words(x)),), _constraint(a, x)) for x in model.constraints]
    if rows:
        a.say("The motion is tied by")
        a.table(("name", "kind", "what it says"), rows)


def _words(x: object) -> str:
    """NoSlip → no slip."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(x).__name__).lower()


def _constraint(a: Author, x: Constraint) -> Runs:
    match x:
        case NoSlip():
            point, direction = _point(a, x.point, x.name), _point(a, x.direction, x.name)
            return (
                Text(f"the point of {x.body} at "),
                point,
                Text(" has no velocity along its direction "),
                direction,
            )
        case Rolling():
            return _rolling(a, x)
        case Holonomic() | Nonholonomic():
            work = (Text("; the constraint does work of its own"),) if x.nonideal else ()
            return a.formula(x.expression, x.name), Math("=0"), *work
        case Distance():
            points = [_point(a, p, x.name) for p in x.points]
            start, between = (
                Text(f"the points of {x.bodies[0]} at "),
                Text(f" and of {x.bodies[1]} at "),
            )
            return (
                start,
                points[0],
                between,
                points[1],
                Text(" stay apart by "),
                a.formula(x.length, x.name),
            )
    return _listed(a, x)


def _rolling(a: Author, x: Rolling) -> Runs:
    radius, normal, axis = (
        a.formula(x.radius, x.name),
        _point(a, x.normal, x.name),
        _point(a, x.axis, x.name),
    )
    about = () if x.shape == "sphere" else (Text(" about its axis "), axis)
    start = Text(f"{x.body}, a {x.shape} of radius ")
    return start, radius, *about, Text(", rolls without slip on the plane normal to "), normal


def _listed(a: Author, x: object) -> Runs:
    """Any other declaration: its bodies and velocities by name, then every formula in it that is a
    quantity."""
    result: list[Run] = []
    for field in fields(x):  # type: ignore[arg-type]
        value, label = getattr(x, field.name), field.name.replace("_", " ")
        if field.name in ("body", "bodies", "velocity", "coordinate", "frame_body"):
            result += [Text(f"{', '.join((value,) if isinstance(value, str) else value)}; ")]
        elif isinstance(value, Expression) and field.name != "surface":
            result += [Text(f"{label} "), a.formula(value, label), Text("; ")]
        elif (
            isinstance(value, tuple)
            and len(value) == 3
            and all(isinstance(e, Expression) for e in value)
        ):
            result += [Text(f"{label} "), _vector(a, value, label), Text("; ")]
    return *result[:-1], Text(
        str(result[-1].text).rstrip("; ") if isinstance(result[-1], Text) else ""
    )


def _vector(a: Author, entries: Sequence[Expression], about: str) -> Math:
    return Math("(" + r",\; ".join(a.formula(e, about).latex for e in entries) + ")")


def _driven(a: Author) -> None:
    """Loads and inputs."""
    model = a.system.model
    rows = [((Text(x.name),), _load(a, x)) for x in model.loads]
    rows += [((Math(a.names[s]),), _input(a, x)) for s, x in zip(a.u, model.inputs)]
    for s, x in zip(a.u, model.inputs):
        a.mean(a.names[s], x.about or f"input {x.name}", x.unit)
    if rows:
        a.say("Applied forces and inputs are")
        a.table(("name", "what it does"), rows)


def _input(a: Author, x: Input) -> Runs:
    """What it acts along, with its gear where it has one."""
    unit = names.unit(x.unit)
    where = f"acts along {x.velocity}" if x.velocity else "occurs in the formulas"
    start = Text(f"input{'' if unit == '–' else ' in ' + unit}, {where}")
    gear = () if x.gear == ONE else (Text(", times "), a.formula(x.gear, x.name))
    return start, *gear, *((Text(f": {x.about}"),) if x.about else ())


def _load(a: Author, x: Load) -> Runs:
    match x:
        case JointSpring():
            stiffness, rest = a.formula(x.stiffness, x.name), a.formula(x.rest, x.name)
            return (
                Text(f"spring on {x.coordinate}: stiffness "),
                stiffness,
                Text(", at rest at "),
                rest,
            )
        case JointDamper():
            return Text(f"damper on {x.velocity}: coefficient "), a.formula(x.coefficient, x.name)
        case PointSpring():
            parts = [a.formula(e, x.name) for e in (x.stiffness, x.length, x.damping)]
            start = Text(f"spring between {x.bodies[0]} and {x.bodies[1]}: stiffness ")
            return start, parts[0], Text(", length "), parts[1], Text(", damping "), parts[2]
        case Force():
            point, force = _point(a, x.point, x.name), _point(a, x.components, x.name)
            return (
                Text(f"force on {x.body} at "),
                point,
                Text(": "),
                force,
                Text(f" N in {_axes(x)}"),
            )
        case Torque():
            return (
                Text(f"torque on {x.body}: "),
                _vector(a, x.components, x.name),
                Text(f" N·m in {_axes(x)}"),
            )
        case GeneralisedForce():
            return Text(f"generalised force along {x.velocity}: "), a.formula(x.expression, x.name)
    return Text(f"{_words(x)} of "), *_listed(a, x)


def _axes(x: Force | Torque) -> str:
    return "its own axes" if x.frame == "body" else "ground axes"
