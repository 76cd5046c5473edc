"""A free body that rolls, written with one frame more: one that leans with the wheel and does not
turn with it.

Of a free joint with Euler angles about i, j, k, where e_k is the axle of a wheel, the frame before
the last turn is put at the wheel's centre c. In it the normal of the ground depends on the second
angle alone and the wheel's centre is at rest. Velocities are the centre's and

    ω·e_j = θ̇₂,   ω·e_a (a is neither j nor k),   Ω = ω·e_k of the body:

the body's own twist, in other axes and at another point, so that M, A and S only look different. At
which rate the frame itself turns about e_k follows from the attitude,

    ω_k = (f·e_k / f·e_a) ω_a,   f = R_jᵀ e_i,

and only velocity products know of it: the frame has no mass, and no row speaks of that turning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints import joint_type
from derive.joints.free import free_joint
from derive.joints.records import Rotation, Still, Turn
from derive.joints.rotations import (
    UNIT,
    cross,
    inverse,
    is_one,
    is_zero,
    matrix,
    merged,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.blocks import blocks
from derive.mechanics.constraints.rolling import wheel_of
from derive.mechanics.links import NOTHING, ORIGIN, moved, regrouped
from derive.mechanics.records import Carried, Link, Place, Spinless
from derive.mechanics.recursions.tree import twists
from derive.mechanics.scene import Scene
from derive.model.constraint_records import Rolling
from derive.model.records import Joint

FREE = 6  # velocities of a free joint


@dataclass(frozen=True)
class _Base:
    """The free joint: its link, where its coordinates begin, and the letters of its angles."""

    joint: Joint
    link: int
    start: int
    sequence: str


def carried(scene: Scene, gravity: Vector) -> tuple[Carried, ...]:
    """For every free body with Euler angles that a wheel turns about the last axis of, in its own
    axes and in those of a tilted joint: with symbols for the tilt these may take more. None where
    there is no such wheel."""
    result: list[Carried] = []
    for base in _bases(scene):
        centre, tilt = _centre(scene, base), _tilt(scene.links, base)
        if centre is not None:
            tilts = (_Tilt(), tilt) if tilt.turn else (tilt,)
            result += [_with_frame(scene, base, (centre, x), gravity) for x in tilts]
    return tuple(result)


def _bases(scene: Scene) -> list[_Base]:
    coordinates = [c.name for c in scene.model.coordinates]
    result: list[_Base] = []
    for joint in scene.model.joints:
        if joint_type(joint.type, joint.orientation).name != "free":
            continue
        sequence = joint.orientation or "zyx"
        link = scene.places[joint.child].link
        if sequence != "quaternion" and _is_plain(scene, link, sequence):
            start = coordinates.index(joint.coordinates[0])
            result.append(_Base(joint, link, start, sequence))
    return result


def _is_plain(scene: Scene, i: int, sequence: str) -> bool:
    """Whether the link moves in the ground's axes and its frame is the joint's."""
    link = scene.links[i]
    turns = [x.axis for x in link.rotation if isinstance(x, Turn)]
    plain = len(link.rotation) == len(turns) and turns == [UNIT[letter] for letter in sequence]
    return plain and link.parent < 0 and all(is_zero(x) for x in link.b)


def _centre(scene: Scene, base: _Base) -> Vector | None:
    """Of the first wheel whose axle is the last axis of the free joint, in the body's link."""
    k = "xyz".index(base.sequence[2])
    moving = ca.vertcat(scene.symbols.t, scene.symbols.q)
    for constraint in scene.model.constraints:
        if not isinstance(constraint, Rolling) or constraint.shape == "sphere":
            continue
        found = wheel_of(scene, constraint)
        along = all(is_zero(x) for i, x in enumerate(found.axis) if i != k)
        still = not ca.depends_on(ca.vertcat(*found.centre), moving)
        if found.place.link == base.link and along and still:
            return found.centre
    return None


def _with_frame(scene: Scene, base: _Base, seat: tuple[Vector, _Tilt], gravity: Vector) -> Carried:
    """`seat`: the wheel's centre, and the axes of the body."""
    s, i, (centre, tilt) = scene.symbols, base.link, seat
    first = scene.links[i].columns[0]
    own = [ca.SX.sym(f"frame_{x}") for x in ("vx", "vy", "vz", "wx", "wy", "wz", "spin")]
    v = ca.vertcat(s.v[:first], *own, s.v[first + FREE :])
    links = _links(scene, base, centre, tilt)
    frame = _frame(base, first, links[i])
    columns = tuple(range(first, first + FREE))
    own_axes = matrix(tilt.turn)
    speeds = _speeds(s.v, v, frame, links, own_axes)
    names = {name: _over(x, s.v, speeds) for name, x in s.names.items()}
    symbols = replace(s, v=v, names=names)
    qdot = _rates(scene, base, links, frame, v)
    places = {name: _shifted(place, i, tilt) for name, place in scene.places.items()}
    new = Scene(scene.model, symbols, qdot, links, places, frame)
    return Carried(
        s.t,
        s.q,
        s.p,
        v,
        _labels(scene, base, first),
        links,
        (tuple(link.inertia for link in links), regrouped(links)),
        tuple(block.ways for block in blocks(new)),
        gravity,
        speeds,
        qdot,
        frame,
        i + 1,
        own_axes,
        columns,
    )


def _speeds(
    old: ca.SX, v: ca.SX, frame: Spinless, links: Sequence[Link], own_axes: Matrix
) -> ca.SX:
    """v over v': the body's twist in its own axes, and all others as they are."""
    first, still = links[frame.link].columns[0], frame.still([v[j] for j in range(v.numel())])
    omega, velocity = (rotated(own_axes, x) for x in twists(links, still)[frame.link + 1])
    return ca.vertcat(old[:first], *velocity, *omega, old[first + FREE :])


