"""<actuator> and fixed <tendon>s: forces along joint coordinates, as inputs where they are plain
motors, else by formula.

A transmission has a length ℓ = gear · Σ cᵢ qᵢ (one joint, or the joints of a fixed tendon); a force
f along it acts on joint i as gear · cᵢ · f. Motors at a site push and turn the site's body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.settings import ACTUATORS, completed
from derive.robots.numbers import listing, scalar, written
from derive.robots.robot import ONE_RATE, Entry, Joint, Reading, quoted
from derive.robots.rotations import rotated

Transmission = list[tuple[Joint, float]]
CLAMPS = ("ctrlrange", "forcerange", "actrange")


@dataclass(frozen=True)
class Law:
    """force = (g₀ + g₁ ℓ + g₂ dℓ/dt) u + b₀ + b₁ ℓ + b₂ dℓ/dt."""

    gain: Sequence[float]
    bias: Sequence[float]

    @property
    def plain(self) -> bool:
        """Whether the force is gain · control alone, without a term in length or velocity: then it
        is an input."""
        return not any(self.gain[1:]) and not any(self.bias)


def tendons(reading: Reading, root: Element, scene: Scene) -> dict[str, Transmission]:
    """Fixed tendons by name, their springs and dampers written down; spatial ones are refused where
    they act."""
    result: dict[str, Transmission] = {}
    for section in root.all("tendon"):
        for element in section.children:
            tendon = completed(reading, element, scene.settings)
            acts = [
                name
                for name in ("stiffness", "damping", "armature", "frictionloss")
                if any(listing(reading, tendon, name) or ())
            ]
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
            elif "range" in tendon.attributes:
                scene.robot.left_out.append(
                    f"the tendon {quoted(tendon.get('name'))}, which only ends a motion where "
                    "it is taut"
                )
            else:
                scene.robot.changed.append(
                    f"the tendon {quoted(tendon.get('name'))} does nothing and is left out"
                )
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
    start = sum(c * scene.references.get(joint.name, 0.0) for joint, c in along)
    law = Law((0.0,), (stiffness * (start if rest[0] == -1.0 else rest[0]), -stiffness, -damping))
    if any(law.bias):
        _by_formula(reading, tendon, tendon.get("name") or "tendon", law, along, "", scene)


def actuators(
    reading: Reading, root: Element, known: dict[str, Transmission], scene: Scene
) -> None:
    """Reads every <actuator> into inputs or forces of the robot. Ranges are left out and said so: a
    clamped force is not smooth."""
    clamped = 0
    for section in root.all("actuator"):
        for element in section.children:
            actuator = completed(reading, element, scene.settings)
            law = _law(reading, actuator)
            if law is not None:
                _transmitted(reading, actuator, law, known, scene)
            clamped += any(name in actuator.attributes for name in CLAMPS)
    if clamped:
        scene.robot.left_out.append(
            f"the ranges of {clamped} actuator{'s' * (clamped != 1)}: inputs and forces are not "
            "clamped"
        )


def _law(reading: Reading, actuator: Element) -> Law | None:
    """The force law of an actuator without states of its own; None after reporting another."""
    kind = actuator.tag
    states = (
        actuator.get("dyntype", "none") not in ("none", "")
        or scalar(reading, actuator, "timeconst") != 0.0
    )
    if kind not in ACTUATORS or kind in ("intvelocity", "cylinder", "muscle", "adhesion") or states:
        why = f"a <{kind}> actuator" + (" with an activation" if states else "")
        reading.report(
            actuator,
            f"{why}, which has a state or a law of its own",
            "motor, position, velocity, damper, general",
        )
        return None
    if "dampratio" in actuator.attributes and scalar(reading, actuator, "dampratio"):
        reading.report(
            actuator,
            "damping as a ratio of the critical one",
            "kv in numbers",
            attribute="dampratio",
        )
    if kind == "motor":
        return Law((1.0,), ())
    kv = scalar(reading, actuator, "kv", 1.0 if kind != "position" else 0.0)
    if kind == "position":
        kp = scalar(reading, actuator, "kp", 1.0)
        return Law((kp,), (0.0, -kp, -kv))
    if kind == "velocity":
        return Law((kv,), (0.0, 0.0, -kv))
    return Law((0.0, 0.0, -kv), ()) if kind == "damper" else _general(reading, actuator)


def _general(reading: Reading, actuator: Element) -> Law | None:
    kinds = {"gaintype": ("fixed", "affine"), "biastype": ("none", "affine")}
    for attribute, allowed in kinds.items():
        if actuator.get(attribute, allowed[0]) not in allowed:
            reading.report(
                actuator,
                f"{attribute}='{actuator.get(attribute)}'",
                ", ".join(allowed),
                attribute=attribute,
            )
            return None
    gain = (listing(reading, actuator, "gainprm") or [1.0])[:3]
    bias = (listing(reading, actuator, "biasprm") or [0.0])[:3]
    affine = actuator.get("biastype", "none") == "affine"
    return Law(gain if actuator.get("gaintype") == "affine" else gain[:1], bias if affine else ())


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
            _along(
                reading,
                actuator,
                law,
                [(j, gear[0] * c) for j, c in known[actuator.get("tendon")]],
                scene,
            )
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
        name = _noted_input(reading, actuator, joint.name, scene)
        for rate, factor in zip(joint.rates(), gear):
            if factor * law.gain[0]:
                _load(
                    reading,
                    actuator,
                    name,
                    f"velocity: {rate}",
                    _times(_factor(factor * law.gain[0], ""), name),
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
    first = along[0][0].name
    if law.plain and len(along) == 1:
        factor = along[0][1] * law.gain[0]
        notes: list[str] = []
        name = _input(reading, actuator, first, notes)
        gear = "" if factor == 1.0 else f", gear: {written(factor)}"
        scene.robot.inputs.append(
            Entry(name, f"{{joint: {first}{gear}}}", actuator, "; ".join(notes))
        )
    else:
        name = _noted_input(reading, actuator, first, scene)
        _by_formula(reading, actuator, name, law, along, name, scene)


def _noted_input(reading: Reading, actuator: Element, target: str, scene: Scene) -> str:
    """An input that formulas use."""
    notes: list[str] = []
    name = _input(reading, actuator, target, notes)
    scene.robot.inputs.append(
        Entry(name, "{}", actuator, "; ".join([*notes, f"a <{actuator.tag}> of the file"]))
    )
    return name


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
        gain = _affine(law.gain, c, along, lambda unit: "")
        terms = [_times(term, u) for term in gain] if u else []
        force = "N*m" if joint.type == "revolute" else "N"
        terms += _affine(law.bias, c, along, lambda unit, force=force: f" {force}{unit}")
        _load(reading, element, name, f"joint: {joint.name}", " + ".join(terms), scene)


def _times(term: str, u: str) -> str:
    return u if term == "1" else f"{term}*{u}"


def _affine(
    k: Sequence[float], c: float, along: Transmission, unit: Callable[[str], str]
) -> list[str]:
    """c (k₀ + k₁ ℓ + k₂ dℓ/dt) in terms of the joints; `unit` completes the unit of a
    coefficient."""
    k0, k1, k2 = [*k, 0.0, 0.0, 0.0][:3]
    terms = [_factor(c * k0, unit(""))] if k0 else []
    for joint, other in along:
        per = "rad" if joint.type == "revolute" else "m"
        terms += [f"{_factor(c * k1 * other, unit(f'/{per}'))}*{joint.name}"] if k1 else []
        terms += [f"{_factor(c * k2 * other, unit(f'*s/{per}'))}*der({joint.name})"] if k2 else []
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
    name = _noted_input(reading, actuator, actuator.get("site"), scene)
    gear = [law.gain[0] * g for g in [*gear, *[0.0] * 6][:6]]
    at = ", ".join(written(x) for x in frame.at)
    for kind, place, part in (("force", f"at: [{at}], ", gear[:3]), ("torque", "", gear[3:])):
        if any(part):
            components = ", ".join(
                _times(_factor(x, ""), name) if x else "0" for x in rotated(frame.turn, part)
            )
            text = f"{{type: {kind}, body: {body}, {place}components: [{components}], frame: body}}"
            scene.robot.loads.append(
                Entry(reading.symbols(f"{name}_{kind}", "load"), text, actuator)
            )
