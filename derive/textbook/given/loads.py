"""What a load of the model does, in a sentence each; values have their unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from derive.expressions.tree import ZERO, Expression
from derive.model.actuators import per_acceleration
from derive.model.load_records import (
    Armature,
    BallSpring,
    Bushing,
    Contact,
    Exhaust,
    Force,
    GeneralisedForce,
    JointDamper,
    JointFriction,
    JointSpring,
    PointSpring,
    Tension,
    Torque,
    Wrench,
)
from derive.model.loads.places import per
from derive.model.mechanism.named_frames import frame_named
from derive.model.reader import force_unit
from derive.model.records import GROUND, Coordinate, Path, Velocity, Waypoint
from derive.textbook.given.sentences import (
    about_normal,
    called,
    coordinate,
    in_plane,
    is_nothing,
    joined,
    kind,
    listed,
    measured,
    measured_point,
    measured_vector,
    place,
    point,
    velocity,
)
from derive.textbook.given.surfaces import shape, touched
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.prose import runs
from derive.textbook.records import Math, Runs, Text

PACEJKA = 4  # coefficients of the curve of a tyre that is not linear
PRESSURE = (
    r"Where a contact is $\delta$ deep, it presses with $k\,\delta\,\max(0,\; 1+d\,\dot\delta)$; "
    r"$k$ is the stiffness, $d$ the damping."
)
HEIGHT = r"Above a surface $f=0$ the height is taken for $f/\left|\nabla f\right|$."
FRICTION = (
    r"Friction is the pressure times the friction coefficient, times "
    r"$!v/\sqrt{v^2+\varepsilon^2}$ against the slip $!v$."
)
TYRE = (
    r"Of a tyre, $s=(r\,\omega-v)/\sqrt{v^2+\varepsilon^2}$ is the slip of the rim against the "
    r"speed of travel $v$; the force acts against it."
)
ACROSS = (
    r"The slip angle $\alpha$ has the tangent $u/\sqrt{v^2+\varepsilon^2}$, with the speed $u$ "
    r"across the wheel. The force acts against it."
)


def load(doc: Manuscript, x: Any) -> Runs:
    """What a load does; one without a sentence of its own is listed."""
    write = LOADS.get(x.__class__)
    return write(doc, x) if write else (Text(f"{kind(x)} of "), *listed(doc, x))


def laws(doc: Manuscript) -> None:
    """What contacts have in common."""
    found = [x for x in doc.system.model.loads if isinstance(x, Contact)]
    told = (
        (PRESSURE, bool(found)),
        (HEIGHT, any(x.surface is not None for x in found)),
        (FRICTION, any(x.friction != ZERO for x in found)),
        (TYRE, any(x.tyre for x in found)),
        (ACROSS, any(x.tyre for x in found) and not doc.system.model.plane),
    )
    if found:
        doc.say(" ".join(sentence for sentence, there in told if there))


def _unit_of(declared: Sequence[Coordinate] | Sequence[Velocity], name: str) -> str:
    """Of a coordinate or a generalized velocity."""
    return next((x.unit for x in declared if x.name == name), "")


def _rate_unit(doc: Manuscript, name: str) -> str:
    """Of a generalized velocity, or of the rate of a coordinate that is none."""
    model = doc.system.model
    return _unit_of((*model.velocities, *model.other_rates.values()), name)


def _joint_spring(doc: Manuscript, x: JointSpring) -> Runs:
    unit = _unit_of(doc.system.model.coordinates, x.coordinate)
    return runs(
        "spring on {coordinate}: stiffness {stiffness}, at rest at {rest}",
        coordinate=coordinate(doc, x.coordinate),
        stiffness=measured(doc, x.stiffness, x.name, per(force_unit(f"{unit or '1'}/s"), unit)),
        rest=measured(doc, x.rest, x.name, unit),
    )


def _ball_spring(doc: Manuscript, x: BallSpring) -> Runs:
    equal = len(set(x.stiffness)) == 1
    size = (
        measured(doc, x.stiffness[0], x.name, "N*m/rad")
        if equal
        else measured_vector(doc, x.stiffness, x.name, "N*m/rad")
    )
    turn = "the angle it has turned by" if equal else "the components of its rotation vector"
    return runs(
        "spring in the ball joint {joint}: stiffness {size}, times {turn}",
        joint=called(x.joint),
        size=size,
        turn=turn,
    )


def _per_rate(doc: Manuscript, name: str) -> str:
    """The unit of a force per generalized velocity."""
    unit = _rate_unit(doc, name)
    return per(force_unit(unit), unit)


def _joint_damper(doc: Manuscript, x: JointDamper) -> Runs:
    return runs(
        "damper on {velocity}: coefficient {coefficient}",
        velocity=velocity(doc, x.velocity),
        coefficient=measured(doc, x.coefficient, x.name, _per_rate(doc, x.velocity)),
    )


def _joint_friction(doc: Manuscript, x: JointFriction) -> Runs:
    """Against a generalized velocity: what is proportional to it, and what is not."""
    unit, rate = _rate_unit(doc, x.velocity), velocity(doc, x.velocity)
    viscous = runs(
        "viscous coefficient {value}",
        value=measured(doc, x.viscous, x.name, _per_rate(doc, x.velocity)),
    )
    dry = runs(
        "dry friction {force}, times the hyperbolic tangent of {rate} over {smoothing}",
        force=measured(doc, x.coulomb, x.name, force_unit(unit)),
        rate=rate,
        smoothing=measured(doc, x.smoothing, x.name, unit),
    )
    parts = [viscous if x.viscous != ZERO else (), dry if x.coulomb != ZERO else ()]
    return runs("friction against {rate}: ", rate=rate) + joined(parts)


def _armature(doc: Manuscript, x: Armature) -> Runs:
    """M is larger by it in one place of the diagonal."""
    unit = per_acceleration(_unit_of(doc.system.model.velocities, x.velocity))
    return runs(
        "the inertia {inertia} is added to what is felt along {velocity}",
        inertia=measured(doc, x.inertia, x.name, unit),
        velocity=velocity(doc, x.velocity),
    )


def _point_spring(doc: Manuscript, x: PointSpring) -> Runs:
    """Between two points; without stiffness it is a damper."""
    first, second = (point(doc, entries, x.name) for entries in x.points)
    spring = x.stiffness != ZERO
    start = runs(
        "{kind} between {one} at {first} and {other} at {second}: ",
        kind="spring" if spring else "damper",
        one=called(x.bodies[0]),
        first=first,
        other=called(x.bodies[1]),
        second=second,
    )
    parts = [
        _quantity(doc, x, "stiffness", x.stiffness, "N/m") if spring else (),
        _quantity(doc, x, "length", x.length, "m") if spring else (),
        _quantity(doc, x, "damping" if spring else "coefficient", x.damping, "N*s/m"),
    ]
    return start + joined(parts, ", ")


def _quantity(doc: Manuscript, x: Any, label: str, value: Expression, unit: str) -> Runs:
    """stiffness 5 N/m; nothing where there is none of it, but for a length."""
    if value == ZERO and label != "length":
        return ()
    return Text(f"{label} "), measured(doc, value, x.name, unit)


def _bushing(doc: Manuscript, x: Bushing) -> Runs:
    """Coefficients along and about the axes of the first body's frame."""
    start = runs(
        "springs and dampers between frames of {one} at {first} and of {other} at {second}: ",
        one=called(x.bodies[0]),
        first=place(doc, x.placements[0]),
        other=called(x.bodies[1]),
        second=place(doc, x.placements[1]),
    )
    along = (
        ("stiffness", in_plane(doc, x.stiffness), "N/m"),
        ("damping", in_plane(doc, x.damping), "N*s/m"),
    )
    about = (
        ("torsional stiffness", _sizes(doc, x.torsion), "N*m/rad"),
        ("torsional damping", _sizes(doc, x.torsion_damping), "N*m*s/rad"),
    )
    parts = [
        (Text(f"{label} "), measured_vector(doc, entries, x.name, unit))
        for label, entries, unit in (*along, *about)
        if not is_nothing(entries)
    ]
    axes = runs(", along the axes of the frame of {one}", one=called(x.bodies[0]))
    return start + joined(parts, ", ") + axes


