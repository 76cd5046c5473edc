"""<equality>: connect and weld become closures, joint and tendon constraints; they hold as at the
reference configuration."""

from __future__ import annotations

from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.forces import Transmission, joint_of
from derive.robots.mjcf.inertia import Frame
from derive.robots.mjcf.settings import completed
from derive.robots.mjcf.tendons import Line, Tendons
from derive.robots.numbers import listing, scalar, vector, written
from derive.robots.robot import GROUND, ONE_RATE, Closure, Entry, Joint, Reading, quoted
from derive.robots.rotations import Vector, from_quaternion, minus, product, rotated, transposed


def equalities(reading: Reading, root: Element, tendons: Tendons, scene: Scene) -> None:
    """Reads every <equality> into closures and constraints. An inactive one is left out and said
    so; a kind that is not known is reported."""
    for section in root.all("equality"):
        for element in section.children:
            tie = completed(reading, element, scene.settings)
            if tie.get("active", "true") == "false":
                scene.robot.changed.append(
                    f"the <{tie.tag}> {quoted(tie.get('name'))} is not active and left out"
                )
            elif tie.tag in _READERS:
                _READERS[tie.tag](reading, tie, scene)
            elif tie.tag == "tendon":
                _tendon(reading, tie, tendons, scene)
            else:
                reading.report(
                    tie, f"an equality of kind <{tie.tag}>", ", ".join([*_READERS, "tendon"])
                )


def _name(reading: Reading, tie: Element) -> str:
    return reading.symbols(tie.get("name") or tie.tag, tie.tag)


def _bodies(reading: Reading, tie: Element, scene: Scene) -> tuple[str, str] | None:
    """The two bodies; the second is the ground where it is left out."""
    first, second = tie.get("body1"), tie.get("body2", "world")
    for attribute, name in (("body1", first), ("body2", second)):
        if name not in scene.bodies:
            reading.unknown(tie, attribute, "body", list(scene.bodies))
            return None
    if scene.bodies[first] == scene.bodies[second]:
        reading.report(
            tie, f"a <{tie.tag}> of '{first}' with itself", "two bodies", attribute="body2"
        )
        return None
    pair = scene.bodies[first], scene.bodies[second]
    return None if _are_one(tie, pair, scene) else pair


def _are_one(tie: Element, pair: tuple[str, str], scene: Scene) -> bool:
    """Whether the bodies do not move against each other in any case; said, for then the tie does
    nothing."""
    above = {joint.child: joint for joint in scene.robot.joints if joint.type == "fixed"}

    def piece(name: str) -> str:
        while name in above:
            name = above[name].parent
        return name

    one = piece(pair[0]) == piece(pair[1])
    if one:
        said = f"the <{tie.tag}> {quoted(tie.get('name'))} of bodies that are one: left out"
        scene.robot.changed.append(said)
    return one


def _sites(
    reading: Reading, tie: Element, scene: Scene
) -> tuple[tuple[str, Frame], tuple[str, Frame]] | None:
    """Bodies and frames of site1 and site2."""
    for attribute in ("site1", "site2"):
        if tie.get(attribute) not in scene.sites:
            reading.unknown(tie, attribute, "site", list(scene.sites))
            return None
    first, second = scene.sites[tie.get("site1")], scene.sites[tie.get("site2")]
    return None if _are_one(tie, (first[0], second[0]), scene) else (first, second)


def _ground_frame(scene: Scene, body: str, point: Frame) -> Frame:
    """A frame of the ground in a body at the reference configuration."""
    pose = scene.poses[body]
    back = transposed(pose.turn)
    return Frame(rotated(back, minus(point.at, pose.at)), product(back, point.turn))


def _connect(reading: Reading, tie: Element, scene: Scene) -> None:
    """Two points stay together."""
    if "site1" in tie.attributes:
        if sites := _sites(reading, tie, scene):
            (first, a), (second, b) = sites
            scene.robot.closures.append(
                Closure(_name(reading, tie), "ball", (first, second), (a.at, b.at), tie)
            )
        return
    pair = _bodies(reading, tie, scene)
    if "anchor" not in tie.attributes:
        reading.report(tie, "a <connect> without an anchor", '<connect anchor="x y z">')
    if pair is None:
        return
    anchor = vector(reading, tie, "anchor")
    there = _ground_frame(
        scene, pair[1], scene.poses[pair[0]].then(anchor, scene.poses[GROUND].turn)
    )
    scene.robot.closures.append(Closure(_name(reading, tie), "ball", pair, (anchor, there.at), tie))


def _weld(reading: Reading, tie: Element, scene: Scene) -> None:
    """Two bodies keep their relative pose: that of the reference configuration, of `relpose`, or of
    two sites that meet."""
    if "site1" in tie.attributes:
        if sites := _sites(reading, tie, scene):
            (first, a), (second, b) = sites
            turn = product(a.turn, transposed(b.turn))
            _hold(reading, tie, (first, second), Frame(a.at, turn), b.at, scene)
        return
    pair = _bodies(reading, tie, scene)
    if pair is None:
        return
    relative = _ground_frame(scene, pair[0], scene.poses[pair[1]])
    pose, anchor = listing(reading, tie, "relpose", 7), vector(reading, tie, "anchor")
    there = Frame(relative.then(anchor, relative.turn).at, relative.turn)
    if pose and any(pose[3:]):  # where the anchor is then
        turn = from_quaternion(pose[3:])
        assert turn is not None
        there = Frame((pose[0], pose[1], pose[2]), turn)
    _hold(reading, tie, pair, there, anchor, scene)


