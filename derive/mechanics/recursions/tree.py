"""Recursions over the tree of links: poses, Newton–Euler bias (tip to base), composite-body mass
matrix, energies.

Sources: Luh, Walker, Paul 1980 (recursive Newton–Euler); Walker, Orin 1982 (composite bodies);
written in link frames with first moments, after Khalil, so that a link turning about a fixed axis
costs one product.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation
from derive.joints.rotations import (
    IDENTITY,
    cross,
    difference,
    dot,
    inverse,
    matrix,
    merged,
    minus,
    plus,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.links import moved, summed
from derive.mechanics.records import Inertia, Link, Place, RowForm
from derive.mechanics.recursions.motion import STILL, Numbers, child_numbers

Positions = Sequence[Vector] | Mapping[int, Vector]  # of links, by their numbers
Rotations = Sequence[Matrix] | Mapping[int, Matrix]
Wrench = tuple[Vector, Vector]  # moment about the link's origin, force


def path(links: Sequence[Link], i: int) -> list[int]:
    """Indices from the root to link i; empty for the ground."""
    result: list[int] = []
    while i >= 0:
        result.append(i)
        i = links[i].parent
    return result[::-1]


def relative_rotation(links: Sequence[Link], to: int, of: int) -> Rotation:
    """Frame `to` ← frame `of`, through their nearest common carrier; −1 is the ground. Not through
    the ground: what carries both would turn and turn back."""
    down, up = path(links, of), path(links, to)
    shared = sum(1 for _ in _common(down, up))
    back = merged(*[links[i].rotation for i in up[shared:]])
    there = merged(*[links[i].rotation for i in down[shared:]])
    return merged(inverse(back), there)


def nearest_carrier(links: Sequence[Link], *tips: int) -> tuple[int, list[int]]:
    """The link nearest to all of these that carries them, −1 for the ground, and what lies between
    it and them, carriers first: a link comes after its parent."""
    carrier, beyond = tips[0], set[int]()
    for tip in tips[1:]:
        while carrier != tip:
            farther = max(carrier, tip)
            beyond.add(farther)
            above = links[farther].parent
            carrier, tip = (above, tip) if farther == carrier else (carrier, above)
    return carrier, sorted(beyond)


def _common(a: Sequence[int], b: Sequence[int]) -> list[int]:
    return [x for x, y in zip(a, b) if x == y]


def ground_rotations(links: Sequence[Link]) -> list[Matrix]:
    """Ground ← link for every link: one turn where all turns about it are parallel, else the
    product with its parent's."""
    found = rotations_on(links, -1, range(len(links)))
    return [found[i] for i in range(len(links))]


def rotations_on(links: Sequence[Link], carrier: int, beyond: Iterable[int]) -> dict[int, Matrix]:
    """Carrier ← link, by the link's number, for the carrier and what lies `beyond` it, carriers
    first; −1 is the ground."""
    chains: dict[int, Rotation | None] = {carrier: ()}  # None where a product has been taken
    result: dict[int, Matrix] = {carrier: IDENTITY}
    for i in beyond:
        link = links[i]
        above, turned = chains[link.parent], result[link.parent]
        chain = None if above is None else merged(above, link.rotation)
        short = chain is not None and (len(chain) <= 1 or turned is IDENTITY)
        result[i] = matrix(chain) if short and chain is not None else product(turned, link.R)
        chains[i] = chain if short else None
    return result


def ground_positions(links: Sequence[Link], rotations: Rotations) -> list[Vector]:
    """Of the links' origins: r = r_p + R_p a − R b."""
    result: list[Vector] = []
    for i, link in enumerate(links):
        R = rotations[i]
        carrier: tuple[Vector, Matrix] = (
            (result[link.parent], rotations[link.parent])
            if link.parent >= 0
            else ([0.0, 0.0, 0.0], IDENTITY)
        )
        result.append(origin_on(carrier, link, R))
    return result


