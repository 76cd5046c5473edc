"""Constraints of a model as positions φ and velocity rows, one function per kind.

A block is one constraint with the equivalent ways of writing its velocity rows; the first way
defines A, c and β. The rows of a closure can be taken along the axes of the ground or of either
body: the equations are the same, the pivots are not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from derive.expressions.evaluate import casadi_functions, value
from derive.expressions.tree import ZERO
from derive.joints.records import Matrix, Rotation, Scalar, Still, Vector
from derive.joints.rotations import (
    IDENTITY,
    cross,
    difference,
    dot,
    matrix,
    merged,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.links import placement
from derive.mechanics.records import Link, Place, Row, RowForm, TwistTerm
from derive.mechanics.symbols import Symbols
from derive.mechanics.tree import ground_point, link_direction, link_point, relative_rotation
from derive.model.records import (
    Closure,
    Constraint,
    Distance,
    Holonomic,
    Model,
    Nonholonomic,
    NoSlip,
    OnSurface,
    Placement,
    Rolling,
    Vector3,
)

NORMAL = {"xy": [0.0, 0.0, 1.0], "xz": [0.0, -1.0, 0.0], "yz": [1.0, 0.0, 0.0], "": [0.0, 0.0, 1.0]}
IN_PLANE = {"xy": (0, 1), "xz": (0, 2), "yz": (1, 2), "": (0, 1, 2)}
NOTHING: Vector = [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class Scene:
    """What a constraint needs to know: symbols, q̇ = N v, and where every body is."""

    model: Model
    symbols: Symbols
    qdot: ca.SX
    links: tuple[Link, ...]
    places: dict[str, Place]
    rotations: list[Matrix]  # ground ← link
    positions: list[Vector]  # of the links' origins, in the ground
    omegas: list[Vector]  # of the links, in their frames

    def rate(self, expression: ca.SX) -> ca.SX:
        """d/dt of a function of t and q."""
        s = self.symbols
        return ca.jtimes(expression, ca.vertcat(s.t, s.q), ca.vertcat(1, self.qdot))

    def over_v(self, expression: ca.SX) -> ca.SX:
        """The same with q̇ replaced by N v."""
        return ca.substitute(expression, self.symbols.qd, self.qdot)


@dataclass(frozen=True)
class Block:
    rows: tuple[Row, ...]
    phi: tuple[ca.SX, ...]
    ways: tuple[tuple[RowForm, ...], ...]
    nonideal: tuple[ca.SX, ...] = ()  # generalised force per coordinate, conjugate to q̇


def blocks(scene: Scene) -> list[Block]:
    """Closures first, then constraints, in the model's order."""
    result = [_closure(scene, closure) for closure in scene.model.closures]
    for constraint in scene.model.constraints:
        result.append(_constraint(scene, constraint))
    return _numbered(result)


def _numbered(found: Sequence[Block]) -> list[Block]:
    """φ indices counted through all blocks."""
    result, start = [], 0
    for block in found:
        rows = tuple(
            Row(r.name, r.position + start if r.position >= 0 else -1, r.unit) for r in block.rows
        )
        result.append(Block(rows, block.phi, block.ways, block.nonideal))
        start += len(block.phi)
    return result


def _constraint(scene: Scene, constraint: Constraint) -> Block:
    match constraint:
        case Holonomic():
            return _holonomic(scene, constraint)
        case Nonholonomic():
            return _nonholonomic(scene, constraint)
        case NoSlip():
            return _no_slip(scene, constraint)
        case Rolling():
            return _rolling(scene, constraint)
        case Distance():
            return _distance(scene, constraint)
        case OnSurface():
            return _on_surface(scene, constraint)


def _closure(scene: Scene, closure: Closure) -> Block:
    """A joint that closes a loop: points that coincide first, then directions that stay at right
    angles.

    Points: φ = p₂ − p₁ in ground axes, or the parts of it along axes of the first body. Directions:
    φ = b · a with a, b fixed in the first and second body; never 1 − cos, whose gradient vanishes
    at the solution.
    """
    parts = CLOSURES[closure.type](scene, closure)
    rest = tuple(row for part in parts[1:] for row in part.ways[0])
    rows = tuple(row for part in _numbered(parts) for row in part.rows)
    return Block(
        rows,
        tuple(x for part in parts for x in part.phi),
        tuple((*way, *rest) for way in parts[0].ways),
    )


