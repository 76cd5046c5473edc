"""Axes of joints and closures: one or two directions in the joint's frame, and how far a screw
advances along its own."""

from __future__ import annotations

from derive.expressions import tree
from derive.expressions.quantities import quantity
from derive.expressions.tree import ZERO, Expression, Number
from derive.model.document import Items, Key, Scalar
from derive.model.language.entries import ClosureEntry, JointEntry
from derive.model.limits import RIGHT_ANGLE
from derive.model.mechanism.placements import numbers
from derive.model.mechanism.space import constant_vector, normalised
from derive.model.reader import Reader
from derive.model.records import Vector3

_TURN = 6.283185307179586


def axis(
    reader: Reader, key: Key, entry: JointEntry | ClosureEntry, kind: str, needed: bool
) -> Vector3:
    """The joint's axis: a planar model's normal where it turns, what the file says where it
    slides."""
    space = reader.space
    turns = kind in ("revolute", "planar", "point")
    if entry.axis is None:
        if needed and not (space.plane and turns):
            wanted = f"axis: {', '.join(space.letters)} or a list of numbers"
            reader.report(key.span, f"the {kind} joint '{key}' has no axis", wanted)
        return space.normal
    if kind in ("fixed", "free", "ball"):
        reader.report(entry.axis.span, f"an axis of a {kind} joint", "no axis")
        return space.normal
    if space.plane and turns:
        return _turning_axis(reader, entry.axis, kind)
    given = reader.direction(entry.axis, "an axis")
    if kind in ("planar", "point") and isinstance(entry, JointEntry):
        _check_plane(reader, entry.axis, given, kind)
    return given


def _turning_axis(reader: Reader, node: Scalar | Items, kind: str) -> Vector3:
    letter = "xyz"[reader.space.normal_index]
    wanted = f"-{letter}" if reader.space.plane == "xz" else letter
    if not isinstance(node, Scalar) or node.text != wanted:
        reader.report(
            node.span, f"an axis of a {kind} joint in a planar model", f"no axis: it is {wanted}"
        )
    return reader.space.normal


def _check_plane(reader: Reader, node: Scalar | Items, given: Vector3, kind: str) -> None:
    if numbers(given) not in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)):
        wanted = "x, -y or z: the planes (y, z), (x, z) and (x, y)"
        reader.report(
            node.span, f"the axis of a {kind} joint", wanted, "turn the joint's frame with `rpy`"
        )


def axis2(
    reader: Reader, key: Key, entry: JointEntry | ClosureEntry, kind: str, first: Vector3
) -> Vector3 | None:
    """A universal joint's second axis: at right angles to the first, x, y and z in turn where the
    file does not say."""
    if kind != "universal":
        if entry.axis2 is not None:
            reader.report(entry.axis2.span, f"a second axis of a {kind} joint", "no axis2")
        return None
    a = numbers(first)
    if entry.axis2 is None:
        largest = max(range(3), key=lambda i: abs(a[i]))
        return _across(a, tuple(float(i == (largest + 1) % 3) for i in range(3)))
    given = numbers(reader.direction(entry.axis2, "a second axis"))
    along = sum(x * y for x, y in zip(a, given))
    if abs(along) > RIGHT_ANGLE:
        how = "parallel" if abs(along) > 1.0 - RIGHT_ANGLE else "not at right angles"
        reader.report(
            entry.axis2.span,
            f"the second axis of '{key}' is {how} to the first",
            "a direction at right angles to it",
        )
        return None
    return _across(a, given)


def _across(a: tuple[float, ...], b: tuple[float, ...]) -> Vector3:
    """The part of b at right angles to the unit vector a, of length one."""
    along = sum(x * y for x, y in zip(a, b))
    x, y, z = (q - along * p for p, q in zip(a, b))
    return normalised((x, y, z)) or constant_vector((0.0, 0.0, 1.0))


def pitch(reader: Reader, key: Key, entry: JointEntry | ClosureEntry, kind: str) -> Expression:
    """Metres per turn of a screw."""
    if kind != "screw":
        if entry.pitch is not None:
            reader.report(
                entry.pitch.span, f"the pitch of a {kind} joint", "no pitch: it belongs to a screw"
            )
        return ZERO
    if entry.pitch is None:
        reader.report(
            key.span, f"the screw '{key}' has no pitch", "pitch: the advance per turn, such as 5 mm"
        )
        return ZERO
    lead = _per_turn(reader, entry.pitch)
    if reader.value(lead, entry.pitch) == 0.0:
        wanted = "metres per turn, positive or negative"
        reader.report(
            entry.pitch.span,
            f"the pitch of '{key}' is zero",
            wanted,
            "without pitch it is a revolute joint",
        )
    return lead


def _per_turn(reader: Reader, scalar: Scalar) -> Expression:
    """The pitch in metres; a number in mm/rev or m/rad is per angle, and angles are plain numbers
    to the check of units."""
    plain = quantity(scalar.text)
    if plain is not None and plain.unit == "m/rad":
        return Number(plain.value * _TURN, "m")
    formula = reader.formula(scalar, "a pitch", unit="m")
    for node in tree.walk(formula):
        unit = reader.units.get(node.name, "") if isinstance(node, tree.Name) else ""
        if "rad" in unit:
            reader.report(scalar.span, f"a pitch in {unit}", "metres per turn, such as 5 mm")
    return formula
