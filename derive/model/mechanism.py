"""Bodies, joints and closures: the tree from the ground, where its joints sit, and whether its masses can exist."""

from __future__ import annotations

from derive.diagnostics import did_you_mean, listed
from derive.expressions.tree import ZERO, Expression, Number
from derive.model.document import Items, Key, Scalar
from derive.model.frames import Frame
from derive.model.reader import Reader
from derive.model.records import GROUND, Body, Closure, Joint, Placement, Span, Vector3
from derive.model.schema import BodyEntry, ClosureEntry, Document, JointEntry
from derive.model.space import ORIGIN, Rotation, roll_pitch_yaw, turned_about

Inertia = tuple[Expression, Expression, Expression, Expression, Expression, Expression]
POINT_MASS: Inertia = (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)
INERTIA_UNIT = "kg*m^2"
_SLACK = 1e-9  # relative: a thin disk has Ixx + Izz = Iyy exactly, up to rounding


def body(reader: Reader, key: Key, entry: BodyEntry) -> Body:
    """One body, checked with the parameters' defaults."""
    mass = reader.formula(entry.mass, "a mass", unit="kg")
    com = reader.point(entry.com, "a centre of mass")
    inertia = POINT_MASS if entry.inertia is None else _inertia(reader, entry.inertia)
    _check_mass(reader, key, entry, mass, inertia)
    return Body(str(key), mass, com, inertia, key.span)


def _inertia(reader: Reader, node: Scalar | Items) -> Inertia:
    if isinstance(node, Scalar):
        return _one_moment(reader, reader.formula(node, "a moment of inertia", unit=INERTIA_UNIT))
    entries = [reader.formula(entry, "a moment of inertia", unit=INERTIA_UNIT) for entry in node]
    if reader.space.plane and len(entries) == 1:
        return _one_moment(reader, entries[0])
    if reader.space.plane or len(entries) not in (3, 6):
        wanted = "one moment of inertia" if reader.space.plane else "one, three [xx, yy, zz] or six [xx, yy, zz, xy, xz, yz]"
        reader.report(node.span, f"{len(entries)} moments of inertia", wanted)
        return POINT_MASS
    entries += [ZERO] * (6 - len(entries))
    return (entries[0], entries[1], entries[2], entries[3], entries[4], entries[5])


def _one_moment(reader: Reader, moment: Expression) -> Inertia:
    """About the normal of a planar model; the same about every axis in space."""
    only = reader.space.normal_index if reader.space.plane else None
    diagonal = [moment if only in (None, axis) else ZERO for axis in range(3)]
    return (diagonal[0], diagonal[1], diagonal[2], ZERO, ZERO, ZERO)


def _check_mass(reader: Reader, key: Key, entry: BodyEntry, mass: Expression, inertia: Inertia) -> None:
    given = reader.value(mass, entry.mass)
    if given is not None and given < 0.0:
        reader.report(entry.mass.span, f"the mass of '{key}' is {given:g} kg", "zero or more")
    if entry.inertia is None:
        return
    scalars = [entry.inertia] if isinstance(entry.inertia, Scalar) else list(entry.inertia)
    moments = [0.0 if moment == ZERO else reader.value(moment, scalars[0]) for moment in inertia]
    numbers = [moment for moment in moments if moment is not None]
    if len(numbers) == 6:
        _check_moments(reader, key, entry.inertia.span, given, numbers)


def _check_moments(reader: Reader, key: Key, span: Span, mass: float | None, moments: list[float]) -> None:
    if mass == 0.0 and any(moments):
        reader.report(span, f"'{key}' has inertia but no mass", "inertia 0 for a body without mass")
    if min(moments[:3]) < 0.0:
        reader.report(span, f"a moment of inertia of '{key}' is {min(moments[:3]):g} kg*m^2", "zero or more")
    elif not reader.space.plane:
        low, middle, high = _principal(moments)
        if low < -_SLACK * high:
            reader.report(span, f"a principal moment of inertia of '{key}' is {low:g} kg*m^2", "zero or more")
        elif low + middle < high * (1.0 - _SLACK):
            problem = f"no body has the inertia of '{key}': {low:g} + {middle:g} < {high:g} kg*m^2"
            reader.report(span, problem, "the largest principal moment at most the sum of the other two")


