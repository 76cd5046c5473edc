"""Where a named frame is and how it moves, along the path that carries it from the base.

A frame sits in the link that its body is part of. Its twist is (v, ω): velocity of its origin, then
angular velocity, the order of Pinocchio. Three ways to write it down, by the names that Pinocchio
gives them:

    LOCAL                origin of the frame, axes of the frame
    LOCAL_WORLD_ALIGNED  origin of the frame, axes of the ground
    WORLD                the point that is at the ground's origin, axes of the ground

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008; Carpentier et al., The Pinocchio C++
library, 2019.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from derive.expressions.counting import cheapest
from derive.expressions.scalars import Matrix, Scalar, Vector
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
from derive.mechanics.links import carried, placement
from derive.mechanics.records import Link, Place
from derive.mechanics.recursions.motion import STILL, Numbers, child_numbers, velocity_products
from derive.mechanics.recursions.tree import ground_rotations, path
from derive.mechanics.symbols import Symbols
from derive.model.records import NamedFrame

LOCAL, ALIGNED, WORLD = "_local", "", "_world"
NOTHING: Vector = [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class FrameChain:
    """A frame at the end of the chain of links that carry it, the first on the ground."""

    chain: tuple[Link, ...]
    place: Place


def place_of(symbols: Symbols, places: Mapping[str, Place], frame: NamedFrame) -> Place:
    """The frame in the link that its body is part of."""
    body = places[frame.body]
    on_body, inside = placement(symbols, frame.at)
    position = sum_of(body.position, rotated(matrix(body.rotation), inside))
    return Place(body.link, merged(body.rotation, on_body), position)


def frame_chain(links: Sequence[Link], place: Place) -> FrameChain:
    """The frame with the links from the base to its own, each the child of the one before."""
    chain = [links[i] for i in path(links, place.link)]
    return FrameChain(tuple(replace(x, parent=k - 1) for k, x in enumerate(chain)), place)


def pose(frame: FrameChain) -> Matrix:
    """[R p], 3 × 4: R ground ← frame, p (m) the origin of the frame in the ground."""
    place = frame.place
    if not frame.chain:
        return _beside(matrix(place.rotation), place.position)
    axes = ground_rotations(frame.chain)
    point = sum_of(frame.chain[0].a, arms(frame, axes)[0])
    last = frame.chain[-1].rotation
    above = axes[-2] if len(axes) > 1 else IDENTITY
    ways = [
        product(axes[-1], matrix(place.rotation)),
        # what is fixed beyond the last joint turns with it: one product less, where it is a turn
        product(above, matrix(merged(last, place.rotation))),
    ]
    return cheapest([_beside(R, point) for R in ways])


def _beside(R: Matrix, point: Vector) -> Matrix:
    return [[*row, x] for row, x in zip(R, point)]


def arms(frame: FrameChain, axes: Sequence[Matrix]) -> list[Vector]:
    """From the joint point of each link to the origin of the frame, along the axes that `axes`
    (target ← link) turn to. Summed from the frame back, so that no position is subtracted."""
    result: list[Vector] = []
    beyond, after = frame.place.position, NOTHING
    for link, R in zip(reversed(frame.chain), reversed(axes)):
        after = sum_of(rotated(R, difference(beyond, link.b)), after)
        result.append(after)
        beyond = link.a
    return result[::-1]


def jacobian(frame: FrameChain, written: str) -> dict[int, Vector]:
    """The columns of J, (v, ω) = J v, by their index in v: six numbers each. What does not move the
    frame has none."""
    axes = _frame_axes(frame) if written == LOCAL else ground_rotations(frame.chain)
    reach = _from_origin(frame, axes) if written == WORLD else arms(frame, axes)
    result: dict[int, Vector] = {}
    for link, R, arm in zip(frame.chain, axes, reach):
        for column, j in zip(link.motion, link.columns):
            turn, slide = rotated(R, column[:3]), rotated(R, column[3:])
            result[j] = [*sum_of(slide, cross(turn, arm)), *turn]
    return result


def _frame_axes(frame: FrameChain) -> list[Matrix]:
    """Frame ← link for every link of the chain, walked from the frame back to the base."""
    steps = [inverse(frame.place.rotation), *(inverse(x.rotation) for x in frame.chain[:0:-1])]
    back = [
        replace(link, parent=k - 1, rotation=step, R=matrix(step))
        for k, (link, step) in enumerate(zip(frame.chain, steps))
    ]
    return ground_rotations(back)[::-1]


def _from_origin(frame: FrameChain, axes: Sequence[Matrix]) -> list[Vector]:
    """From the joint points back to the ground's origin."""
    result: list[Vector] = []
    point, before, carrier = NOTHING, NOTHING, IDENTITY
    for link, own in zip(frame.chain, axes):
        point = difference(point, rotated(carrier, difference(link.a, before)))
        result.append(point)
        before, carrier = link.b, own
    return result


def velocity(frame: FrameChain, v: Sequence[Scalar], written: str) -> Vector:
    """J v by recursion over the links: (velocity of the origin, angular velocity), m/s and
    rad/s."""
    if not frame.chain:
        return [0.0] * 6
    omega, speed = _at_origin(frame, _twists(frame, v)[-1])
    return _along_axes(frame, (omega, speed), written)


