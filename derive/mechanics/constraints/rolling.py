"""Disks, spheres and tori that roll without slip."""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic
from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Still, Turn
from derive.joints.rotations import (
    IDENTITY,
    cross,
    difference,
    dot,
    is_zero,
    matrix,
    merged,
    minus,
    plus,
    product,
    rotated,
    scaled,
    sum_of,
    times,
    transpose,
)
from derive.mechanics.constraints.records import Tie
from derive.mechanics.geometry.frames import axes_in_plane, ground_rotation, on_ground, triad
from derive.mechanics.geometry.surfaces import nearest_point, surface_over
from derive.mechanics.limits import FLAT
from derive.mechanics.records import Link, Place, Row, RowForm, TwistTerm
from derive.mechanics.recursions.tree import (
    ground_point,
    link_direction,
    link_point,
    relative_rotation,
)
from derive.mechanics.scene import NORMAL, NOTHING, Block, Scene
from derive.model.constraint_records import Rolling
from derive.model.mechanism.space import ORIGIN

Way = tuple[Vector, Vector]  # a direction, and r × direction, r from the centre to the contact


@dataclass(frozen=True)
class Wheel:
    """The body as its rows are written: in the frame of its link or, where it turns about its own
    axis on another link, in that link's, which does not spin with it. `axis` and `centre` in that
    frame; `spinning`: the link that turns about the axis, which is `own_axis` there, −1 where it is
    that of `place`."""

    place: Place
    axis: Vector
    centre: Vector
    spinning: int = -1
    own_axis: Vector = field(default_factory=lambda: NOTHING)


def rolling(scene: Scene, constraint: Rolling) -> Block:
    """A round body on a plane: φ = n·(P − origin) at the contact P, and the material point there
    does not move.

    Disk: P = centre + r d with d = −(n − (n·e) e)/|…|, the steepest way down in the disk; torus: P
    = centre + r d − tube n; sphere: P = centre − r n. Directions: n, t₁ = e × n/|…| (forward), t₂ =
    n × t₁; or, which is the same, the axes of the frame it is written in, or those of a wheel that
    leans: d, t₁ and e. In the plane a wheel has n and t₁ only.
    """
    base = scene.places[constraint.carrier]
    wheel = wheel_of(scene, constraint)
    back = _from_carrier(scene, wheel.place, base)
    foot = _foot(scene, constraint)
    # the normal of a surface changes from place to place, that of a plane with its body alone
    flat = constraint.surface is None and base.link < 0
    normal = _normal(scene, wheel, flat, rotated(back, foot.normal))
    contact, directions = _contact(scene, constraint, wheel.axis, normal.letters, back)
    point = normal.put_in(sum_of(wheel.centre, contact))
    phi = foot.height if constraint.surface else _height(scene, constraint, wheel.place, point)
    names = [f"{constraint.name}.{k}" for k in ("normal", "forward", "sideways")]
    links = (wheel.place.link, base.link)
    rows = tuple(
        _moving_row(normal, name, links, wheel, point, way) for name, way in zip(names, directions)
    )
    along_body = tuple(
        _moving_row(normal, f"{constraint.name} {'xyz'[k]}", links, wheel, point,
                    (IDENTITY[k], cross(contact, IDENTITY[k])))
        for k in axes_in_plane(scene, wheel.place.link)
    )  # fmt: skip
    marks = tuple(Row(row.name, 0 if i == 0 else -1, "m/s") for i, row in enumerate(rows))
    leaning = _leaning_rows(normal, constraint, wheel, base.link)
    ways = tuple(way for way in (rows, along_body, leaning) if len(way) == len(rows))
    return Block(marks, (phi,), ways)


