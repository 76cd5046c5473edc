"""The configuration that is drawn.

The consistent initial state of the model; where single angles are zero there, which lays links on
their lines of reference, they are turned a little, and a platform that stands on the ground's origin
is moved away from it. What the constraints do not allow is left as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from derive.diagnostics import HamelError
from derive.mechanics.records import System
from derive.states.initial import initial_state
from hamel.draw.mechanism.scene import Numbers

ZERO = math.radians(6.0)  # an angle that a drawing would not show
TURNED = (25.0, 35.0, -30.0, 40.0, -25.0, 30.0)  # degrees, one after the other
MOVED = (1.1, 0.75)  # of a platform, in sizes of the mechanism
MOST = 60  # coordinates; in longer ones what is straight is shown straight
INITIAL = "the consistent initial state"
NEARBY = "near the initial state, with {names} moved so that they can be seen"


@dataclass(frozen=True)
class Configuration:
    """q (SI), parameters, and in words what state it is."""

    q: np.ndarray
    p: np.ndarray
    about: str
    moved: tuple[str, ...] = ()


def configuration(system: System) -> Configuration:
    """Raises ModelError where the model has no consistent initial state."""
    p = np.array(system.parameters, dtype=float)
    start = initial_state(system).q
    changes = _changes(system, start)
    if not changes:
        return Configuration(start, p, INITIAL)
    for some in (changes, _half(changes)):
        try:
            near = initial_state(system, some)
        except HamelError:
            continue
        if np.isfinite(near.q).all() and _kept(system, near.q, some):
            names = tuple(some)
            listed = ", ".join(names) if len(names) <= 4 else f"{len(names)} coordinates"
            return Configuration(near.q, p, NEARBY.format(names=listed), names)
    return Configuration(start, p, INITIAL)


def _kept(system: System, q: np.ndarray, changes: dict[str, float]) -> bool:
    """Whether the changes stand: where constraints contradict them they moved something else far
    away."""
    names = [c.name for c in system.model.coordinates]
    return all(abs(q[names.index(name)] - x) < 1e-6 * (1 + abs(x)) for name, x in changes.items())


def _half(changes: dict[str, float]) -> dict[str, float]:
    """The first of them alone: constraints tie the others to it."""
    first = next(iter(changes))
    return {first: changes[first]}


def _changes(system: System, q: np.ndarray) -> dict[str, float]:
    """Coordinates that are next to zero and hide something there, with values that do not."""
    model = system.model
    if len(model.coordinates) > MOST:
        return {}
    values = {c.name: float(x) for c, x in zip(model.coordinates, q)}
    changes: dict[str, float] = {}
    for joint in model.joints:
        if joint.type == "planar" and model.plane:
            changes |= _platform(system, joint.coordinates, values, len(changes))
        elif joint.type in ("revolute", "universal"):
            changes |= _angles(joint.coordinates, values, len(changes))
    return changes


def _angles(names: tuple[str, ...], values: dict[str, float], count: int) -> dict[str, float]:
    flat = [name for name in names if abs(math.remainder(values[name], math.tau)) < ZERO]
    return {
        name: values[name] + math.radians(TURNED[(count + k) % len(TURNED)])
        for k, name in enumerate(flat)
    }


def _platform(
    system: System, names: tuple[str, ...], values: dict[str, float], count: int
) -> dict[str, float]:
    """x, y and the angle of a body that moves freely in the plane."""
    x, y, angle = names
    changes = _angles((angle,), values, count)
    if abs(values[x]) + abs(values[y]) < 1e-9:
        size = reach(system)
        changes |= {x: MOVED[0] * size, y: MOVED[1] * size}
    return changes


def reach(system: System) -> float:
    """A length of the mechanism: the largest distance between two points of one link (m)."""
    numbers = Numbers(system, np.zeros(len(system.model.coordinates)), np.array(system.parameters))
    largest = 0.0
    for joint in system.model.joints:
        for at in (joint.at_parent, joint.at_child):
            largest = max(largest, float(np.linalg.norm(numbers.vector(at.position))))
    for body in system.model.bodies:
        largest = max(largest, float(np.linalg.norm(numbers.vector(body.com))))
    return largest or 1.0
