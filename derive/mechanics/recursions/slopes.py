"""The slopes of inverse dynamics on a tree, link by link: M, ½ ∂h/∂v and ∂(M v̇ + h)/∂q, where q is
moved by displacements over v.

Of a subtree, about the joint point P that its link carries: mass m, h = ∫ x dm, inertia I, and of
velocities relative to P (so that no linear velocity of the base appears)

    p = ∫ ẋ dm,   G = ∫ ẋ xᵀ dm,   B (e, s) = (tr(G) e − G e, e × p).

A joint's motion (e, s) at P, with ω, A = α× + ω×ω× of the carrier, a the acceleration of the
carrier's point at P less gravity, ω_J and ṡ the joint's own twist, needs the wrenches

    F₁ = I (e, s)                          χ = ½ ((2 ω + ω_J) × e, (2 ω + ω_J) × s − ṡ × e)
    F₂ = B (e, s) + I χ                    ψ = (ω × e, ·)
    F₃ = 2 B ψ + I ξ                       ξ = (A e, A s + a × e − 2 ṡ × ψ)

per unit of acceleration, velocity and displacement; joints nearer to the base feel F₃ and the
turned wrench of the subtree, (e × n + s × f, e × f). They are formed in the axes in which the
joint's motion is constant, and carried to the base. The other halves need F₁ alone and the couple
c = tr(G) e − Gᵀ e + p × s:  c·e_j + F₁·χ_j  and  2 c·ψ_j + F₁·ξ_j.

Since h is quadratic in v but for gravity, ½ ∂h/∂v v are its velocity products. Sources: J.
Carpentier, N. Mansard, Analytical derivatives of rigid body dynamics algorithms, RSS 2018; S.
Singh, R. P. Russell, P. M. Wensing, Efficient analytical derivatives of rigid-body dynamics using
spatial vector algebra, IEEE RA-L 7 (2022) 1776–1783; composites of ten and nine numbers after S.
Echeandia, P. M. Wensing, J. Comput. Nonlinear Dyn. 16 (2021) 021001.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import (
    UNIT,
    cross,
    difference,
    dot,
    inverse,
    is_zero,
    matrix,
    minus,
    plus,
    product,
    rotated,
    scaled,
    spin_matrix,
    sum_of,
    times,
    transpose,
)
from derive.mechanics.links import moved, summed, turned_tensor
from derive.mechanics.records import Inertia, Link
from derive.mechanics.recursions.flows import (
    Flow,
    combined,
    flow_couple,
    flow_wrench,
    own_flow,
    power,
    shifted,
)
from derive.mechanics.recursions.tree import Wrench, momentum

NONE: Vector = [0.0, 0.0, 0.0]
Pair = tuple[Vector, Vector]  # angular, linear


@dataclass(frozen=True)
class Seat:
    """How a link sits on its carrier: carrier ← forming axes ← link's own. The motion of the joint
    is constant in the forming axes; `arm`: P of the link from P of the carrier, in its axes."""

    parent: int
    outer: Rotation
    inner: Rotation
    motion: tuple[Pair, ...]
    columns: tuple[int, ...]
    arm: Vector


@dataclass(frozen=True)
class Speed:
    """`carrier`, `own`: angular velocity of the carrier in the forming axes, of the link in its
    own; `turn`, `slide`: the joint's own twist, forming axes; `rate`: of the arm, carrier's
    axes."""

    carrier: Vector
    own: Vector
    turn: Vector
    slide: Vector
    rate: Vector


@dataclass(frozen=True)
class Rate:
    """Of the carrier at P: α and a, forming axes; of the link at P: α and a, its own axes."""

    carrier: Pair
    own: Pair


class Tree:
    """The links with everything about P, at velocities v. `ground`: the gravity (m/s², ground axes)
    that each link with no carrier feels."""

    def __init__(
        self,
        links: Sequence[Link],
        inertias: Sequence[Inertia],
        v: Sequence[Scalar],
        ground: Sequence[Vector],
    ) -> None:
        self.nv = len(v)
        self.ground = ground
        points = joint_points(links)
        self.seats = [_seat(link, points, i) for i, link in enumerate(links)]
        self.bodies = [
            moved(body, (), [-x for x in point]) for point, body in zip(points, inertias)
        ]
        self.speeds = _speeds(self.seats, v)
        self.composites = list(self.bodies)
        formed: list[tuple[Inertia, Flow]] = []
        self.flows = [own_flow(b, s.own) for b, s in zip(self.bodies, self.speeds)]
        for i in reversed(range(len(links))):
            formed.append(self._formed(i))
        self.formed = formed[::-1]
        self.velocities = v

    def _formed(self, i: int) -> tuple[Inertia, Flow]:
        """Composite and flow of a subtree in the forming axes; the carrier has them added."""
        seat, speed = self.seats[i], self.speeds[i]
        body, flow = _turned(self.composites[i], self.flows[i], seat.inner)
        if seat.parent >= 0:
            outer, moving = _turned(body, flow, seat.outer)
            below, through = _shifted(outer, moving, seat.arm, speed.rate)
            self.composites[seat.parent] = summed(self.composites[seat.parent], below)
            self.flows[seat.parent] = combined(self.flows[seat.parent], through)
        return body, flow

    def masses(self) -> tuple[Matrix, Matrix]:
        """M and ½ ∂h/∂v."""
        M, H = _zeros(self.nv), _zeros(self.nv)
        for i, seat in enumerate(self.seats):
            body, flow = self.formed[i]
            for motion, j in zip(seat.motion, seat.columns):
                held = momentum(body, motion)
                driving = _sum(flow_wrench(flow, motion), momentum(body, self._chi(i, motion)))
                for other, k in zip(seat.motion, seat.columns):
                    M[k][j], H[k][j] = power(other, held), power(other, driving)
                towards = self._towards_base(i, held, driving, flow_couple(flow, motion))
                for below, held, driving, couple in towards:
                    for other, k in self._joint(below):
                        M[k][j] = M[j][k] = power(other, held)
                        H[k][j] = power(other, driving)
                        H[j][k] = plus(dot(couple, other[0]), power(self._chi(below, other), held))
        return M, H

    def displacements(
        self, vdot: Sequence[Scalar], balance: Sequence[Scalar] | None = None
    ) -> Matrix:
        """∂(M v̇ + h)/∂(displacement over v). `balance`: M v̇ + h itself, where it is known."""
        D = _zeros(self.nv)
        rates = self._rates(vdot)
        wrenches = self._wrenches(rates, balance)
        for i, seat in enumerate(self.seats):
            body, flow = self.formed[i]
            for motion, j in zip(seat.motion, seat.columns):
                psi, xi = self._psi(i, motion), self._xi(i, rates[i], motion)
                twice = flow_wrench(flow, ([times(2.0, x) for x in psi], NONE))
                driving = _sum(twice, momentum(body, xi))
                for other, k in zip(seat.motion, seat.columns):
                    D[k][j] = power(other, driving)
                driving = _sum(driving, _crossed(motion, wrenches[i]))
                held = momentum(body, motion)
                towards = self._towards_base(i, held, driving, flow_couple(flow, motion))
                for below, held, driving, couple in towards:
                    for other, k in self._joint(below):
                        D[k][j] = power(other, driving)
                        swung = dot(couple, [times(2.0, x) for x in self._psi(below, other)])
                        rate = self._xi(below, rates[below], other)
                        D[j][k] = plus(swung, power(rate, held))
        return D

    def _joint(self, i: int) -> Iterator[tuple[Pair, int]]:
        """The motions of a joint, each with the column of its velocity."""
        return zip(self.seats[i].motion, self.seats[i].columns)

    def _towards_base(
        self, i: int, held: Wrench, driving: Wrench, couple: Vector
    ) -> Iterator[tuple[int, Wrench, Wrench, Vector]]:
        """Each link between link i and the base, with what of a joint of link i reaches it: both
        wrenches and the couple, in the forming axes of that link."""
        while self.seats[i].parent >= 0:
            held, driving = (self._handed_down(i, x) for x in (held, driving))
            couple = self._couple_down(i, couple, held)
            i = self.seats[i].parent
            held, driving = (self._to_forming(i, x) for x in (held, driving))
            couple = _spun(self.seats[i].inner, couple)
            yield i, held, driving, couple

    def weights(self) -> Vector:
        """The part of h that gravity has."""
        result: Vector = [0.0] * self.nv
        down: list[Vector] = []
        for i, seat in enumerate(self.seats):
            above = down[seat.parent] if seat.parent >= 0 else self.ground[i]
            formed = _spun(inverse(seat.outer), above)
            down.append(_spun(inverse(seat.inner), formed))
            for motion, j in zip(seat.motion, seat.columns):
                force = momentum(self.formed[i][0], motion)[1]
                result[j] = -dot(force, formed)
        return result

    def _chi(self, i: int, motion: Pair) -> Pair:
        (e, s), speed = motion, self.speeds[i]
        if is_nothing(speed.turn, speed.slide) or len(self.seats[i].motion) == 1:
            return self._chi_alone(i, motion)
        middle = sum_of(speed.carrier, [times(0.5, x) for x in speed.turn])
        half = [times(0.5, x) for x in speed.slide]
        return cross(middle, e), difference(cross(middle, s), cross(half, e))

    def _chi_alone(self, i: int, motion: Pair) -> Pair:
        """Of a joint with one velocity: its own turn and slide are along its own motion."""
        e, s = motion
        return cross(self.speeds[i].carrier, e), cross(self.speeds[i].carrier, s)

    def _psi(self, i: int, motion: Pair) -> Vector:
        return cross(self.speeds[i].carrier, motion[0])

    def _xi(self, i: int, rate: Rate, motion: Pair) -> Pair:
        (e, s), (alpha, a) = motion, rate.carrier
        omega, psi = self.speeds[i].carrier, self._psi(i, motion)
        angular = sum_of(cross(alpha, e), cross(omega, psi))
        linear = sum_of(cross(alpha, s), cross(omega, cross(omega, s)))
        twice = [times(-2.0, x) for x in self.speeds[i].slide]
        return angular, sum_of(sum_of(linear, cross(a, e)), cross(twice, psi))

    def _rates(self, vdot: Sequence[Scalar]) -> list[Rate]:
        result: list[Rate] = []
        for seat, speed, gravity in zip(self.seats, self.speeds, self.ground):
            ground: Pair = (NONE, [-x for x in gravity])
            above = result[seat.parent].own if seat.parent >= 0 else ground
            omega = self.speeds[seat.parent].own if seat.parent >= 0 else NONE
            result.append(_rate(seat, speed, above, omega, vdot))
        return result

    def _wrenches(self, rates: Sequence[Rate], balance: Sequence[Scalar] | None) -> list[Wrench]:
        """Of every subtree at P, forming axes."""
        parts = zip(self.bodies, self.speeds, rates)
        carried = [_inertia_force(body, speed.own, rate.own) for body, speed, rate in parts]
        result: list[Wrench] = [(NONE, NONE) for _ in self.seats]
        for i in reversed(range(len(self.seats))):
            result[i] = _balanced(self.seats[i], self._to_forming(i, carried[i]), balance)
            below = self.seats[i].parent
            if below >= 0:
                carried[below] = _sum(carried[below], self._handed_down(i, result[i]))
        return result

    def _handed_down(self, i: int, wrench: Wrench) -> Wrench:
        """From the forming axes of a link to P of its carrier, in the carrier's axes."""
        seat = self.seats[i]
        n, f = _spun(seat.outer, wrench[0]), _spun(seat.outer, wrench[1])
        return sum_of(n, cross(seat.arm, f)), f

    def _couple_down(self, i: int, couple: Vector, held: Wrench) -> Vector:
        return sum_of(_spun(self.seats[i].outer, couple), cross(self.speeds[i].rate, held[1]))

    def _to_forming(self, i: int, wrench: Wrench) -> Wrench:
        inner = self.seats[i].inner
        return _spun(inner, wrench[0]), _spun(inner, wrench[1])