def _principal(moments: list[float]) -> tuple[float, float, float]:
    import numpy as np

    xx, yy, zz, xy, xz, yz = moments
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(low), float(middle), float(high)


def ordered(reader: Reader, document: Document, frames: list[Frame]) -> list[Frame]:
    """The joints, parents before children; reports what is not a tree from the ground."""
    by_child: dict[str, Frame] = {}
    before = len(reader.problems)
    for frame in frames:
        _check_ends(reader, document, frame)
        child = frame.entry.child
        if child.text in by_child:
            other = by_child[child.text].name
            problem = f"'{child.text}' is already the child of the joint '{other}', line {other.span.line}"
            reader.report(child.span, problem, "one joint per child", "a joint that closes a loop goes under `closures:`")
        by_child.setdefault(child.text, frame)
    for key in document.bodies:
        reader.name(key)
    if len(reader.problems) == before:  # else most of it would be said twice
        _check_bodies(reader, document, by_child)
    return _by_depth(frames, by_child)


def _check_ends(reader: Reader, document: Document, frame: Frame) -> None:
    parent, child = frame.entry.parent, frame.entry.child
    reader.word(parent, [*document.bodies, GROUND], "body")
    if child.text == GROUND:
        reader.report(child.span, "the ground as a child", f"a body; {GROUND} can only be a parent")
    else:
        reader.word(child, document.bodies, "body")
    if parent.text == child.text:
        reader.report(child.span, f"the joint '{frame.name}' joins '{child.text}' to itself", "two bodies")


def _check_bodies(reader: Reader, document: Document, by_child: dict[str, Frame]) -> None:
    grounded = {GROUND}
    for key in document.bodies:
        if key not in by_child:
            hint = f"a {'planar' if reader.space.plane else 'free'} joint lets it move freely"
            reader.report(key.span, f"no joint carries the body '{key}'", f"a joint with child: {key}", hint)
        elif not _reaches_ground(key, by_child, grounded):
            reader.report(key.span, f"the body '{key}' is not connected to the ground", "a chain of joints from the ground")


def _reaches_ground(name: str, by_child: dict[str, Frame], grounded: set[str]) -> bool:
    seen: set[str] = set()
    while name in by_child and name not in seen and name not in grounded:
        seen.add(name)
        name = by_child[name].entry.parent.text
    if name in seen:
        return False
    grounded |= seen  # a name that nothing carries is reported for itself, not for those it carries
    return True


def _by_depth(frames: list[Frame], by_child: dict[str, Frame]) -> list[Frame]:
    """The order of the file, but each joint after the one that carries its parent."""
    placed: dict[str, Frame] = {}
    for frame in frames:
        chain = []
        while frame is not None and frame.name not in placed and len(chain) < len(frames):
            chain.append(frame)
            frame = by_child.get(frame.entry.parent.text)
        placed |= {link.name: link for link in reversed(chain)}
    return list(placed.values())


def joint(reader: Reader, frame: Frame) -> Joint:
    """Where a joint sits and which way it goes."""
    entry, kind = frame.entry, frame.type.name
    at_parent, at_child = _points(reader, entry.at)
    return Joint(
        name=str(frame.name),
        type=kind,
        parent=entry.parent.text,
        child=entry.child.text,
        at_parent=Placement(at_parent, rotation(reader, entry)),
        at_child=Placement(at_child, None),
        axis=axis(reader, frame.name, entry, kind, frame.type.needs_axis),
        coordinates=tuple(coordinate.name for coordinate in frame.coordinates),
        velocities=tuple(velocity.name for velocity in frame.velocities),
        orientation=frame.orientation,
        span=frame.name.span,
    )


def _points(reader: Reader, at: Items | list[Items] | None) -> tuple[Vector3, Vector3]:
    """The joint's place in the parent and in the child."""
    if at is None:
        return ORIGIN, ORIGIN
    if isinstance(at, Items):
        return reader.point(at, "a point"), ORIGIN
    return reader.point(at[0], "a point"), reader.point(at[1], "a point")


