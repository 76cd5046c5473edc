"""<actuator>: forces along joints and tendons, as inputs where they are plain motors, else by
formula; activations as first-order states.

A transmission has a length ℓ, gear times that of what it drives; a force f along it acts on joints
as f ∂ℓ/∂q. Motors at a site push and turn the site's body.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from derive.diagnostics import counted
from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.forces import Transmission, by_formula, coefficient, joint_of, load, times
from derive.robots.mjcf.laws import Law, law_of
from derive.robots.mjcf.reference import felt_by_line, felt_inertia
from derive.robots.mjcf.settings import completed
from derive.robots.mjcf.tendons import Line, Tendons, pull, tension_of
from derive.robots.numbers import listing, scalar, written
from derive.robots.robot import GROUND, ONE_RATE, Entry, Joint, Reading
from derive.robots.rotations import rotated

CLAMPS = ("ctrlrange", "forcerange", "actrange")


def actuators(reading: Reading, root: Element, known: Tendons, scene: Scene) -> None:
    """Reads every <actuator> into inputs or forces of the robot. Ranges are left out and said so: a
    clamped force is not smooth."""
    clamped = early = late = off = 0
    for section in root.all("actuator"):
        for element in section.children:
            actuator = completed(reading, element, scene.settings)
            if scalar(reading, actuator, "group") in scene.settings.idle_groups:
                off += 1
                continue
            early += actuator.get("actearly") == "true"
            late += scalar(reading, actuator, "delay") > 0.0
            law = law_of(reading, element, scene.settings)
            if law is not None:
                _transmitted(reading, actuator, law, known, scene)
            inherits = scalar(reading, actuator, "inheritrange") > 0.0
            clamped += inherits or any(name in actuator.attributes for name in CLAMPS)
    of = partial(counted, one="actuator")
    if off:
        scene.robot.assumed.append(f"{of(off)} of groups that are switched off: not read")
    if early:
        scene.robot.left_out.append(f"actearly, a step's advance of the force, of {of(early)}")
    if late:
        scene.robot.left_out.append(f"the delay of {of(late)}")
    if clamped:
        scene.robot.left_out.append(
            f"the ranges of {of(clamped)}: inputs and forces are not clamped"
        )


def _transmitted(
    reading: Reading, actuator: Element, law: Law, known: Tendons, scene: Scene
) -> None:
    gear = listing(reading, actuator, "gear") or [1.0]
    if "site" in actuator.attributes:
        _at_site(reading, actuator, law, gear, scene)
    elif "tendon" in actuator.attributes:
        _at_tendon(reading, actuator, law, gear[0], known, scene)
    elif "joint" in actuator.attributes or "jointinparent" in actuator.attributes:
        attribute = "joint" if "joint" in actuator.attributes else "jointinparent"
        if (joint := joint_of(reading, actuator, attribute, scene)) is not None:
            _at_joint(reading, actuator, law, gear, joint, scene)
    else:
        crank = "cranksite" in actuator.attributes or "slidersite" in actuator.attributes
        through = "drives a slider-crank" if crank else "drives no joint, tendon or site"
        hint = "bodies and an equality can stand for crank and slider" if crank else ""
        expected = "joint, tendon or site"
        reading.report(actuator, f"a <{actuator.tag}> that {through}", expected, hint)


def _at_tendon(
    reading: Reading, actuator: Element, law: Law, gear: float, known: Tendons, scene: Scene
) -> None:
    if "damper" not in scene.settings.off:
        b0, b1, b2 = (*law.bias, 0.0, 0.0, 0.0)[:3]
        law = replace(law, bias=(b0, b1, b2 - _damping(reading, actuator)))
    name = actuator.get("tendon")
    if name in known.fixed:
        _along(reading, actuator, law, [(j, gear * c) for j, c in known.fixed[name]], scene)
    elif name in known.lines:
        _along_line(reading, actuator, law, gear, known.lines[name], scene)
    elif name not in known.refused:
        reading.unknown(actuator, "tendon", "tendon", [*known.fixed, *known.lines])


def _along_line(
    reading: Reading, actuator: Element, law: Law, gear: float, line: Line, scene: Scene
) -> None:
    """f along ℓ pulls with −gear f: a positive one makes the line longer."""
    law = _damped(law, lambda: felt_by_line(reading, actuator, line, gear, scene))
    name = _driver(reading, actuator, law, actuator.get("tendon"), scene)
    driven = tension_of(law.gain, line, gear, " N" if law.activation else "", scene)
    own = tension_of(law.bias, line, gear, " N", scene)
    if terms := [times(term, name) for term in driven] + own:
        pull(reading, actuator, line, name, " + ".join(terms), scene)


def rotors(reading: Reading, root: Element, scene: Scene) -> None:
    """What the armature and the damping of actuators are to their joints, times gear squared. They
    belong to the joints before anything is damped by a ratio."""
    for section in root.all("actuator"):
        for element in section.children:
            actuator = completed(reading, element, scene.settings)
            armature, damping = scalar(reading, actuator, "armature"), _damping(reading, actuator)
            joint = scene.joints.get(actuator.get("joint") or actuator.get("jointinparent"))
            if joint is not None and joint.type in ONE_RATE:
                gear = (listing(reading, actuator, "gear") or [1.0])[0]
                joint.armature += armature * gear**2
                joint.damper += damping * gear**2 * ("damper" not in scene.settings.off)
            elif armature or (damping and "tendon" not in actuator.attributes):
                problem = "an armature or damping of an actuator that drives no hinge or slide"
                reading.report(actuator, problem, "those of a joint, or of none")


def _damping(reading: Reading, actuator: Element) -> float:
    linear, *further = listing(reading, actuator, "damping") or [0.0]
    if any(further):
        problem = "damping with the square or the cube of a speed"
        reading.report(actuator, problem, "one number", attribute="damping")
    return linear


def _input(reading: Reading, actuator: Element, target: str, notes: list[str]) -> str:
    """Named after the actuator, or after what it drives where that is taken."""
    wanted = actuator.get("name") or f"tau_{target}"
    free = not actuator.get("name") or reading.symbols.is_free(wanted, "input")
    return reading.input_name(wanted if free else f"tau_{wanted}", actuator.get("name"), notes)


def _at_joint(
    reading: Reading, actuator: Element, law: Law, gear: list[float], joint: Joint, scene: Scene
) -> None:
    if joint.type in ONE_RATE:
        _along(reading, actuator, law, [(joint, gear[0])], scene)
    elif joint.type == "ball" and law.plain and "joint" in actuator.attributes:
        name = _driver(reading, actuator, law, joint.name, scene)
        for rate, factor in zip(joint.rates(), gear):
            if factor * law.gain[0]:
                load(
                    reading,
                    actuator,
                    name,
                    f"velocity: {rate}",
                    times(
                        coefficient(factor * law.gain[0], " N*m" if law.activation else ""), name
                    ),
                    scene,
                )
    elif joint.type in ("ball", "free") and law.plain:
        _in_other_axes(reading, actuator, law, gear, joint, scene)
    else:
        reading.report(
            actuator,
            f"a <{actuator.tag}> at the {joint.type} joint '{joint.name}'",
            "a motor, or a hinge, a slide or a site",
        )


def _in_other_axes(
    reading: Reading, actuator: Element, law: Law, gear: list[float], joint: Joint, scene: Scene
) -> None:
    """At a free joint a force along the world's axes and a torque along the body's; `jointinparent`
    torques are along the joint's axes on the parent, which feels the opposite one."""
    name = _driver(reading, actuator, law, joint.name, scene)
    gains = [law.gain[0] * g for g in [*gear, *[0.0] * 6][:6]]
    unit = law.activation is not None
    if joint.type == "free":
        force, torque = gains[:3], gains[3:]
        along = GROUND if "jointinparent" in actuator.attributes else "body"
        _push(
            reading,
            actuator,
            name,
            f"body: {joint.child}, at: [0, 0, 0]",
            (force, GROUND),
            unit,
            scene,
        )
    else:
        torque, along = rotated(joint.rotation, gains[:3]), joint.parent
    _push(reading, actuator, name, f"body: {joint.child}", (torque, along), unit, scene)
    if joint.parent != GROUND:
        opposite = [-x for x in torque]
        _push(reading, actuator, name, f"body: {joint.parent}", (opposite, along), unit, scene)


