"""What each generalized velocity feels of the ten inertial parameters of a body.

Of a body whose origin has the acceleration a (gravity taken off) in its frame, with
U = [ω̇]× + [ω]× [ω]×,

    f = m a + U mc,   n = mc × a + L(ω̇) I + [ω]× L(ω) I

and the row of a velocity that moves it with (ω_s, v_s) is v_s · f + ω_s · n. The twist of each
velocity is carried down to the body, where the parameters are constant: that takes fewer
operations than to carry ten wrenches up. (Atkeson, An, Hollerbach 1986; Khalil & Dombre.)

What a joint does not feel of its body looks the same from the body that carries it, at every
position: mass, first moment along the axis and one tensor of a body that turns, the whole tensor of
one that slides. Their entries are sums of entries of the carrier. (Gautier & Khalil 1990.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    inverse,
    is_zero,
    matrix,
    minus,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.links import ORIGIN, at_zero, carried, exact, moved, summed
from derive.mechanics.records import Inertia, Link, Place

Motion = tuple[Vector, Vector, Vector, Matrix]  # ω, ω̇, a, U
Twist = tuple[Vector, Vector]  # ω, v
Rows = dict[int, Vector]  # velocity → its ten
# places of the tensor's entries behind m and mc: by columns of its upper triangle
ENTRIES = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))
DIAGONAL = (4, 6, 9)  # xx, yy, zz
SUMMANDS = 4  # entries of the carrier that are added up at most: from five on a product is cheaper


def inertial_rows(
    links: Sequence[Link], places: Sequence[Place], motions: Sequence[Motion]
) -> list[Rows]:
    """Of the body at each of `places`, which are one to a link in the order of the links, in the
    axes of the body and about its origin."""
    twists = _twists(links)
    known: dict[int, tuple[Place, Rows]] = {}
    for place in places:
        link = links[place.link]
        rows = _products(twists[place.link], place, motions[place.link])
        if link.parent in known:
            carrier, above = known[link.parent]
            rows = _with_sums(rows, above, _sums(link, place, carrier))
        known[place.link] = place, rows
    return [known[place.link][1] for place in places]


def _twists(links: Sequence[Link]) -> list[dict[int, Twist]]:
    """Of every link: (ω, v) at its origin, in its frame, per unit of each generalized velocity that
    moves it, in the order from the root."""
    result: list[dict[int, Twist]] = []
    for link in links:
        above = result[link.parent] if link.parent >= 0 else {}
        at_joint = {j: carried(twist, link.R, link.a) for j, twist in above.items()}
        at_joint |= {j: (x[:3], x[3:]) for x, j in zip(link.motion, link.columns)}
        result.append({j: _at_origin(link, twist) for j, twist in at_joint.items()})
    return result


def _at_origin(link: Link, twist: Twist) -> Twist:
    """From the joint point to the origin of the link."""
    return twist[0], difference(twist[1], cross(twist[0], link.b))


def _products(twists: dict[int, Twist], place: Place, motion: Motion) -> Rows:
    """Twist times wrench."""
    back = transpose(matrix(place.rotation))
    omega, alpha, a = (rotated(back, x) for x in motion[:3])
    U = product(product(back, motion[3]), transpose(back)) if place.rotation else motion[3]
    moments = _moments(omega, alpha, U)
    return {
        j: _row((rotated(back, turn), rotated(back, slide)), a, U, moments)
        for j, (turn, slide) in twists.items()
    }


def _row(twist: Twist, a: Vector, U: Matrix, moments: Matrix) -> Vector:
    turn, slide = twist
    first = sum_of(rotated(transpose(U), slide), cross(a, turn))
    return [dot(slide, a), *first, *(dot(turn, column) for column in moments)]


def _moments(omega: Vector, alpha: Vector, U: Matrix) -> Matrix:
    """The moment I ω̇ + ω × I ω of a unit of each of the six entries of I, read off U."""
    x, y, z = omega
    xy, xz, yz = dot([x], [y]), dot([x], [z]), dot([y], [z])
    return [
        [alpha[0], xz, minus(0.0, xy)],
        [minus(0.0, U[2][0]), U[2][1], minus(U[0][0], U[1][1])],
        [minus(0.0, yz), alpha[1], xy],
        [U[1][0], minus(U[2][2], U[0][0]), minus(0.0, U[1][2])],
        [minus(U[1][1], U[2][2]), minus(0.0, U[0][1]), U[0][2]],
        [yz, minus(0.0, xz), alpha[2]],
    ]


@dataclass(frozen=True)
class _Sum:
    """An entry of a row: a sum of the carrier's `weights`, less another entry of the same row."""

    weights: Vector
    less: int | None = None


def _sums(link: Link, place: Place, carrier: Place) -> dict[int, _Sum]:
    """Of the entries that the joint does not feel, where few of the carrier's make them up."""
    units, start = _unfelt(link, place)
    result: dict[int, _Sum] = {}
    for k, (unit, less) in units.items():
        in_link = moved(unit, place.rotation, ORIGIN)
        seen = in_body(moved(in_link, at_zero(link.rotation), start), carrier)
        weights = [exact(x) for x in ten_of(seen)]
        if sum(not is_zero(x) for x in weights) <= SUMMANDS:
            result[k] = _Sum(weights, less)
    return result


def _unfelt(link: Link, place: Place) -> tuple[dict[int, tuple[Inertia, int | None]], Vector]:
    """What looks the same from the carrier at every position, by the entry that is told by it, and
    the origin in the carrier; the last of a tensor across the axis is a sum with another entry."""
    z = link.turns_about
    if z < 0:
        slides = len(link.columns) == 1 and all(is_zero(x) for x in link.motion[0][:3])
        kept = range(4, 10) if slides else ()
        return {k: (_unit(k), None) for k in kept}, ORIGIN
    if place.rotation or not all(is_zero(x) for x in link.b):
        return {}, ORIGIN
    first, last = (DIAGONAL[(z + k) % 3] for k in (1, 2))
    across = summed(_unit(first), _unit(last))
    return {0: (_unit(0), None), 1 + z: (_unit(1 + z), None), last: (across, first)}, link.a


def _unit(k: int) -> Inertia:
    return inertia_of([float(i == k) for i in range(10)])


def _with_sums(rows: Rows, above: Rows, sums: dict[int, _Sum]) -> Rows:
    """The rows with what the joint does not feel by the carrier's; its own velocities move no
    carrier."""
    result = dict(rows)
    for j in rows.keys() & above.keys():
        result[j] = [_entry(sums.get(k), rows[j], above[j], x) for k, x in enumerate(rows[j])]
    return result


def _entry(known: _Sum | None, row: Vector, above: Vector, otherwise: Scalar) -> Scalar:
    if known is None:
        return otherwise
    value = dot(known.weights, above)
    return value if known.less is None else minus(value, row[known.less])


def in_body(own: Inertia, place: Place) -> Inertia:
    """Of a link, seen from the body that carries it: their origins are one."""
    return moved(own, inverse(place.rotation), ORIGIN) if place.rotation else own


def ten_of(own: Inertia) -> Vector:
    """m, mc, then the tensor by columns of its upper triangle."""
    return [own.mass, *own.moment, *(own.tensor[i][j] for i, j in ENTRIES)]


def inertia_of(ten: Vector) -> Inertia:
    """The inverse of `ten_of`."""
    xx, xy, yy, xz, yz, zz = ten[4:]
    return Inertia(ten[0], list(ten[1:4]), [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
