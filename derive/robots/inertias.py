"""Inertias that no body can have, of bodies that are fixed to others: the tensors of one rigid
piece add up to the same.

Robot files are full of sensors and dummy links with invented inertias. Refusing the robot for them
would help nobody: a body on a fixed joint moves with its carrier, and only the sum of their tensors
(each about its own centre of mass, in one orientation) enters the equations. So such a tensor is
counted with the body of the same piece that has the largest; mass and centre of mass stay where
they are. One of a piece that the ground holds is left away. What is impossible for a whole piece
that moves is left for the model language to refuse, or waived.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from derive.diagnostics import counted
from derive.robots.limits import NOISE, SLACK, TRIANGLE
from derive.robots.robot import GROUND, Body, Joint, Robot
from derive.robots.rotations import IDENTITY, Matrix, product, transposed, turned_tensor


def possible(mass: float, tensor: Sequence[float]) -> bool:
    """Whether a body can have this mass (kg) and this tensor (xx, yy, zz, xy, xz, yz in kg m²)
    about its centre of mass: principal moments are not negative and meet the triangle inequality.
    """
    if not any(tensor):
        return True
    xx, yy, zz, xy, xz, yz = tensor
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return (
        mass > 0.0
        and low >= -SLACK * high
        and low + middle >= high * (1.0 - TRIANGLE)
        and min(tensor[:3]) >= 0.0
    )


def gather(robot: Robot) -> None:
    """Count impossible tensors with the bodies they are fixed to, and say so. The motion of the
    robot is that of the file: a rigid piece feels only the sum of its tensors."""
    _drop_noise(robot)
    wrong = [body for body in robot.bodies if not possible(body.mass, body.inertia)]
    places = _places(robot) if wrong else {}
    still = _on_ground(robot)
    for body in wrong:
        if places[body.name][0] in still:
            body.notes.append("its inertia, which no body can have, is left away: it never moves")
            body.inertia = ()
    wrong = [body for body in wrong if body.inertia]
    moved = [body for body in wrong if _handed_over(body, robot, places)]
    if moved:
        text = "an inertia that no body can have; each is counted with a body that it is fixed to"
        robot.changed.append(f"{counted(len(moved), 'body has', 'bodies have')} {text}")


def waive(robot: Robot) -> None:
    """Take the inertias that are still impossible as they are."""
    for body in robot.bodies:
        body.physical = possible(body.mass, body.inertia)


def _drop_noise(robot: Robot) -> None:
    noisy = [
        body for body in robot.bodies if any(body.inertia) and max(map(abs, body.inertia)) < NOISE
    ]
    for body in noisy:
        body.notes.append(
            f"inertia of rounding errors, at most {max(map(abs, body.inertia)):.0e}, left away"
        )
        body.inertia = ()
    if noisy:
        robot.changed.append(
            f"{counted(len(noisy), 'inertia', 'inertias')} below {NOISE:g} kg*m^2 read as zero"
        )


def _on_ground(robot: Robot) -> set[str]:
    """First bodies of the pieces that the ground holds."""
    return {
        joint.child for joint in robot.joints if (joint.type, joint.parent) == ("fixed", GROUND)
    }


def _places(robot: Robot) -> dict[str, tuple[str, Matrix]]:
    """Body → the first body of its rigid piece, and its orientation there."""
    by_child = {joint.child: joint for joint in robot.joints}
    places: dict[str, tuple[str, Matrix]] = {}
    for body in robot.bodies:
        chain: list[Joint] = []
        name = body.name
        while (
            name not in places
            and (joint := by_child[name]).type == "fixed"
            and joint.parent != GROUND
        ):
            chain.append(joint)
            name = joint.parent
        places.setdefault(name, (name, IDENTITY))
        for joint in reversed(chain):
            piece, turned = places[joint.parent]
            places[joint.child] = (piece, product(turned, joint.turn()))
    return places


def _handed_over(body: Body, robot: Robot, places: dict[str, tuple[str, Matrix]]) -> bool:
    """Whether a body of the same piece, the largest first, could take the tensor."""
    piece, turned = places[body.name]
    others = [
        other
        for other in robot.bodies
        if other is not body and places[other.name][0] == piece and other.mass > 0.0
    ]
    for carrier in sorted(others, key=lambda other: -sum(other.inertia[:3])):
        R = product(transposed(places[carrier.name][1]), turned)
        total = tuple(
            a + b for a, b in zip(carrier.inertia or (0.0,) * 6, turned_tensor(R, body.inertia))
        )
        if possible(carrier.mass, total):
            body.notes.append(
                f"its inertia {list(body.inertia)} is impossible and counted with {carrier.name}"
            )
            carrier.notes.append(f"with the inertia of {body.name}")
            carrier.inertia, body.inertia = total, ()
            return True
    return False
