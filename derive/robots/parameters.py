"""Inertial parameters of a robot as parameters of the model, and a payload at its end.

For identification, adaptation and tools that change: mass, centre of mass and inertia of each link
become arguments of the functions in the place of numbers. What is exactly zero in the file stays
zero, so that symmetric links keep short equations.
"""

from __future__ import annotations

from derive.robots.numbers import written
from derive.robots.robot import GROUND, Body, Entry, Joint, Robot

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
KINDS = ("inertial",)  # of `--parameters`


def name_inertial(robot: Robot) -> None:
    """Give every inertial number that is not zero a name, and the robot a payload."""
    for body in robot.bodies:
        for short, value, unit in _numbers(body):
            if value:
                _name(robot, body, short, f"{written(value)} {unit}")
    _add_payload(robot)


def _numbers(body: Body) -> list[tuple[str, float, str]]:
    """The ten numbers of a body, each with the short name of its parameter and its unit."""
    coms = [(f"c_{x}", value, "m") for x, value in zip("xyz", body.com)]
    moments = [(f"I_{x}", value, "kg*m^2") for x, value in zip(MOMENTS, body.inertia)]
    return [("m", body.mass, "kg"), *coms, *moments]


def _name(robot: Robot, body: Body, short: str, value: str) -> None:
    kind, _, place = short.partition("_")
    wanted = "_".join(filter(None, (kind, body.name, place)))
    body.symbols[short] = robot.names(wanted, "parameter")
    robot.parameters.append(Entry(body.symbols[short], value, body.place))


def _add_payload(robot: Robot) -> None:
    """A point mass, zero until it is said, on the last link."""
    last = _last(robot)
    payload = Body(robot.body_names("payload", "body"), robot.root)
    for short, unit in (("m", "kg"), ("c_x", "m"), ("c_y", "m"), ("c_z", "m")):
        _name(robot, payload, short, f"0 {unit}")
    robot.bodies.append(payload)
    mount = robot.names("payload_mount", "joint")
    robot.joints.append(Joint(mount, "fixed", last, payload.name, robot.root))
    robot.changed.append(
        "masses, centres of mass and inertias are parameters, but for those that are zero; "
        f"{payload.name} is a point mass at {last}"
    )


def _last(robot: Robot) -> str:
    """The body at the end of the longest chain: of moving joints first, then of all."""
    above = {joint.child: joint for joint in robot.joints}
    lengths = {GROUND: (0, 0)}
    for body in robot.bodies:
        chain: list[Joint] = []
        name = body.name
        while name not in lengths:
            chain.append(above[name])
            name = above[name].parent
        for joint in reversed(chain):
            moving, every = lengths[joint.parent]
            lengths[joint.child] = (moving + (joint.type != "fixed"), every + 1)
    return max((body.name for body in robot.bodies), key=lambda name: lengths[name])