def _sizes(doc: Manuscript, entries: Sequence[Expression]) -> list[Expression]:
    """Coefficients about the axes: in a plane the one that is not zero."""
    if not doc.system.model.plane:
        return list(entries)
    return [next((x for x in entries if x != ZERO), ZERO)]


def _tension(doc: Manuscript, x: Tension) -> Runs:
    start = runs(
        "pull of {tension} along the shortest path ", tension=measured(doc, x.tension, x.name, "N")
    )
    return start + _path(doc, x.path)


def _path(doc: Manuscript, path: Path) -> Runs:
    """From its first point over all others to its last."""
    first, *rest = path.points
    ways = ["to"] * len(rest) if len(rest) == 1 else [*["over"] * (len(rest) - 1), "to"]
    stations = [_station(doc, path, way, x) for way, x in zip(("from", *ways), (first, *rest))]
    return joined(stations, ", ")


def _station(doc: Manuscript, path: Path, way: str, x: Waypoint) -> Runs:
    """A point, or a pulley with the way the path goes round it."""
    at = {"body": called(x.body), "point": point(doc, x.point, path.name)}
    if x.radius == ZERO:
        return runs(way + " {point} of {body}", **at)
    more = f" and {x.turns} whole turns more" if x.turns else ""
    about = "" if doc.system.model.plane else " about {axis}"
    turn = "counter-clockwise" if x.side > 0 else "clockwise"
    return runs(
        f"{way} a pulley about {{point}} of {{body}}, of radius {{radius}}, {turn}{about}{more}",
        radius=measured(doc, x.radius, path.name, "m"),
        axis=point(doc, x.axis, path.name),
        **at,
    )


