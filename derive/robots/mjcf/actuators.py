"""<actuator> and fixed <tendon>s: forces along joint coordinates, as inputs where they are plain
motors, else by formula; activations as first-order states.

A transmission has a length ℓ = gear · Σ cᵢ qᵢ (one joint, or the joints of a fixed tendon); a force
f along it acts on joint i as gear · cᵢ · f. Motors at a site push and turn the site's body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from derive.diagnostics import listed
from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.laws import Law, is_mixed, law_of
from derive.robots.mjcf.reference import felt_inertia
from derive.robots.mjcf.settings import completed
from derive.robots.numbers import listing, scalar, written
from derive.robots.robot import ONE_RATE, Entry, Joint, Reading, counted, quoted
from derive.robots.rotations import rotated

Transmission = list[tuple[Joint, float]]
CLAMPS = ("ctrlrange", "forcerange", "actrange")


def tendons(reading: Reading, root: Element, scene: Scene) -> dict[str, Transmission]:
    """Fixed tendons by name, their springs and dampers written down; spatial ones are refused where
    they act."""
    result: dict[str, Transmission] = {}
    ends: list[str] = []
    for section in root.all("tendon"):
        for element in section.children:
            tendon = completed(reading, element, scene.settings)
            acts = [
                name
                for name in ("stiffness", "damping", "armature", "frictionloss")
                if any(listing(reading, tendon, name) or ())
            ]
            if "range" in tendon.attributes and tendon.get("limited") != "false":
                ends.append(tendon.get("name") or tendon.tag)
            if tendon.tag == "fixed":
                result[tendon.get("name")] = _coefficients(reading, tendon, scene)
                _tendon_forces(reading, tendon, acts, result[tendon.get("name")], scene)
            elif acts:
                reading.report(
                    tendon,
                    f"a <{tendon.tag}> tendon with {acts[0]}",
                    "fixed tendons",
                    attribute=acts[0],
                )
            elif "range" not in tendon.attributes:
                scene.robot.changed.append(
                    f"the tendon {quoted(tendon.get('name'))} does nothing and is left out"
                )
    if ends:
        said = f"the ranges of {listed(map(quoted, ends))}, which end a motion where they are taut"
        scene.robot.left_out.append(f"of tendons, {said}")
    return result


def _coefficients(reading: Reading, tendon: Element, scene: Scene) -> Transmission:
    coefficients: Transmission = []
    for term in tendon.all("joint"):
        joint = _joint(reading, term, "joint", scene)
        if joint is not None:
            coefficients.append((joint, scalar(reading, term, "coef", 1.0)))
    return coefficients


def _joint(reading: Reading, element: Element, attribute: str, scene: Scene) -> Joint | None:
    joint = scene.joints.get(element.get(attribute))
    if joint is None:
        reading.unknown(element, attribute, "joint", list(scene.joints))
    return joint


def _tendon_forces(
    reading: Reading, tendon: Element, acts: list[str], along: Transmission, scene: Scene
) -> None:
    for name in acts:
        if name in ("armature", "frictionloss"):
            reading.report(
                tendon, f"a tendon with {name}", "tendons with stiffness or damping", attribute=name
            )
    stiffness, damping = (
        (listing(reading, tendon, name) or [0.0])[0] for name in ("stiffness", "damping")
    )
    off = scene.settings.off
    stiffness, damping = stiffness * ("spring" not in off), damping * ("damper" not in off)
    rest = listing(reading, tendon, "springlength") or [-1.0]
    if stiffness and rest[0] != rest[-1]:
        reading.report(
            tendon,
            "a spring that is slack over a range",
            "one springlength",
            attribute="springlength",
        )
    start = sum(c * scene.rests.get(joint.name, 0.0) for joint, c in along)
    law = Law((0.0,), (stiffness * (start if rest[0] == -1.0 else rest[0]), -stiffness, -damping))
    if any(law.bias):
        _by_formula(reading, tendon, tendon.get("name") or "tendon", law, along, "", scene)


def actuators(
    reading: Reading, root: Element, known: dict[str, Transmission], scene: Scene
) -> None:
    """Reads every <actuator> into inputs or forces of the robot. Ranges are left out and said so: a
    clamped force is not smooth."""
    clamped = early = late = off = mixed = 0
    for section in root.all("actuator"):
        for element in section.children:
            actuator = completed(reading, element, scene.settings)
            if scalar(reading, actuator, "group") in scene.settings.idle_groups:
                off += 1
                continue
            mixed += is_mixed(element, scene.settings)
            early += actuator.get("actearly") == "true"
            late += scalar(reading, actuator, "delay") > 0.0
            law = law_of(reading, element, scene.settings)
            if law is not None:
                _transmitted(reading, actuator, law, known, scene)
            clamped += any(name in actuator.attributes for name in CLAMPS)
    of = partial(counted, one="actuator")
    if mixed:
        scene.robot.assumed.append(
            f"gains of {of(mixed)} whose class has defaults of other kinds: look at them"
        )
    if off:
        scene.robot.changed.append(f"{of(off)} of groups that are switched off: not read")
    if early:
        scene.robot.left_out.append(f"actearly, a step's advance of the force, of {of(early)}")
    if late:
        scene.robot.left_out.append(f"the delay of {of(late)}")
    if clamped:
        scene.robot.left_out.append(
            f"the ranges of {of(clamped)}: inputs and forces are not clamped"
        )


def _transmitted(
    reading: Reading, actuator: Element, law: Law, known: dict[str, Transmission], scene: Scene
) -> None:
    gear = listing(reading, actuator, "gear") or [1.0]
    if "site" in actuator.attributes:
        _at_site(reading, actuator, law, gear, scene)
    elif "tendon" in actuator.attributes:
        if actuator.get("tendon") not in known:
            hint = "only fixed tendons can be driven"
            reading.report(
                actuator,
                f"the tendon '{actuator.get('tendon')}'",
                ", ".join(known) or "none",
                hint,
                "tendon",
            )
        else:
            if "damper" not in scene.settings.off:
                b0, b1, b2 = (*law.bias, 0.0, 0.0, 0.0)[:3]
                law = replace(law, bias=(b0, b1, b2 - _damping(reading, actuator)))
            along = [(j, gear[0] * c) for j, c in known[actuator.get("tendon")]]
            _along(reading, actuator, law, along, scene)
    elif "joint" in actuator.attributes or "jointinparent" in actuator.attributes:
        attribute = "joint" if "joint" in actuator.attributes else "jointinparent"
        if (joint := _joint(reading, actuator, attribute, scene)) is not None:
            _at_joint(reading, actuator, law, gear, joint, scene)
    else:
        reading.report(
            actuator,
            f"a <{actuator.tag}> that drives no joint, tendon or site",
            "joint, tendon or site",
        )


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
    free = reading.symbols.is_free(wanted, "input")
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
                _load(
                    reading,
                    actuator,
                    name,
                    f"velocity: {rate}",
                    _times(_factor(factor * law.gain[0], " N*m" if law.activation else ""), name),
                    scene,
                )
    else:
        reading.report(
            actuator,
            f"a <{actuator.tag}> at the {joint.type} joint '{joint.name}'",
            "a hinge or slide, or a site",
        )


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
    law = _damped(reading, actuator, law, along, scene)
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
        _by_formula(reading, actuator, name, law, along, name, scene)


def _damped(
    reading: Reading, actuator: Element, law: Law, along: Transmission, scene: Scene
) -> Law:
    """With the damping of a ratio ζ in numbers, as MuJoCo 4 has it: 2 ζ √(kp m), with the inertia m
    that the force accelerates at the reference configuration."""
    if not law.ratio:
        return law
    kp = -law.bias[1]
    felt = felt_inertia(reading, actuator, along, scene)
    damping = 2.0 * law.ratio * math.sqrt(max(kp * felt, 0.0))
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


def _by_formula(
    reading: Reading,
    element: Element,
    name: str,
    law: Law,
    along: Transmission,
    u: str,
    scene: Scene,
) -> None:
    """cᵢ · law for every joint, multiplied out so that every coefficient can have its unit."""
    for joint, c in along:
        if not (any(law.gain) and u) and not any(law.bias):
            continue  # such as a servo of gain zero
        force = " N*m" if joint.type == "revolute" else " N"
        gain = _affine(law.gain, c, along, force if law.activation else None)
        terms = [_times(term, u) for term in gain] if u else []
        terms += _affine(law.bias, c, along, force)
        _load(reading, element, name, f"joint: {joint.name}", " + ".join(terms), scene)


def _times(term: str, u: str) -> str:
    return u if term == "1" else f"{term}*{u}"


def _affine(k: Sequence[float], c: float, along: Transmission, unit: str | None) -> list[str]:
    """c (k₀ + k₁ ℓ + k₂ dℓ/dt) in terms of the joints; `unit` is that of the sum, None where its
    coefficients are to have none."""
    k0, k1, k2 = [*k, 0.0, 0.0, 0.0][:3]
    terms = [_factor(c * k0, unit or "")] if k0 else []
    for joint, other in along:
        per = "rad" if joint.type == "revolute" else "m"
        stiff, viscous = ("", "") if unit is None else (f"{unit}/{per}", f"{unit}*s/{per}")
        terms += [f"{_factor(c * k1 * other, stiff)}*{joint.name}"] if k1 else []
        terms += [f"{_factor(c * k2 * other, viscous)}*der({joint.name})"] if k2 else []
    return terms


def _factor(number: float, unit: str) -> str:
    return f"({written(number)}{unit})" if unit or number < 0.0 else written(number)


def _load(
    reading: Reading, element: Element, name: str, where: str, force: str, scene: Scene
) -> None:
    own = reading.symbols(f"{name}_force", "load")
    scene.robot.loads.append(
        Entry(own, f"{{type: expression, {where}, expression: {force}}}", element)
    )


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
    parts = (("force", f"at: [{at}], ", gear[:3], " N"), ("torque", "", gear[3:], " N*m"))
    for kind, place, part, unit in parts:
        if any(part):
            own = unit if law.activation else ""
            components = ", ".join(
                _times(_factor(x, own), name) if x else "0" for x in rotated(frame.turn, part)
            )
            text = f"{{type: {kind}, body: {body}, {place}components: [{components}], frame: body}}"
            scene.robot.loads.append(
                Entry(reading.symbols(f"{name}_{kind}", "load"), text, actuator)
            )