def _push(
    reading: Reading,
    actuator: Element,
    name: str,
    where: str,
    components: tuple[Sequence[float], str],
    has_unit: bool,
    scene: Scene,
) -> None:
    """A force, where `where` has a point, or a torque, times an input, along a frame's axes."""
    numbers, frame = components
    if not any(numbers):
        return
    kind, unit = ("force", " N") if " at: " in where else ("torque", " N*m")
    own = unit if has_unit else ""
    listed = ", ".join(times(coefficient(x, own), name) if x else "0" for x in numbers)
    text = f"{{type: {kind}, {where}, components: [{listed}], frame: {frame}}}"
    scene.robot.loads.append(Entry(reading.symbols(f"{name}_{kind}", "load"), text, actuator))


def _along(
    reading: Reading, actuator: Element, law: Law, along: Transmission, scene: Scene
) -> None:
    """Along one or several joints with one coordinate each."""
    if any(joint.type not in ONE_RATE for joint, _ in along) or not along:
        reading.report(
            actuator,
            f"a <{actuator.tag}> along joints that are not hinges or slides",
            "hinges and slides",
        )
        return
    law = _damped(law, lambda: felt_inertia(reading, actuator, along, scene))
    first = along[0][0].name
    factor = along[0][1] * law.gain[0]
    if law.plain and not law.activation and len(along) == 1 and factor:
        notes: list[str] = []
        name = _input(reading, actuator, first, notes)
        gear = "" if factor == 1.0 else f", gear: {written(factor)}"
        scene.robot.inputs.append(
            Entry(name, f"{{joint: {first}{gear}}}", actuator, "; ".join(notes))
        )
    else:
        name = _driver(reading, actuator, law, first, scene)
        by_formula(reading, actuator, name, law, along, name, scene)


