"""Joints of a URDF file that move together: something of what they carry has to have mass."""

from __future__ import annotations

from derive.robots.markup import Element
from derive.robots.robot import GROUND, ONE_RATE, Joint, Reading, Robot, quoted


def check_coupled_masses(reading: Reading, result: Robot, mimics: set[Element]) -> None:
    """Joints that mimic each other move together; report those of which none carries any mass.

    A single joint without mass behind it is for the model language to report; a coupled one passes
    there.
    """
    heavy = _carrying_mass(result)
    coupled = [joint for joint in result.joints if joint.place.first("mimic") in mimics]
    leaders = {joint.name: joint for joint in result.joints if joint.type in ONE_RATE}
    by_file = {joint.place.get("name"): joint for joint in leaders.values()}
    groups: dict[str, list[Joint]] = {}
    for joint in coupled:
        leader = joint
        while (
            (mimic := leader.place.first("mimic")) is not None
            and mimic in mimics
            and mimic.get("joint") in by_file
        ):
            leader = by_file[mimic.get("joint")]
        groups.setdefault(leader.name, [leaders[leader.name]]).append(joint)
    for group in groups.values():
        if not any(joint.child in heavy for joint in group):
            names = ", ".join(quoted(joint.place.get("name")) for joint in group[:3])
            problem = (
                f"the joints {names}{' …' if len(group) > 3 else ''} move together and "
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
