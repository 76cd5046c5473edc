"""Soft welds."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from derive.expressions.scalars import Matrix, Vector
from derive.joints.rotations import (
    difference,
    dot,
    minus,
    plus,
    product,
    rotated,
    scaled,
    times,
    transpose,
)
from derive.mechanics.geometry.frames import joint_frame
from derive.mechanics.loads.points import (
    Point,
    are_far,
    moments,
    pair,
    point_at,
    turning,
    velocity,
)
from derive.mechanics.loads.records import Applied, Couples, Law, all_of
from derive.mechanics.scene import Scene
from derive.model.load_records import Bushing


def bushing(scene: Scene, load: Bushing) -> Applied:
    """A soft weld: ½ Σ kᵢ dᵢ² + ½ Σ κᵢ θᵢ² and the dampings, in the first body's joint frame.

    d is the second origin's displacement, θ = ½ Σ aᵢ × bᵢ of the two frames' axes: the rotation
    vector while it is small.
    """
    if are_far(scene, load.bodies):
        return _far(scene, load)
    s, near = scene.symbols, scene.among(load.bodies)
    frames = [joint_frame(near, body, at, ()) for body, at in zip(load.bodies, load.placements)]
    (start, a), (end, b) = frames
    turn = 0.5 * sum((ca.cross(x, y) for x, y in zip(a, b)), ca.SX.zeros(3))
    parts = [(ca.vertcat(*[ca.dot(e, end - start) for e in a]), load.stiffness, load.damping)]
    parts.append((ca.vertcat(*[ca.dot(e, turn) for e in a]), load.torsion, load.torsion_damping))
    energy, force = ca.SX(0), ca.SX.zeros(s.v.numel())
    for deflection, stiffness, damping in parts:
        energy += 0.5 * ca.dot(ca.vertcat(*s.vector(stiffness)), deflection * deflection)
        rate = scene.rate(deflection)
        force -= ca.jtimes(rate, s.v, ca.vertcat(*s.vector(damping)) * rate, True)
    return Applied(energy, force)


@dataclass(frozen=True)
class _Weld:
    """The second frame as the first sees it: C = Aᵀ B of the axes, and what moves at its origin.
    With the rate W ω of θ, W = ½ (tr(C) E − C), moments n do the power of Wᵀ n."""

    scene: Scene
    ends: tuple[Point, Point]
    A: Matrix
    W: Matrix

    def rate(self) -> tuple[Vector, Vector]:
        """Of d and θ. The first body's point at the second origin moves with that body."""
        own, other = (velocity(self.scene, end) for end in self.ends)
        omegas = [turning(self.scene, end.link) for end in self.ends]
        relative = rotated(transpose(self.A), difference(omegas[1], omegas[0]))
        return rotated(transpose(self.A), difference(other, own)), rotated(self.W, relative)

    def against(self, force: Vector, moment: Vector) -> Couples:
        """What −force · d and −moment · θ mean for the links."""
        pushed = rotated(self.A, scaled(-1.0, force))
        twisted = rotated(self.A, rotated(transpose(self.W), scaled(-1.0, moment)))
        links = (self.ends[0].link, self.ends[1].link)
        return all_of(pair(self.scene, self.ends, pushed), moments(self.scene, links, twisted))


def _far(scene: Scene, load: Bushing) -> Applied:
    """The same from link to link."""
    s = scene.symbols
    frames = [joint_frame(scene, body, at, ()) for body, at in zip(load.bodies, load.placements)]
    (start, end), axes = ([_entries(x) for x, _ in frames]), [axes for _, axes in frames]
    A, B = (transpose([_entries(axis) for axis in triad]) for triad in axes)
    C = product(transpose(A), B)
    weld = _Weld(
        scene,
        (point_at(scene, load.bodies[0], end), point_at(scene, load.bodies[1], end)),
        A,
        _rates_of_turning(C),
    )
    d = rotated(transpose(A), difference(end, start))
    theta = [times(0.5, minus(C[k - 1][k - 2], C[k - 2][k - 1])) for k in range(3)]
    moving, twisting = weld.rate()
    force, moment = _each(s.vector(load.stiffness), d), _each(s.vector(load.torsion), theta)
    return Applied(
        ca.SX(0),
        ca.SX.zeros(s.v.numel()),
        weld.against(
            _each(s.vector(load.damping), moving), _each(s.vector(load.torsion_damping), twisting)
        ),
        stored=ca.SX(times(0.5, plus(dot(force, d), dot(moment, theta)))),
        pulls=weld.against(force, moment),
    )


def _rates_of_turning(C: Matrix) -> Matrix:
    trace = plus(plus(C[0][0], C[1][1]), C[2][2])
    return [
        [times(0.5, minus(trace if i == k else 0.0, C[i][k])) for k in range(3)] for i in range(3)
    ]


def _entries(column: ca.SX) -> Vector:
    return [column[k] for k in range(3)]


def _each(factors: Vector, values: Vector) -> Vector:
    return [times(factor, x) for factor, x in zip(factors, values)]


BUSHING = Law(Bushing, bushing)
