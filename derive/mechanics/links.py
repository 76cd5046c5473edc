"""Model → links: joint by joint from base to tip, bodies on fixed joints merged into the body that
carries them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints import joint_type
from derive.joints.records import JointType, Rotation, Still, Turn
from derive.joints.rotations import (
    UNIT,
    cross,
    difference,
    dot,
    inverse,
    is_zero,
    matrix,
    matrix_sum,
    merged,
    minus,
    plus,
    product,
    rotated,
    scaled,
    sum_of,
    transpose,
)
from derive.mechanics.limits import EXACT
from derive.mechanics.records import Inertia, Link, Place
from derive.mechanics.symbols import Symbols
from derive.model.records import GROUND, Body, Joint, Model, Placement

ORIGIN: Vector = [0.0, 0.0, 0.0]
ON_GROUND = Place(-1, (), ORIGIN)
NOTHING = Inertia(0.0, [0.0] * 3, [[0.0] * 3 for _ in range(3)])


def links_and_places(model: Model, symbols: Symbols) -> tuple[tuple[Link, ...], dict[str, Place]]:
    """The links, parents first, and for every body (ground too) where it sits in which link.

    A joint with several parts gives massless links between; a fixed joint gives none, its body is
    merged into its carrier. A link's frame has an axis along the joint where that can be had, as a
    turn about x, y or z costs least.
    """
    places: dict[str, Place] = {GROUND: ON_GROUND}
    links: list[Link] = []
    bodies = {body.name: body for body in model.bodies}
    for joint in model.joints:
        places[joint.child] = _placed(model, symbols, joint, places[joint.parent], links)
        _absorb(links, places[joint.child], inertia(symbols, bodies[joint.child]))
    return tuple(links), places


def _placed(
    model: Model, symbols: Symbols, joint: Joint, carrier: Place, links: list[Link]
) -> Place:
    """Append the joint's links and say where the child sits."""
    if not joint.velocities:
        return _welded(symbols, joint, carrier)
    parts = _parts(model, symbols, joint)
    on_parent, in_parent = placement(symbols, joint.at_parent)
    start = sum_of(carrier.position, rotated(matrix(carrier.rotation), in_parent))
    # the carrier may be a body that is merged into another: its own place comes first
    on_carrier, parent = merged(carrier.rotation, on_parent), carrier.link
    for part in parts[:-1]:
        links.append(_link(f"{joint.child} at {joint.name}", parent, on_carrier, start, part, ()))
        parent, on_carrier, start = len(links) - 1, _body_in_link(part, ()), ORIGIN
    on_child, b = placement(symbols, joint.at_child)
    last = _link(joint.child, parent, on_carrier, start, parts[-1], on_child)
    body = _body_in_link(parts[-1], on_child)
    links.append(replace(last, b=rotated(matrix(body), b)))
    return Place(len(links) - 1, body, ORIGIN)


@dataclass(frozen=True)
class Part:
    """A joint, or one of the simpler joints it is a chain of."""

    kind: JointType
    axis: Vector
    q: Vector
    columns: tuple[int, ...]


def _parts(model: Model, symbols: Symbols, joint: Joint) -> list[Part]:
    """The joint itself, or its chain of simpler joints: a universal joint is two turns."""
    kind = joint_type(joint.type, joint.orientation, symbols.scalar(joint.pitch))
    axis = symbols.vector(joint.axis)
    q = [symbols.names[name] for name in joint.coordinates]
    columns = tuple(map(model.velocity_index, joint.velocities))
    if not kind.parts:
        return [Part(kind, axis, q, columns)]
    axes = (axis, symbols.vector(joint.axis2) if joint.axis2 else axis)
    return [
        Part(joint_type(n), e, [q[k]], (columns[k],))
        for k, (n, e) in enumerate(zip(kind.parts, axes))
    ]


def _link(
    name: str, parent: int, on_carrier: Rotation, start: Vector, part: Part, on_child: Rotation
) -> Link:
    """A massless link; its frame is the child's body frame or, where the axis is oblique there, one
    with z along the axis."""
    if _is_oblique(part, on_child):
        upright = _aligning(part.axis)
        to_link = inverse(upright)  # link ← joint frame
        rotation = merged(
            on_carrier,
            upright,
            part.kind.rotation(part.q, [0.0, 0.0, 1.0] if upright else part.axis),
        )
    else:
        to_link = on_child
        rotation = merged(on_carrier, part.kind.rotation(part.q, part.axis), inverse(on_child))
    motion = tuple(
        _turned_twist(matrix(to_link), column) for column in part.kind.motion(part.q, part.axis)
    )
    motion = tuple([exact(x) for x in column] for column in motion)
    slide = part.kind.translation(part.q, part.axis)
    a = sum_of(start, rotated(matrix(on_carrier), slide))
    return Link(
        name,
        parent,
        rotation,
        matrix(rotation),
        a,
        ORIGIN,
        motion,
        part.columns,
        _principal_turn(motion),
        NOTHING,
    )