def _hold(
    reading: Reading,
    tie: Element,
    pair: tuple[str, str],
    there: Frame,
    anchor: Vector,
    scene: Scene,
) -> None:
    """The second body's frame at its anchor on one of the first; the point alone where the file
    gives torques no weight."""
    name, ends = _name(reading, tie), (there.at, anchor)
    closure = Closure(name, "fixed", pair, ends, tie, there.turn)
    if scalar(reading, tie, "torquescale", 1.0) == 0.0:
        closure = Closure(name, "ball", pair, ends, tie)
    scene.robot.closures.append(closure)


def _joint(reading: Reading, tie: Element, scene: Scene) -> None:
    """y − y₀ = a₀ + a₁ (x − x₀) + … a₄ (x − x₀)⁴; without a second joint y − y₀ = a₀."""
    joints = [
        _of(reading, tie, attribute, scene)
        for attribute in ("joint1", "joint2")
        if attribute in tie.attributes
    ]
    if not joints or None in joints:
        if not joints:
            reading.report(tie, "an equality of no joint", '<joint joint1="…" joint2="…">')
        return
    powers = (listing(reading, tie, "polycoef") or [])[:5]
    powers += [0.0, 1.0, 0.0, 0.0, 0.0][len(powers) :]
    (first, y0), *others = [
        (joint, scene.references.get(joint.name, 0.0)) for joint in joints if joint
    ]
    text = (
        _polynomial(powers, _length([(others[0][0], 1.0)], scene)) if others else written(powers[0])
    )
    if others and not any(powers[2:]) and powers[1:2] and powers[1]:
        offset = y0 + powers[0] - powers[1] * others[0][1]
        terms = f"ratio: {written(powers[1])}" + (f", offset: {written(offset)}" if offset else "")
        first.follows = first.follows or (others[0][0].name, powers[1])
        row = f"{{type: coupling, joints: [{first.name}, {others[0][0].name}], {terms}}}"
    else:
        row = f"{{holonomic: {_length([(first, 1.0)], scene)} - ({text})}}"
    scene.robot.constraints.append(Entry(_name(reading, tie), row, tie))


def _of(reading: Reading, tie: Element, attribute: str, scene: Scene) -> Joint | None:
    joint = joint_of(reading, tie, attribute, scene)
    if joint is not None and joint.type not in ONE_RATE:
        reading.report(
            tie,
            f"an equality of the {joint.type} joint '{joint.name}'",
            "hinges and slides",
            attribute=attribute,
        )
        return None
    return joint


def _tendon(reading: Reading, tie: Element, tendons: Tendons, scene: Scene) -> None:
    """The same between lengths of tendons, from their lengths at the reference configuration."""
    given = [attribute for attribute in ("tendon1", "tendon2") if attribute in tie.attributes]
    if not given:
        reading.report(tie, "an equality of no tendon", '<tendon tendon1="…" tendon2="…">')
    lengths = [_tendon_length(reading, tie, attribute, tendons, scene) for attribute in given]
    powers = (listing(reading, tie, "polycoef") or [])[:5]
    powers += [0.0, 1.0, 0.0, 0.0, 0.0][len(powers) :]
    if lengths and all(lengths):
        text = _polynomial(powers, lengths[1]) if lengths[1:] else written(powers[0])
        scene.robot.constraints.append(
            Entry(_name(reading, tie), f"{{holonomic: {lengths[0]} - ({text})}}", tie)
        )


def _tendon_length(
    reading: Reading, tie: Element, attribute: str, tendons: Tendons, scene: Scene
) -> str:
    """ℓ − ℓ at the reference configuration; nothing after reporting."""
    name = tie.get(attribute)
    if name in tendons.lines:
        return _line_length(tendons.lines[name], scene)
    along = tendons.fixed.get(name)
    if name in tendons.refused:
        return ""
    if not along:
        reading.unknown(tie, attribute, "tendon", [*tendons.fixed, *tendons.lines])
    elif any(joint.type not in ONE_RATE for joint, _ in along):
        problem = "an equality along joints that are not hinges or slides"
        reading.report(tie, problem, "hinges and slides", attribute=attribute)
    else:
        return _length(along, scene)
    return ""


def _line_length(line: Line, scene: Scene) -> str:
    start = written(line.reference(scene))
    return f"({line.length(scene)} - ({start} m))/(1 m)"


def _length(along: Transmission, scene: Scene) -> str:
    """Σ cᵢ (qᵢ − qᵢ at the reference configuration), a plain number."""
    terms: list[str] = []
    for joint, c in along:
        start, unit = (
            scene.references.get(joint.name, 0.0),
            " m" if joint.type == "prismatic" else "",
        )
        moved = f"({joint.name} - ({written(start)}{unit}))" if start else joint.name
        terms.append(
            (f"({written(c)})*" if c != 1.0 else "") + (f"{moved}/(1 m)" if unit else moved)
        )
    return " + ".join(terms)


def _polynomial(powers: list[float], argument: str) -> str:
    terms = [written(powers[0])] + [
        f"{written(a)}*({argument}){f'**{k}' if k > 1 else ''}"
        for k, a in enumerate(powers[1:], 1)
        if a
    ]
    return " + ".join(terms)


_READERS = {"connect": _connect, "weld": _weld, "joint": _joint}
