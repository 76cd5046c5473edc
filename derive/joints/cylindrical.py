"""Cylindrical joint: turns about and slides along one axis; generalized velocities = the two
rates."""

from derive.joints.records import PARALLEL, JointType, Slot
from derive.joints.turns import turn

CYLINDRICAL = JointType(
    name="cylindrical",
    about="turns about and slides along one axis",
    coordinates=(Slot("angle", "rad"), Slot("slide", "m")),
    velocities=(Slot("", "rad/s"), Slot("", "m/s")),
    needs_axis=True,
    rotation=lambda q, axis: turn(axis, q[0]),
    translation=lambda q, axis: [q[1] * a for a in axis],
    motion=lambda q, axis: [[*axis, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, *axis]],
    rates=lambda q, v, axis: [v[0], v[1]],
    closing=lambda plane: ("shift1", "shift2", *PARALLEL),
)
