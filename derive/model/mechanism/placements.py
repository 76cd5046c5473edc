"""Where joint frames sit in bodies: points, and turns given as an angle, as roll, pitch and yaw,
about an axis or as a matrix."""

from __future__ import annotations

from typing import Any

import numpy as np

from derive.diagnostics import listed
from derive.expressions.evaluate import is_constant
from derive.expressions.tree import Call, Expression, Number
from derive.model import algebra
from derive.model.document import Items, Key, Scalar
from derive.model.language.place_entries import SideEntry, SidesEntry, TurnedEntry
from derive.model.limits import ORTHOGONAL
from derive.model.mechanism.space import Rotation, snapped, turned_about
from derive.model.reader import Reader
from derive.model.records import Placement, Vector3

TURNS = ("angle", "rpy", "axis_angle", "matrix")
Place = Items | list[Any] | SidesEntry | None


def placements(
    reader: Reader, key: Key, at: Place, entry: TurnedEntry | None = None
) -> tuple[Placement, Placement]:
    """The two sides of a joint, closure or bushing: body ← joint frame, origin in m. Keys beside
    `at` turn the frame in the first body."""
    sides = _sides(at)
    first, second = (_placement(reader, side) for side in sides)
    beside = None if entry is None else rotation(reader, entry)
    if beside is None:
        return first, second
    if first.rotation is not None:
        reader.report(key.span, f"the frame of '{key}' is turned twice", "one of the two turns")
    return Placement(first.position, beside), second


def _sides(at: Place) -> list[Any]:
    if at is None:
        return [None, None]
    if isinstance(at, SidesEntry):
        return [at.parent, at.child]
    return [at, None] if isinstance(at, Items) else at


def _placement(reader: Reader, side: Items | SideEntry | None) -> Placement:
    if isinstance(side, SideEntry):
        return Placement(reader.point(side.position, "a point"), rotation(reader, side))
    return Placement(reader.point(side, "a point"), None)


def rotation(reader: Reader, entry: TurnedEntry) -> Rotation | None:
    """How a frame is turned, in a plane by `angle` alone; None where it is not."""
    given = [name for name in TURNS if getattr(entry, name) is not None]
    if not given:
        return None
    name = given[0]
    if len(given) > 1:
        reader.report(
            getattr(entry, given[1]).span, f"'{given[1]}' beside '{name}'", "one of the two"
        )
    elif (name == "angle") != bool(reader.space.plane):
        where, wanted = (
            ("a planar model", "angle") if reader.space.plane else ("space", listed(TURNS[1:]))
        )
        reader.report(getattr(entry, name).span, f"'{name}' in {where}", wanted)
    else:
        result = _READERS[name](reader, getattr(entry, name))
        return None if result == algebra.IDENTITY else result
    return None


def _angle(reader: Reader, scalar: Scalar) -> Rotation:
    return _about(reader.space.normal, _angle_of(reader, scalar))


def _angle_of(reader: Reader, scalar: Scalar) -> Expression:
    """A formula of parameters; a number where it holds none."""
    formula = reader.formula(scalar, "an angle", unit="rad")
    value = reader.value(formula, scalar) if is_constant(formula) else None
    return formula if value is None else Number(value)


def _rpy(reader: Reader, angles: Items) -> Rotation | None:
    """Rz(yaw) Ry(pitch) Rx(roll), the convention of URDF."""
    if len(angles) != 3:
        reader.report(angles.span, f"{len(angles)} angles", "three: [roll, pitch, yaw]")
        return None
    roll, pitch, yaw = (_angle_of(reader, angle) for angle in angles)
    about_x, about_y, about_z = (
        _about(axis, angle) for axis, angle in zip(algebra.IDENTITY, (roll, pitch, yaw))
    )
    return snapped(algebra.product(about_z, algebra.product(about_y, about_x)))


def _about(axis: Vector3, angle: Expression) -> Rotation:
    """Rodrigues; by numbers where the angle is one, else as a formula of parameters."""
    if isinstance(angle, Number) and angle.value == 0.0:
        return algebra.IDENTITY
    if isinstance(angle, Number):
        return turned_about(numbers(axis), angle.value)
    s, c = Call("sin", (angle,)), Call("cos", (angle,))
    x, y, z = axis
    zero = algebra.constant(0.0)
    skew = (
        (zero, algebra.negated(z), y),
        (z, zero, algebra.negated(x)),
        (algebra.negated(y), x, zero),
    )

    def entry(i: int, j: int) -> Expression:
        """Entry (i, j) of Rodrigues' formula n nᵀ + (1 − n nᵀ) cos α + [n]ₓ sin α."""
        along = algebra.times(axis[i], axis[j])
        across = algebra.minus(algebra.constant(float(i == j)), along)
        return algebra.plus(along, algebra.times(across, c), algebra.times(skew[i][j], s))

    return algebra.rows([[entry(i, j) for j in algebra.AXES] for i in algebra.AXES])


def _axis_angle(reader: Reader, pair: Items) -> Rotation | None:
    if len(pair) != 2 or not isinstance(pair[0], Scalar | Items) or not isinstance(pair[1], Scalar):
        reader.report(
            pair.span,
            "this is not an axis and an angle",
            "[axis, angle], such as [z, 30 deg] or [[1, 1, 0], 30 deg]",
        )
        return None
    if not _only_scalars(reader, pair[0]):
        return None
    return snapped(_about(reader.direction(pair[0], "an axis"), _angle_of(reader, pair[1])))


def _only_scalars(reader: Reader, node: Scalar | Items) -> bool:
    wrong = (
        [entry for entry in node if not isinstance(entry, Scalar)]
        if isinstance(node, Items)
        else []
    )
    if wrong:
        reader.report(wrong[0].span, "a list or a mapping here", "a number")
    return not wrong


def _matrix(reader: Reader, lines: Items) -> Rotation | None:
    if len(lines) != 3 or any(not isinstance(line, Items) or len(line) != 3 for line in lines):
        reader.report(
            lines.span,
            "this is not a rotation matrix",
            "three rows of three numbers: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        )
        return None
    if not all(_only_scalars(reader, line) for line in lines):
        return None
    entries = [
        [
            reader.value(reader.formula(x, "an entry of a matrix", frozenset(), unit=""), x)
            for x in line
        ]
        for line in lines
    ]
    known = [[x for x in line if x is not None] for line in entries]
    return _orthogonal(reader, lines, known) if all(len(line) == 3 for line in known) else None


def _orthogonal(reader: Reader, lines: Items, entries: list[list[float]]) -> Rotation | None:
    """The nearest rotation, where the entries are one up to the digits that were printed."""
    u, _, v = np.linalg.svd(np.array(entries))
    nearest = u @ v
    if np.abs(nearest - entries).max() > ORTHOGONAL or np.linalg.det(nearest) < 0.0:
        reader.report(
            lines.span,
            "the matrix is not a rotation",
            "columns of length one at right angles, determinant 1",
        )
        return None
    return snapped(algebra.rows([[Number(float(x)) for x in line] for line in nearest]))


_READERS: dict[str, Any] = {
    "angle": _angle,
    "rpy": _rpy,
    "axis_angle": _axis_angle,
    "matrix": _matrix,
}


def numbers(vector: Vector3) -> tuple[float, float, float]:
    """The components of a constant vector."""
    a, b, c = (component.value if isinstance(component, Number) else 0.0 for component in vector)
    return (a, b, c)