def _meeting(scene: Scene, closure: Closure) -> Block:
    """The two points coincide."""
    axes = IN_PLANE[scene.model.plane]
    points = [placement(scene.symbols, at)[1] for at in closure.placements]
    where = [scene.places[body] for body in closure.bodies]
    ground = [ground_point(w, p, scene.positions, scene.rotations) for w, p in zip(where, points)]
    names = [f"{closure.name}.{'xyz'[k]}" for k in axes]
    phi = tuple(ca.SX(ground[1][k] - ground[0][k]) for k in axes)
    frames = dict.fromkeys((-1, where[0].link, where[1].link))
    ways = tuple(_closure_rows(scene, names, where, points, frame, axes) for frame in frames)
    return Block(tuple(Row(name, i, "m/s") for i, name in enumerate(names)), phi, ways)


def _from_positions(scene: Scene, names: Sequence[str], phi: Sequence[ca.SX], unit: str) -> Block:
    """Rows found by differentiating φ."""
    forms = tuple(_velocity_row(scene, name, scene.rate(x)) for name, x in zip(names, phi))
    return Block(tuple(Row(name, i, unit) for i, name in enumerate(names)), tuple(phi), (forms,))


@dataclass(frozen=True)
class Frames:
    """The joint frames of a closure in the ground: origins, and axes as columns; the axis is the
    third where there is one."""

    origins: tuple[ca.SX, ca.SX]
    axes: tuple[tuple[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX, ca.SX]]


def _frames(scene: Scene, closure: Closure) -> Frames:
    turned = _triad(scene.symbols.vector(closure.axis), scene.model.plane)
    found = [
        joint_frame(scene, body, at, turned) for body, at in zip(closure.bodies, closure.placements)
    ]
    return Frames((found[0][0], found[1][0]), (found[0][1], found[1][1]))


def _triad(axis: Vector, plane: str) -> Rotation:
    """A frame whose third axis is the given one; in the plane its first axis lies in the plane
    too."""
    unit = np.array([float(x) for x in axis])
    normal = np.array(NORMAL[plane])
    if not unit.any():
        unit = normal
    across = np.cross(normal, unit)
    if not plane or not across.any():
        across = np.cross(unit, np.eye(3)[int(np.argmin(np.abs(unit)))])
    x = across / np.linalg.norm(across)
    return (Still(np.column_stack([x, np.cross(unit, x), unit]).tolist()),)


def joint_frame(
    scene: Scene, body: str, at: Placement, turned: Rotation
) -> tuple[ca.SX, tuple[ca.SX, ca.SX, ca.SX]]:
    """Origin and axes, in the ground, of a frame placed on a body and turned there."""
    place = scene.places[body]
    on_body, origin = placement(scene.symbols, at)
    R = product(_ground_rotation(scene, place), matrix(merged(on_body, turned)))
    axes = [ca.vertcat(*[row[k] for row in R]) for k in range(3)]
    point = ca.vertcat(*ground_point(place, origin, scene.positions, scene.rotations))
    return point, (axes[0], axes[1], axes[2])


def _ground_rotation(scene: Scene, place: Place) -> Matrix:
    own = matrix(place.rotation)
    return own if place.link < 0 else product(scene.rotations[place.link], own)


def _right_angles(scene: Scene, closure: Closure, pairs: Sequence[tuple[int, int]]) -> Block:
    """φ = bⱼ · aᵢ for the given axes i of the first and j of the second joint frame."""
    frames = _frames(scene, closure)
    phi = [ca.dot(frames.axes[1][j], frames.axes[0][i]) for i, j in pairs]
    return _from_positions(
        scene, [f"{closure.name}.turn{k + 1}" for k in range(len(pairs))], phi, "rad/s"
    )