def is_nothing(*vectors: Vector) -> bool:
    """Zeros by structure alone."""
    return all(is_zero(x) for vector in vectors for x in vector)


def _zeros(n: int) -> Matrix:
    return [[0.0] * n for _ in range(n)]


def joint_points(links: Sequence[Link]) -> list[Vector]:
    """P of every link, in its own axes: a point that the joint holds. On the axis of a turn any
    point will do; of the joint's own and the one nearest to P of the carrier the one with fewer
    products: every velocity beyond is carried over each arm once."""
    points = [list(link.b) for link in links]
    beyond = _beyond(links)
    for i, link in enumerate(links):
        if link.turns_about < 0 or link.parent < 0:
            continue
        near = _nearest(link, points)
        if near is None:
            continue
        costs = [
            _products(links, [*points[:i], p, *points[i + 1 :]], i, beyond)
            for p in (points[i], near)
        ]
        if costs[1] < costs[0]:
            points[i] = near
    return points


def _beyond(links: Sequence[Link]) -> list[int]:
    """How many velocities are carried by each link, its own too."""
    counts = [len(link.columns) for link in links]
    for i in reversed(range(len(links))):
        if links[i].parent >= 0:
            counts[links[i].parent] += counts[i]
    return counts


def _nearest(link: Link, points: Sequence[Vector]) -> Vector | None:
    """The point of the axis nearest to P of the carrier; None where it is the joint's own."""
    outer, inner = _parted(link)
    motion = list(link.motion[0][:3])
    along = _spun(outer, _spun(inner, motion))
    way = dot(along, _arm(link, points))
    if is_zero(way):
        return None
    return difference(link.b, scaled(way, motion))


