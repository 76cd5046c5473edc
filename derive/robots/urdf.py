"""URDF → Robot. The tree is checked first; then every link becomes a body and every joint a joint
of the same frames.

In URDF a joint's frame is its child's frame, so origins carry over as they are.
"""

from __future__ import annotations

import math

from derive.diagnostics import counted, listed
from derive.robots.couplings import check_coupled_masses
from derive.robots.markup import Element
from derive.robots.naming import is_ambiguous, legal
from derive.robots.numbers import is_endless, listing, scalar, vector, written
from derive.robots.robot import (
    GROUND,
    ONE_RATE,
    Body,
    Entry,
    Joint,
    Reading,
    Robot,
    quoted,
)
from derive.robots.rotations import (
    IDENTITY,
    ORIGIN,
    Matrix,
    Vector,
    about,
    cross,
    from_quaternion,
    from_rpy,
    product,
    turned_tensor,
    unit,
    unrounded,
)
from derive.robots.transmissions import read_transmissions
from derive.robots.tree import Tree, collect, root_of
from derive.robots.urdf_words import ROBOT
from derive.robots.words import unread_words
from derive.robots.writing import frame_text

TYPES = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "fixed": "fixed",
    "planar": "planar",
    "floating": "free",
}
PLANES = (
    (1.0, 0.0, 0.0),
    (0.0, -1.0, 0.0),
    (0.0, 0.0, 1.0),
)  # normals that a planar joint can have as they are
SWAPPED = "lower and upper are the other way round in the file"
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def robot(root: Element, name: str, floating: bool, exact: bool = False) -> Robot:
    """The robot of a <robot> element; ModelError with everything wrong with it. `exact`: roll,
    pitch and yaw are taken to the last digit, else as the angles that they are roundings of."""
    _refuse_macros(root)
    reading, tree = Reading(), Tree()
    result = Robot(root.get("name") or name, "URDF", root)
    result.names, result.body_names = reading.symbols, reading.bodies
    unread = unread_words(reading, root, ROBOT)
    reading.finish()
    _old_quaternions(root, result)
    if not exact:
        _unrounded(root, result)
    collect(reading, root, tree)
    base = root_of(reading, tree)
    reading.finish()
    reading.bodies.kept, reading.symbols.kept = set(tree.links), set(tree.joints)
    _bodies(reading, tree, result)
    _joints(reading, tree, result, base, floating)
    _planar_frames(tree, result)
    reading.finish()
    if all(joint.type == "fixed" for joint in result.joints):
        hint = "--floating gives the root link a free joint"
        root.refuse(
            "nothing moves: every joint is fixed, and the root link is fixed to the ground",
            "a joint that moves",
            hint,
        )
    _mimics(reading, tree, result)
    reading.finish()
    check_coupled_masses(reading, result)
    _inputs(reading, tree, result)
    read_transmissions(reading, root, tree.made, result)
    reading.finish()
    _notes(reading, root, unread, result)
    return result


def _refuse_macros(root: Element) -> None:
    for element in root.walk():
        if element.tag.startswith("xacro:"):
            element.refuse(
                "a xacro macro", "a URDF file", "expand it first: xacro FILE.xacro > robot.urdf"
            )


def _old_quaternions(root: Element, result: Robot) -> None:
    """Before version 1.1 of the format quat_xyzw is no attribute of an origin, and parsers pass
    over it."""
    origins = [
        element
        for element in root.walk()
        if element.tag == "origin" and "quat_xyzw" in element.attributes
    ]
    if origins and root.get("version", "1.0") in ("1", "1.0"):
        for origin in origins:
            del origin.attributes["quat_xyzw"]
        result.changed.append(
            f"quat_xyzw of {counted(len(origins), 'origin')} is not read: it takes <robot "
            'version="1.1">'
        )