def wheel_of(scene: Scene, constraint: Rolling) -> Wheel:
    """From link to link as long as each turns about the axis of the body, through its centre."""
    s, own = scene.symbols, scene.places[constraint.body]
    axis = own_axis = link_direction(own, s.vector(constraint.axis))
    centre, place = link_point(own, s.vector(constraint.centre)), own
    while place.link >= 0:
        link = scene.links[place.link]
        if link.parent < 0 or not _spins(link, axis, difference(centre, link.b)):
            break
        still = matrix(tuple(x for x in link.rotation if isinstance(x, Still)))
        centre = sum_of(link.a, rotated(still, difference(centre, link.b)))
        axis, place = rotated(still, axis), Place(link.parent, (), NOTHING)
    spinning = -1 if place.link == own.link else own.link
    return Wheel(place, axis, centre, spinning, own_axis)


def _spins(link: Link, axis: Vector, centre: Vector) -> bool:
    """Whether the link turns about the axis of the body, through its centre."""
    if link.turns_about < 0 or sum(isinstance(x, Turn) for x in link.rotation) != 1:
        return False
    beside = [k for k in range(3) if k != link.turns_about]
    return all(is_zero(x[k]) for x in (axis, centre) for k in beside)


def _from_carrier(scene: Scene, place: Place, base: Place) -> Matrix:
    """Link of the body ← body that carries the plane."""
    if base.link < 0:
        own = transpose(scene.rotations[place.link])
        return product(own, matrix(base.rotation)) if base.rotation else own
    turned = relative_rotation(scene.links, place.link, base.link)
    return matrix(merged(turned, base.rotation))


def _contact(
    scene: Scene, constraint: Rolling, e: Vector, n: Vector, back: Matrix
) -> tuple[Vector, list[Way]]:
    """From the centre to the contact, r, in the wheel's frame; and n, forward and sideways, each
    with r × direction."""
    s = scene.symbols
    radius = s.scalar(constraint.radius)
    if scene.model.plane or constraint.shape == "sphere":
        contact = [dot([-radius], [x]) for x in n]
        directions = _directions(scene, constraint, back, n)
        return contact, [(d, cross(contact, d)) for d in directions]
    lean = _lean(scene, constraint, e, n)
    forward, length = scaled(lean.side, lean.forward), times(lean.side, lean.length)
    tube, sideways = s.scalar(constraint.tube), cross(n, forward)
    contact = difference(scaled(radius, cross(e, forward)), scaled(tube, n))
    if constraint.surface is not None:
        directions = _directions(scene, constraint, back, n)
        return contact, [(d, cross(contact, d)) for d in directions]
    turning = [
        scaled(dot([radius], [dot(n, e)]), forward),
        [minus(0.0, x) for x in sum_of(scaled(radius, e), scaled(tube, sideways))],
        scaled(plus(dot([radius], [length]), tube), forward),
    ]
    return contact, list(zip([n, forward, sideways], turning))


@dataclass(frozen=True)
class Lean:
    """How a wheel stands on a plane: e along the axle, forward f = e × n/ℓ, down d = e × f, so that
    n = −ℓ d + ν e. ℓ is ±|e × n|, whichever is a smooth function, and `side` its sign."""

    axle: Vector
    forward: Vector
    down: Vector
    length: Scalar
    along: Scalar
    side: Scalar


def _lean(scene: Scene, constraint: Rolling, e: Vector, n: Vector) -> Lean:
    """AssumptionError for a disk that lies flat on the plane however the body moves: it has no
    lowest point."""
    across = cross(e, n)
    size = dot(across, across)
    if isinstance(size, float) and size < FLAT**2:
        raise AssumptionError(_flat(scene, constraint))
    entries = [x for x in across if not is_zero(x)]
    length, side = ca.sqrt(size), 1.0
    if len(entries) == 1:  # the length is |x|: x itself has a slope where that has none
        length, side = entries[0], ca.sign(entries[0])
        forward: Vector = [0.0 if is_zero(x) else 1.0 for x in across]
    else:
        forward = [0.0 if is_zero(x) else x / length for x in across]
    return Lean(e, forward, cross(e, forward), length, dot(n, e), side)


