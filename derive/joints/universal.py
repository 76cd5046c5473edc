"""Universal joint: a turn about `axis` fixed in the parent, then one about `axis2` fixed in the
child; two revolute joints."""

from dataclasses import replace

from derive.joints.records import Slot, meeting
from derive.joints.revolute import REVOLUTE


def _closing(plane: str) -> tuple[str, ...]:
    return (*meeting(plane), "cross")


UNIVERSAL = replace(
    REVOLUTE,
    name="universal",
    about="turns about two crossing axes, one fixed in each body",
    coordinates=(Slot("angle1", "rad"), Slot("angle2", "rad")),
    velocities=(Slot("", "rad/s"), Slot("", "rad/s")),
    parts=("revolute", "revolute"),
    planar=False,
    closing=_closing,
)