def _unrounded(root: Element, result: Robot) -> None:
    """Roll, pitch and yaw such as 1.5708 in the place of a right angle: only exact right angles
    give the structural zeros that make equations short."""
    changed: dict[str, int] = {}
    for origin in root.walk():
        if origin.tag != "origin" or "rpy" not in origin.attributes:
            continue
        words = origin.get("rpy").split()
        meant = [unrounded(word) for word in words]
        for word, angle in zip(words, meant):
            if angle is not None:
                changed[word] = round(math.degrees(angle))
        if any(angle is not None for angle in meant):
            exact = [word if angle is None else repr(angle) for word, angle in zip(words, meant)]
            origin.attributes["rpy"] = " ".join(exact)
    if changed:
        pairs = [f"{word} as {degrees} deg" for word, degrees in changed.items()]
        result.assumed.append(
            f"rounded angles are read as what they round: {listed(pairs)}; --exact keeps them"
        )


def _turned(reading: Reading, origin: Element | None) -> tuple[Vector | None, Matrix]:
    """Roll, pitch and yaw with their rotation; None for them where a quaternion gives it."""
    rpy = vector(reading, origin, "rpy")
    quaternion = listing(reading, origin, "quat_xyzw", 4) if origin is not None else None
    if origin is None or quaternion is None:
        return rpy, from_rpy(rpy)
    if "rpy" in origin.attributes:
        reading.report(
            origin, "an origin with rpy and quat_xyzw", "one of the two", attribute="quat_xyzw"
        )
    x, y, z, w = quaternion
    rotation = from_quaternion((w, x, y, z))
    if rotation is None:
        reading.report(origin, "a quaternion of length zero", "a rotation", attribute="quat_xyzw")
    return None, rotation or IDENTITY


def _bodies(reading: Reading, tree: Tree, result: Robot) -> None:
    for name, link in tree.links.items():
        body = Body("", link)
        body.name = reading.body_name(name, body.notes)
        if (inertial := link.first("inertial")) is not None:
            _inertial(reading, name, inertial, body)
        tree.bodies[name] = body
        result.bodies.append(body)


def _inertial(reading: Reading, name: str, inertial: Element, body: Body) -> None:
    mass, inertia, origin = (inertial.first(tag) for tag in ("mass", "inertia", "origin"))
    if mass is None or "value" not in mass.attributes:
        reading.report(
            mass or inertial, f"the inertial of '{name}' has no mass", '<mass value="…"/>'
        )
        return
    if inertia is None:
        reading.report(
            inertial,
            f"the inertial of '{name}' has no inertia",
            "<inertia …/>, with zeros for a point mass",
        )
        return
    body.mass = scalar(reading, mass, "value")
    if body.mass < 0.0:
        problem = f"the mass of '{name}' is {body.mass:g} kg"
        reading.report(mass, problem, "zero or more", attribute="value")
    body.com, body.moments = vector(reading, origin, "xyz"), inertia
    moments = [scalar(reading, inertia, moment) for moment in MOMENTS]
    body.inertia = turned_tensor(_turned(reading, origin)[1], moments) if any(moments) else ()


def _joints(reading: Reading, tree: Tree, result: Robot, base: str, floating: bool) -> None:
    root = tree.links[base]
    kind = "free" if floating else "fixed"
    # the names of the file come first: the base joint is the one that gives way
    for name, element in tree.joints.items():
        if (joint := _joint(reading, tree, element)) is not None:
            tree.made[name] = joint
    others = {body.name for name, body in tree.bodies.items() if name != base}
    name = reading.joint_name("root" if "base" in others else "base", kind, [])
    result.joints.append(Joint(name, kind, GROUND, tree.bodies[base].name, root))
    result.joints += tree.made.values()
    if not floating:
        result.changed.append(
            f"the root link {quoted(base)} is fixed to the ground; --floating frees it"
        )


def _joint(reading: Reading, tree: Tree, element: Element) -> Joint | None:
    given = element.get("type")
    if given not in TYPES:
        problem = (
            f"the joint '{element.get('name')}' has "
            f"{f'the type {quoted(given)}' if given else 'no type'}"
        )
        reading.report(element, problem, ", ".join(TYPES), attribute="type")
        return None
    ends = (element.first("parent"), element.first("child"))
    parent, child = (tree.bodies[end.get("link")].name for end in ends if end is not None)
    joint = Joint("", TYPES[given], parent, child, element)
    origin = element.first("origin")
    joint.at = vector(reading, origin, "xyz")
    joint.rpy, joint.rotation = _turned(reading, origin)
    if joint.type not in ("fixed", "free"):
        joint.axis = _axis(reading, element)
    if joint.type == "planar":
        _planar(joint)
    wanted = element.get("name")
    wanted = wanted if joint.rotation_child == IDENTITY else f"{wanted}_plane"
    joint.name = reading.joint_name(wanted, joint.type, joint.notes)
    if joint.type in ONE_RATE:
        _limits(reading, element, joint)
        _dynamics(reading, element, joint)
    return joint