def _leaning_rows(
    normal: _Normal, constraint: Rolling, wheel: Wheel, carrier: int
) -> tuple[RowForm, ...]:
    """Rows down in the wheel, forward and along the axle; none for a body without an axle, or on
    what is not the ground's plane.

    r = ρ d − σ e with ρ = ±radius + tube ℓ and σ = tube ν: of a disk r is along d, so that its
    turning does not enter the first row, and only its spin the second. Their rates are those where
    the contact is at rest: r' × direction, with d' = β f, β = ω·e + (ν/ℓ) ω·d,

        r' = −tube ν (ω·f) d + ρ β f − tube ℓ (ω·f) e.
    """
    scene, ground = normal.scene, constraint.surface is None and carrier < 0
    if scene.model.plane or constraint.shape == "sphere" or not ground or wheel.place.link < 0:
        return ()
    s, x = scene.symbols, _lean(scene, constraint, wheel.axis, normal.value)
    radius, tube = s.scalar(constraint.radius), s.scalar(constraint.tube)
    rho, sigma = plus(times(x.side, radius), dot([tube], [x.length])), dot([tube], [x.along])
    omega = scene.omegas[wheel.place.link]
    turning = plus(dot(omega, x.axle), dot([x.along / x.length], [dot(omega, x.down)]))
    if all(isinstance(a, float) for a in x.forward):
        turning = 0.0  # its place in the frame is fixed
    slope = minus(0.0, dot([tube], [dot(omega, x.forward)]))
    inward, sideways = dot([slope], [x.along]), dot([slope], [x.length])
    ahead = dot([rho], [turning])
    down = (scaled(sigma, x.forward), 0.0), (scaled(minus(0.0, sideways), x.forward), ahead)
    forward = (
        (scaled(minus(0.0, sigma), x.down), minus(0.0, rho)),
        (scaled(sideways, x.down), minus(0.0, inward)),
    )
    axle = (
        (scaled(rho, x.forward), 0.0),
        (difference(scaled(inward, x.forward), scaled(ahead, x.down)), 0.0),
    )
    ways = zip(("down", "forward", "along the axle"), (x.down, x.forward, x.axle),
               (down, forward, axle))  # fmt: skip
    return tuple(
        _row_at_rest(f"{constraint.name} {name}", wheel, direction, *moments)
        for name, direction, moments in ways
    )


def _row_at_rest(
    name: str,
    wheel: Wheel,
    direction: Vector,
    here: tuple[Vector, Scalar],
    rate: tuple[Vector, Scalar],
) -> RowForm:
    """direction · v + moment · ω of the wheel, the moment and its rate given by what is across the
    axle and what is along it."""
    across, moving = here[0], rate[0]
    terms: list[TwistTerm] = []
    if wheel.spinning < 0:
        across = sum_of(across, scaled(here[1], wheel.axis))
        moving = sum_of(moving, scaled(rate[1], wheel.axis))
    elif not is_zero(here[1]) or not is_zero(rate[1]):
        axial, moved = (scaled(x, wheel.own_axis) for x in (here[1], rate[1]))
        terms.append(TwistTerm(wheel.spinning, NOTHING, NOTHING, axial, "state",
                               NOTHING, NOTHING, moved))  # fmt: skip
    first = TwistTerm(wheel.place.link, direction, wheel.centre, across, "state",
                      NOTHING, NOTHING, moving)  # fmt: skip
    return RowForm(name, (first, *terms))


def _flat(scene: Scene, constraint: Rolling) -> Diagnostic:
    return scene.model.diagnostic(
        constraint.span,
        f"{constraint.name}: the {constraint.shape} lies flat on the plane at every position of "
        f"{constraint.body}, so that no point of it is the lowest",
        "an axis that is not the normal of the plane, or a joint that tilts it",
    )