def _body_in_link(part: Part, on_child: Rotation) -> Rotation:
    """link ← body."""
    return (
        merged(inverse(_aligning(part.axis)), inverse(on_child))
        if _is_oblique(part, on_child)
        else ()
    )


def _is_oblique(part: Part, on_child: Rotation) -> bool:
    """Whether the axis of a joint with one axis lies along no axis of the child's frame."""
    if not part.kind.needs_axis:
        return False
    return sum(not is_zero(exact(x)) for x in rotated(matrix(on_child), part.axis)) > 1


def exact(x: Scalar) -> Scalar:
    """Rounding errors of a constant direction taken away, so that structural zeros are seen."""
    if not isinstance(x, float):
        return x
    nearest = float(round(x))
    return nearest if abs(x - nearest) < EXACT else x


def _aligning(axis: Vector) -> Rotation:
    """A constant rotation that takes z to the axis; none where the axis is x, y or z already."""
    unit = np.array([float(x) for x in axis])
    if np.count_nonzero(unit) == 1:
        return ()
    side = np.cross(np.eye(3)[int(np.argmin(np.abs(unit)))], unit)
    x = side / np.linalg.norm(side)
    return (Still(np.column_stack([x, np.cross(unit, x), unit]).tolist()),)


def _turned_twist(R: Matrix, twist: Vector) -> Vector:
    return [*rotated(R, twist[:3]), *rotated(R, twist[3:])]


def _principal_turn(motion: tuple[Vector, ...]) -> int:
    if len(motion) != 1 or not all(is_zero(x) for x in motion[0][3:]):
        return -1
    entries = [x for x in motion[0][:3] if not is_zero(x)]
    return next(i for i in range(3) if not is_zero(motion[0][i])) if len(entries) == 1 else -1


def placement(symbols: Symbols, at: Placement) -> tuple[Rotation, Vector]:
    """body ← joint frame, and the joint frame's origin in the body (m); no factor where the axes
    agree, so that nothing is multiplied."""
    if at.rotation is None:
        return (), symbols.vector(at.position)
    return (Still([symbols.vector(row) for row in at.rotation]),), symbols.vector(at.position)


def _welded(symbols: Symbols, joint: Joint, carrier: Place) -> Place:
    on_parent, in_parent = placement(symbols, joint.at_parent)
    on_child, in_child = placement(symbols, joint.at_child)
    turned = merged(carrier.rotation, on_parent, inverse(on_child))
    start = sum_of(carrier.position, rotated(matrix(carrier.rotation), in_parent))
    return Place(carrier.link, turned, difference(start, rotated(matrix(turned), in_child)))


def _absorb(links: list[Link], place: Place, extra: Inertia) -> None:
    if place.link >= 0:  # a body without mass has exact zeros, and adding them changes nothing
        link = links[place.link]
        links[place.link] = replace(
            link, inertia=summed(link.inertia, moved(extra, place.rotation, place.position))
        )


def inertia(symbols: Symbols, body: Body) -> Inertia:
    """Mass, first moment m c and tensor of a body about its own origin, in its frame: I_o = I_c + m
    (c·c 1 − c cᵀ), in kg, kg m, kg m².

    The file's tensor is about the centre of mass, or about the origin and then taken as it is, with
    products of inertia as entries of the matrix (Ixy = −∫ x y dm).
    """
    mass, com = symbols.scalar(body.mass), symbols.vector(body.com)
    first = body.first_moment
    moment = scaled(mass, com) if first is None else symbols.vector(first)
    if body.about_origin is not None:
        return Inertia(mass, moment, _tensor(symbols.vector(body.about_origin)))
    about_com = _tensor(symbols.vector(body.inertia))
    return Inertia(mass, moment, matrix_sum(about_com, _steiner(mass, com)))


def _tensor(six: Vector) -> Matrix:
    xx, yy, zz, xy, xz, yz = six
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _steiner(mass: Scalar, r: Vector) -> Matrix:
    square = dot(r, r)
    return [
        [dot([mass], [(square if i == j else 0.0) - dot([r[i]], [r[j]])]) for j in range(3)]
        for i in range(3)
    ]


def summed(a: Inertia, b: Inertia) -> Inertia:
    """The inertia of two bodies as one rigid link. Both are about the same origin and in the same
    axes, so mass, first moment and tensor simply add: no parallel-axis term."""
    return Inertia(plus(a.mass, b.mass), sum_of(a.moment, b.moment), matrix_sum(a.tensor, b.tensor))


def moved(i: Inertia, rotation: Rotation, r: Vector) -> Inertia:
    """The same inertia seen from a frame in which its own sits with `rotation` (frame ← own) at r.

    m' = m,  (mc)' = R mc + m r,  I' = R I Rᵀ − [r]× [(mc)']× − [R mc]× [r]×; upper triangle only,
    then mirrored.
    """
    turned = rotated(matrix(rotation), i.moment)
    moment = sum_of(turned, scaled(i.mass, r))
    tensor = i.tensor
    for factor in reversed(rotation):
        tensor = turned_tensor(tensor, factor)
    return Inertia(
        i.mass, moment, symmetric(lambda a, b: minus(tensor[a][b], _shift(r, moment, turned, a, b)))
    )