def _axis(reading: Reading, element: Element) -> Vector:
    axis = element.first("axis")
    given = vector(reading, axis, "xyz", (1.0, 0.0, 0.0))
    direction = unit(given)
    if axis is not None and direction is None:
        reading.report(
            axis,
            f"the axis of the joint '{element.get('name')}' has length zero",
            "a direction",
            attribute="xyz",
        )
    return direction or (1.0, 0.0, 0.0)


def _limits(reading: Reading, element: Element, joint: Joint) -> None:
    """The range as limits, effort and speed in words."""
    limit = element.first("limit")
    if limit is None:
        return
    for name in ("lower", "upper", "effort", "velocity"):
        if is_endless(limit, name):
            del limit.attributes[name]
    if element.get("type") != "continuous" and {"lower", "upper"} & limit.attributes.keys():
        ends = scalar(reading, limit, "lower"), scalar(reading, limit, "upper")
        joint.limits = (min(ends), max(ends))
        if ends[0] > ends[1]:  # robots that were mirrored by hand have such
            joint.notes.append(SWAPPED)
    unit_of, force = ("rad", "N*m") if joint.type == "revolute" else ("m", "N")
    said = [
        f"{written(scalar(reading, limit, attribute))} {suffix}"
        for attribute, suffix in (("effort", force), ("velocity", f"{unit_of}/s"))
        if attribute in limit.attributes
    ]
    joint.notes += [f"at most {', '.join(said)}"] if said else []


def _dynamics(reading: Reading, element: Element, joint: Joint) -> None:
    dynamics = element.first("dynamics")
    if dynamics is not None:
        joint.damper, joint.coulomb = (
            scalar(reading, dynamics, "damping"),
            scalar(reading, dynamics, "friction"),
        )


def _planar(joint: Joint) -> None:
    """A plane whose normal is not x, -y or z: the joint's frame is turned in both bodies."""
    if joint.axis not in PLANES and joint.axis is not None:
        turn = _onto(joint.axis)
        joint.rotation, joint.rotation_child = product(joint.turn(), turn), turn
        joint.rpy, joint.axis = None, (0.0, 0.0, 1.0)


def _planar_frames(tree: Tree, result: Robot) -> None:
    """The frame of a planar joint that had to be turned, which is that of its link, by its own
    name."""
    taken = {joint.name for joint in result.joints} | {body.name for body in result.bodies}
    for original, joint in tree.made.items():
        name = legal(original, "joint")
        if joint.rotation_child == IDENTITY:
            continue
        joint.notes.append(f"the plane of {quoted(original)}")
        if name not in taken and not is_ambiguous(name):
            text = frame_text(joint.child, ORIGIN, IDENTITY)
            result.frames.append(Entry(name, text, joint.place))


def _onto(axis: Vector) -> Matrix:
    """A rotation that takes z to the axis."""
    across = cross((0.0, 0.0, 1.0), axis)
    return about(unit(across) or (1.0, 0.0, 0.0), math.atan2(math.hypot(*across), axis[2]))