def _along(scene: Scene, closure: Closure, axes: Sequence[int]) -> Block:
    """φ = aᵢ · (p₂ − p₁) along axes of the first joint frame."""
    frames = _frames(scene, closure)
    gap = frames.origins[1] - frames.origins[0]
    phi = [ca.dot(frames.axes[0][i], gap) for i in axes]
    return _from_positions(
        scene, [f"{closure.name}.shift{k + 1}" for k in range(len(axes))], phi, "m/s"
    )


PARALLEL = (
    (0, 2),
    (1, 2),
)  # the second frame's axis stays at right angles to the first frame's other two
LOCKED = (*PARALLEL, (1, 0))


def _revolute(scene: Scene, closure: Closure) -> list[Block]:
    return [
        _meeting(scene, closure),
        *([] if scene.model.plane else [_right_angles(scene, closure, PARALLEL)]),
    ]


def _ball(scene: Scene, closure: Closure) -> list[Block]:
    return [_meeting(scene, closure)]


def _universal(scene: Scene, closure: Closure) -> list[Block]:
    """The cross: the axis fixed in the first body stays at right angles to the one fixed in the
    second."""
    s = scene.symbols
    axes = (closure.axis, closure.axis2 or closure.axis)
    ground = [
        _in_ground(scene, body, at, s.vector(e))
        for body, at, e in zip(closure.bodies, closure.placements, axes)
    ]
    cross_angle = _from_positions(scene, [f"{closure.name}.cross"], [ca.dot(*ground)], "rad/s")
    return [_meeting(scene, closure), cross_angle]


def _in_ground(scene: Scene, body: str, at: Placement, direction: Vector) -> ca.SX:
    place = scene.places[body]
    inside = rotated(matrix(placement(scene.symbols, at)[0]), direction)
    return ca.vertcat(*rotated(_ground_rotation(scene, place), inside))


def _fixed(scene: Scene, closure: Closure) -> list[Block]:
    return [
        _meeting(scene, closure),
        _right_angles(scene, closure, ((0, 1),) if scene.model.plane else LOCKED),
    ]


def _prismatic(scene: Scene, closure: Closure) -> list[Block]:
    """Across the axis nothing shifts and nothing turns."""
    if scene.model.plane:
        return [_along(scene, closure, (0,)), _right_angles(scene, closure, ((0, 2),))]
    return [_along(scene, closure, (0, 1)), _right_angles(scene, closure, LOCKED)]


def _cylindrical(scene: Scene, closure: Closure) -> list[Block]:
    return [_along(scene, closure, (0, 1)), _right_angles(scene, closure, PARALLEL)]


def _planar(scene: Scene, closure: Closure) -> list[Block]:
    return [_along(scene, closure, (2,)), _right_angles(scene, closure, PARALLEL)]


def _screw(scene: Scene, closure: Closure) -> list[Block]:
    """A cylindrical closure whose slide follows its turn. The turn has no single-valued angle, so
    that row is held as a velocity: axis · (ṗ₂ − ṗ₁) = pitch/2π axis · (ω₂ − ω₁).
    """
    frames = _frames(scene, closure)
    axis = frames.axes[0][2]
    slide = scene.rate(ca.dot(axis, frames.origins[1] - frames.origins[0]))
    spins = [ca.vertcat(*_angular_velocity(scene, scene.places[body])) for body in closure.bodies]
    advance = scene.symbols.scalar(closure.pitch) / (2 * np.pi)
    name = f"{closure.name}.advance"
    row = _velocity_row(scene, name, slide - advance * ca.dot(axis, spins[1] - spins[0]))
    return [*_cylindrical(scene, closure), Block((Row(name, -1, "m/s"),), (), ((row,),))]


def _angular_velocity(scene: Scene, place: Place) -> Vector:
    """In ground axes."""
    if place.link < 0:
        return NOTHING
    return rotated(scene.rotations[place.link], scene.omegas[place.link])


CLOSURES: dict[str, Callable[[Scene, Closure], list[Block]]] = {
    "revolute": _revolute,
    "ball": _ball,
    "fixed": _fixed,
    "prismatic": _prismatic,
    "cylindrical": _cylindrical,
    "planar": _planar,
    "universal": _universal,
    "screw": _screw,
}


