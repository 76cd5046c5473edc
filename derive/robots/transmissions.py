"""Transmissions of URDF files: gear ratios, and the inertia of rotors that the joints feel.

A <transmission> names joints and actuators. Commands of ROS are efforts at the joint, so its input
stays the force or torque there and the ratio is told beside it. A rotor turns `ratio` times as fast
as its joint, which feels ratio² times its inertia: the joint's armature. URDF itself has no place
for rotors; `rotor_inertia` and `gear_ratio` are those of Drake, in the actuator, with or without
the prefix `drake:`.
"""

from __future__ import annotations

from collections.abc import Mapping

from derive.robots.markup import Element
from derive.robots.numbers import scalar, written
from derive.robots.robot import ONE_RATE, Joint, Reading, Robot, counted, quoted


def read_transmissions(
    reading: Reading, root: Element, joints: Mapping[str, Joint], result: Robot
) -> None:
    """Ratios beside the joints, armatures of the rotors, and what was read in one sentence."""
    ratios = rotors = 0
    for element in root.all("transmission"):
        for joint, actuator in _driven(element, joints, result):
            ratio = _ratio(reading, actuator)
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
    if ratios:
        result.changed.append(
            f"inputs are forces and torques at the joints; {counted(ratios, 'gear ratio')} of "
            "<transmission> stand beside the joints"
        )
    if rotors:
        felt = f"{counted(rotors, 'rotor')} of <transmission> felt by the joints"
        result.changed.append(f"{felt}: inertia times ratio squared, as armature")


def _driven(
    element: Element, joints: Mapping[str, Joint], result: Robot
) -> list[tuple[Joint, Element]]:
    """The joint and the actuator of a simple transmission; others are said to be left out."""
    driven, actuators = element.all("joint"), element.all("actuator")
    name = quoted(element.get("name"))
    known = [joints[joint.get("name")] for joint in driven if joint.get("name") in joints]
    if len(known) == len(driven) == len(actuators) == 1 and known[0].type in ONE_RATE:
        return [(known[0], actuators[0])]
    if len(known) < len(driven):
        result.assumed.append(f"not read: the transmission {name} names no joint of the robot")
    elif len(driven) > 1:
        result.assumed.append(
            f"not read: the transmission {name} of {len(driven)} joints; inputs are forces and "
            "torques at the joints"
        )
    else:
        result.assumed.append(f"not read: the transmission {name}")
    return []


def _ratio(reading: Reading, actuator: Element) -> float:
    """Turns of the motor to one of the joint."""
    named = ("mechanicalReduction", "gear_ratio")
    values = [_value(reading, actuator, name, 1.0) for name in named]
    for name, ratio in zip(named, values):
        if ratio == 0.0:
            reading.report(actuator, f"the {name} of an actuator is zero", "a number that is not")
    return next((ratio for ratio in values if ratio != 1.0), 1.0)


def _value(reading: Reading, actuator: Element, name: str, otherwise: float) -> float:
    """A number that stands as the text of an element or in its attribute `value`."""
    for tag in (name, f"drake:{name}"):
        element = actuator.first(tag)
        if element is not None:
            element.attributes.setdefault("value", element.text.strip())
            return scalar(reading, element, "value", otherwise)
    return otherwise