def _mimics(reading: Reading, tree: Tree, result: Robot) -> None:
    """q = multiplier · q_master + offset as a constraint, for every joint with a <mimic>."""
    masters: dict[str, str] = {}
    for name, element in tree.joints.items():
        mimic = element.first("mimic")
        if mimic is None or name not in tree.made:
            continue
        if tree.made[name].type == "fixed":
            tree.made[name].notes.append("its mimic is left out: it is fixed")
        elif "joint" not in mimic.attributes:
            reading.report(mimic, f"the mimic of '{name}' names no joint", '<mimic joint="…"/>')
        elif mimic.get("joint") not in tree.joints:
            reading.unknown(mimic, "joint", "joint", list(tree.joints))
        else:
            masters[name] = mimic.get("joint")
    for circle in _mimic_circles(masters):
        problem = (
            "joints that mimic each other in a circle: "
            f"{' → '.join(quoted(name) for name in [*circle, circle[0]][:10])}"
        )
        reading.report(
            tree.joints[circle[0]].first("mimic") or tree.joints[circle[0]],
            problem,
            "a joint that moves by itself",
        )
    for name, master in masters.items():
        _couple(reading, tree, result, name, master)


def _mimic_circles(masters: dict[str, str]) -> list[list[str]]:
    done: set[str] = set()
    circles: list[list[str]] = []
    for name in masters:
        chain: list[str] = []
        while name in masters and name not in done:
            done.add(name)
            chain.append(name)
            name = masters[name]
        if name in chain:
            circles.append(chain[chain.index(name) :])
    return circles


def _couple(reading: Reading, tree: Tree, result: Robot, name: str, master: str) -> None:
    joint, other = tree.made[name], tree.made.get(master)
    mimic = joint.place.first("mimic")
    assert mimic is not None
    for end, given in ((joint, name), (other, master)):
        if end is not None and end.type not in (*ONE_RATE, "fixed"):
            reading.report(
                mimic, f"a mimic of the {end.type} joint '{given}'", "joints with one coordinate"
            )
            return
    multiplier, offset = scalar(reading, mimic, "multiplier", 1.0), scalar(reading, mimic, "offset")
    terms = [f"ratio: {written(multiplier)}"] + ([f"offset: {written(offset)}"] if offset else [])
    if other is None or other.type == "fixed" or multiplier == 0.0:
        # nothing to follow: it stays at the offset
        text = f"{{holonomic: {joint.name} - ({written(offset)})}}"
    else:
        joint.follows = (other.name, multiplier)
        text = f"{{type: coupling, joints: [{joint.name}, {other.name}], {', '.join(terms)}}}"
    result.constraints.append(Entry(reading.symbols(f"mimic_{joint.name}", "mimic"), text, mimic))


def _inputs(reading: Reading, tree: Tree, result: Robot) -> None:
    """An input at every joint that moves by itself, named after it."""
    following = {entry.place for entry in result.constraints}
    for joint in tree.made.values():
        if joint.type in ONE_RATE and joint.place.first("mimic") not in following:
            name = reading.symbols(f"tau_{joint.name}", "input")
            result.inputs.append(Entry(name, f"{{joint: {joint.name}}}", joint.place))


def _notes(reading: Reading, root: Element, unread: list[str], result: Robot) -> None:
    """What a reader of the model should know about how it was made."""
    massless = sum(1 for body in result.bodies if not body.mass)
    if massless:
        result.changed.append(
            f"{counted(massless, 'link')} without mass: kept, as bodies without mass"
        )
    if reading.renamed:
        result.changed.append(
            f"{counted(reading.renamed, 'name')} changed to fit the model language; the old "
            "ones stand beside"
        )
    meshes = sum(1 for element in root.walk() if element.tag == "mesh")
    if any(link.first("visual") or link.first("collision") for link in root.all("link")):
        files = counted(meshes, "mesh file")
        result.changed.append(
            f"geometry is not read ({files}, there or not): the equations do not need it"
        )
    if unread:
        result.assumed.append(f"not read: {listed(sorted(unread))}")
    swapped = [joint.name for joint in result.joints if SWAPPED in joint.notes]
    if swapped:
        result.assumed.append(f"lower and upper limits are the other way round: {listed(swapped)}")
    undamped = [
        quoted(joint.get("name"))
        for joint in root.all("joint")
        if TYPES.get(joint.get("type")) in ("planar", "free") and joint.first("dynamics")
    ]
    if undamped:
        result.assumed.append(
            f"not read: <dynamics> of {listed(undamped)}, joints of several directions"
        )
    if any(joint.first("limit") for joint in root.all("joint")):
        result.assumed.append(
            "limits are there to read: nothing in the equations stops a joint at them"
        )
