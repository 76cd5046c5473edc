"""Where a model belongs: topics in the order in which they are learned, and the things that a model
is made of, by the names that readers look up."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from derive.model.constraint_records import Nonholonomic, NoSlip, Rolling
from derive.model.records import Model


@dataclass(frozen=True)
class Topic:
    """`holds` says whether a model belongs to it, of those that belong to no later one."""

    title: str
    about: str
    holds: Callable[[Model], bool]


def _has(*kinds: type) -> Callable[[Model], bool]:
    return lambda model: any(isinstance(x, kinds) for x in model.constraints)


TOPICS = (
    Topic(
        "Energies and coordinates",
        "The kinetic and the potential energy are given; there is nothing to assemble.",
        lambda model: not model.joints,
    ),
    Topic(
        "Open chains",
        "Links from base to tip: every joint rate is free.",
        lambda model: bool(model.joints),
    ),
    Topic(
        "Closed loops and couplings",
        "Position constraints tie coordinates together; fewer quasi-velocities than rates remain.",
        lambda model: bool(model.joints) and bool(model.closures or model.constraints),
    ),
    Topic(
        "Skates and wheels",
        "Constraints on velocities that no constraint on positions gives.",
        lambda model: bool(model.joints) and _has(NoSlip, Nonholonomic)(model),
    ),
    Topic(
        "Rolling in space",
        "Wheels, tyres and balls on the ground: contacts that wander over the body.",
        _has(Rolling),
    ),
)


def topic_of(model: Model) -> int:
    """The place of the last topic that the model belongs to."""
    return max(k for k, topic in enumerate(TOPICS) if topic.holds(model))


def length_of(model: Model) -> int:
    """How much there is to say of a model: short ones come first."""
    lines = [line.split("#")[0].strip() for line in model.text.splitlines()]
    return sum(len(line) for line in lines)


def things_of(model: Model) -> tuple[str, ...]:
    """Joints, closures, constraints, loads and the rest, by the words of the index."""
    things = [f"{joint.type} joint" for joint in model.joints]
    things += [f"{closure.type} joint as closure" for closure in model.closures]
    things += [f"{_words(x)} constraint" for x in model.constraints]
    things += [_words(x) for x in model.loads]
    parts = {
        "energies by formula": bool(model.kinetic or model.potential),
        "first-order states": bool(model.states),
        "steady motion": bool(model.steady_motions),
        "input": bool(model.inputs),
        "output": bool(model.outputs),
        "event": bool(model.events),
        "published values": bool(model.published),
    }
    things += [name for name, there in parts.items() if there]
    return tuple(dict.fromkeys(things))


def _words(thing: object) -> str:
    """The name of a record's class as words."""
    return re.sub(r"(?<!^)(?=[A-Z])", " ", type(thing).__name__).lower()
