"""Inertial parameters of a robot as parameters of the model, and a payload at its end.

For identification, adaptation and tools that change: mass, centre of mass (or first moment) and
inertia of each link become arguments of the functions in the place of numbers. What is exactly zero
in the file stays zero, so that symmetric links keep short equations.
"""

from __future__ import annotations

from derive.robots.numbers import written
from derive.robots.robot import GROUND, Body, Entry, Joint, Robot

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
INERTIAL, BARYCENTRIC = "inertial", "barycentric"
KINDS = (INERTIAL, BARYCENTRIC)  # of `--parameters`


def name_parameters(robot: Robot, kind: str) -> None:
    """Give every inertial number that is not zero a name, and the robot a payload. `barycentric`:
    mass, first moment and tensor about the origin, in which the equations are linear."""
    for body in robot.bodies:
        if kind == BARYCENTRIC and body.mass:
            _refer_to_origin(body)
        for short, value, unit in _numbers(body):
            if value:
                _name(robot, body, short, f"{written(value)} {unit}")
    _add_payload(robot)


def _refer_to_origin(body: Body) -> None:
    """h = m c, and I about the origin: I_c + m (c·c 1 − c cᵀ)."""
    x, y, z = body.com
    squares = (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    about_com = (*body.inertia, *[0.0] * (6 - len(body.inertia)))
    body.inertia = tuple(a + body.mass * b for a, b in zip(about_com, squares))
    body.first_moment = (body.mass * x, body.mass * y, body.mass * z)


def _numbers(body: Body) -> list[tuple[str, float, str]]:
    """The ten numbers of a body, each with the short name of its parameter and its unit."""
    first = body.first_moment
    kind, unit, place = ("c", "m", body.com) if first is None else ("h", "kg*m", first)
    places = [(f"{kind}_{x}", value, unit) for x, value in zip("xyz", place)]
    moments = [(f"I_{x}", value, "kg*m^2") for x, value in zip(MOMENTS, body.inertia)]
    return [("m", body.mass, "kg"), *places, *moments]


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