def _damped(law: Law, felt: Callable[[], float]) -> Law:
    """With the damping of a ratio ζ in numbers, as MuJoCo 4 has it: 2 ζ √(kp m), with the inertia m
    that the force accelerates at the reference configuration."""
    if not law.ratio:
        return law
    kp = -law.bias[1]
    damping = 2.0 * law.ratio * math.sqrt(max(kp * felt(), 0.0))
    b0, b1, b2 = law.bias
    return replace(law, bias=(b0, b1, b2 - damping), ratio=0.0)


def _driver(reading: Reading, actuator: Element, law: Law, target: str, scene: Scene) -> str:
    """What the formulas of a force use: an input, or the activation that follows it."""
    notes: list[str] = []
    name = _input(reading, actuator, target, notes)
    scene.robot.inputs.append(
        Entry(name, "{}", actuator, "; ".join([*notes, f"a <{actuator.tag}> of the file"]))
    )
    if law.activation is None:
        return name
    own = reading.symbols(f"{name}_activation", "state")
    scene.robot.states.append(Entry(own, f"{{rate: {law.activation.rate(name, own)}}}", actuator))
    return own


def _at_site(
    reading: Reading, actuator: Element, law: Law, gear: list[float], scene: Scene
) -> None:
    """Force and torque on the site's body, in its frame."""
    if actuator.get("site") not in scene.sites:
        reading.unknown(actuator, "site", "site", list(scene.sites))
        return
    if "refsite" in actuator.attributes or not law.plain:
        reading.report(actuator, "an actuator that follows a site", "a motor that pushes at a site")
        return
    body, frame = scene.sites[actuator.get("site")]
    name = _driver(reading, actuator, law, actuator.get("site"), scene)
    gear = [law.gain[0] * g for g in [*gear, *[0.0] * 6][:6]]
    at = ", ".join(written(x) for x in frame.at)
    force, torque = (rotated(frame.turn, part) for part in (gear[:3], gear[3:]))
    unit = law.activation is not None
    _push(reading, actuator, name, f"body: {body}, at: [{at}]", (force, "body"), unit, scene)
    _push(reading, actuator, name, f"body: {body}", (torque, "body"), unit, scene)
