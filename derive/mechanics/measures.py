"""Measures of the motion that formulas use, over (t, q, v): where frames are and how they move.

With p and R (ground ← frame) of a frame, and those of the frame f that it is seen from,

    position      R_fᵀ (p + R x − p_f)          velocity   its rate
    orientation   R_fᵀ R                        turning    its rate
    angular velocity   R_fᵀ (ω − ω_f)

where the product of rotations goes through what carries both and not through the ground.
Accelerations are the rates of these rates, over v̇ too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca

from derive.expressions.scalars import Matrix, Scalar, Vector
from derive.joints.records import Rotation
from derive.joints.rotations import (
    cross,
    difference,
    dot,
    inverse,
    matrix,
    merged,
    product,
    rotated,
    sum_of,
    transpose,
)
from derive.mechanics.geometry.frames import angular_velocity, carrier_in_plane, ground_rotation
from derive.mechanics.geometry.named_frames import place_of
from derive.mechanics.geometry.paths import path_length
from derive.mechanics.outputs import planar_angle
from derive.mechanics.records import Place
from derive.mechanics.recursions.tree import ground_point, link_point, relative_rotation
from derive.mechanics.scene import NORMAL, NOTHING, Scene
from derive.mechanics.symbols import define
from derive.model.mechanism.named_frames import carrier
from derive.model.records import Measure


def with_measures(scene: Scene) -> Scene:
    """The scene whose symbols know every measure of the model, and the definitions that use
    them."""
    model = scene.model
    every = (*model.measures, *model.accelerations)
    if not every:
        return scene
    symbols = replace(scene.symbols, names=dict(scene.symbols.names))
    for measure in every:
        symbols.names[measure.name] = _QUANTITIES[measure.quantity](scene, measure)
    define(model, symbols)
    return scene.with_symbols(symbols)


def frame_place(scene: Scene, name: str) -> Place:
    """Where a body or frame sits in its link."""
    return place_of(scene.symbols, scene.places, carrier(scene.model, name))


def _places(scene: Scene, measure: Measure) -> tuple[Place, Place]:
    return frame_place(scene, measure.frame), frame_place(scene, measure.relative)


def _position(scene: Scene, measure: Measure) -> Scalar:
    """What carries both frames is no part of it."""
    here, there = _places(scene, measure)
    near, point = scene.near(here.link, there.link), scene.symbols.vector(measure.point)
    ends = [
        ground_point(place, x, near.positions, near.rotations)
        for place, x in ((there, NOTHING), (here, point))
    ]
    (k,) = measure.component
    return _turned_back(near, there, difference(ends[1], ends[0]))[k]


def _velocity(scene: Scene, measure: Measure) -> Scalar:
    """Against the ground and far from it R (v + ω × x) of the link, which goes from link to link;
    else the rate of the position."""
    here, there = _places(scene, measure)
    if there.link >= 0 or scene.frame or not scene.is_deep(here.link):
        return scene.rate(ca.SX(_position(scene, measure)))
    point = link_point(here, scene.symbols.vector(measure.point))
    omega, velocity = scene.numbers[here.link]
    own = sum_of(velocity, cross(omega, point))
    (k,) = measure.component
    return _turned_back(scene, there, rotated(scene.rotations[here.link], own))[k]


def _turned_back(scene: Scene, place: Place, vector: Vector) -> Vector:
    """A vector in ground axes along the axes of a frame."""
    return rotated(transpose(ground_rotation(scene, place)), vector)


def _orientation(scene: Scene, measure: Measure) -> Scalar:
    row, column = measure.component
    return _relative(scene, measure)[row][column]


def _relative(scene: Scene, measure: Measure) -> Matrix:
    here, there = _places(scene, measure)
    if scene.cut and there.link < 0:
        back = transpose(matrix(there.rotation))
        return product(back, ground_rotation(scene, here))
    chain: Rotation = merged(
        inverse(there.rotation),
        relative_rotation(scene.links, there.link, here.link),
        here.rotation,
    )
    return matrix(chain)


def _angle(scene: Scene, measure: Measure) -> Scalar:
    """Against what carries both, if it keeps the axes of the plane."""
    here, there = _places(scene, measure)
    below = carrier_in_plane(scene, here.link, there.link)
    return planar_angle(scene, here, below) - planar_angle(scene, there, below)


def _angular_velocity(scene: Scene, measure: Measure) -> Scalar:
    here, there = _places(scene, measure)
    if here.link == there.link:
        return 0.0
    omega = difference(angular_velocity(scene, here), angular_velocity(scene, there))
    if scene.model.plane:
        return dot(NORMAL[scene.model.plane], omega)
    (k,) = measure.component
    return _turned_back(scene, there, omega)[k]


def _rate(of: Callable[[Scene, Measure], Scalar]) -> Callable[[Scene, Measure], Scalar]:
    return lambda scene, measure: scene.rate(ca.SX(of(scene, measure)))


def _second(of: Callable[[Scene, Measure], Scalar]) -> Callable[[Scene, Measure], Scalar]:
    return lambda scene, measure: scene.speeding(ca.SX(of(scene, measure)))


def _speed(scene: Scene, measure: Measure) -> Scalar:
    """The rate of a coordinate, or a generalized velocity."""
    names = [x.name for x in scene.model.coordinates]
    if measure.frame in names:
        return scene.qdot[names.index(measure.frame)]
    return scene.symbols.names[measure.frame]


def _length(scene: Scene, measure: Measure) -> Scalar:
    return path_length(scene, scene.model.path(measure.frame))


_QUANTITIES: dict[str, Callable[[Scene, Measure], Scalar]] = {
    "position": _position,
    "velocity": _velocity,
    "orientation": _orientation,
    "turning": _rate(_orientation),
    "angle": _angle,
    "angular_velocity": _angular_velocity,
    "length": _length,
    "lengthening": _rate(_length),
    "acceleration": _second(_rate(_position)),
    "second_turning": _second(_rate(_orientation)),
    "angular_acceleration": _second(_angular_velocity),
    "second_lengthening": _second(_rate(_length)),
    "speeding": _second(_speed),
}
