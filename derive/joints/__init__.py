"""Joint types: one file each, one line each in JOINTS."""

from derive.joints.fixed import FIXED
from derive.joints.free import FREE, free_joint
from derive.joints.planar import PLANAR
from derive.joints.prismatic import PRISMATIC
from derive.joints.records import JointType
from derive.joints.revolute import REVOLUTE

JOINTS = (REVOLUTE, PRISMATIC, PLANAR, FREE, FIXED)


def joint_type(name: str, orientation: str = "") -> JointType:
    """The table of a joint type; for a free joint with the Euler sequence `orientation`. Raises KeyError for an unknown name."""
    if name == "free" and orientation:
        return free_joint(orientation)
    return {joint.name: joint for joint in JOINTS}[name]