def _arm(link: Link, points: Sequence[Vector]) -> Vector:
    return difference(link.a, points[link.parent]) if link.parent >= 0 else list(link.a)


def _products(
    links: Sequence[Link], points: Sequence[Vector], i: int, beyond: Sequence[int]
) -> int:
    """Entries of the arms to and from link i, each as often as it is carried over."""
    near = [k for k, link in enumerate(links) if k == i or link.parent == i]
    return sum(
        beyond[k] * sum(not is_zero(x) for x in _placed_arm(links[k], points, k)) for k in near
    )


def _placed_arm(link: Link, points: Sequence[Vector], i: int) -> Vector:
    """From P of the carrier to P of the link, in the carrier's axes."""
    outer, inner = _parted(link)
    shift = difference(points[i], link.b)
    if is_nothing(shift):
        return _arm(link, points)
    return sum_of(_arm(link, points), _spun(outer, _spun(inner, shift)))


def _seat(link: Link, points: Sequence[Vector], i: int) -> Seat:
    outer, inner = _parted(link)
    motion = tuple((_spun(inner, list(m[:3])), _spun(inner, list(m[3:]))) for m in link.motion)
    arm = _placed_arm(link, points, i)
    return Seat(link.parent, outer, inner, motion, link.columns, arm)


def _parted(link: Link) -> tuple[Rotation, Rotation]:
    """The factors before the joint's turn, and from it on: a turn leaves its own axis alone. Of
    other joints the motion is constant in the link's own axes."""
    if len(link.columns) == 1:
        for k, factor in enumerate(link.rotation):
            if isinstance(factor, Turn):
                return link.rotation[:k], link.rotation[k:]
    return link.rotation, ()


