"""Words of URDF: ROS's description of the format, Drake's additions, and what transmissions of
PR2 and ros_control have."""

from __future__ import annotations

from derive.robots.words import words

ORIGIN = words("xyz rpy quat_xyzw")
INERTIAL = words(
    "",
    {
        "origin": ORIGIN,
        "mass": words("value"),
        "inertia": words("ixx ixy ixz iyy iyz izz"),
    },
    once="origin mass inertia",
)
LINK = words(
    "name type",
    {"inertial": INERTIAL},
    once="inertial",
    closed="visual collision contact self_collision_checking",
)
JOINT = words(
    "name type",
    {
        "parent": words("link"),
        "child": words("link"),
        "origin": ORIGIN,
        "axis": words("xyz"),
        "limit": words(
            "lower upper effort velocity acceleration deceleration jerk drake:acceleration"
        ),
        "dynamics": words("damping friction"),
        "mimic": words("joint multiplier offset"),
        "calibration": words("rising falling reference_position"),
        "safety_controller": words("soft_lower_limit soft_upper_limit k_position k_velocity"),
    },
    once="parent child origin axis limit dynamics mimic calibration safety_controller",
)
# the reduction is read where it is the actuator's, its rotor by Drake's names
HARDWARE = (
    "hardwareInterface hardware_interface mechanicalReduction mechanical_reduction role offset "
    "motorTorqueConstant maximumTorque pulsesPerRevolution encoderResolution"
)
ACTUATOR = words(
    "name type role",
    {
        name: words("value")
        for name in ("gear_ratio", "rotor_inertia", "drake:gear_ratio", "drake:rotor_inertia")
    },
    closed=HARDWARE,
)
DRIVEN = words(
    "name role",
    closed=f"{HARDWARE} saturationLower saturationUpper deadBandLower deadBandUpper "
    "ignoreTransmissionAbsoluteEncoder",
)
TRANSMISSION = words(
    "name type",
    {"joint": DRIVEN, "actuator": ACTUATOR},
    closed=f"{HARDWARE} type plugin param leftActuator rightActuator flexJoint rollJoint gap_joint "
    "passive_joint use_simulated_gripper_joint simulated_actuated_joint compensator",
)
ROBOT = words(
    "name version",
    {"link": LINK, "joint": JOINT, "transmission": TRANSMISSION},
    closed="material",
)