def origin_on(carrier: tuple[Vector, Matrix], link: Link, R: Matrix) -> Vector:
    """r = r_p + R_p a − R b of a link turned by R, on a carrier at (r_p, R_p)."""
    joint = sum_of(carrier[0], rotated(carrier[1], link.a))
    return difference(joint, rotated(R, link.b))


def ground_point(
    place: Place,
    point: Vector,
    positions: Positions,
    rotations: Rotations,
) -> Vector:
    """A body point in the ground frame, in m: r + R (p + R_b x) for a body that sits at (p, R_b) in
    its link."""
    inside = link_point(place, point)
    if place.link < 0:
        return inside
    return sum_of(positions[place.link], rotated(rotations[place.link], inside))


def link_point(place: Place, point: Vector) -> Vector:
    """A point of a body in the frame of the link that the body is part of: p + R r, in m."""
    return sum_of(place.position, rotated(matrix(place.rotation), point))


def link_direction(place: Place, direction: Vector) -> Vector:
    """A direction of a body in the axes of its link: it is turned and not shifted."""
    return rotated(matrix(place.rotation), direction)


def twists(links: Sequence[Link], v: Sequence[Scalar]) -> list[Numbers]:
    """(ω, v) of every link for the generalized velocities v: rad/s and m/s, of the link's origin,
    in the link's frame."""
    result: list[Numbers] = []
    for link in links:
        parent = result[link.parent] if link.parent >= 0 else STILL
        result.append(child_numbers(link, parent, [v[j] for j in link.columns]))
    return result


def momentum(body: Inertia, twist: Numbers) -> Wrench:
    """(I ω + mc × v, m v + ω × mc): angular momentum about the link's origin and linear momentum,
    in its frame. mc is the first moment, so that no centre of mass is divided out."""
    omega, velocity = twist
    angular = sum_of([dot(row, omega) for row in body.tensor], cross(body.moment, velocity))
    return angular, sum_of([dot([body.mass], [x]) for x in velocity], cross(omega, body.moment))


def inertia_force(body: Inertia, twist: Numbers, rate: Numbers, gravity: Vector) -> Wrench:
    """Newton–Euler at the link's origin: with a = v̇ + ω × v − g,
    f = m a + ω̇ × mc + ω × (ω × mc),  n = I ω̇ + ω × I ω + mc × a.
    """
    (omega, velocity), (alpha, apparent) = twist, rate
    a = difference(sum_of(apparent, cross(omega, velocity)), gravity)
    force = sum_of([dot([body.mass], [x]) for x in a], cross(alpha, body.moment))
    force = sum_of(force, cross(omega, cross(omega, body.moment)))
    spin = [dot(row, omega) for row in body.tensor]
    moment = sum_of([dot(row, alpha) for row in body.tensor], cross(omega, spin))
    return sum_of(moment, cross(body.moment, a)), force


def handed_down(link: Link, wrench: Wrench) -> tuple[Wrench, Wrench]:
    """A wrench (n, f) at the link's origin: at the joint point in the link's frame, n − b × f, and
    at the parent's origin in the parent's frame, R n + a × R f."""
    moment, force = wrench
    at_joint = (difference(moment, cross(link.b, force)), force)
    turned = rotated(link.R, at_joint[0]), rotated(link.R, force)
    return at_joint, (sum_of(turned[0], cross(link.a, turned[1])), turned[1])


def joint_forces(links: Sequence[Link], wrenches: Sequence[Wrench], nv: int) -> list[Scalar]:
    """Hᵀ (n, f) summed from tip to base: the generalised forces (nv), conjugate to v, that equal
    the given wrenches at the links' origins. By d'Alembert's principle they do the same power."""
    carried = [(list(n), list(f)) for n, f in wrenches]
    result: list[Scalar] = [0.0] * nv
    for i in reversed(range(len(links))):
        link = links[i]
        at_joint, below = handed_down(link, carried[i])
        for column, j in zip(link.motion, link.columns):
            result[j] = dot(column, [*at_joint[0], *at_joint[1]])
        if link.parent >= 0:
            n, f = carried[link.parent]
            carried[link.parent] = (sum_of(n, below[0]), sum_of(f, below[1]))
    return result