def _spun(rotation: Rotation, x: Vector) -> Vector:
    """R x, factor by factor."""
    for factor in reversed(rotation):
        x = rotated(matrix((factor,)), x)
    return x


def _speeds(seats: Sequence[Seat], v: Sequence[Scalar]) -> list[Speed]:
    result: list[Speed] = []
    for seat in seats:
        above = result[seat.parent].own if seat.parent >= 0 else NONE
        carrier = _spun(inverse(seat.outer), above)
        turn, slide = _combined(seat, v)
        own = _spun(inverse(seat.inner), sum_of(carrier, turn))
        rate = sum_of(cross(above, seat.arm), _spun(seat.outer, slide))
        result.append(Speed(carrier, own, turn, slide, rate))
    return result


def _combined(seat: Seat, values: Sequence[Scalar]) -> Pair:
    own = [values[j] for j in seat.columns]
    turn, slide = ([dot([m[k][i] for m in seat.motion], own) for i in range(3)] for k in (0, 1))
    return turn, slide


def _rate(seat: Seat, speed: Speed, above: Pair, omega: Vector, vdot: Sequence[Scalar]) -> Rate:
    """α and a from those of the carrier: a + A r at P, then what the joint adds."""
    alpha, a = above
    at_joint = sum_of(a, _swung(omega, alpha, seat.arm))
    back = inverse(seat.outer)
    carrier = _spun(back, alpha), _spun(back, at_joint)
    turn, slide = _combined(seat, vdot)
    turning = sum_of(sum_of(carrier[0], turn), cross(speed.carrier, speed.turn))
    middle = sum_of([times(2.0, x) for x in speed.carrier], speed.turn)
    sliding = sum_of(sum_of(carrier[1], slide), cross(middle, speed.slide))
    own = inverse(seat.inner)
    return Rate(carrier, (_spun(own, turning), _spun(own, sliding)))


