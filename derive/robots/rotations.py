"""Rotations as 3 × 3 tuples of floats, and the angles that are written into a model file.

Angles within 1e-11 of a whole number of degrees are taken for that number, and components of a unit
vector within 1e-9 of 0 and ±1 for these: `1.57079632679` in a robot file means a right angle, and
only exact right angles give the structural zeros that make equations short. What is farther away,
but a rounding or within 1e-8 of a multiple of 15°, is a matter of choice: see `unrounded`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from derive.robots.limits import MEANT, MOST_STEPS, NEAR, ROUNDING, SAME_ANGLE, SAME_DEGREE

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN: Vector = (0.0, 0.0, 0.0)
STEP = 1  # degree
_DECIMAL = re.compile(r"[+-]?[0-9]{1,3}\.([0-9]{2,15})\Z")
_UNIT = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def whole_degrees(angle: float) -> int | None:
    """The whole number of degrees that an angle in radians means, or None."""
    steps = angle / math.radians(STEP)
    if not math.isfinite(steps) or abs(steps) > MOST_STEPS:
        return None
    away = abs(angle - math.radians(STEP * round(steps)))
    return STEP * round(steps) if away <= SAME_DEGREE else None


def unrounded(word: str) -> float | None:
    """The multiple of 15° that a decimal number in radians is a rounding of, or means with a wrong
    last digit; None where it is none, or is one to all digits of `whole_degrees`.

    Rounded or cut off after at least three decimals, or nearer than 1e-8; after two decimals only
    multiples of 90° are meant (0.26 is a number, 1.57 a right angle).
    """
    match = _DECIMAL.match(word)
    if match is None:
        return None
    digits, angle = len(match[1]), float(word)
    grid = math.pi / 12.0 if digits >= 3 else math.pi / 2.0
    meant = grid * round(angle / grid)
    cut = math.floor(abs(meant) * 10**digits) / 10**digits
    roundings = (round(abs(meant), digits), cut)
    if meant == 0.0 or whole_degrees(angle) is not None:
        return None
    same = any(math.isclose(abs(angle), each, rel_tol=SAME_ANGLE) for each in roundings)
    return meant if same or abs(angle - meant) <= MEANT else None


def sine_cosine(angle: float) -> tuple[float, float]:
    """(sin, cos) of an angle in rad, exact at right angles: sin π is 1e-16 in floats, and would
    leave terms in the equations that are not there."""
    degrees = whole_degrees(angle)
    if degrees is not None and degrees % 90 == 0:
        return ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))[degrees // 90 % 4]
    angle = angle if degrees is None else math.radians(degrees)
    return math.sin(angle), math.cos(angle)


def product(a: Matrix, b: Matrix) -> Matrix:
    """A B."""
    columns = transposed(b)
    return (_times(a[0], columns), _times(a[1], columns), _times(a[2], columns))


def _times(row: Vector, columns: Matrix) -> Vector:
    """Without −0, which would be written into a file."""
    x, y, z = row
    a, b, c = (0.0 + x * column[0] + y * column[1] + z * column[2] for column in columns)
    return (a, b, c)


def transposed(a: Matrix) -> Matrix:
    """Aᵀ; of a rotation it is the inverse, so it leads back."""
    return (
        _three([row[0] for row in a]),
        _three([row[1] for row in a]),
        _three([row[2] for row in a]),
    )


def rotated(a: Matrix, x: Sequence[float]) -> Vector:
    """A x: components of x in the axes that A leads to."""
    return _three([sum(row[k] * x[k] for k in range(3)) for row in a])


def plus(x: Sequence[float], y: Sequence[float]) -> Vector:
    """x + y."""
    return (x[0] + y[0], x[1] + y[1], x[2] + y[2])


def minus(x: Sequence[float], y: Sequence[float]) -> Vector:
    """x − y."""
    return (x[0] - y[0], x[1] - y[1], x[2] - y[2])


def times(k: float, x: Sequence[float]) -> Vector:
    """k x."""
    return (k * x[0], k * x[1], k * x[2])


def cross(x: Sequence[float], y: Sequence[float]) -> Vector:
    """x × y, right-handed."""
    return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])


def _three(x: Sequence[float]) -> Vector:
    return (x[0], x[1], x[2])


def unit(x: Sequence[float]) -> Vector | None:
    """The direction of a vector, exact along the axes; None for the zero vector."""
    length = math.hypot(*x)
    if length == 0.0:
        return None
    a, b, c = (_exact(e / length) for e in x)
    return (a, b, c)


def _exact(component: float) -> float:
    nearest = float(round(component))
    return nearest + 0.0 if abs(component - nearest) <= NEAR else component


def about(axis: Vector, angle: float) -> Matrix:
    """The turn about a unit axis (Rodrigues)."""
    s, c = sine_cosine(angle)
    x, y, z = axis
    skew = ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    rows = [
        [c * (i == j) + s * skew[i][j] + (1.0 - c) * axis[i] * axis[j] for j in range(3)]
        for i in range(3)
    ]
    return (_three(rows[0]), _three(rows[1]), _three(rows[2]))


def from_rpy(rpy: Sequence[float]) -> Matrix:
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    return from_euler("XYZ", rpy)


def from_euler(sequence: str, angles: Sequence[float]) -> Matrix:
    """Small letters turn about axes that move along, capitals about fixed ones (as MuJoCo has
    it)."""
    result = IDENTITY
    for letter, angle in zip(sequence, angles):
        if angle == 0.0:
            continue
        turn = about(_UNIT[letter.lower()], angle)
        result = product(result, turn) if letter.islower() else product(turn, result)
    return result


def from_quaternion(q: Sequence[float]) -> Matrix | None:
    """Of (w, x, y, z), of any length but zero."""
    length = math.hypot(*q)
    if length == 0.0:
        return None
    w, x, y, z = (_exact(e / length) for e in q)
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def to_quaternion(R: Matrix) -> tuple[float, float, float, float]:
    """(w, x, y, z) with w ≥ 0, from the largest of the four components."""
    squares = (
        1.0 + R[0][0] + R[1][1] + R[2][2],
        1.0 + R[0][0] - R[1][1] - R[2][2],
        1.0 - R[0][0] + R[1][1] - R[2][2],
        1.0 - R[0][0] - R[1][1] + R[2][2],
    )
    sums = (R[0][1] + R[1][0], R[0][2] + R[2][0], R[1][2] + R[2][1])
    differences = (R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1])
    columns = (
        (squares[0], *differences),
        (differences[0], squares[1], sums[0], sums[1]),
        (differences[1], sums[0], squares[2], sums[2]),
        (differences[2], sums[1], sums[2], squares[3]),
    )
    largest = columns[max(range(4), key=lambda k: squares[k])]
    length = math.hypot(*largest) * (1.0 if largest[0] >= 0.0 else -1.0)
    w, x, y, z = (_exact(e / length) for e in largest)
    return (w, x, y, z)


def to_rpy(R: Matrix) -> Vector:
    """Roll, pitch and yaw of a rotation; roll is 0 where pitch is ±90° and only one of the two is
    determined."""
    level = math.hypot(R[0][0], R[1][0])
    pitch = math.atan2(-R[2][0], level)
    if level <= NEAR:
        return (0.0, math.copysign(math.pi / 2.0, pitch), math.atan2(-R[0][1], R[1][1]))
    return (math.atan2(R[2][1], R[2][2]), pitch, math.atan2(R[1][0], R[0][0]))


def is_identity(R: Matrix) -> bool:
    """Whether no entry of R differs from the unit matrix by more than NEAR: such a rotation is not
    written into the file."""
    return all(abs(R[i][j] - (i == j)) <= NEAR for i in range(3) for j in range(3))


def turned_tensor(R: Matrix, tensor: Sequence[float]) -> tuple[float, ...]:
    """R I Rᵀ of (xx, yy, zz, xy, xz, yz); rounding errors of right angles are taken away."""
    xx, yy, zz, xy, xz, yz = tensor
    full: Matrix = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    turned = full if R == IDENTITY else product(product(R, full), transposed(R))
    least = ROUNDING * max(abs(e) for e in tensor)
    entries = (turned[0][0], turned[1][1], turned[2][2], turned[0][1], turned[0][2], turned[1][2])
    return tuple(0.0 if abs(e) <= least else e for e in entries)
