"""Rows that several closures share: points that coincide, directions at right angles, shifts along
axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from derive.expressions.scalars import Vector
from derive.joints.rotations import (
    matrix,
)
from derive.mechanics.geometry.frames import axes_in_plane, axes_of, closure_frames
from derive.mechanics.geometry.gaps import gap
from derive.mechanics.limits import HALF_A_TURN
from derive.mechanics.links import placement
from derive.mechanics.records import Place, Row, RowForm, TwistTerm
from derive.mechanics.recursions.tree import ground_point, link_point, relative_rotation
from derive.mechanics.rows import block_of_positions
from derive.mechanics.scene import IN_PLANE, NOTHING, Block, Scene
from derive.model.records import (
    Closure,
)

LOCKED = ((0, 2), (1, 2), (1, 0))


def meeting(scene: Scene, closure: Closure) -> Block:
    """The two points coincide: φ = p₂ − p₁ in ground axes, or in those of a joint frame, in m.

    The velocity rows can be taken along the axes of the ground or of either body: they say the
    same, but which entries are constant, and so which pivots are safe, differs.
    """
    axes = IN_PLANE[scene.model.plane]
    points = [placement(scene.symbols, at)[1] for at in closure.placements]
    where = [scene.places[body] for body in closure.bodies]
    ground = [ground_point(w, p, scene.positions, scene.rotations) for w, p in zip(where, points)]
    names = [f"{closure.name}.{'xyz'[k]}" for k in axes]
    way = gap(ground[0], ground[1], scene.symbols.p)
    phi = tuple(ca.SX(way[k]) for k in axes)
    frames = dict.fromkeys((-1, where[0].link, where[1].link))
    ways = tuple(
        _closure_rows(scene, names, where, points, frame, own)
        for frame in frames
        if len(own := axes_in_plane(scene, frame)) == len(axes)
    )
    if closure.along >= 0:
        turned = _turned_gap(scene, closure, range(len(axes)))
        block = block_of_positions(scene, names, turned, "m/s")
        return replace(block, ways=(*block.ways, *ways))
    return Block(tuple(Row(name, i, "m/s") for i, name in enumerate(names)), phi, ways)


def _turned_gap(scene: Scene, closure: Closure, axes: Sequence[int]) -> list[ca.SX]:
    """aᵢ · (p₂ − p₁) along axes of a joint frame, or of the body that the closure is seen from."""
    near = scene.among(closure.bodies)
    frames = closure_frames(near, closure)
    gap = frames.origins[1] - frames.origins[0]
    along = frames.axes[_side(closure)] if closure.along < 2 else axes_of(near, closure.seen_from)
    return [ca.dot(along[i], gap) for i in axes]


def _across(near: Scene, closure: Closure, axis: ca.SX, turned: ca.SX) -> list[ca.SX]:
    """gᵢ · (a × x) about two axes of the body that the closure is seen from: where both bodies spin
    about a, these do not turn along."""
    moved = ca.cross(axis, turned)
    about = axes_of(near, closure.seen_from)
    return [ca.dot(about[i], moved) for i in range(3) if i != closure.along - 2]


def _closure_rows(
    scene: Scene,
    names: Sequence[str],
    where: Sequence[Place],
    points: Sequence[Vector],
    frame: int,
    axes: Sequence[int],
) -> tuple[RowForm, ...]:
    """d · (v₂ + ω₂ × r₂) − d · (v₁ + ω₁ × r₁) along the axes of one frame (−1 is the ground), seen
    from each link. Terms of the ground are left out: it rests."""
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


def right_angles(scene: Scene, closure: Closure, pairs: Sequence[tuple[int, int]]) -> Block:
    """φ = bⱼ · aᵢ for the given axes i of the first and j of the second joint frame, unit vectors:
    the cosine of the angle, whose slope is one where the angle is right."""
    frames = closure_frames(scene.among(closure.bodies), closure)
    phi = [ca.dot(frames.axes[1][j], frames.axes[0][i]) for i, j in pairs]
    return block_of_positions(
        scene, [f"{closure.name}.turn{k + 1}" for k in range(len(pairs))], phi, "rad/s"
    )


def parallel(scene: Scene, closure: Closure) -> Block:
    """`right_angles` by which two axes stay parallel: that of one frame to the other two axes of
    the other. A body that turns about its axis turns these rows along. The sign is such that they
    say how the second body turns, whichever frame it is."""
    near, side = scene.among(closure.bodies), _side(closure)
    frames = closure_frames(near, closure)
    across, axis = frames.axes[side], frames.axes[1 - side][2]
    phi = [(-1) ** side * ca.dot(axis, across[i]) for i in (0, 1)]
    if closure.along > 1:
        phi = _across(near, closure, frames.axes[0][2], frames.axes[1][2])
    return block_of_positions(scene, [f"{closure.name}.turn{i}" for i in (1, 2)], phi, "rad/s")


def locked(scene: Scene, closure: Closure, pairs: Sequence[tuple[int, int]]) -> Block:
    """`right_angles` of pairs that leave no turn. Half a turn away they are met as well: a loop is
    closed by Rodrigues' parameters instead,

        2 tan(θ/2) e = 2 vee(R − Rᵀ)/(1 + tr R),   Rᵢⱼ = aᵢ · bⱼ,

    which have the same slope where the frames agree, are zero there alone, and are not singular
    anywhere short of half a turn, where they have no value. A step that is to undo the turn along
    the slopes of the right angles has to change these by ω · (bⱼ × aᵢ), with ω = −2 sin(θ/2) e."""
    frames = closure_frames(scene.among(closure.bodies), closure)
    first, second = frames.axes
    R = [[ca.dot(a, b) for b in second] for a in first]
    below = 1 + R[0][0] + R[1][1] + R[2][2]
    below = ca.if_else(below > HALF_A_TURN, below, 0)  # what rounding leaves is no number, either
    assembly = [2 * (R[i][j] - R[j][i]) / below for i, j in pairs]
    turn = ca.vertcat(R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]) / ca.sqrt(below)
    columns = [ca.vertcat(*[row[j] for row in R]) for j in range(3)]
    whole = [ca.dot(turn, ca.cross(columns[j], ca.DM.eye(3)[:, i])) for i, j in pairs]
    block = right_angles(scene, closure, pairs)
    return replace(block, assembly=tuple(assembly), whole=tuple(whole))


def shifts(scene: Scene, closure: Closure, axes: Sequence[int]) -> Block:
    """φ = aᵢ · (p₂ − p₁) along axes of one joint frame, in m. These axes turn, so the row's rate
    holds ω × aᵢ as well."""
    names = [f"{closure.name}.shift{k + 1}" for k in range(len(axes))]
    near, side = scene.among(closure.bodies), _side(closure)
    frames = closure_frames(near, closure)
    gap = frames.origins[1] - frames.origins[0]
    phi = [ca.dot(frames.axes[side][i], gap) for i in axes]
    if closure.along > 1 and len(axes) == 2:
        phi = _across(near, closure, frames.axes[0][2], gap)
    return block_of_positions(scene, names, phi, "m/s")


def _side(closure: Closure) -> int:
    """Along whose axes: the first frame's, unless the closure says the second's."""
    return int(closure.along == 1)
