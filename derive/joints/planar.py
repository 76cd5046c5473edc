"""Planar joint: two translations and a turn; generalized velocities = linear and angular velocity
in the child's frame.

The plane is at right angles to the axis, spanned by e1 and e2 = axis × e1: (x, y) for axis z, (x,
z) for −y, (y, z) for x.
"""

from collections.abc import Sequence

from derive.expressions.scalars import Scalar, Vector
from derive.joints.records import PARALLEL, JointType, Slot
from derive.joints.rotations import axis_rotation, cross, rotated, sum_of
from derive.joints.turns import turn


def first(axis: Sequence[Scalar]) -> Vector:
    """e1 of the plane at right angles to the axis."""
    along_x = abs(float(axis[0])) == 1.0
    return [0.0, 1.0, 0.0] if along_x else [1.0, 0.0, 0.0]


def second(axis: Sequence[Scalar]) -> Vector:
    """e2 = axis × e1."""
    return cross(axis, first(axis))


def in_plane(a: Scalar, b: Scalar, axis: Sequence[Scalar]) -> Vector:
    """a e1 + b e2."""
    return sum_of([a * e for e in first(axis)], [b * e for e in second(axis)])


def _rates(q: Sequence[Scalar], v: Sequence[Scalar], axis: Sequence[Scalar]) -> Vector:
    velocity = rotated(axis_rotation(axis, q[2]), in_plane(v[0], v[1], axis))
    return [_component(velocity, first(axis)), _component(velocity, second(axis)), v[2]]


def _component(x: Sequence[Scalar], unit: Sequence[Scalar]) -> Scalar:
    return next(a * e for a, e in zip(x, unit) if float(e) != 0.0)


def _turned(v: Sequence[Scalar], p: Sequence[Scalar]) -> Vector:
    """ω × P in the plane, and v × P about its axis."""
    return [-v[2] * p[1], v[2] * p[0], v[0] * p[1] - v[1] * p[0]]


PLANAR = JointType(
    name="planar",
    about="moves and turns in a plane; generalized velocities in the body's frame",
    coordinates=(Slot("x", "m"), Slot("y", "m"), Slot("angle", "rad")),
    velocities=(Slot("vx", "m/s"), Slot("vy", "m/s"), Slot("w", "rad/s")),
    needs_axis=False,
    rotation=lambda q, axis: turn(axis, q[2]),
    translation=lambda q, axis: in_plane(q[0], q[1], axis),
    motion=lambda q, axis: [
        [0.0, 0.0, 0.0, *first(axis)],
        [0.0, 0.0, 0.0, *second(axis)],
        [*axis, 0.0, 0.0, 0.0],
    ],
    rates=_rates,
    planar=True,
    closing=lambda plane: () if plane else ("shift1", *PARALLEL),
    turned=_turned,
)