def row_forces(row: RowForm, links: Sequence[Link], nv: int) -> list[Scalar]:
    """The coefficients of v (nv) in a row: the forces at the joints of a unit force along it."""
    wrenches: list[Wrench] = [([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]) for _ in links]
    for term in row.terms:
        if term.link >= 0:
            n, f = wrenches[term.link]
            moment = sum_of(term.moment, cross(term.point, term.direction))
            wrenches[term.link] = (sum_of(n, moment), sum_of(f, term.direction))
    result = joint_forces(links, wrenches, nv)
    for j, coefficient in row.coefficients:
        result[j] = plus(result[j], coefficient)
    return result


def composite_inertias(links: Sequence[Link], inertias: Sequence[Inertia]) -> list[Inertia]:
    """Each link's inertia with everything that hangs on it, about its own origin, in its frame, as
    if all joints beyond were locked (Walker, Orin 1982)."""
    result = list(inertias)
    for i in reversed(range(len(links))):
        link = links[i]
        if link.parent >= 0:
            at_joint = moved(result[i], (), [-x for x in link.b])
            result[link.parent] = summed(
                result[link.parent], moved(at_joint, link.rotation, link.a)
            )
    return result


def mass_matrix(links: Sequence[Link], inertias: Sequence[Inertia], nv: int) -> Matrix:
    """Composite-body M, nv × nv: Mⱼₖ = pₖᵀ (momentum of what hangs on joint j at unit speed, handed
    down to joint k). Entries of links on different branches stay exact zeros."""
    result: Matrix = [[0.0] * nv for _ in range(nv)]
    for i, (link, body) in enumerate(zip(links, composite_inertias(links, inertias))):
        for column, j in zip(link.motion, link.columns):
            omega, slide = list(column[:3]), list(column[3:])
            # from the joint point to the link's origin: v = u − ω × b
            at_origin = (omega, sum_of(slide, cross(link.b, omega)))
            _fill(result, links, i, j, momentum(body, at_origin))
    return result


def _fill(result: Matrix, links: Sequence[Link], i: int, j: int, wrench: Wrench) -> None:
    while i >= 0:
        at_joint, below = handed_down(links[i], wrench)
        for column, k in zip(links[i].motion, links[i].columns):
            result[j][k] = result[k][j] = dot(column, [*at_joint[0], *at_joint[1]])
        i, wrench = links[i].parent, below


def kinetic_energy(links: Sequence[Link], numbers: Sequence[Numbers]) -> Scalar:
    """T = ½ Σ (ω·n + v·f) with the momenta (n, f), in J."""
    result: Scalar = 0.0
    for link, twist in zip(links, numbers):
        n, f = momentum(link.inertia, twist)
        result = result + 0.5 * (dot(twist[0], n) + dot(twist[1], f))
    return result


def gravity_energy(
    links: Sequence[Link], positions: Positions, rotations: Rotations, g: Vector
) -> Scalar:
    """V = −Σ g · (m r + R mc), in J, zero where all mass is at the ground's origin; g in ground
    axes, m/s²."""
    result: Scalar = 0.0
    for i, link in enumerate(links):
        moment = sum_of(
            [dot([link.inertia.mass], [x]) for x in positions[i]],
            rotated(rotations[i], link.inertia.moment),
        )
        result = minus(result, dot(g, moment))
    return result


def gravities(links: Sequence[Link], rotations: Sequence[Matrix], g: Vector) -> list[Vector]:
    """Rᵀ g (m/s²), the gravity vector in every link's frame."""
    return [rotated(transpose(R), g) for R in rotations]