@dataclass(frozen=True)
class Foot:
    """The normal at the contact, in the carrier's frame, and φ where a surface is given."""

    normal: Vector
    height: ca.SX


def _foot(scene: Scene, constraint: Rolling) -> Foot:
    s = scene.symbols
    if constraint.surface is None:
        return Foot(s.vector(constraint.normal), ca.SX(0))
    R = ground_rotation(scene, scene.places[constraint.carrier])
    gap = on_ground(scene, constraint.body, constraint.centre) - on_ground(
        scene, constraint.carrier, ORIGIN
    )
    centre = ca.vertcat(*rotated(transpose(R), [gap[k] for k in range(3)]))
    surface, at = surface_over(scene, constraint.surface, constraint.span)
    nearest = nearest_point(surface, at, centre)
    slope = ca.substitute(ca.gradient(surface, at), at, nearest)
    normal = slope / ca.sqrt(ca.dot(slope, slope))
    height = ca.dot(normal, centre - nearest) - s.scalar(constraint.radius)
    return Foot([normal[k] for k in range(3)], height)


def _directions(scene: Scene, constraint: Rolling, back: Matrix, n: Vector) -> list[Vector]:
    """n, forward and sideways of a body without an axis to tell forward by: the axes of the plane's
    own body do; on a surface forward is at right angles to its y."""
    if scene.model.plane:
        return [n, cross(NORMAL[scene.model.plane], n)]
    if constraint.surface is None:
        unit = np.array([float(x) for x in scene.symbols.vector(constraint.normal)])
        first, second, _ = np.array(matrix(triad(unit.tolist(), ""))).T.tolist()
        return [n, rotated(back, first), rotated(back, second)]
    forward = cross(rotated(back, [0.0, 1.0, 0.0]), n)
    length = ca.sqrt(dot(forward, forward))
    unit_forward: Vector = [x / length for x in forward]
    return [n, unit_forward, cross(n, unit_forward)]


def _height(scene: Scene, constraint: Rolling, place: Place, point: Vector) -> ca.SX:
    """Of the contact above the plane, in m."""
    s, base = scene.symbols, scene.places[constraint.carrier]
    inside = rotated(scene.rotations[place.link], point)
    ground = sum_of(scene.positions[place.link], inside)
    origin = ground_point(base, s.vector(constraint.origin), scene.positions, scene.rotations)
    normal = rotated(ground_rotation(scene, base), s.vector(constraint.normal))
    return ca.SX(dot(normal, difference(ground, origin)))


@dataclass(frozen=True)
class _Normal:
    """The normal in the wheel's frame. Rows are written over letters that stand for it, and
    differentiated along its own rate: n fixed in the ground turns with ṅ = −ω × n."""

    scene: Scene
    letters: Vector
    value: Vector
    turning: Vector | None  # ṅ; None where it is a function of t and q like any other

    def put_in(self, entries: Vector) -> Vector:
        """With the normal in the place of its letters."""
        if self.turning is None or not entries:
            return entries
        letters, value = ca.vertcat(*self.letters), ca.vertcat(*self.value)
        found = ca.substitute(ca.vertcat(*entries), letters, value)
        return [x if isinstance(x, float) else found[i] for i, x in enumerate(entries)]

    def rate(self, entries: Vector) -> Vector:
        """d/dt of functions of the letters, or of t and q."""
        column = ca.vertcat(*entries)
        if self.turning is None:
            rates = self.scene.rate(column)
        else:
            rates = ca.jtimes(column, ca.vertcat(*self.letters), ca.vertcat(*self.turning))
        return self.put_in([rates[i] for i in range(len(entries))])


