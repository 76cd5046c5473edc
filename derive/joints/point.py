"""Point joint: two translations in a plane and no turn; generalized velocities = the rates of the
coordinates. The plane is that of a planar joint."""

from derive.joints.planar import first, in_plane, second
from derive.joints.records import JointType, Slot

POINT = JointType(
    name="point",
    about="moves in a plane without turning",
    coordinates=(Slot("x", "m"), Slot("y", "m")),
    velocities=(Slot("", "m/s"), Slot("", "m/s")),
    needs_axis=False,
    rotation=lambda q, axis: (),
    translation=lambda q, axis: in_plane(q[0], q[1], axis),
    motion=lambda q, axis: [[0.0, 0.0, 0.0, *first(axis)], [0.0, 0.0, 0.0, *second(axis)]],
    rates=lambda q, v, axis: [v[0], v[1]],
    planar=True,
)