def symmetric(entry: Callable[[int, int], Scalar]) -> Matrix:
    """A symmetric 3 × 3 matrix from its upper triangle."""
    upper = {(a, b): entry(a, b) for a in range(3) for b in range(a, 3)}
    return [[upper[min(a, b), max(a, b)] for b in range(3)] for a in range(3)]


def _shift(r: Vector, moment: Vector, turned: Vector, a: int, b: int) -> Scalar:
    """Entry of [r]× [moment]× + [turned]× [r]×, with [x]× [y]× = y xᵀ − (x·y) 1."""
    off = dot([moment[a], r[a]], [r[b], turned[b]])
    if a != b:
        return off
    others = [k for k in range(3) if k != a]
    return -sum((dot([r[k]], [moment[k]]) + dot([turned[k]], [r[k]]) for k in others), 0.0)


def turned_tensor(I: Matrix, factor: Turn | Still) -> Matrix:
    """R I Rᵀ for one factor of a rotation."""
    if isinstance(factor, Turn) and factor.axis in UNIT.values():
        return _spun_tensor(I, factor)
    R = matrix((factor,))
    half = product(R, I)
    return symmetric(lambda a, b: dot(half[a], R[b]))


def _spun_tensor(I: Matrix, turn: Turn) -> Matrix:
    """About a principal axis z with c, s and k = s (Ixx − Iyy) + 2 c Ixy:
    Ixx' = Ixx − s k,  Iyy' = Iyy + s k,  Ixy' = c k − Ixy,  (Ixz', Iyz') turned like a vector.
    """
    z = turn.axis.index(1.0)
    x, y = (z + 1) % 3, (z + 2) % 3
    s, c = ca.sin(turn.angle), ca.cos(turn.angle)
    k = dot([s], [I[x][x] - I[y][y]]) + dot([c], [2.0 * I[x][y]])
    result = [list(row) for row in I]
    result[x][x], result[y][y] = I[x][x] - dot([s], [k]), I[y][y] + dot([s], [k])
    result[x][y] = result[y][x] = dot([c], [k]) - I[x][y]
    result[x][z] = result[z][x] = dot([c, -s], [I[x][z], I[y][z]])
    result[y][z] = result[z][y] = dot([s, c], [I[x][z], I[y][z]])
    return result


def regrouped(links: Sequence[Link]) -> tuple[Inertia, ...]:
    """Inertias with everything a joint cannot feel moved to the link that carries it; M and h stay
    the same.

    Of a link that turns about z through the joint point: mass, mz and the part diag(Iyy, Iyy, 0)
    look the same from the carrier at every angle. Of a link that slides: its tensor about the
    origin. What reaches the ground is dropped. (Gautier & Khalil 1990, base inertial parameters.)
    """
    result = [link.inertia for link in links]
    for i in reversed(range(len(links))):
        link = links[i]
        if len(link.columns) != 1:
            continue
        common = _unfelt(link, result[i])
        if common is None:
            continue
        # negative masses are no mistake here: only what the joint feels is left
        result[i] = summed(result[i], _negative(moved(common, (), link.b)))
        if link.parent >= 0:
            seen = moved(common, at_zero(link.rotation), _start(link))
            result[link.parent] = summed(result[link.parent], seen)
    return tuple(result)


def _unfelt(link: Link, own: Inertia) -> Inertia | None:
    """The part, about the joint point, that moves with the carrier at every position of the
    joint."""
    z = link.turns_about
    if z < 0:
        if any(not is_zero(x) for x in link.motion[0][:3]):
            return None
        return Inertia(0.0, [0.0] * 3, moved(own, (), [-x for x in link.b]).tensor)
    at_joint = moved(own, (), [-x for x in link.b])
    y = (z + 2) % 3
    across = at_joint.tensor[y][y]
    tensor = [[across if a == b and a != z else 0.0 for b in range(3)] for a in range(3)]
    return Inertia(
        at_joint.mass, [x if k == z else 0.0 for k, x in enumerate(at_joint.moment)], tensor
    )


def _negative(i: Inertia) -> Inertia:
    return Inertia(-i.mass, [-x for x in i.moment], [[-x for x in row] for row in i.tensor])


def at_zero(rotation: Rotation) -> Rotation:
    """With all angles zero."""
    return tuple(f if isinstance(f, Still) else Turn(f.axis, 0.0) for f in rotation)


def _start(link: Link) -> Vector:
    """The joint point in the carrier; a sliding link hands down a tensor alone, for which the place
    does not matter."""
    return link.a if link.turns_about >= 0 else [0.0, 0.0, 0.0]


def carried(twist: tuple[Vector, Vector], R: Matrix, a: Vector) -> tuple[Vector, Vector]:
    """(ω, v) of the parent at the joint point, in the link's frame: Rᵀ ω, Rᵀ (v + ω × a). R: parent
    ← link, a in the parent's frame."""
    back = transpose(R)
    return rotated(back, twist[0]), rotated(back, sum_of(twist[1], cross(twist[0], a)))