def _closure_rows(
    scene: Scene,
    names: Sequence[str],
    where: Sequence[Place],
    points: Sequence[Vector],
    frame: int,
    axes: Sequence[int],
) -> tuple[RowForm, ...]:
    turned = [matrix(relative_rotation(scene.links, place.link, frame)) for place in where]
    terms: list[list[TwistTerm]] = []
    for k in axes:
        directions = [[sign * row[k] for row in R] for sign, R in zip((-1.0, 1.0), turned)]
        terms.append(
            [
                TwistTerm(w.link, d, link_point(w, p), NOTHING, "ground")
                for w, d, p in zip(where, directions, points)
            ]
        )
    return tuple(
        RowForm(name, tuple(x for x in pair if x.link >= 0)) for name, pair in zip(names, terms)
    )


def _holonomic(scene: Scene, constraint: Holonomic) -> Block:
    s = scene.symbols
    phi = ca.SX(s.scalar(constraint.expression))
    velocity = scene.rate(phi)
    row = _velocity_row(scene, constraint.name, velocity)
    return Block(
        (Row(constraint.name, 0, ""),), (phi,), ((row,),), _nonideal(scene, constraint.nonideal)
    )


def _nonholonomic(scene: Scene, constraint: Nonholonomic) -> Block:
    velocity = scene.over_v(ca.SX(scene.symbols.scalar(constraint.expression)))
    row = _velocity_row(scene, constraint.name, velocity)
    return Block(
        (Row(constraint.name, -1, ""),), (), ((row,),), _nonideal(scene, constraint.nonideal)
    )


def _velocity_row(scene: Scene, name: str, velocity: ca.SX) -> RowForm:
    """Coefficients, value and rate of a row given as an expression a(q, t)·v + b(q, t) = 0."""
    coefficients, value, rate = velocity_row(scene.symbols, scene.qdot, velocity)
    return RowForm(name, (), coefficients, value, rate)


def velocity_row(
    s: Symbols, qdot: ca.SX, velocity: ca.SX
) -> tuple[tuple[tuple[int, Scalar], ...], Scalar, Scalar]:
    """((j, aⱼ), …), −b and −d(a)/dt v − d(b)/dt of a·v + b."""
    coefficients = ca.jacobian(velocity, s.v)
    offset = ca.substitute(velocity, s.v, ca.SX.zeros(s.v.numel()))
    rate = -ca.jtimes(velocity, ca.vertcat(s.t, s.q), ca.vertcat(1, qdot))
    columns = coefficients.sparsity().get_triplet()[1]
    return tuple((j, coefficients[0, j]) for j in columns), -offset, rate


def _nonideal(scene: Scene, forces: Sequence) -> tuple[ca.SX, ...]:
    return tuple(scene.over_v(ca.SX(scene.symbols.scalar(f))) for f in forces)


def _no_slip(scene: Scene, constraint: NoSlip) -> Block:
    place = scene.places[constraint.body]
    point = link_point(place, scene.symbols.vector(constraint.point))
    direction = link_direction(place, scene.symbols.vector(constraint.direction))
    row = RowForm(constraint.name, (TwistTerm(place.link, direction, point, NOTHING),))
    return Block((Row(constraint.name, -1, "m/s"),), (), ((row,),))


def _distance(scene: Scene, constraint: Distance) -> Block:
    """φ = |p₂ − p₁| − length."""
    ends = [
        _on_ground(scene, body, point) for body, point in zip(constraint.bodies, constraint.points)
    ]
    gap = ends[1] - ends[0]
    length = scene.symbols.scalar(constraint.length)
    return _from_positions(scene, [constraint.name], [ca.sqrt(ca.dot(gap, gap)) - length], "m/s")


def _on_ground(scene: Scene, body: str, point: Vector3) -> ca.SX:
    inside = scene.symbols.vector(point)
    return ca.vertcat(*ground_point(scene.places[body], inside, scene.positions, scene.rotations))


def _on_surface(scene: Scene, constraint: OnSurface) -> Block:
    """φ = surface(x, y, z) at the point, in the frame of the body that carries the surface."""
    s, carrier = scene.symbols, scene.places[constraint.frame_body]
    gap = _on_ground(scene, constraint.body, constraint.point) - _on_ground(
        scene, constraint.frame_body, (ZERO, ZERO, ZERO)
    )
    inside = rotated(transpose(_ground_rotation(scene, carrier)), [gap[k] for k in range(3)])
    names = s.names | dict(zip("xyz", inside))
    phi = ca.SX(value(constraint.surface, names, s.rates, casadi_functions()))
    return _from_positions(scene, [constraint.name], [phi], "")


