"""Disks, spheres and tori that roll without slip."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.diagnostics import AssumptionError, Diagnostic
from derive.expressions.scalars import Matrix, Vector
from derive.joints.rotations import (
    IDENTITY,
    cross,
    difference,
    dot,
    matrix,
    merged,
    minus,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.constraints.records import Tie
from derive.mechanics.frames import axes_in_plane, ground_rotation, on_ground, triad
from derive.mechanics.limits import FLAT
from derive.mechanics.records import Place, Row, RowForm, TwistTerm
from derive.mechanics.scene import NORMAL, NOTHING, Block, Scene
from derive.mechanics.surfaces import nearest_point, surface_over
from derive.mechanics.tree import ground_point, link_direction, link_point, relative_rotation
from derive.model.constraint_records import Rolling
from derive.model.space import ORIGIN


def rolling(scene: Scene, constraint: Rolling) -> Block:
    """A round body on a plane: φ = n·(P − origin) at the contact P, and the material point there
    does not move.

    Disk: P = centre + r d with d = −(n − (n·e) e)/|…|, the steepest way down in the disk; torus: P
    = centre + r d − tube n; sphere: P = centre − r n. Directions: n, t₁ = e × n/|…| (forward), t₂ =
    n × t₁; or, which is the same, the axes of the body's own frame. In the plane a wheel has n and
    t₁ only.
    """
    s = scene.symbols
    place, base = scene.places[constraint.body], scene.places[constraint.carrier]
    back = _from_carrier(scene, place, base)
    foot = _foot(scene, constraint)
    n = rotated(back, foot.normal)
    e = link_direction(place, s.vector(constraint.axis))
    point = sum_of(
        link_point(place, s.vector(constraint.centre)),
        _to_contact(scene, constraint, n, e),
    )
    phi = foot.height if constraint.surface else _height(scene, constraint, place, point)
    directions = _directions(scene, constraint, back, foot.normal, (n, e))
    names = [f"{constraint.name}.{k}" for k in ("normal", "forward", "sideways")]
    links = (place.link, base.link)
    rows = tuple(_moving_row(scene, name, links, d, point) for name, d in zip(names, directions))
    along_body = tuple(
        _moving_row(scene, f"{constraint.name} {'xyz'[k]}", links, IDENTITY[k], point)
        for k in axes_in_plane(scene, place.link)
    )
    marks = tuple(Row(row.name, 0 if i == 0 else -1, "m/s") for i, row in enumerate(rows))
    ways = (rows, along_body) if len(along_body) == len(rows) else (rows,)
    return Block(marks, (phi,), ways)


def _from_carrier(scene: Scene, place: Place, base: Place) -> Matrix:
    """Link of the body ← body that carries the plane."""
    if base.link < 0:
        own = transpose(scene.rotations[place.link])
        return product(own, matrix(base.rotation)) if base.rotation else own
    turned = relative_rotation(scene.links, place.link, base.link)
    return matrix(merged(turned, base.rotation))


def _to_contact(scene: Scene, constraint: Rolling, n: Vector, e: Vector) -> Vector:
    """From the centre to the lowest point, in the link's frame. AssumptionError for a disk that
    lies flat on the plane however the body moves: it has no lowest point."""
    s = scene.symbols
    radius = s.scalar(constraint.radius)
    if scene.model.plane or constraint.shape == "sphere":
        return [dot([-radius], [x]) for x in n]
    across = dot(n, e)
    down = [-(x - across * y) for x, y in zip(n, e)]
    size = dot(down, down)
    if isinstance(size, float) and size < FLAT**2:
        raise AssumptionError(_flat(scene, constraint))
    length = ca.sqrt(size)
    tube = s.scalar(constraint.tube)
    return [radius * x / length - tube * y for x, y in zip(down, n)]


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


def _directions(
    scene: Scene, constraint: Rolling, back: Matrix, normal: Vector, axes: tuple[Vector, Vector]
) -> list[Vector]:
    """n, forward and sideways; a sphere has no axis to tell forward by, the axes of the plane's own
    body do: on a surface forward is at right angles to its y."""
    n, e = axes
    if scene.model.plane:
        return [n, cross(NORMAL[scene.model.plane], n)]
    if constraint.surface is not None:
        e = rotated(back, [0.0, 1.0, 0.0])
    elif constraint.shape == "sphere":
        unit = np.array([float(x) for x in normal])
        first, second, _ = np.array(matrix(triad(unit.tolist(), ""))).T.tolist()
        return [n, rotated(back, first), rotated(back, second)]
    forward = cross(e, n)
    length = ca.sqrt(dot(forward, forward))
    unit_forward = [x / length for x in forward]
    return [n, unit_forward, cross(n, unit_forward)]


def _height(scene: Scene, constraint: Rolling, place: Place, point: Vector) -> ca.SX:
    """Of the contact above the plane, in m."""
    s, base = scene.symbols, scene.places[constraint.carrier]
    inside = rotated(scene.rotations[place.link], point)
    ground = sum_of(scene.positions[place.link], inside)
    origin = ground_point(base, s.vector(constraint.origin), scene.positions, scene.rotations)
    normal = rotated(ground_rotation(scene, base), s.vector(constraint.normal))
    return ca.SX(dot(normal, difference(ground, origin)))


def _moving_row(
    scene: Scene, name: str, links: tuple[int, int], direction: Vector, point: Vector
) -> RowForm:
    """direction · (velocity of the body's point − that of the carrier's, at the same place); both
    given in the body's link."""
    link, carrier = links
    terms = [_moving_term(scene, link, direction, point)]
    if carrier >= 0:
        turned = matrix(relative_rotation(scene.links, carrier, link))
        ground = sum_of(scene.positions[link], rotated(scene.rotations[link], point))
        gap = difference(ground, scene.positions[carrier])
        inside = rotated(transpose(scene.rotations[carrier]), gap)
        opposite: Vector = [minus(0.0, x) for x in rotated(turned, direction)]
        terms.append(_moving_term(scene, carrier, opposite, inside))
    return RowForm(name, tuple(terms))


def _moving_term(scene: Scene, link: int, direction: Vector, point: Vector) -> TwistTerm:
    """A term whose direction and point move in the link: their rates by differentiation along the
    motion."""
    # the contact wanders over the body: its rate is no velocity of a material point
    rates = scene.rate(ca.vertcat(*direction, *point))
    parts: Vector = [rates[i] for i in range(6)]
    return TwistTerm(link, direction, point, NOTHING, "state", parts[:3], parts[3:], NOTHING)


ROLLING = Tie(Rolling, rolling)
