"""MJCF → Robot: bodies, joints, inertias, equalities and motors of MuJoCo's format; contacts are
left out, and that is said."""

from __future__ import annotations

from collections.abc import Sequence

from derive.diagnostics import counted, did_you_mean, listed
from derive.robots.markup import Budget, Element
from derive.robots.mjcf.actuators import actuators, rotors
from derive.robots.mjcf.bodies import Scene, walk
from derive.robots.mjcf.reference import springs_by_time
from derive.robots.mjcf.replicas import replicate
from derive.robots.mjcf.settings import included, settings
from derive.robots.mjcf.sites import sites
from derive.robots.mjcf.tendons import tendons
from derive.robots.mjcf.ties import equalities
from derive.robots.mjcf.words import unread_in
from derive.robots.robot import Reading, Robot

READ = ("compiler", "option", "default", "worldbody", "equality", "tendon", "actuator")
NOT_NEEDED = ("asset", "contact", "custom", "keyframe", "sensor", "size", "statistic", "visual")
REFUSED = {"deformable": "deformable bodies", "extension": "plugins"}


def robot(
    root: Element, name: str, floating: bool, budget: Budget, folders: Sequence[str] = ()
) -> Robot:
    """The robot of a <mujoco> element; ModelError with everything wrong with it. `folders`: where
    included files may be, beside the model's own."""
    included(root, budget, folders)
    reading = Reading()
    _check_sections(reading, root)
    unread = unread_in(reading, root)
    outcome = settings(reading, root, folders)
    replicate(reading, root, outcome, budget)
    reading.finish()
    _keep_names(reading, root)
    result = Robot(root.get("model") or name, "MJCF", root, outcome.gravity)
    result.names, result.body_names = reading.symbols, reading.bodies
    scene = Scene(result, outcome)
    for world in root.all("worldbody"):
        walk(reading, world, scene, floating)
    if not result.bodies and not reading.problems:
        root.refuse("the file has no bodies", "<body> inside <worldbody>")
    rotors(reading, root, scene)
    springs_by_time(reading, scene)
    known = tendons(reading, root, scene)
    if not _is_off("equality", "equality", root, scene):
        equalities(reading, root, known, scene)
    if not _is_off("actuation", "actuator", root, scene):
        actuators(reading, root, known, scene)
    reading.finish()
    sites(reading, scene)
    if unread:
        result.assumed.append(f"not read: {listed(unread)}")
    _notes(reading, root, scene)
    return result


def _keep_names(reading: Reading, root: Element) -> None:
    """Bodies and joints keep the names of the file where the model may have them."""
    for world in root.all("worldbody"):
        for element in world.walk():
            if element.tag == "body":
                reading.bodies.kept.add(element.get("name"))
            elif element.tag in ("joint", "freejoint"):
                reading.symbols.kept.add(element.get("name"))


def _is_off(flag: str, section: str, root: Element, scene: Scene) -> bool:
    """Whether the file switches off what a section holds; said where there is something."""
    off = flag in scene.settings.off
    count = sum(len(one.children) for one in root.all(section))
    if off and count:
        scene.robot.assumed.append(f"switched off by a <flag>: <{section}>, {count} of them")
    return off


def _check_sections(reading: Reading, root: Element) -> None:
    for section in root.children:
        if section.tag in REFUSED:
            reading.report(
                section,
                f"<{section.tag}>: {REFUSED[section.tag]}",
                "rigid bodies, joints and motors",
            )
        elif section.tag not in (*READ, *NOT_NEEDED):
            known = [*READ, *NOT_NEEDED]
            reading.report(
                section,
                f"unknown section <{section.tag}>",
                ", ".join(READ),
                did_you_mean(section.tag, known),
            )


def _notes(reading: Reading, root: Element, scene: Scene) -> None:
    result = scene.robot
    if scene.geoms:
        result.left_out.append(f"contacts between {counted(scene.geoms, 'geom')}")
    if scene.clamped:
        names = listed(scene.clamped)
        result.left_out.append(f"the ranges of the forces of actuators at {names}")
    if scene.unaligned:
        names = listed(scene.unaligned)
        result.assumed.append(
            f"coordinates of {names} are those of the body's own frame, not its inertia's (align)"
        )
    massless = sum(1 for body in result.bodies if not body.mass)
    if massless:
        result.changed.append(
            f"{counted(massless, 'body', 'bodies')} without mass, such as between several "
            "joints of one"
        )
    if reading.renamed:
        result.changed.append(
            f"{counted(reading.renamed, 'name')} changed to fit the model language; the old "
            "ones stand beside"
        )
    solids = scene.settings.solids
    if solids:
        result.changed.append(f"read for their inertia: {counted(len(solids), 'mesh', 'meshes')}")
    ignored = sorted(
        ({section.tag for section in root.children} & set(NOT_NEEDED))
        - ({"asset"} if solids else set())
    )
    if ignored:
        result.changed.append(f"not read: {', '.join(f'<{tag}>' for tag in ignored)}")
    if any(joint.limits for joint in result.joints):
        result.assumed.append(
            "limits are there to read: nothing in the equations stops a joint at them"
        )
    medium = {"density": scene.settings.density, "viscosity": scene.settings.viscosity}
    fluid = [name for name, value in medium.items() if value]
    if fluid:
        result.left_out.append(f"forces of the medium around the bodies ({', '.join(fluid)})")
