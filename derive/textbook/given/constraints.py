"""What a constraint of the model says, in a sentence each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from derive.expressions.tree import ZERO
from derive.model.constraint_records import (
    Distance,
    Holonomic,
    Nonholonomic,
    NoSlip,
    OnSurface,
    Rolling,
)
from derive.textbook.given.sentences import (
    UNREADABLE,
    called,
    coordinate,
    joined,
    listed,
    measured,
    point,
)
from derive.textbook.given.surfaces import shape, surface, touched
from derive.textbook.manuscript import Manuscript
from derive.textbook.prose import runs
from derive.textbook.records import Math, Runs, Text


def constraint(doc: Manuscript, x: Any) -> Runs:
    """What a constraint says; one without a sentence of its own is listed."""
    write = CONSTRAINTS.get(x.__class__, listed)
    return write(doc, x)


def _no_slip(doc: Manuscript, x: NoSlip) -> Runs:
    return runs(
        "the point of {body} at {point} has no velocity along its direction {direction}",
        body=called(x.body),
        point=point(doc, x.point, x.name),
        direction=point(doc, x.direction, x.name),
    )


def _rolling(doc: Manuscript, x: Rolling) -> Runs:
    return (
        *shape(doc, x, x.tube),
        Text(" rolls without slip on "),
        *touched(doc, x),
    )


def _on_surface(doc: Manuscript, x: OnSurface) -> Runs:
    start = runs(
        "the point of {body} at {point} stays on ",
        body=called(x.body),
        point=point(doc, x.point, x.name),
    )
    return start + surface(doc, x.surface, x.frame_body)


def _formula(doc: Manuscript, x: Holonomic | Nonholonomic) -> Runs:
    zero = (doc.formula(x.expression, x.name), Math("=0"))
    own = _own_forces(doc, x)
    return (*zero, Text("; the constraint does work of its own: "), *own) if own else zero


def _own_forces(doc: Manuscript, x: Holonomic | Nonholonomic) -> Runs:
    """Of a constraint that is not ideal: a generalised force for each coordinate."""
    own = [
        (doc.formula(force, x.name), along.name)
        for force, along in zip(x.nonideal, doc.system.model.coordinates)
        if force != ZERO
    ]
    if UNREADABLE in [force for force, _ in own]:
        return (Text("its forces are too long to be read here"),)
    return joined(
        [
            runs(
                "the generalised force {force} along {coordinate}",
                force=force,
                coordinate=coordinate(doc, name),
            )
            for force, name in own
        ],
        ", ",
    )


def _distance(doc: Manuscript, x: Distance) -> Runs:
    first, second = (point(doc, entries, x.name) for entries in x.points)
    return runs(
        "the points of {one} at {first} and of {other} at {second} stay apart by {length}",
        one=called(x.bodies[0]),
        first=first,
        other=called(x.bodies[1]),
        second=second,
        length=measured(doc, x.length, x.name, "m"),
    )


CONSTRAINTS: dict[type[Any], Callable[[Manuscript, Any], Runs]] = {
    NoSlip: _no_slip,
    Rolling: _rolling,
    OnSurface: _on_surface,
    Holonomic: _formula,
    Nonholonomic: _formula,
    Distance: _distance,
}