def _swung(omega: Vector, alpha: Vector, r: Vector) -> Vector:
    """(α× + ω×ω×) r, by the matrix: its six products serve the link as well."""
    if is_nothing(r):
        return NONE
    return rotated(spin_matrix(omega, alpha), r)


def _inertia_force(body: Inertia, omega: Vector, rate: Pair) -> Wrench:
    """Newton–Euler at P: f = m a + A h, n = I α + ω × I ω + h × a."""
    alpha, a = rate
    force = rotated(spin_matrix(omega, alpha), body.moment)
    force = sum_of(force, scaled(body.mass, a))
    spin = [dot(row, omega) for row in body.tensor]
    moment = sum_of([dot(row, alpha) for row in body.tensor], cross(omega, spin))
    return sum_of(moment, cross(body.moment, a)), force


def _balanced(seat: Seat, wrench: Wrench, balance: Sequence[Scalar] | None) -> Wrench:
    """Along an axis of the frame the wrench is what the joint gives."""
    if balance is None or len(seat.motion) != 1:
        return wrench
    entries, motion = [*wrench[0], *wrench[1]], [*seat.motion[0][0], *seat.motion[0][1]]
    places = [k for k, x in enumerate(motion) if not is_zero(x)]
    if len(places) == 1 and motion[places[0]] in (1.0, -1.0):
        entries[places[0]] = times(motion[places[0]], balance[seat.columns[0]])
    return entries[:3], entries[3:]


def _turned(body: Inertia, flow: Flow, rotation: Rotation) -> tuple[Inertia, Flow]:
    """In the axes that the rotation leads to."""
    moment, tensor, p, swirl = body.moment, body.tensor, flow.p, flow.G
    for factor in reversed(rotation):
        R = matrix((factor,))
        moment, tensor, p = rotated(R, moment), turned_tensor(tensor, factor), rotated(R, p)
        swirl = _turned_flow(swirl, factor)
    return Inertia(body.mass, moment, tensor), Flow(p, swirl)


def _turned_flow(G: Matrix, factor: Turn | Still) -> Matrix:
    """R G Rᵀ; about a principal axis z with k = s (Gxx − Gyy) + c (Gxy + Gyx): Gxx' = Gxx − s k,
    Gyy' = Gyy + s k, Gxy' = c k − Gyx, Gyx' = c k − Gxy."""
    R = matrix((factor,))
    if not (isinstance(factor, Turn) and factor.axis in UNIT.values()):
        return product(product(R, G), transpose(R))
    z = factor.axis.index(1.0)
    x, y = (z + 1) % 3, (z + 2) % 3
    s, c = ca.sin(factor.angle), ca.cos(factor.angle)
    k = dot([s, c], [minus(G[x][x], G[y][y]), plus(G[x][y], G[y][x])])
    sk, ck = dot([s], [k]), dot([c], [k])
    result = [list(row) for row in G]
    result[x][x], result[y][y] = minus(G[x][x], sk), plus(G[y][y], sk)
    result[x][y], result[y][x] = minus(ck, G[y][x]), minus(ck, G[x][y])
    result[x][z], result[y][z] = dot([c, -s], [G[x][z], G[y][z]]), dot([s, c], [G[x][z], G[y][z]])
    result[z][x], result[z][y] = dot([c, -s], [G[z][x], G[z][y]]), dot([s, c], [G[z][x], G[z][y]])
    return result


def _shifted(body: Inertia, flow: Flow, r: Vector, rate: Vector) -> tuple[Inertia, Flow]:
    """About a point −r away that moves with −ṙ."""
    return moved(body, (), r), shifted(flow, body.mass, body.moment, r, rate)


def _sum(a: Wrench, b: Wrench) -> Wrench:
    return sum_of(a[0], b[0]), sum_of(a[1], b[1])


def _crossed(motion: Pair, wrench: Wrench) -> Wrench:
    """The rate of a wrench that is turned and shifted with the motion."""
    (e, s), (n, f) = motion, wrench
    return sum_of(cross(e, n), cross(s, f)), cross(e, f)