def _contact(doc: Manuscript, x: Contact) -> Runs:
    """The law of Hunt and Crossley, and what acts along the ground."""
    pressure = [
        _quantity(doc, x, "stiffness", x.stiffness, "N/m"),
        _quantity(doc, x, "damping", x.damping, "s/m"),
    ]
    return (
        *shape(doc, x),
        Text(" presses on "),
        *touched(doc, x),
        Text(": "),
        *joined([*pressure, _tyre(doc, x) if x.tyre else _rubbing(doc, x)], ", "),
    )


def _rubbing(doc: Manuscript, x: Contact) -> Runs:
    if x.friction == ZERO:
        return ()
    return runs(
        r"friction coefficient {friction}, $\varepsilon=$ {smoothing}",
        friction=doc.formula(x.friction, x.name),
        smoothing=measured(doc, x.smoothing, x.name, "m/s"),
    )


def _tyre(doc: Manuscript, x: Contact) -> Runs:
    """Forces per pressure over the two slips; in a plane there is no sideways."""
    letters = ("s",) if doc.system.model.plane else ("s", r"\alpha")
    along = runs(
        "force per pressure {curve} along the wheel",
        curve=_curve(doc, x, x.tyre[0], letters[0]),
    )
    across = () if len(letters) == 1 else runs(
        "{curve} across it",
        curve=_curve(doc, x, x.tyre[1], letters[1]),
    )  # fmt: skip
    slow = runs(r"$\varepsilon=$ {smoothing}", smoothing=measured(doc, x.smoothing, x.name, "m/s"))
    return joined([along, across, slow], ", ")


def _curve(doc: Manuscript, x: Contact, law: Sequence[Expression], s: str) -> Math:
    """B s, or the magic formula of Pacejka."""
    numbers = [doc.formula(entry, x.name).latex for entry in law]
    if len(numbers) < PACEJKA:
        return Math("0" if law[0] == ZERO else rf"{numbers[0]}\, {s}")
    B, C, D, E = numbers
    slip = rf"{B}\, {s}"
    inside = rf"{slip} - {E} \left({slip} - \arctan\left({slip}\right)\right)"
    height = "" if D == "1" else rf"{D}\, "
    return Math(rf"{height}\sin\left({C} \arctan\left({inside}\right)\right)")


def _force(doc: Manuscript, x: Force) -> Runs:
    return runs(
        "force on {body} at {point}: {force}, in {axes}",
        body=called(x.body),
        point=point(doc, x.point, x.name),
        force=measured_point(doc, x.components, x.name, "N"),
        axes=_axes(x.frame, "body"),
    )


def _torque(doc: Manuscript, x: Torque) -> Runs:
    """In a plane there is no axis to name."""
    axes = "" if doc.system.model.plane else f", in {_axes(x.frame, 'body')}"
    return runs(
        "torque on {body}: {torque}{axes}",
        body=called(x.body),
        torque=measured_vector(doc, about_normal(doc, x.components), x.name, "N*m"),
        axes=axes,
    )


def _wrench(doc: Manuscript, x: Wrench) -> Runs:
    """At the origin of its frame, along the axes of this or of the ground."""
    frame, moment = frame_named(doc.system.model, x.frame), about_normal(doc, x.moment)
    start = runs(
        "wrench on {body} at {point}: ", body=called(frame.body), point=place(doc, frame.at)
    )
    parts = [
        () if is_nothing(x.force) else
        (Text("force "), measured_point(doc, x.force, x.name, "N")),
        () if is_nothing(moment) else
        (Text("moment "), measured_vector(doc, moment, x.name, "N*m")),
    ]  # fmt: skip
    own = "its own axes" if frame.at.rotation is None else "the axes of its frame"
    axes = own if x.axes == "frame" else _axes(x.axes, "frame")
    return start + joined(parts, ", ") + runs(", in {axes}", axes=axes)


def _axes(frame: str, own: str) -> str:
    if frame == GROUND:
        return "ground axes"
    return "its own axes" if frame == own else f"the axes of {words(frame)}"


def _exhaust(doc: Manuscript, x: Exhaust) -> Runs:
    return runs(
        "matter leaves {body} at {point} with {velocity} relative to it, in its own axes",
        body=called(x.body),
        point=point(doc, x.point, x.name),
        velocity=measured_point(doc, x.velocity, x.name, "m/s"),
    )


def _generalised(doc: Manuscript, x: GeneralisedForce) -> Runs:
    unit = force_unit(_rate_unit(doc, x.velocity))
    return runs(
        "generalised force along {velocity}: {force}",
        velocity=velocity(doc, x.velocity),
        force=measured(doc, x.expression, x.name, unit),
    )


LOADS: dict[type[Any], Callable[[Manuscript, Any], Runs]] = {
    JointSpring: _joint_spring,
    BallSpring: _ball_spring,
    JointDamper: _joint_damper,
    JointFriction: _joint_friction,
    Armature: _armature,
    PointSpring: _point_spring,
    Bushing: _bushing,
    Tension: _tension,
    Contact: _contact,
    Force: _force,
    Torque: _torque,
    Wrench: _wrench,
    Exhaust: _exhaust,
    GeneralisedForce: _generalised,
}
