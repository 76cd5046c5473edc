"""Constraints of a model as positions φ and velocity rows, one function per kind.

A block is one constraint with the equivalent ways of writing its velocity rows; the first way defines A, c and β. The rows
of a closure can be taken along the axes of the ground or of either body: the equations are the same, the pivots are not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from derive.joints.records import Matrix, Scalar, Vector
from derive.joints.rotations import IDENTITY, cross, dot, matrix, rotated, sum_of, transpose
from derive.mechanics.links import placement
from derive.mechanics.records import Link, Place, Row, RowForm, TwistTerm
from derive.mechanics.symbols import Symbols
from derive.mechanics.tree import ground_point, link_direction, link_point, relative_rotation
from derive.model.records import Closure, Constraint, Holonomic, Model, Nonholonomic, NoSlip, Rolling

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
        rows = tuple(Row(r.name, r.position + start if r.position >= 0 else -1, r.unit) for r in block.rows)
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


def _closure(scene: Scene, closure: Closure) -> Block:
    """The two points coincide: φ = p₂ − p₁ in ground axes."""
    axes = IN_PLANE[scene.model.plane]
    points = [placement(scene.symbols, at)[1] for at in closure.placements]
    where = [scene.places[body] for body in closure.bodies]
    ground = [ground_point(w, p, scene.positions, scene.rotations) for w, p in zip(where, points)]
    names = [f"{closure.name}.{'xyz'[k]}" for k in axes]
    phi = tuple(ca.SX(ground[1][k] - ground[0][k]) for k in axes)
    frames = dict.fromkeys((-1, where[0].link, where[1].link))
    ways = tuple(_closure_rows(scene, names, where, points, frame, axes) for frame in frames)
    return Block(tuple(Row(name, i, "m/s") for i, name in enumerate(names)), phi, ways)


def _closure_rows(
    scene: Scene, names: Sequence[str], where: Sequence[Place], points: Sequence[Vector], frame: int, axes: Sequence[int]
) -> tuple[RowForm, ...]:
    turned = [matrix(relative_rotation(scene.links, place.link, frame)) for place in where]
    terms: list[list[TwistTerm]] = []
    for k in axes:
        directions = [[sign * row[k] for row in R] for sign, R in zip((-1.0, 1.0), turned)]
        terms.append([TwistTerm(w.link, d, link_point(w, p), NOTHING, "ground") for w, d, p in zip(where, directions, points)])
    return tuple(RowForm(name, tuple(x for x in pair if x.link >= 0)) for name, pair in zip(names, terms))


def _holonomic(scene: Scene, constraint: Holonomic) -> Block:
    s = scene.symbols
    phi = ca.SX(s.scalar(constraint.expression))
    velocity = scene.rate(phi)
    row = _velocity_row(scene, constraint.name, velocity)
    return Block((Row(constraint.name, 0, ""),), (phi,), ((row,),), _nonideal(scene, constraint.nonideal))


def _nonholonomic(scene: Scene, constraint: Nonholonomic) -> Block:
    velocity = scene.over_v(ca.SX(scene.symbols.scalar(constraint.expression)))
    row = _velocity_row(scene, constraint.name, velocity)
    return Block((Row(constraint.name, -1, ""),), (), ((row,),), _nonideal(scene, constraint.nonideal))


def _velocity_row(scene: Scene, name: str, velocity: ca.SX) -> RowForm:
    """Coefficients, value and rate of a row given as an expression a(q, t)·v + b(q, t) = 0."""
    coefficients, value, rate = velocity_row(scene.symbols, scene.qdot, velocity)
    return RowForm(name, (), coefficients, value, rate)


def velocity_row(s: Symbols, qdot: ca.SX, velocity: ca.SX) -> tuple[tuple[tuple[int, Scalar], ...], Scalar, Scalar]:
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


def _rolling(scene: Scene, constraint: Rolling) -> Block:
    """Thin disk on a plane: contact at d = −(n − (n·e) e)/|…| below the centre, in the disk.

    φ = n·(P − origin); the material point at P does not move along n, t₁ = e × n/|…| (forward) and t₂ = n × t₁, or, which
    is the same, along the axes of the body's own frame.
    """
    s = scene.symbols
    place = scene.places[constraint.body]
    e = link_direction(place, s.vector(constraint.axis))
    centre = link_point(place, s.vector(constraint.centre))
    normal = s.vector(constraint.normal)
    n = rotated(transpose(scene.rotations[place.link]), normal)
    across = dot(n, e)
    down = [-(x - across * y) for x, y in zip(n, e)]
    length = ca.sqrt(dot(down, down))
    point = sum_of(centre, [s.scalar(constraint.radius) * x / length for x in down])
    forward = [x / length for x in cross(e, n)]
    phi = _height(scene, place, point, normal, s.vector(constraint.origin))
    names = [f"{constraint.name}.{k}" for k in ("normal", "forward", "sideways")]
    rows = tuple(_moving_row(scene, name, place.link, d, point) for name, d in zip(names, (n, forward, cross(n, forward))))
    along_body = tuple(_moving_row(scene, f"{constraint.name} {k}", place.link, d, point) for k, d in zip("xyz", IDENTITY))
    marks = tuple(Row(name, 0 if i == 0 else -1, "m/s") for i, name in enumerate(names))
    return Block(marks, (phi,), (rows, along_body))


def _height(scene: Scene, place: Place, point: Vector, normal: Vector, origin: Vector) -> ca.SX:
    inside = rotated(scene.rotations[place.link], point)
    ground = sum_of(scene.positions[place.link], inside)
    return ca.SX(dot(normal, [x - y for x, y in zip(ground, origin)]))


def _moving_row(scene: Scene, name: str, link: int, direction: Vector, point: Vector) -> RowForm:
    """A row whose direction and point move in the link: their rates by differentiation along the motion."""
    rates = scene.rate(ca.vertcat(*direction, *point))
    parts = [rates[i] for i in range(6)]
    return RowForm(name, (TwistTerm(link, direction, point, NOTHING, "state", parts[:3], parts[3:], NOTHING),))
