"""Joints of a robot that move together, because one mimics the other."""

from __future__ import annotations

from derive.robots.robot import GROUND, ONE_RATE, Joint, Reading, Robot, quoted


def groups(robot: Robot) -> list[dict[str, float]]:
    """The joints with one coordinate by name, in groups that move together: each with its speed at
    the unit speed of the first, which follows none. A joint that follows none and has no followers
    is a group by itself."""
    joints = {joint.name: joint for joint in robot.joints if joint.type in ONE_RATE}
    result: dict[str, dict[str, float]] = {}
    for joint in joints.values():
        leader, ratio = _leader(joint, joints)
        group = result.setdefault(leader, {leader: 1.0})
        group.setdefault(joint.name, ratio)
    return list(result.values())


def _leader(joint: Joint, joints: dict[str, Joint]) -> tuple[str, float]:
    """Which joint it follows in the end, and with which ratio; in a circle the one that the walk
    comes to last."""
    seen, ratio = {joint.name}, 1.0
    while joint.follows is not None and joint.follows[0] not in seen:
        name, times = joint.follows
        joint, ratio = joints[name], ratio * times
        seen.add(name)
    return joint.name, ratio


def check_coupled_masses(reading: Reading, result: Robot) -> None:
    """Joints that mimic each other move together; report those of which none carries any mass.

    A single joint without mass behind it is for the model language to report; a coupled one passes
    there.
    """
    heavy = _carrying_mass(result)
    joints = {joint.name: joint for joint in result.joints}
    for names in groups(result):
        group = [joints[name] for name in names]
        if len(group) > 1 and not any(joint.child in heavy for joint in group):
            said = ", ".join(quoted(joint.place.get("name")) for joint in group[:3])
            problem = (
                f"the joints {said}{' …' if len(group) > 3 else ''} move together and "
                "carry nothing that has mass"
            )
            reading.report(
                group[0].place, problem, "links with mass, or fixed joints", attribute="name"
            )


def _carrying_mass(result: Robot) -> set[str]:
    """Bodies that have mass or carry one that has."""
    above = {joint.child: joint.parent for joint in result.joints}
    bodies: set[str] = set()
    for body in result.bodies:
        name = body.name if body.mass or any(body.inertia) else GROUND
        while name != GROUND and name not in bodies:
            bodies.add(name)
            name = above[name]
    return bodies
