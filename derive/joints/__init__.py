"""Joint types: one file each, one line each in JOINTS."""

from derive.expressions.scalars import Scalar
from derive.joints.ball import BALL, ball_joint
from derive.joints.cylindrical import CYLINDRICAL
from derive.joints.fixed import FIXED
from derive.joints.free import FLOATING, FREE, free_joint
from derive.joints.planar import PLANAR
from derive.joints.point import POINT
from derive.joints.prismatic import PRISMATIC
from derive.joints.records import JointType
from derive.joints.revolute import REVOLUTE
from derive.joints.screw import SCREW, screw_joint
from derive.joints.universal import UNIVERSAL

JOINTS = (REVOLUTE, PRISMATIC, SCREW, CYLINDRICAL, UNIVERSAL, BALL, PLANAR, POINT, FREE, FIXED)

# joints of planar models; joints that can also close a loop, in space and in the plane
PLANAR_JOINTS = tuple(joint.name for joint in JOINTS if joint.planar)
CLOSURES = tuple(joint.name for joint in JOINTS if joint.closing)
PLANAR_CLOSURES = tuple(
    joint.name for joint in JOINTS if joint.planar and joint.closing and joint.closing("xy")
)


def joint_type(name: str, orientation: str = "", pitch: Scalar = 1.0) -> JointType:
    """The table of a joint type; for a free or ball joint with the Euler sequence `orientation` or
    "quaternion", for a screw with its pitch (m a turn). Raises KeyError for an unknown name."""
    if name == "free" and orientation:
        return FLOATING if orientation == "quaternion" else free_joint(orientation)
    if name == "ball" and orientation:
        return BALL if orientation == "quaternion" else ball_joint(orientation)
    if name == "screw":
        return screw_joint(pitch)
    return {joint.name: joint for joint in JOINTS}[name]
