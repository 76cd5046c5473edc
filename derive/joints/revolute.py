"""Revolute joint: one turn about the axis; generalized velocity = the joint rate."""

from derive.joints.records import PARALLEL, JointType, Slot, meeting
from derive.joints.turns import turn

REVOLUTE = JointType(
    name="revolute",
    about="turns about one axis",
    coordinates=(Slot("", "rad"),),
    velocities=(Slot("", "rad/s"),),
    needs_axis=True,
    rotation=lambda q, axis: turn(axis, q[0]),
    translation=lambda q, axis: [0.0, 0.0, 0.0],
    motion=lambda q, axis: [[*axis, 0.0, 0.0, 0.0]],
    rates=lambda q, v, axis: [v[0]],
    planar=True,
    closing=lambda plane: (*meeting(plane), *(() if plane else PARALLEL)),
)