def _rolling(scene: Scene, constraint: Rolling) -> Block:
    """A round body on a plane: φ = n·(P − origin) at the contact P, and the material point there
    does not move.

    Disk: P = centre + r d with d = −(n − (n·e) e)/|…|, the steepest way down in the disk; torus: P
    = centre + r d − tube n; sphere: P = centre − r n. Directions: n, t₁ = e × n/|…| (forward), t₂ =
    n × t₁; or, which is the same, the axes of the body's own frame. In the plane a wheel has n and
    t₁ only.
    """
    s = scene.symbols
    place = scene.places[constraint.body]
    normal = s.vector(constraint.normal)
    n = rotated(transpose(scene.rotations[place.link]), normal)
    e = link_direction(place, s.vector(constraint.axis))
    point = sum_of(
        link_point(place, s.vector(constraint.centre)),
        _to_contact(s, constraint, scene.model.plane, n, e),
    )
    phi = _height(scene, place, point, normal, s.vector(constraint.origin))
    directions = _directions(scene, constraint, place, n, e)
    names = [f"{constraint.name}.{k}" for k in ("normal", "forward", "sideways")]
    rows = tuple(
        _moving_row(scene, name, place.link, d, point) for name, d in zip(names, directions)
    )
    own = [IDENTITY[k] for k in IN_PLANE[scene.model.plane]]
    along_body = tuple(
        _moving_row(scene, f"{constraint.name} {k}", place.link, d, point)
        for k, d in zip("xyz", own)
    )
    marks = tuple(Row(row.name, 0 if i == 0 else -1, "m/s") for i, row in enumerate(rows))
    return Block(marks, (phi,), (rows, along_body))


def _to_contact(s: Symbols, constraint: Rolling, plane: str, n: Vector, e: Vector) -> Vector:
    """From the centre to the lowest point, in the link's frame."""
    radius = s.scalar(constraint.radius)
    if plane or constraint.shape == "sphere":
        return [dot([-radius], [x]) for x in n]
    across = dot(n, e)
    down = [-(x - across * y) for x, y in zip(n, e)]
    length = ca.sqrt(dot(down, down))
    tube = s.scalar(constraint.tube)
    return [radius * x / length - tube * y for x, y in zip(down, n)]


def _directions(
    scene: Scene, constraint: Rolling, place: Place, n: Vector, e: Vector
) -> list[Vector]:
    """n, forward and sideways; a sphere has no axis to tell forward by, the ground's axes do."""
    if scene.model.plane:
        return [n, cross(NORMAL[scene.model.plane], n)]
    if constraint.shape == "sphere":
        unit = np.array([float(x) for x in scene.symbols.vector(constraint.normal)])
        first, second, _ = np.array(matrix(_triad(unit.tolist(), ""))).T.tolist()
        back = transpose(scene.rotations[place.link])
        return [n, rotated(back, first), rotated(back, second)]
    forward = cross(e, n)
    length = ca.sqrt(dot(forward, forward))
    unit_forward = [x / length for x in forward]
    return [n, unit_forward, cross(n, unit_forward)]


def _height(scene: Scene, place: Place, point: Vector, normal: Vector, origin: Vector) -> ca.SX:
    inside = rotated(scene.rotations[place.link], point)
    ground = sum_of(scene.positions[place.link], inside)
    return ca.SX(dot(normal, difference(ground, origin)))


def _moving_row(scene: Scene, name: str, link: int, direction: Vector, point: Vector) -> RowForm:
    """A row whose direction and point move in the link: their rates by differentiation along the
    motion."""
    rates = scene.rate(ca.vertcat(*direction, *point))
    parts = [rates[i] for i in range(6)]
    return RowForm(
        name, (TwistTerm(link, direction, point, NOTHING, "state", parts[:3], parts[3:], NOTHING),)
    )
