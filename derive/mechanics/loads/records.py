"""What a load contributes, and the helpers that several share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from derive.expressions.scalars import Scalar, Vector
from derive.joints.rotations import rotated, sum_of, transpose
from derive.mechanics.geometry.named_frames import place_of
from derive.mechanics.limits import FEW_ENTRIES
from derive.mechanics.recursions.tree import Wrench, ground_point, link_direction
from derive.mechanics.scene import Scene
from derive.model.mechanism.named_frames import frame_named
from derive.model.records import GROUND

Couples = Mapping[int, Wrench]  # moments and forces on links, about their origins, in their axes
NONE: Vector = [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class Applied:
    """`energy` is a potential, of which the assembly takes the gradient; `force` (nv × 1) is
    conjugate to v and has no potential. Couples go from link to link together with those of other
    loads: `couples` have no potential, and `pulls` are those of the potential `stored`."""

    energy: ca.SX
    force: ca.SX
    couples: Couples = field(default_factory=dict[int, Wrench])
    stored: ca.SX = field(default_factory=lambda: ca.SX(0))
    pulls: Couples = field(default_factory=dict[int, Wrench])

    @property
    def every_force(self) -> ca.SX:
        """In one column, to look through."""
        both = [*self.couples.values(), *self.pulls.values()]
        return ca.vertcat(self.force, *[ca.SX(x) for n, f in both for x in (*n, *f)])


@dataclass(frozen=True)
class Law:
    """`applied` gives what a load of the type `record` (derive.model) contributes."""

    record: type
    applied: Callable[[Scene, Any], Applied]


def along(scene: Scene, velocity: str, force: Scalar) -> ca.SX:
    """A force conjugate to one generalized velocity, e f, or, for a coordinate whose rate is none,
    to that rate: its power f q̇ᵢ = f eᵀ N v makes it Nᵀ e f over v (nv × 1)."""
    j = scene.model.conjugate_index(velocity)
    if j is not None:
        return _unit(scene.symbols.v.numel(), j, force)
    name = velocity.removeprefix("der(").removesuffix(")")
    i = scene.model.coordinate_index(name)
    return ca.jacobian(scene.qdot[i], scene.symbols.v).T * force


def _unit(n: int, j: int, x: Scalar) -> ca.SX:
    result = ca.SX(n, 1)
    result[j] = x
    return result


def plus(total: ca.SX, part: ca.SX) -> ca.SX:
    """A sum of columns, of which `total` is dense, and may become the sum itself; most loads of a
    long mechanism act on one entry."""
    if part.nnz() > FEW_ENTRIES:
        return total + part
    for i in part.sparsity().row():
        total[i] = total[i] + part[i]
    return total


def force_alone(scene: Scene, force: ca.SX) -> Applied:
    """A load without potential: it adds to Q and not to V, so its work shows in the power."""
    return Applied(ca.SX(0), force)


def rate_of(scene: Scene, velocity: str) -> ca.SX:
    """A generalized velocity, or the rate of a coordinate, by name."""
    rate = scene.symbols.rates.get(velocity.removeprefix("der(").removesuffix(")"))
    return ca.SX(scene.symbols.names[velocity] if rate is None else rate)


def couples_alone(scene: Scene, couples: Couples) -> Applied:
    """Moments and forces on links, likewise."""
    return Applied(ca.SX(0), ca.SX.zeros(scene.symbols.v.numel()), couples)


def all_of(*parts: Couples) -> dict[int, Wrench]:
    """Couples on the same links added up."""
    total: dict[int, Wrench] = {}
    for part in parts:
        for link, (moment, force) in part.items():
            n, f = total.get(link, (NONE, NONE))
            total[link] = sum_of(n, moment), sum_of(f, force)
    return total


def in_link(scene: Scene, body: str, frame: str, components: Vector) -> Vector:
    """Components of a force or torque in the axes of the body's link."""
    if frame == "body":
        return link_direction(scene.places[body], components)
    turned = components_in_ground(scene, body, frame, components)
    return rotated(transpose(scene.rotations[scene.places[body].link]), turned)


def in_ground(scene: Scene, body: str, point: Vector) -> Vector:
    """A point given in a body's frame, in ground axes, in m."""
    return ground_point(scene.places[body], point, scene.positions, scene.rotations)


def components_in_ground(scene: Scene, body: str, frame: str, components: Vector) -> Vector:
    """Components of a force or torque in ground axes. `frame` says along what they were given: the
    axes of the "body", of the "ground", or of another body, joint or frame."""
    if frame == GROUND:
        return components
    place = scene.places[body]
    if frame != "body":
        place = place_of(scene.symbols, scene.places, frame_named(scene.model, frame))
    turned = link_direction(place, components)
    return turned if place.link < 0 else rotated(scene.rotations[place.link], turned)
