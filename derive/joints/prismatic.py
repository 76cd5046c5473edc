"""Prismatic joint: slides along the axis; generalized velocity = the joint rate."""

from derive.joints.records import LOCKED, JointType, Slot

PRISMATIC = JointType(
    name="prismatic",
    about="slides along one axis",
    coordinates=(Slot("", "m"),),
    velocities=(Slot("", "m/s"),),
    needs_axis=True,
    rotation=lambda q, axis: (),
    translation=lambda q, axis: [q[0] * a for a in axis],
    motion=lambda q, axis: [[0.0, 0.0, 0.0, *axis]],
    rates=lambda q, v, axis: [v[0]],
    planar=True,
    closing=lambda plane: ("shift1", "turn1") if plane else ("shift1", "shift2", *LOCKED),
)
