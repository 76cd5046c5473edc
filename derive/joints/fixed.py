"""Fixed joint: child and parent move as one."""

from derive.joints.records import LOCKED, JointType, meeting

FIXED = JointType(
    name="fixed",
    about="welds the child to the parent",
    coordinates=(),
    velocities=(),
    needs_axis=False,
    rotation=lambda q, axis: (),
    translation=lambda q, axis: [0.0, 0.0, 0.0],
    motion=lambda q, axis: [],
    rates=lambda q, v, axis: [],
    planar=True,
    closing=lambda plane: (*meeting(plane), *(("turn1",) if plane else LOCKED)),
)
