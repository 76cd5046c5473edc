"""Forces along joint coordinates, by formula.

A transmission has a length ℓ = Σ cᵢ qᵢ (one joint, or the joints of a fixed tendon); a force f
along it acts on joint i as cᵢ f.
"""

from __future__ import annotations

from collections.abc import Sequence

from derive.robots.markup import Element
from derive.robots.mjcf.bodies import Scene
from derive.robots.mjcf.laws import Law
from derive.robots.numbers import written
from derive.robots.robot import Entry, Joint, Reading

Transmission = list[tuple[Joint, float]]


def joint_of(reading: Reading, element: Element, attribute: str, scene: Scene) -> Joint | None:
    """The joint that an attribute names; None after reporting that there is none."""
    joint = scene.joints.get(element.get(attribute))
    if joint is None:
        reading.unknown(element, attribute, "joint", list(scene.joints))
    return joint


def by_formula(
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
        terms = [times(term, u) for term in gain] if u else []
        terms += _affine(law.bias, c, along, force)
        load(reading, element, name, f"joint: {joint.name}", " + ".join(terms), scene)


def times(term: str, u: str) -> str:
    """term · u, where a term of one need not be written."""
    return u if term == "1" else f"{term}*{u}"


def _affine(k: Sequence[float], c: float, along: Transmission, unit: str | None) -> list[str]:
    """c (k₀ + k₁ ℓ + k₂ dℓ/dt) in terms of the joints; `unit` is that of the sum, None where its
    coefficients are to have none."""
    k0, k1, k2 = [*k, 0.0, 0.0, 0.0][:3]
    terms = [coefficient(c * k0, unit or "")] if k0 else []
    for joint, other in along:
        per = "rad" if joint.type == "revolute" else "m"
        stiff, viscous = ("", "") if unit is None else (f"{unit}/{per}", f"{unit}*s/{per}")
        terms += [f"{coefficient(c * k1 * other, stiff)}*{joint.name}"] if k1 else []
        terms += [f"{coefficient(c * k2 * other, viscous)}*der({joint.name})"] if k2 else []
    return terms


def coefficient(number: float, unit: str) -> str:
    """A number with its unit, in brackets where they are needed."""
    return f"({written(number)}{unit})" if unit or number < 0.0 else written(number)


def load(
    reading: Reading, element: Element, name: str, where: str, force: str, scene: Scene
) -> None:
    """A force by formula on what `where` names."""
    own = reading.symbols(f"{name}_force", "load")
    scene.robot.loads.append(
        Entry(own, f"{{type: expression, {where}, expression: {force}}}", element)
    )


def in_yaml(formula: str) -> str:
    """A formula as it stands in a flow of YAML: in quotes where it has commas."""
    return f'"{formula}"' if "," in formula else formula