def _normal(scene: Scene, wheel: Wheel, flat: bool, value: Vector) -> _Normal:
    """With letters where it is fixed in the ground and all else in the link."""
    inside = [*wheel.axis, *wheel.centre]
    moving = ca.vertcat(scene.symbols.t, scene.symbols.q)
    fixed = not ca.depends_on(ca.vertcat(*inside), moving)
    link = wheel.place.link
    if not flat or link < 0 or not fixed:
        return _Normal(scene, value, value, None)
    if any(ca.SX(x).is_constant() for x in value):
        return _Normal(scene, value, value, None)
    n = ca.SX.sym("n", 3)
    turning = cross(value, scene.omegas[link])
    return _Normal(scene, [n[0], n[1], n[2]], value, turning)


def _moving_row(
    normal: _Normal, name: str, links: tuple[int, int], wheel: Wheel, point: Vector, way: Way
) -> RowForm:
    """direction · (velocity of the body's point − that of the carrier's, at the same place); both
    given in the wheel's frame."""
    link, carrier = links
    base = [_carrier_term(normal, links, point, way)] if carrier >= 0 else []
    first = _moving_term(normal, link, wheel.centre, way)
    if wheel.spinning < 0:
        return RowForm(name, (first, *base))
    own = normal.scene.links[wheel.spinning]
    if own.parent == link and normal.scene.frame is None:
        here, rate = _joint_spin(normal, own, way)
        spin = () if is_zero(here) else ((own.columns[0], here),)
        return RowForm(name, (first, *base), spin, 0.0, rate)
    # of several turns about the axle the rows know the sum alone: what the wheel itself does
    across, along = _across(way[1], wheel.axis), dot(way[1], wheel.axis)
    terms = [_moving_term(normal, link, wheel.centre, (way[0], across))]
    if not is_zero(along):
        spin_way = (NOTHING, scaled(along, wheel.own_axis))
        terms.append(_moving_term(normal, wheel.spinning, NOTHING, spin_way))
    return RowForm(name, (*terms, *base))


def _joint_spin(normal: _Normal, own: Link, way: Way) -> tuple[Scalar, Scalar]:
    """What the rate of the wheel's own joint is multiplied by, and what that adds to the row's
    rate."""
    still = matrix(tuple(x for x in own.rotation if isinstance(x, Still)))
    spinning = dot(rotated(still, list(own.motion[0][:3])), way[1])
    if is_zero(spinning):
        return 0.0, 0.0
    (here,), (rate,) = normal.put_in([spinning]), normal.rate([spinning])
    return here, -dot([rate], [normal.scene.symbols.v[own.columns[0]]])


def _carrier_term(normal: _Normal, links: tuple[int, int], point: Vector, way: Way) -> TwistTerm:
    """The carrier's material point at the contact, in the carrier's frame."""
    scene, (link, carrier) = normal.scene, links
    turned = matrix(relative_rotation(scene.links, carrier, link))
    ground = sum_of(scene.positions[link], rotated(scene.rotations[link], point))
    gap = difference(ground, scene.positions[carrier])
    inside = rotated(transpose(scene.rotations[carrier]), gap)
    opposite: Vector = [minus(0.0, x) for x in rotated(turned, way[0])]
    return _moving_term(normal, carrier, inside, (opposite, NOTHING))


def _across(x: Vector, axis: Vector) -> Vector:
    """What of x is at right angles to a unit axis."""
    if sum(not is_zero(e) for e in axis) == 1:
        return [a if is_zero(e) else 0.0 for a, e in zip(x, axis)]
    return difference(x, scaled(dot(x, axis), axis))


def _moving_term(normal: _Normal, link: int, point: Vector, way: Way) -> TwistTerm:
    """A term whose direction, point and moment move in the link."""
    # the contact wanders over the body: its rate is no velocity of a material point
    entries = [*way[0], *point, *way[1]]
    here, rates = normal.put_in(entries), normal.rate(entries)
    return TwistTerm(link, here[:3], here[3:6], here[6:], "state", rates[:3], rates[3:6], rates[6:])


ROLLING = Tie(Rolling, rolling)
