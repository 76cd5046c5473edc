"""Screw joint: turns about an axis and advances along it by `pitch` metres a turn; generalized
velocity = the rate of the angle."""

from math import pi

from derive.expressions.scalars import Scalar
from derive.joints.records import PARALLEL, JointType, Slot
from derive.joints.turns import turn


def screw_joint(pitch: Scalar) -> JointType:
    """The screw joint with the given advance per turn, in m: positive is right-handed, it advances
    by pitch/2π a radian. One coordinate, so no constraint ties slide and turn."""
    advance = pitch / (2 * pi)
    return JointType(
        name="screw",
        about="turns about an axis and advances along it",
        coordinates=(Slot("", "rad"),),
        velocities=(Slot("", "rad/s"),),
        needs_axis=True,
        rotation=lambda q, axis: turn(axis, q[0]),
        translation=lambda q, axis: [advance * q[0] * a for a in axis],
        motion=lambda q, axis: [[*axis, *(advance * a for a in axis)]],
        rates=lambda q, v, axis: [v[0]],
        closing=lambda plane: ("shift1", "shift2", *PARALLEL, "advance"),
    )


SCREW = screw_joint(1.0)