def acceleration(
    frame: FrameChain, v: Sequence[Scalar], vdot: Sequence[Scalar], written: str
) -> Vector:
    """J v̇ + J̇ v: the rate of the six components of `velocity`.

    With the axes of the frame, and at the ground's origin, that is the spatial acceleration; at the
    frame's origin with the ground's axes the classical one, v̈ of the point (Pinocchio's
    getFrameClassicalAcceleration). J̇ v alone where v̇ is zero.
    """
    if not frame.chain:
        return [0.0] * 6
    omega, speed = _at_origin(frame, _twists(frame, v)[-1])
    alpha, rate = _at_origin(frame, _rates(frame, v, vdot))
    if written == LOCAL:
        return _along_axes(frame, (alpha, rate), LOCAL)
    # v̇ holds the rates of components along axes that turn with ω
    moved = _along_axes(frame, (alpha, sum_of(rate, cross(omega, speed))), ALIGNED)
    if written == ALIGNED:
        return moved
    now = _along_axes(frame, (omega, speed), ALIGNED)
    point = [row[3] for row in pose(frame)]
    swung = sum_of(cross(point, moved[3:]), cross(now[:3], now[3:]))
    return [*sum_of(moved[:3], swung), *moved[3:]]


def _twists(frame: FrameChain, v: Sequence[Scalar]) -> list[Numbers]:
    result: list[Numbers] = []
    for link in frame.chain:
        before = result[-1] if result else STILL
        result.append(child_numbers(link, before, [v[j] for j in link.columns]))
    return result


def _rates(frame: FrameChain, v: Sequence[Scalar], vdot: Sequence[Scalar]) -> Numbers:
    """(ω̇, v̇) of the last link: the rates of its twist's components."""
    rate = before = STILL
    for link, numbers in zip(frame.chain, _twists(frame, v)):
        rate = rate_of(link, before, rate, [v[j] for j in link.columns], vdot)
        before = numbers
    return rate


def rate_of(
    link: Link, parent: Numbers, rate: Numbers, v: Vector, vdot: Sequence[Scalar]
) -> Numbers:
    """The rate of a link's twist from the twist of its parent and that twist's rate; `v` are the
    joint's own velocities, `vdot` the rates of all."""
    products = velocity_products(link, parent, v)
    angular, linear = carried(rate, link.R, link.a)
    own = [vdot[j] for j in link.columns]
    joint = [dot([column[i] for column in link.motion], own) for i in range(6)]
    alpha = sum_of(sum_of(angular, products.angular), joint[:3])
    at_joint = sum_of(sum_of(linear, products.linear), joint[3:])
    return alpha, sum_of(at_joint, cross(link.b, alpha))


def _at_origin(frame: FrameChain, numbers: Numbers) -> Numbers:
    """(ω, v) of the link at the frame's origin, still along the axes of the link."""
    omega, speed = numbers
    return omega, sum_of(speed, cross(omega, frame.place.position))


def _along_axes(frame: FrameChain, numbers: Numbers, written: str) -> Vector:
    """(v, ω) along the axes, and at the point, that it is to be written down for."""
    omega, speed = numbers
    if written == LOCAL:
        back = transpose(matrix(frame.place.rotation))
        return [*rotated(back, speed), *rotated(back, omega)]
    R = ground_rotations(frame.chain)[-1]
    spin, motion = rotated(R, omega), rotated(R, speed)
    if written == WORLD:
        point = [row[3] for row in pose(frame)]
        motion = sum_of(motion, cross(point, spin))
    return [*motion, *spin]


def unit_quaternion(R: Matrix) -> Vector:
    """(w, x, y, z) with the largest entry positive, of the row of 4 q qᵀ with the largest diagonal,
    so that nothing is divided by less than one (Shepperd 1978)."""
    rows = _products_of_quaternion(R)
    sizes = [ca.SX(rows[k][k]) for k in range(4)]
    largest = sizes[0]
    for size in sizes[1:]:
        largest = ca.fmax(largest, size)
    chosen = [ca.SX(x) for x in rows[3]]
    for k in (2, 1, 0):
        chosen = [ca.if_else(sizes[k] >= largest, x, y) for x, y in zip(rows[k], chosen)]
    divisor = 2.0 * ca.sqrt(largest)
    return [x / divisor for x in chosen]


def _products_of_quaternion(R: Matrix) -> Matrix:
    """4 q qᵀ, from the entries of R."""
    diagonal = [R[k][k] for k in range(3)]
    result: Matrix = [[0.0] * 4 for _ in range(4)]
    for k, signs in enumerate(((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1))):
        signed = [x if sign > 0 else minus(0.0, x) for sign, x in zip(signs, diagonal)]
        result[k][k] = plus(1.0, plus(signed[0], plus(signed[1], signed[2])))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        result[0][i + 1] = result[i + 1][0] = minus(R[k][j], R[j][k])
        result[i + 1][j + 1] = result[j + 1][i + 1] = plus(R[i][j], R[j][i])
    return result
