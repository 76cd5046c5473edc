"""The tree of <body> elements: poses, joints, inertias. Walked without recursion, for chains nest
one level per body.

In MJCF a joint is placed in the child's frame and moves it from the pose given for the body;
several joints on one body act one after the other, so that a chain of bodies without mass carries
them. A coordinate is zero in MuJoCo's `qpos` = 0, which is `ref` before the pose of the file, and
starts at `ref`, as in MuJoCo's `qpos0`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from derive.robots.markup import Element
from derive.robots.mjcf.inertia import Frame, Piece, explicit, fill, of_geom, together
from derive.robots.mjcf.polynomials import NONE, of_length, of_speed, powers
from derive.robots.mjcf.settings import Settings, completed, orientation
from derive.robots.numbers import listing, scalar, vector, written
from derive.robots.robot import GROUND, Body, Entry, Joint, Reading, Robot, quoted
from derive.robots.rotations import (
    IDENTITY,
    about,
    minus,
    product,
    rotated,
    times,
    to_quaternion,
    unit,
    whole_degrees,
)

TYPES = {"hinge": "revolute", "slide": "prismatic", "ball": "ball", "free": "free"}
HARMLESS = ("geom", "site", "camera", "light", "joint", "freejoint", "inertial", "body", "frame")


@dataclass(frozen=True)
class Inverse:
    """M⁻¹ at the reference configuration, and where the rates of each joint start in it."""

    matrix: NDArray[np.float64]
    starts: dict[str, int]


@dataclass
class Scene:
    """What the rest of the file refers to by name; poses in the ground frame at the reference
    configuration."""

    robot: Robot
    settings: Settings
    bodies: dict[str, str] = field(default_factory=lambda: {"world": GROUND})
    poses: dict[str, Frame] = field(default_factory=lambda: {GROUND: Frame()})
    joints: dict[str, Joint] = field(default_factory=dict[str, Joint])
    references: dict[str, float] = field(default_factory=dict[str, float])
    rests: dict[str, float] = field(default_factory=dict[str, float])  # of springs
    sites: dict[str, tuple[str, Frame]] = field(default_factory=dict[str, tuple[str, Frame]])
    site_elements: dict[str, Element] = field(default_factory=dict[str, Element])
    clamped: list[str] = field(default_factory=list[str])
    unaligned: list[str] = field(default_factory=list[str])
    inverse: Inverse | None = None  # where something asked for it
    geoms: int = 0


@dataclass(frozen=True)
class Waiting:
    """A body still to be read: its carrier, where frames around it put it, and the class its
    children have."""

    element: Element
    parent: str
    frame: Frame
    inherited: str


@dataclass(frozen=True)
class Attachment:
    """What a joint lies between, where the child is in its carrier, and whether the body that the
    file joins so is on the ground."""

    carrier: str
    child: str
    pose: Frame
    on_ground: bool


def walk(reading: Reading, world: Element, scene: Scene, floating: bool) -> None:
    """Read every body under <worldbody>."""
    waiting = _below(reading, world, GROUND, "", scene)[::-1]
    if floating:
        _check_floating(reading, world, waiting)
    while waiting:
        body = waiting.pop()
        waiting += _body(reading, body, scene, floating and body.parent == GROUND)[::-1]
    _scale(scene)
    _carried_armatures(reading, scene)
    for body in scene.robot.bodies:
        _gravity_compensation(reading, body.place, body, scene)


def _carried_armatures(reading: Reading, scene: Scene) -> None:
    """What the armature of a free joint is to its translation: a mass at the body's origin that has
    no weight."""
    for joint in [joint for joint in scene.robot.joints if joint.type == "free"]:
        armature = scalar(reading, joint.place, "armature")
        if armature <= 0.0:
            continue
        name = f"{joint.name}_armature"
        body = Body(reading.bodies(name, "body"), joint.place, armature)
        mount = Joint("", "fixed", joint.child, body.name, joint.place)
        mount.name = reading.joint_name(f"{body.name}_mount", "fixed", [])
        scene.robot.bodies.append(body)
        scene.robot.joints.append(mount)
        scene.poses[body.name] = scene.poses[joint.child]
        if any(scene.settings.gravity):
            lift = ", ".join(written(x) for x in times(-armature, scene.settings.gravity))
            text = f"{{type: force, body: {body.name}, components: [{lift}]}}"
            scene.robot.loads.append(Entry(reading.symbols(name, "load"), text, joint.place))


def _scale(scene: Scene) -> None:
    """Masses and inertias, so that the whole weighs what <compiler settotalmass> says."""
    bodies, wanted = scene.robot.bodies, scene.settings.total_mass
    whole = sum(body.mass for body in bodies)
    if wanted > 0.0 and whole > 0.0:
        for body in bodies:
            body.mass *= wanted / whole
            body.inertia = tuple(wanted / whole * entry for entry in body.inertia)
        scene.robot.changed.append(
            f"masses and inertias are scaled by {wanted / whole:.6g}, to {wanted:g} kg in all"
        )


def _check_floating(reading: Reading, world: Element, waiting: list[Waiting]) -> None:
    if len(waiting) != 1 or any(waiting[0].element.all("joint", "freejoint")):
        hint = "an MJCF file says itself which bodies are free: <freejoint/>"
        reading.report(
            world,
            "--floating for a file that is not one body on the ground",
            "one body without joints",
            hint,
        )


def _content(
    reading: Reading, element: Element, inherited: str, scene: Scene
) -> Iterator[tuple[Element, Frame, str]]:
    """The children, with those of <frame>s in their place."""
    waiting = [(child, Frame(), inherited) for child in reversed(element.children)]
    while waiting:
        child, frame, owner = waiting.pop()
        if child.tag == "frame":
            inner = frame.then(
                vector(reading, child, "pos"), orientation(reading, child, scene.settings)
            )
            waiting += [
                (below, inner, child.get("childclass", owner)) for below in reversed(child.children)
            ]
        elif child.tag in HARMLESS:
            yield child, frame, owner
        else:
            flat = "let MuJoCo write the model out in one first: mj_saveLastXML"
            hint = flat if child.tag == "attach" else "rigid bodies and joints can be imported"
            reading.report(child, f"<{child.tag}> in a body", ", ".join(HARMLESS), hint)


def _below(
    reading: Reading, element: Element, name: str, inherited: str, scene: Scene
) -> list[Waiting]:
    """Note the sites of a body, count its geoms, and hand on the bodies below it."""
    children: list[Waiting] = []
    for child, frame, owner in _content(reading, element, inherited, scene):
        if child.tag == "body":
            children.append(Waiting(child, name, frame, owner))
        elif child.tag == "site":
            site = completed(reading, child, scene.settings, owner)
            place = frame.then(
                vector(reading, site, "pos"), orientation(reading, site, scene.settings)
            )
            scene.sites[site.get("name")] = (name, place)
            scene.site_elements[site.get("name")] = child
        scene.geoms += child.tag == "geom"
    return children


def _body(reading: Reading, waiting: Waiting, scene: Scene, floating: bool) -> list[Waiting]:
    element = waiting.element
    inherited = element.get("childclass", waiting.inherited)
    body = Body("", element)
    original = element.get("name")
    body.name = reading.body_name(original or "body", body.notes if original else [])
    if original and original in scene.bodies:
        reading.report(
            element, f"a second body '{original}'", "names that differ", attribute="name"
        )
    if original:
        scene.bodies[original] = body.name
    pose = waiting.frame.then(
        vector(reading, element, "pos"), orientation(reading, element, scene.settings)
    )
    scene.poses[body.name] = scene.poses[waiting.parent].then(pose.at, pose.turn)
    _mass(reading, element, inherited, body, scene)
    _joints(reading, waiting, inherited, body, pose, scene, floating)
    scene.robot.bodies.append(body)
    if element.get("mocap") == "true":
        name = quoted(original or body.name)
        scene.robot.left_out.append(f"what moves the mocap body {name}, which is fixed")
    return _below(reading, element, body.name, inherited, scene)


def _mass(reading: Reading, element: Element, inherited: str, body: Body, scene: Scene) -> None:
    settings = scene.settings
    pieces: list[Piece] = []
    stated: list[Piece] = []
    geoms: list[tuple[Element, Frame]] = []
    for child, frame, owner in _content(reading, element, inherited, scene):
        if child.tag == "inertial":
            stated.append(explicit(reading, child, frame, settings))
            body.moments = child
        elif child.tag == "geom":
            geoms.append((completed(reading, child, settings, owner), frame))
    if settings.inertia_from_geoms == "true" or (
        settings.inertia_from_geoms == "auto" and not stated
    ):
        pieces = [
            piece for geom, frame in geoms if (piece := of_geom(reading, geom, frame, settings))
        ]
    if pieces:
        body.moments = None
    if pieces or stated:
        fill(body, together(pieces or stated), settings)


def _joints(
    reading: Reading,
    waiting: Waiting,
    inherited: str,
    body: Body,
    pose: Frame,
    scene: Scene,
    floating: bool,
) -> None:
    """One joint of the model for each of the file, with bodies without mass between; a fixed one
    where there is none."""
    elements = [
        (completed(reading, child, scene.settings, owner) if child.tag == "joint" else child, frame)
        for child, frame, owner in _content(reading, waiting.element, inherited, scene)
        if child.tag in ("joint", "freejoint")
    ]
    if not elements:
        _without_joints(reading, waiting, body, pose, scene, floating)
    carrier, at = waiting.parent, pose
    for number, (element, frame) in enumerate(elements, 1):
        child = body.name
        if number < len(elements):
            between = Body(reading.bodies(f"{body.name}_{number}", "body"), waiting.element)
            scene.robot.bodies.append(between)
            child = between.name
        attachment = Attachment(carrier, child, at, waiting.parent == GROUND)
        joint = _joint(reading, element, frame, attachment, scene)
        if joint is not None:
            scene.robot.joints.append(joint)
        carrier, at = child, Frame()


def _without_joints(
    reading: Reading, waiting: Waiting, body: Body, pose: Frame, scene: Scene, floating: bool
) -> None:
    kind = "free" if floating else "fixed"
    joint = Joint("", kind, waiting.parent, body.name, waiting.element)
    joint.name = reading.joint_name("base" if floating else f"{body.name}_mount", kind, [])
    if floating:
        _start(joint, pose, scene)
    else:
        joint.at, joint.rotation = pose.at, pose.turn
    scene.robot.joints.append(joint)


def _joint(
    reading: Reading,
    element: Element,
    frame: Frame,
    attachment: Attachment,
    scene: Scene,
) -> Joint | None:
    carrier, child, pose = attachment.carrier, attachment.child, attachment.pose
    given = "free" if element.tag == "freejoint" else element.get("type", "hinge")
    if given not in TYPES:
        reading.report(element, f"a joint of type '{given}'", ", ".join(TYPES), attribute="type")
        return None
    joint = Joint("", TYPES[given], carrier, child, element)
    original = element.get("name")
    joint.name = reading.joint_name(
        original or f"{child}_joint", joint.type, joint.notes if original else []
    )
    if original and original in scene.joints:
        reading.report(
            element, f"a second joint '{original}'", "names that differ", attribute="name"
        )
    if original:
        scene.joints[original] = joint
    if joint.type == "free":
        if not attachment.on_ground:
            reading.report(
                element, "a free joint on a body inside another", "a body of <worldbody>"
            )
        _start(joint, pose, scene)
        aligned = element.get("align", "auto")
        if aligned == "true" or (aligned == "auto" and scene.settings.aligned):
            scene.unaligned.append(joint.name)
    else:
        _place(reading, element, frame, pose, joint, scene)
    _forces(reading, element, joint, scene)
    return joint


def _start(joint: Joint, pose: Frame, scene: Scene) -> None:
    """The coordinates of a free joint where the file puts the body."""
    quaternion = to_quaternion(pose.turn)
    values = zip(("x", "y", "z", "qw", "qx", "qy", "qz"), (*pose.at, *quaternion))
    still = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    moved = [(name, value) for (name, value), rest in zip(values, still) if value != rest]
    scene.robot.initial += [
        Entry(f"{joint.name}_{name}", written(value), joint.place) for name, value in moved
    ]


def _place(
    reading: Reading, element: Element, frame: Frame, pose: Frame, joint: Joint, scene: Scene
) -> None:
    own = frame.then(vector(reading, element, "pos"), IDENTITY)
    turn = pose.turn
    start = pose.then(own.at, IDENTITY).at
    if joint.type != "ball":
        given = unit(vector(reading, element, "axis", (0.0, 0.0, 1.0)))
        if given is None:
            reading.report(
                element, "the axis of a joint has length zero", "a direction", attribute="axis"
            )
        joint.axis = unit(rotated(frame.turn, given or (0.0, 0.0, 1.0)))
        assert joint.axis is not None
        reference = scalar(reading, element, "ref")
        if joint.type == "revolute":
            reference = scene.settings.angle(reference)
            turn = product(turn, about(joint.axis, -reference)) if reference else turn
        elif reference:
            start = pose.then(minus(own.at, times(reference, joint.axis)), IDENTITY).at
        scene.references[joint.name] = reference
        if reference:
            scene.robot.initial.append(Entry(joint.name, _said(reference, joint), element))
    joint.at, joint.at_child, joint.rotation = start, own.at, turn
    if (limits := listing(reading, element, "range", 2)) and joint.type != "ball":
        turned = joint.type == "revolute"
        low, high = (scene.settings.angle(limit) if turned else limit for limit in limits)
        joint.limits = (low, high) if low < high and element.get("limited") != "false" else None
    if "actuatorfrcrange" in element.attributes and element.get("actuatorfrclimited") != "false":
        scene.clamped.append(joint.name)


def _said(start: float, joint: Joint) -> str:
    """Where a hinge or slide starts, in whole degrees where it is that."""
    degrees = whole_degrees(start) if joint.type == "revolute" else None
    return written(start) if degrees is None else f"{degrees} deg"


def _forces(reading: Reading, element: Element, joint: Joint, scene: Scene) -> None:
    """stiffness, damping, frictionloss and armature."""
    loss, armature = (scalar(reading, element, name) for name in ("frictionloss", "armature"))
    k, d = (powers(reading, element, name) for name in ("stiffness", "damping"))
    off = scene.settings.off
    k, d = NONE if "spring" in off else k, NONE if "damper" in off else d
    if by_time(reading, element):
        k, d = [0.0, *k[1:]], [0.0, *d[1:]]
    loss *= "frictionloss" not in off
    if joint.type in ("revolute", "prismatic"):
        rest = scalar(reading, element, "springref")
        rest = scene.settings.angle(rest) if joint.type == "revolute" else rest
        scene.rests[joint.name] = rest
        joint.spring = (k[0], rest) if k[0] else None
        joint.damper, joint.coulomb, joint.armature = d[0], loss, armature
        _bent(reading, element, joint, rest, k, d, scene)
        return
    if any(k[1:]) or (any(d[1:]) and joint.type == "free"):
        which = "stiffness" if any(k[1:]) else "damping"
        problem = f"{which} with squares or cubes in a {joint.type} joint"
        reading.report(element, problem, "one number", attribute=which)
    if k[0] and joint.type == "ball":
        ball_spring(reading, joint, k[0], scene)
    elif k[0]:
        reading.report(
            element,
            f"a spring in a {joint.type} joint",
            "springs in hinges, slides and ball joints",
            attribute="stiffness",
        )
    rates = joint.rates()
    turning = rates[3:] if joint.type == "free" else rates  # for the rest see _carried_armatures
    on_rates(reading, joint, "damper", d[0], rates, scene)
    on_rates(reading, joint, "armature", armature, turning, scene)
    for rate in rates if any(d[1:]) else ():
        terms = of_speed([0.0, *(-x for x in d[1:])], rate, "N*m", "rad")
        name = reading.symbols(f"damper_{rate.replace('.', '_')}", "load")
        text = f"{{type: expression, velocity: {rate}, expression: {' + '.join(terms)}}}"
        scene.robot.loads.append(Entry(name, text, element))
    if loss:
        scene.robot.left_out.append(f"the frictionloss of the {joint.type} joint {joint.name}")


def by_time(reading: Reading, element: Element) -> tuple[float, float] | None:
    """Time constant and damping ratio that say the spring and the damper of a joint."""
    given = listing(reading, element, "springdamper", 2)
    return (given[0], given[1]) if given and min(given) > 0.0 else None


def ball_spring(reading: Reading, joint: Joint, stiffness: float, scene: Scene) -> None:
    """A spring in a ball joint, as a load."""
    name = reading.symbols(f"spring_{joint.name}", "load")
    text = f"{{type: spring, joint: {joint.name}, stiffness: {written(stiffness)}}}"
    scene.robot.loads.append(Entry(name, text, joint.place))


def on_rates(
    reading: Reading, joint: Joint, kind: str, value: float, rates: Sequence[str], scene: Scene
) -> None:
    """A damper or armature along every one of the rates."""
    key = "coefficient" if kind == "damper" else "inertia"
    for rate in rates if value else ():
        name = reading.symbols(f"{kind}_{rate.replace('.', '_')}", "load")
        text = f"{{type: {kind}, velocity: {rate}, {key}: {written(value)}}}"
        scene.robot.loads.append(Entry(name, text, joint.place))


def _bent(
    reading: Reading,
    element: Element,
    joint: Joint,
    rest: float,
    k: Sequence[float],
    d: Sequence[float],
    scene: Scene,
) -> None:
    """What the spring and the damper of a hinge or slide have with squares and cubes."""
    force, unit = ("N*m", "rad") if joint.type == "revolute" else ("N", "m")
    x = f"({joint.name} - ({written(rest)} {unit}))" if rest else joint.name
    terms = of_length([0.0, *(-x for x in k[1:])], x, force, unit)
    terms += of_speed([0.0, *(-x for x in d[1:])], f"der({joint.name})", force, unit)
    if terms:
        name = reading.symbols(f"spring_{joint.name}", "load")
        text = f"{{type: expression, joint: {joint.name}, expression: {' + '.join(terms)}}}"
        scene.robot.loads.append(Entry(name, text, element))


def _gravity_compensation(reading: Reading, element: Element, body: Body, scene: Scene) -> None:
    """gravcomp times the weight, upwards at the centre of mass."""
    share = scalar(reading, element, "gravcomp")
    if share and body.mass and any(scene.settings.gravity):
        force = ", ".join(written(x) for x in times(-share * body.mass, scene.settings.gravity))
        com = ", ".join(written(x) for x in body.com)
        text = f"{{type: force, body: {body.name}, at: [{com}], components: [{force}]}}"
        scene.robot.loads.append(
            Entry(reading.symbols(f"gravcomp_{body.name}", "load"), text, element)
        )
