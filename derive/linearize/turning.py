"""Which quasi-velocities make a turning body steady: the rates of its Euler angles. In the axes of
the body its angular velocity turns along, and the equations depend on the angle it turns by."""

from __future__ import annotations

from derive.expressions.tree import Rate
from derive.formulations.records import Equations


def rates_of_angles(equations: Equations, name: str) -> str:
    """The advice to move with the rates of those Euler angles that `name` is one of, or the rate
    `der(name)` of; "" where it is of none, or where the choice has them."""
    model = equations.system.model
    coordinate = name.removeprefix("der(").removesuffix(")")
    turning = [joint for joint in model.joints if len(joint.orientation) == 3]
    angles = next(
        (joint.coordinates[-3:] for joint in turning if coordinate in joint.coordinates[-3:]), ()
    )
    rows = [
        row for choice in model.choices if choice.name == equations.choice for row in choice.rows
    ]
    if not angles or any(formula == Rate(coordinate) for _, formula in rows):
        return ""
    wanted = ", ".join(f"der({angle})" for angle in angles)
    more = ", …" if len(equations.w) > len(angles) else ""
    return (
        "with the rates of the angles as quasi-velocities it can be: "
        f"quasi_velocities: {{euler: [{wanted}{more}]}}"
    )
