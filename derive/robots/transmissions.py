"""Transmissions of URDF files: gear ratios, and the inertia of rotors that the joints feel.

A <transmission> names joints and actuators. Commands of ROS are efforts at the joint, so its input
stays the force or torque there and the ratio is told beside it. A rotor turns `ratio` times as fast
as its joint, which feels ratio² times its inertia: the joint's armature. URDF itself has no place
for rotors; `rotor_inertia` and `gear_ratio` are those of Drake, in the actuator, with or without
the prefix `drake:`.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from derive.diagnostics import counted, listed
from derive.robots.markup import Element
from derive.robots.numbers import scalar, written
from derive.robots.robot import ONE_RATE, Joint, Reading, Robot, quoted


def read_transmissions(
    reading: Reading, root: Element, joints: Mapping[str, Joint], result: Robot
) -> None:
    """Ratios beside the joints, armatures of the rotors, and what was read in one sentence."""
    ratios = rotors = 0
    unread: dict[str, list[str]] = {}
    for element in root.all("transmission"):
        driven, why = _driven(element, joints)
        if why:
            unread.setdefault(why, []).append(quoted(element.get("name")))
        for joint, actuator in driven:
            ratio = _ratio(reading, actuator)
            if ratio is None:
                unread.setdefault("its ratio is no number", []).append(quoted(element.get("name")))
                continue
            if ratio != 1.0:
                ratios += 1
                joint.notes.append(f"{written(ratio)} turns of its motor to one of the joint")
            inertia = _value(reading, actuator, "rotor_inertia", 0.0)
            if inertia < 0.0:
                problem = f"the rotor of '{joint.name}' has the inertia {inertia:g} kg*m^2"
                reading.report(actuator, problem, "zero or more")
            elif inertia:
                rotors += 1
                joint.armature += inertia * ratio**2
    for why, names in unread.items():
        what = "transmission" if len(names) == 1 else "transmissions"
        result.assumed.append(f"not read: the {what} {listed(names, 4)}: {why}")
    if ratios:
        result.changed.append(
            f"inputs are forces and torques at the joints; {counted(ratios, 'gear ratio')} of "
            "<transmission> stand beside the joints"
        )
    if rotors:
        felt = f"{counted(rotors, 'rotor')} of <transmission> felt by the joints"
        result.changed.append(f"{felt}: inertia times ratio squared, as armature")


def _driven(
    element: Element, joints: Mapping[str, Joint]
) -> tuple[list[tuple[Joint, Element]], str]:
    """The joint and the actuator of a simple transmission; of another, why it is left out."""
    named, actuators = element.all("joint"), element.all("actuator")
    known = [joints[joint.get("name")] for joint in named if joint.get("name") in joints]
    if len(known) < len(named):
        return [], "joints that the robot does not have"
    if len(named) > 1:
        return [], f"{len(named)} joints in one; inputs are forces and torques at the joints"
    if len(known) == len(actuators) == 1 and known[0].type in ONE_RATE:
        return [(known[0], actuators[0])], ""
    moves = not known or known[0].type in ONE_RATE
    return [], "not one joint and one actuator" if moves else f"a {known[0].type} joint"


def _ratio(reading: Reading, actuator: Element) -> float | None:
    """Turns of the motor to one of the joint: Drake's gear ratio where there is one, as Drake has
    it. None where a ratio is no number and no rotor needs it."""
    name = "gear_ratio" if _told(actuator, "gear_ratio") is not None else "mechanicalReduction"
    element = _told(actuator, name)
    if element is not None and _told(actuator, "rotor_inertia") is None and not _is_number(element):
        return None
    ratio = _value(reading, actuator, name, 1.0)
    if ratio == 0.0:
        reading.report(actuator, f"the {name} of an actuator is zero", "a number that is not")
    return ratio


def _value(reading: Reading, actuator: Element, name: str, otherwise: float) -> float:
    element = _told(actuator, name)
    return otherwise if element is None else scalar(reading, element, "value", otherwise)


def _told(actuator: Element, name: str) -> Element | None:
    """The element of that name, with or without Drake's prefix; its text stands as the attribute
    `value`, if it has none."""
    element = actuator.first(name) or actuator.first(f"drake:{name}")
    if element is not None:
        element.attributes.setdefault("value", element.text.strip())
    return element


def _is_number(element: Element) -> bool:
    try:
        return isfinite(float(element.get("value")))
    except ValueError:
        return False
