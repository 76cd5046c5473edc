"""Model → links: joint by joint from base to tip, bodies on fixed joints merged into the body that carries them."""

from __future__ import annotations

from dataclasses import replace

from derive.joints import joint_type
from derive.joints.records import Matrix, Rotation, Scalar, Still, Vector
from derive.joints.rotations import IDENTITY, cross, dot, inverse, is_zero, matrix, merged, product, rotated, sum_of, transpose
from derive.mechanics.records import Inertia, Link, Place
from derive.mechanics.symbols import Symbols
from derive.model.records import GROUND, Body, Joint, Model, Placement

ORIGIN: Vector = [0.0, 0.0, 0.0]
ON_GROUND = Place(-1, (), ORIGIN)


def links_and_places(model: Model, symbols: Symbols) -> tuple[tuple[Link, ...], dict[str, Place]]:
    """The links, parents first, and for every body (ground too) where it sits in which link."""
    places: dict[str, Place] = {GROUND: ON_GROUND}
    links: list[Link] = []
    bodies = {body.name: body for body in model.bodies}
    for joint in model.joints:
        if joint.velocities:
            links.append(_link(model, symbols, joint, bodies[joint.child], places[joint.parent]))
            places[joint.child] = Place(len(links) - 1, (), ORIGIN)
        else:
            place = _welded(symbols, joint, places[joint.parent])
            places[joint.child] = place
            _absorb(links, place, inertia(symbols, bodies[joint.child]))
    return tuple(links), places


def _link(model: Model, symbols: Symbols, joint: Joint, body: Body, carrier: Place) -> Link:
    kind = joint_type(joint.type, joint.orientation)
    axis = symbols.vector(joint.axis)
    q = [symbols.names[name] for name in joint.coordinates]
    on_parent, in_parent = placement(symbols, joint.at_parent)
    on_child, b = placement(symbols, joint.at_child)
    on_carrier = merged(carrier.rotation, on_parent)
    turned = merged(on_carrier, kind.rotation(q, axis), inverse(on_child))
    start = sum_of(carrier.position, rotated(matrix(carrier.rotation), in_parent))
    motion = tuple(_turned_twist(matrix(on_child), column) for column in kind.motion(q, axis))
    columns = tuple(_index(model, name) for name in joint.velocities)
    return Link(
        name=body.name,
        parent=carrier.link,
        rotation=turned,
        R=matrix(turned),
        a=sum_of(start, rotated(matrix(on_carrier), kind.translation(q, axis))),
        b=b,
        motion=motion,
        columns=columns,
        turns_about=_principal_turn(motion),
        inertia=inertia(symbols, body),
    )


def _index(model: Model, velocity: str) -> int:
    return next(i for i, v in enumerate(model.velocities) if v.name == velocity)


def _turned_twist(R: Matrix, twist: Vector) -> Vector:
    return [*rotated(R, twist[:3]), *rotated(R, twist[3:])]


def _principal_turn(motion: tuple[Vector, ...]) -> int:
    if len(motion) != 1 or not all(is_zero(x) for x in motion[0][3:]):
        return -1
    entries = [x for x in motion[0][:3] if not is_zero(x)]
    return next(i for i in range(3) if not is_zero(motion[0][i])) if len(entries) == 1 else -1


def placement(symbols: Symbols, at: Placement) -> tuple[Rotation, Vector]:
    """body ← joint frame, and the joint frame's origin in the body."""
    if at.rotation is None:
        return (), symbols.vector(at.position)
    return (Still([symbols.vector(row) for row in at.rotation]),), symbols.vector(at.position)


def _welded(symbols: Symbols, joint: Joint, carrier: Place) -> Place:
    on_parent, in_parent = placement(symbols, joint.at_parent)
    on_child, in_child = placement(symbols, joint.at_child)
    turned = merged(carrier.rotation, on_parent, inverse(on_child))
    start = sum_of(carrier.position, rotated(matrix(carrier.rotation), in_parent))
    return Place(carrier.link, turned, [x - y for x, y in zip(start, rotated(matrix(turned), in_child))])


def _absorb(links: list[Link], place: Place, extra: Inertia) -> None:
    if place.link >= 0:
        link = links[place.link]
        links[place.link] = replace(link, inertia=summed(link.inertia, moved(extra, matrix(place.rotation), place.position)))


def inertia(symbols: Symbols, body: Body) -> Inertia:
    """About the body's origin: I_o = I_c + m (c·c 1 − c cᵀ)."""
    mass, com = symbols.scalar(body.mass), symbols.vector(body.com)
    xx, yy, zz, xy, xz, yz = symbols.vector(body.inertia)
    about_com = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return Inertia(mass, _scaled(mass, com), _added(about_com, _steiner(mass, com)))


def _scaled(k: Scalar, x: Vector) -> Vector:
    return [dot([k], [e]) for e in x]


def _added(a: Matrix, b: Matrix) -> Matrix:
    return [sum_of(x, y) for x, y in zip(a, b)]


def _steiner(mass: Scalar, r: Vector) -> Matrix:
    square = dot(r, r)
    return [[dot([mass], [(square if i == j else 0.0) - dot([r[i]], [r[j]])]) for j in range(3)] for i in range(3)]


def summed(a: Inertia, b: Inertia) -> Inertia:
    return Inertia(a.mass + b.mass, sum_of(a.moment, b.moment), _added(a.tensor, b.tensor))


def moved(i: Inertia, R: Matrix, r: Vector) -> Inertia:
    """The same inertia seen from a frame in which its own sits with R (frame ← own) at r.

    m' = m, (mc)' = R mc + m r, I' = R I Rᵀ + m [r·r] + 2 r·mc − …: I' = R I Rᵀ − ([r]× [mc']× + [R mc]× [r]×).
    """
    turned = rotated(R, i.moment)
    moment = sum_of(turned, _scaled(i.mass, r))
    tensor = i.tensor if R is IDENTITY else product(product(R, i.tensor), transpose(R))
    shift = _added(_cross_product(r, moment), _cross_product(turned, r))
    return Inertia(i.mass, moment, [[x - y for x, y in zip(a, b)] for a, b in zip(tensor, shift)])


def _cross_product(a: Vector, b: Vector) -> Matrix:
    """[a]× [b]× = b aᵀ − (a·b) 1."""
    along = dot(a, b)
    return [[dot([b[i]], [a[j]]) - (along if i == j else 0.0) for j in range(3)] for i in range(3)]


def carried(twist: tuple[Vector, Vector], R: Matrix, a: Vector) -> tuple[Vector, Vector]:
    """(ω, v) of the parent at the joint point, in the link's frame: Rᵀ ω, Rᵀ (v + ω × a)."""
    back = transpose(R)
    return rotated(back, twist[0]), rotated(back, sum_of(twist[1], cross(twist[0], a)))
