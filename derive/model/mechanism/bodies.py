"""Bodies: mass, centre of mass and inertia, in whatever frame they were measured, and whether such
a body can exist."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from derive.expressions import tree
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.tree import ZERO, Expression, Number
from derive.model.algebra import Rows, over, rows, to_centre, turned_tensor
from derive.model.document import Items, Key, Scalar
from derive.model.language.entries import BodyEntry, InertiaEntry
from derive.model.limits import INERTIA_SLACK, SYMMETRIC, TRIANGLE_SLACK
from derive.model.load_records import Exhaust
from derive.model.mechanism.placements import rotation
from derive.model.reader import Reader
from derive.model.records import Body, Load, Vector3
from derive.model.scope import CONSTANT, INPUT, TIME

Inertia = tuple[Expression, Expression, Expression, Expression, Expression, Expression]
POINT_MASS: Inertia = (ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)
INERTIA_UNIT = "kg*m^2"
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of the six numbers in the tensor
ABOUT = ("com", "origin")
JET = CONSTANT | {TIME, INPUT}  # what an exhaust velocity may be a formula of
WAIVER = "physical: false takes it as it is"


def body(reader: Reader, key: Key, entry: BodyEntry) -> Body:
    """One body, checked with the parameters' defaults: mass in kg, centre of mass in m, tensor in
    kg m² about the centre of mass in the body's axes.

    No mass or principal moment is negative, and the largest principal moment is at most the sum of
    the other two, as ∫(y² + z²) dm and so on demand. What does not hold is reported; with
    `physical: false` an impossible inertia is taken as it is, and noted. An inertia without mass is
    that of a rotor whose mass is in another body, and is noted too.
    """
    moments = _given_moments(reader, entry)
    allowed = _allowed(reader, key, entry, moments)
    mass = reader.formula(entry.mass, "a mass", allowed, "kg")
    first = _first_moment(reader, entry, mass)
    com = reader.point(entry.com, "a centre of mass") if first is None else over(first, mass)
    tensor = POINT_MASS if moments is None else _moments(reader, moments, allowed)
    inertia, about_origin = _inertia(reader, entry, tensor, mass, com)
    possible = _is_possible(reader, key, entry, moments, mass, inertia)
    about = entry.about.text if entry.about else ""
    return Body(str(key), mass, com, inertia, key.span, first, about_origin, about, possible)


def _first_moment(reader: Reader, entry: BodyEntry, mass: Expression) -> Vector3 | None:
    """As the file gives it, in kg m; a body without mass has none."""
    if entry.first_moment is None:
        return None
    if entry.com is not None:
        reader.report(
            entry.first_moment.span, "a centre of mass and a first moment", "one of the two"
        )
        return None
    if reader.value(mass, entry.mass) == 0.0:
        reader.report(
            entry.first_moment.span, "a first moment of a body without mass", "a mass above zero"
        )
        return None
    if _uses_time(reader, entry.mass):
        reader.report(
            entry.first_moment.span,
            "a first moment of a mass that depends on t",
            "com:, its centre",
        )
        return None
    return reader.point(entry.first_moment, "a first moment", unit="kg*m")


def _given_moments(reader: Reader, entry: BodyEntry) -> Scalar | Items | None:
    """One, three or six numbers of the file: of a matrix the six in and above its diagonal."""
    given = entry.inertia
    node = given.tensor if isinstance(given, InertiaEntry) else given
    if not isinstance(node, Items) or not any(isinstance(line, Items) for line in node):
        return node
    if len(node) != 3 or not all(map(_is_row, node)):
        rows_of_three = "three rows of three numbers: [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]"
        reader.report(node.span, "this is not a matrix of moments of inertia", rows_of_three)
        return None
    size = _largest(reader, [node[i][i] for i in range(3)])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if not _agree(reader, node[i][j], node[j][i], SYMMETRIC * size):
            problem = f"'{node[j][i].text}' here and '{node[i][j].text}' across the diagonal"
            reader.report(node[j][i].span, problem, "the same: a tensor of inertia is symmetric")
    return Items([node[i][j] for i, j in PLACES], node.span)


def _is_row(line: object) -> bool:
    return isinstance(line, Items) and len(line) == 3 and all(isinstance(x, Scalar) for x in line)


def _agree(reader: Reader, above: Scalar, below: Scalar, slack: float) -> bool:
    """Written alike; or of the same parameters and alike in value but for rounding, such as that of
    R J Rᵀ: the one above the diagonal counts."""
    if above.text == below.text:
        return True
    pair = [_moment(reader, x, CONSTANT | {TIME}) for x in (above, below)]
    names = [{node.name for node in tree.walk(x) if isinstance(node, tree.Name)} for x in pair]
    first, second = (reader.value(x, at) for x, at in zip(pair, (above, below)))
    if first is None or second is None:
        return True  # what is wrong with it is reported
    return names[0] == names[1] and abs(first - second) <= slack


def _moment(reader: Reader, scalar: Scalar, allowed: frozenset[str]) -> Expression:
    return reader.formula(scalar, "a moment of inertia", allowed, INERTIA_UNIT)


def _allowed(
    reader: Reader, key: Key, entry: BodyEntry, moments: Scalar | Items | None
) -> frozenset[str]:
    """Of which names mass and inertia may be formulas: of t only where it is said what leaves the
    body. Else matter would vanish, and nobody could say with which momentum."""
    if entry.exhaust is not None:
        return CONSTANT | {TIME}
    for node in (entry.mass, *_scalars(moments)):
        if _uses_time(reader, node):
            reader.report(
                node.span,
                f"mass or inertia of '{key}' depends on t, and nothing says what leaves the body",
                "exhaust: {velocity: […]}, the velocity relative to the body; zeros if let go",
            )
            return CONSTANT | {TIME}
    return CONSTANT


def _scalars(moments: Scalar | Items | None) -> list[Scalar]:
    return [] if moments is None else [moments] if isinstance(moments, Scalar) else list(moments)


def _uses_time(reader: Reader, scalar: Scalar) -> bool:
    try:
        parsed = expression(scalar.text, reader.scope.symbols, reader.functions)
    except FormulaError:
        return False  # reported where it is read
    names = [node.name for node in tree.walk(parsed) if isinstance(node, tree.Name)]
    kinds = [reader.scope.symbols[name].kinds for name in names if name in reader.scope.symbols]
    return any(TIME in kind for kind in kinds)


def exhausts(reader: Reader, bodies: Mapping[Key, BodyEntry], found: Sequence[Body]) -> list[Load]:
    """The thrust of each body that says what leaves it. A mass that does not depend on t is
    reported: nothing leaves."""
    loads: list[Load] = []
    for (key, entry), body in zip(bodies.items(), found):
        if entry.exhaust is None:
            continue
        if not _uses_time(reader, entry.mass):
            reader.report(
                key.span, f"'{key}' has an exhaust and a mass without t", "a mass of t, or none"
            )
        given = entry.exhaust
        velocity = reader.point(given.velocity, "an exhaust velocity", "m/s", JET)
        point = body.com if given.at is None else reader.point(given.at, "a point")
        name = f"{key}_exhaust"
        loads.append(Exhaust(name, str(key), body.mass, velocity, point, key.span))
    return loads


def _inertia(
    reader: Reader, entry: BodyEntry, tensor: Inertia, mass: Expression, com: Vector3
) -> tuple[Inertia, Inertia | None]:
    """About the centre of mass, and about the origin where the file gives that."""
    if isinstance(entry.inertia, InertiaEntry):
        return _carried(reader, entry.inertia, tensor, mass, com)
    return tensor, None


def _moments(reader: Reader, node: Scalar | Items, allowed: frozenset[str]) -> Inertia:
    if isinstance(node, Scalar):
        return _one_moment(reader, _moment(reader, node, allowed))
    entries = [_moment(reader, entry, allowed) for entry in node]
    if reader.space.plane and len(entries) == 1:
        return _one_moment(reader, entries[0])
    if reader.space.plane or len(entries) not in (3, 6):
        wanted = (
            "one moment of inertia"
            if reader.space.plane
            else "one, three [xx, yy, zz] or six [xx, yy, zz, xy, xz, yz]"
        )
        reader.report(node.span, f"{len(entries)} moments of inertia", wanted)
        return POINT_MASS
    entries += [ZERO] * (6 - len(entries))
    return (entries[0], entries[1], entries[2], entries[3], entries[4], entries[5])


def _one_moment(reader: Reader, moment: Expression) -> Inertia:
    """About the normal of a planar model; the same about every axis in space."""
    only = reader.space.normal_index if reader.space.plane else None
    diagonal = [moment if only in (None, axis) else ZERO for axis in range(3)]
    return (diagonal[0], diagonal[1], diagonal[2], ZERO, ZERO, ZERO)


def _carried(
    reader: Reader, entry: InertiaEntry, given: Inertia, mass: Expression, com: Vector3
) -> tuple[Inertia, Inertia | None]:
    """A tensor taken in a turned frame, or about the body's origin, as one about the centre of mass
    in the body's axes."""
    xx, yy, zz, xy, xz, yz = given
    tensor = rows([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turned = None if entry.frame is None else rotation(reader, entry.frame)
    if turned is not None and not reader.space.plane:
        tensor = turned_tensor(turned, tensor)
    if entry.about is not None and reader.word(entry.about, ABOUT, "point") == "origin":
        return _six(reader, to_centre(tensor, mass, com)), _six(reader, tensor)
    return _six(reader, tensor), None


def _six(reader: Reader, tensor: Rows) -> Inertia:
    """A planar model keeps the moment about its normal alone."""
    if reader.space.plane:
        n = reader.space.normal_index
        return _one_moment(reader, _in_units(tensor[n][n]))
    entries = [_in_units(tensor[i][j]) for i, j in PLACES]
    return (entries[0], entries[1], entries[2], entries[3], entries[4], entries[5])


def _in_units(moment: Expression) -> Expression:
    return (
        Number(moment.value, INERTIA_UNIT)
        if isinstance(moment, Number) and moment != ZERO
        else moment
    )


def _is_possible(
    reader: Reader,
    key: Key,
    entry: BodyEntry,
    given_moments: Scalar | Items | None,
    mass: Expression,
    inertia: Inertia,
) -> bool:
    """Whether a body can have that mass and inertia; reported where it cannot, and noted where the
    file waives it."""
    given = reader.value(mass, entry.mass)
    if given is not None and given < 0.0:
        reader.report(entry.mass.span, f"the mass of '{key}' is {given:g} kg", "zero or more")
    if given_moments is None:
        return True
    scalars = _scalars(given_moments)
    moments = [
        0.0 if moment == ZERO else reader.value(moment, scalars[0]) for moment in inertia if scalars
    ]
    numbers = [moment for moment in moments if moment is not None]
    if len(numbers) < 6:
        return True
    slack = INERTIA_SLACK * _largest(reader, scalars)
    if given == 0.0 and max(map(abs, numbers)) > slack:
        reader.notes.append(f"'{key}' has inertia but no mass: it counts where it turns")
    impossible = _impossible(reader, str(key), numbers, slack)
    if impossible is None:
        return True
    if reader.answer(entry.physical, otherwise=True):
        reader.report(given_moments.span, *impossible, WAIVER)
    else:
        reader.notes.append(f"{impossible[0]}, and it is taken as it is")
    return False


def _largest(reader: Reader, scalars: list[Scalar]) -> float:
    """Of the moments as they stand in the file: rounding in what they are moved to is small against
    it."""
    values = [
        reader.value(_moment(reader, scalar, CONSTANT | {TIME}), scalar) for scalar in scalars
    ]
    return max((abs(value) for value in values if value is not None), default=0.0)


def _impossible(
    reader: Reader, name: str, moments: list[float], slack: float
) -> tuple[str, str] | None:
    """What is wrong with the moments of a body and what was expected; None where nothing is."""
    if min(moments[:3]) < -slack:
        problem = f"a moment of inertia of '{name}' is {min(moments[:3]):g} kg*m^2"
        return problem, "zero or more"
    if reader.space.plane:
        return None
    low, middle, high = _principal(moments)
    if low < -slack:
        return f"a principal moment of inertia of '{name}' is {low:g} kg*m^2", "zero or more"
    if low + middle < high * (1.0 - TRIANGLE_SLACK) - slack:
        problem = f"no body has the inertia of '{name}': {low:g} + {middle:g} < {high:g} kg*m^2"
        return problem, "the largest principal moment at most the sum of the other two"
    return None


def _principal(moments: list[float]) -> tuple[float, float, float]:
    xx, yy, zz, xy, xz, yz = moments
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(low), float(middle), float(high)