def _labels(scene: Scene, base: _Base, first: int) -> tuple[str, ...]:
    """The names of v', for the words on pivots."""
    labels, here = [x.name for x in scene.model.velocities], f"{base.joint.child} at its wheel"
    own = [f"{here}.{x}" for x in ("vx", "vy", "vz", "wx", "wy", "wz", "spin")]
    return (*labels[:first], *own, *labels[first + FREE :])


def _over(x: Scalar, v: ca.SX, speeds: ca.SX) -> Scalar:
    return ca.substitute(x, v, speeds) if isinstance(x, ca.SX) and ca.depends_on(x, v) else x


def _shifted(place: Place, i: int, tilt: _Tilt) -> Place:
    if place.link != i:
        return place if place.link < i else replace(place, link=place.link + 1)
    position = rotated(matrix(tilt.back), place.position)
    return Place(i + 1, merged(tilt.back, place.rotation), position)


@dataclass(frozen=True)
class _Tilt:
    """Axes of the body that are turned about e_k from its link's: link ← axes, the same back, and
    the factor that a joint has for it."""

    turn: Rotation = ()
    back: Rotation = ()
    still: Still | None = None


def _tilt(links: Sequence[Link], base: _Base) -> _Tilt:
    """Those of the body's first joint that is tilted so: a body that turns about e_k anyway may
    have any such axes, and the joint then turns about one of them."""
    k = "xyz".index(base.sequence[2])
    a, b = (k + 1) % 3, (k + 2) % 3
    for link in links:
        if link.parent != base.link or link.turns_about in (-1, k) or not link.rotation:
            continue
        still = link.rotation[0]
        if isinstance(still, Still) and is_one(still.matrix[k][k]):
            turn = Turn(UNIT[base.sequence[2]], _angle(still.matrix[b][a], still.matrix[a][a]))
            return _Tilt((turn,), inverse((turn,)), still)
    return _Tilt()


def _angle(sine: Scalar, cosine: Scalar) -> Scalar:
    if isinstance(sine, float) and isinstance(cosine, float):
        return math.atan2(sine, cosine)
    return ca.atan2(sine, cosine)


def _links(scene: Scene, base: _Base, centre: Vector, tilt: _Tilt) -> tuple[Link, ...]:
    """With the frame before the body, which turns in it about the centre."""
    i, old = base.link, scene.links[base.link]
    first, k = old.columns[0], "xyz".index(base.sequence[2])
    place = sum_of(old.a, rotated(old.R, centre))
    motion = tuple(free_joint(base.sequence).motion([], []))
    leaning = old.rotation[:2]
    columns = tuple(range(first, first + FREE))
    frame = Link(
        f"{old.name} without its spin", -1, leaning, matrix(leaning), place, ORIGIN, motion,
        columns, -1, NOTHING,
    )  # fmt: skip
    spinning, back = merged(old.rotation[2:], tilt.turn), matrix(tilt.back)
    body = replace(
        old, parent=i, rotation=spinning, R=matrix(spinning), a=ORIGIN, b=rotated(back, centre),
        motion=(motion[3 + k],), columns=(first + FREE,), turns_about=k,
        inertia=moved(old.inertia, tilt.back, ORIGIN),
    )  # fmt: skip
    others = [_moved(link, base, first, tilt) for link in scene.links]
    return (*others[:i], frame, body, *others[i + 1 :])


def _moved(link: Link, base: _Base, first: int, tilt: _Tilt) -> Link:
    """With its place in the tree; what hangs on the body, in the body's new axes."""
    columns = tuple(j if j < first else j + 1 for j in link.columns)
    if link.parent != base.link:
        parent = link.parent if link.parent < base.link else link.parent + 1
        return replace(link, parent=parent, columns=columns)
    upright = tilt.still is not None and bool(link.rotation) and link.rotation[0] is tilt.still
    rotation = link.rotation[1:] if upright else merged(tilt.back, link.rotation)
    return replace(
        link, parent=base.link + 1, columns=columns, rotation=rotation, R=matrix(rotation),
        a=rotated(matrix(tilt.back), link.a),
    )  # fmt: skip


def _frame(base: _Base, first: int, link: Link) -> Spinless:
    j, k = ("xyz".index(letter) for letter in base.sequence[1:])
    a = 3 - j - k
    turned = _first_axis(base, link)
    angular = first + 3
    return Spinless(base.link, k, angular + a, angular + k, first + FREE, turned[a], turned[k])


def _first_axis(base: _Base, link: Link) -> Vector:
    """f = R_jᵀ e_i, the axis of the first turn in the frame."""
    return rotated(transpose(matrix(link.rotation[1:])), UNIT[base.sequence[0]])


def _rates(scene: Scene, base: _Base, links: Sequence[Link], frame: Spinless, v: ca.SX) -> ca.SX:
    """q̇ over v'. The body's origin is at −R_k c from the wheel's centre."""
    link, body = links[base.link], links[base.link + 1]
    velocity, omega = (
        [v[j] for j in link.columns[:3]],
        [v[body.columns[0]] if j == frame.column else v[j] for j in link.columns[3:]],
    )
    arm = [-x for x in rotated(body.R, body.b)]
    moved = rotated(link.R, sum_of(velocity, cross(omega, arm)))
    turning = frame.rate(v[frame.beside])
    middle = "xyz".index(base.sequence[1])
    angles = [
        v[frame.beside] / frame.along,
        v[link.columns[3 + middle]],
        v[frame.spin] - turning,
    ]
    result = ca.SX(scene.qdot)
    result[base.start : base.start + FREE] = ca.vertcat(*moved, *angles)
    return result
