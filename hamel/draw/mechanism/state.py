"""The configuration that is drawn.

The consistent initial state of the model; where single angles are zero there, which lays links on
their lines of reference, they are turned a little, and a platform that stands on the ground's
origin is moved away from it. What the constraints do not allow is left as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from derive.diagnostics import HamelError
from derive.mechanics.records import System
from derive.model.records import Model
from derive.states.initial import initial_state
from hamel.draw.mechanism.points import loose_points
from hamel.draw.mechanism.scene import scene
from hamel.draw.mechanism.view import planar

ZERO = math.radians(6.0)  # an angle that a drawing would not show
TURNED = (20.0, -35.0, 40.0, -30.0, 35.0, -25.0)  # degrees, one after the other
ROOM = (0.06, 0.22)  # between the origin and a platform, in sizes of the mechanism
MOVED = 3.0  # times the largest change: farther off nothing moves, or it is put together otherwise
ASIDE = 0.55  # of the other coordinates of a point, against gravity
MOST = 60  # coordinates; in longer ones what is straight is shown straight
INITIAL = "at the consistent initial state"
NEARBY = "near the initial state, with {names} moved to be seen"


@dataclass(frozen=True)
class Configuration:
    """q (SI), parameters, and in words what state it is."""

    q: np.ndarray
    p: np.ndarray
    about: str
    moved: tuple[str, ...] = ()


def configuration(system: System) -> Configuration:
    """Raises ModelError where the model has no consistent initial state."""
    p = np.array(system.own_parameters, dtype=float)
    start = initial_state(system).q
    changes = _changes(system, start)
    if not changes:
        return Configuration(start, p, INITIAL)
    for some in (changes, _half(changes)):
        q = _near(system, some, start)
        if q is None:
            continue
        away = _near(system, some | _platforms(system, q, p), start)
        names = tuple(some)
        listed = ", ".join(names) if len(names) <= 4 else f"{len(names)} coordinates"
        return Configuration(q if away is None else away, p, NEARBY.format(names=listed), names)
    return Configuration(start, p, INITIAL)


def _near(system: System, changes: dict[str, float], start: np.ndarray) -> np.ndarray | None:
    """The consistent state with these changes, where there is one not far from the start."""
    try:
        near = initial_state(system, changes)
    except HamelError:
        return None
    if not np.isfinite(near.q).all() or not _kept(system, near.q, changes):
        return None
    largest = max(map(abs, changes.values()))
    return near.q if np.max(np.abs(near.q - start)) <= MOVED * largest else None


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
    changes: dict[str, float] = _beside_axes(model, values)
    for joint in model.joints:
        if joint.type == "planar" and model.plane:
            changes |= _angles(joint.coordinates[2:], values, len(changes))
        elif joint.type in ("revolute", "universal"):
            changes |= _angles(joint.coordinates, values, len(changes))
    return changes


def _beside_axes(model: Model, values: dict[str, float]) -> dict[str, float]:
    """Of a single point given by coordinates: those that are zero."""
    points = loose_points(model)
    if len(points) != 1:
        return {}
    names = [model.coordinates[k].name for k in points[0].indices if k >= 0]
    far = max(abs(values[name]) for name in names)
    return {name: -ASIDE * far for name in names if abs(values[name]) < 0.05 * far}


def _angles(names: tuple[str, ...], values: dict[str, float], count: int) -> dict[str, float]:
    flat = [name for name in names if abs(math.remainder(values[name], math.tau)) < ZERO]
    return {
        name: values[name] + math.radians(TURNED[(count + k) % len(TURNED)])
        for k, name in enumerate(flat)
    }


def _platforms(system: System, q: np.ndarray, p: np.ndarray) -> dict[str, float]:
    """Where planar platforms on the ground's origin go so that all of the mechanism is above and to
    the right of it."""
    model = system.model
    if not model.plane:
        return {}
    here = scene(system, q, p, planar(model.plane))
    points = [here.pose(k).point(x) for k, some in enumerate(here.held[1:]) for x in some]
    flat = np.array([here.view.paper(x) for x in points] or [(0.0, 0.0)]) * [1, -1]
    size = float(np.max(np.ptp(flat, axis=0))) or here.size
    values = dict(zip((c.name for c in model.coordinates), q))
    changes: dict[str, float] = {}
    for joint in model.joints:
        if joint.type == "planar" and all(abs(values[x]) < 1e-9 for x in joint.coordinates[:2]):
            for name, low, room in zip(joint.coordinates, flat.min(axis=0), ROOM):
                changes[name] = float(room * size - low)
    return changes