def rotation(reader: Reader, entry: JointEntry | ClosureEntry) -> Rotation | None:
    """How the joint's frame is turned: `angle` in a plane, `rpy` in space; numbers only."""
    wrong = entry.rpy if reader.space.plane else entry.angle
    if wrong is not None:
        given, wanted = ("rpy", "angle") if reader.space.plane else ("angle", "rpy")
        reader.report(wrong.span, f"'{given}' in {'a planar model' if reader.space.plane else 'space'}", wanted)
    elif entry.angle is not None:
        return turned_about(_numbers(reader.space.normal), _angle(reader, entry.angle))
    elif entry.rpy is not None and _three(reader, entry.rpy):
        roll, pitch, yaw = (_angle(reader, angle) for angle in entry.rpy)
        return roll_pitch_yaw(roll, pitch, yaw)
    return None


def _three(reader: Reader, angles: Items) -> bool:
    if len(angles) != 3:
        reader.report(angles.span, f"{len(angles)} angles", "three: [roll, pitch, yaw]")
    return len(angles) == 3


def _angle(reader: Reader, scalar: Scalar) -> float:
    formula = reader.formula(scalar, "an angle", frozenset(), unit="rad")
    value = reader.value(formula, scalar)
    return 0.0 if value is None else value


def _numbers(vector: Vector3) -> tuple[float, float, float]:
    a, b, c = (component.value if isinstance(component, Number) else 0.0 for component in vector)
    return (a, b, c)


def axis(reader: Reader, key: Key, entry: JointEntry | ClosureEntry, kind: str, needed: bool) -> Vector3:
    """The joint's axis: a planar model's normal where it turns, what the file says where it slides."""
    space = reader.space
    turns = kind in ("revolute", "planar")
    if entry.axis is None:
        if needed and not (space.plane and turns):
            reader.report(
                key.span, f"the {kind} joint '{key}' has no axis", f"axis: {', '.join(space.letters)} or a list of numbers"
            )
        return space.normal
    if kind in ("fixed", "free"):
        reader.report(entry.axis.span, f"an axis of a {kind} joint", "no axis")
        return space.normal
    return _turning_axis(reader, entry.axis, kind) if space.plane and turns else _spatial_axis(reader, entry.axis, kind)


def _turning_axis(reader: Reader, node: Scalar | Items, kind: str) -> Vector3:
    letter = "xyz"[reader.space.normal_index]
    wanted = f"-{letter}" if reader.space.plane == "xz" else letter
    if not isinstance(node, Scalar) or node.text != wanted:
        reader.report(node.span, f"an axis of a {kind} joint in a planar model", f"no axis: it is {wanted}")
    return reader.space.normal


def _spatial_axis(reader: Reader, node: Scalar | Items, kind: str) -> Vector3:
    given = reader.direction(node, "an axis")
    if kind == "planar" and _numbers(given) not in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)):
        reader.report(
            node.span,
            "the axis of a planar joint",
            "x, -y or z: the planes (y, z), (x, z) and (x, y)",
            "turn the joint's frame with `rpy`",
        )
    return given


def closure(reader: Reader, document: Document, key: Key, entry: ClosureEntry) -> Closure:
    """A joint that closes a loop."""
    from derive.joints import JOINTS

    useless = ("free", "planar") if reader.space.plane else ("free",)
    kinds = {kind.name: kind for kind in JOINTS if kind.name not in useless}
    kind = reader.word(entry.type, kinds, "type of closure") or "revolute"
    first, second = bodies(reader, document, key, entry.between)
    at_first, at_second = reader.point(entry.at[0], "a point"), reader.point(entry.at[1], "a point")
    placements = (Placement(at_first, rotation(reader, entry)), Placement(at_second, None))
    along = axis(reader, key, entry, kind, kinds[kind].needs_axis)
    return Closure(reader.name(key), kind, (first, second), placements, along, key.span)


def bodies(reader: Reader, document: Document, key: Key, between: Items) -> tuple[str, str]:
    """Two different bodies, one of which may be the ground."""
    if len(between) != 2:
        reader.report(between.span, f"'{key}' is between {len(between)} bodies", "two bodies")
        return GROUND, GROUND
    first, second = (some_body(reader, document, name) for name in between)
    if first == second and first in (*document.bodies, GROUND):
        reader.report(between.span, f"'{key}' is between '{first}' and itself", "two bodies")
    return first, second


def some_body(reader: Reader, document: Document, name: Scalar, ground: bool = True) -> str:
    """The name of a body that exists."""
    known = [*document.bodies, GROUND] if ground else list(document.bodies)
    if name.text not in known:
        reader.report(name.span, f"unknown body '{name.text}'", listed(known), did_you_mean(name.text, known))
    return name.text
