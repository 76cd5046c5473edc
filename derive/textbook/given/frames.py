"""Frames that are turned in their bodies: of joints, closures, bushings and wrenches."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca

from derive.expressions.tree import ONE, Call, Expression, Number
from derive.mechanics.scene import IN_PLANE
from derive.model.algebra import Rows, negated
from derive.model.load_records import Bushing, Wrench
from derive.model.mechanism.named_frames import frame_named
from derive.model.records import Closure, Joint, Load, Model, Placement
from derive.textbook.formulas.layout import FEW_DIGITS
from derive.textbook.given.sentences import AXES, called, joined
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Run, Runs, Text

EXACT = 1e-9  # degrees by which an angle of a matrix of numbers may be off


@dataclass(frozen=True)
class Turned:
    """A frame of something by its name, in a body."""

    name: str
    body: str
    at: Placement


def of_joints(joints: Iterable[Joint]) -> list[Turned]:
    """The turned ones of both bodies."""
    return _turned(
        Turned(x.name, body, at)
        for x in joints
        for body, at in ((x.parent, x.at_parent), (x.child, x.at_child))
    )


def of_pairs(pairs: Iterable[Closure | Bushing]) -> list[Turned]:
    """The same of what is between two bodies."""
    return _turned(
        Turned(x.name, body, at) for x in pairs for body, at in zip(x.bodies, x.placements)
    )


def of_loads(model: Model, loads: Iterable[Load]) -> list[Turned]:
    """Of bushings, and of wrenches along the axes of their frame."""
    found = list(loads)
    wrenches = [x for x in found if isinstance(x, Wrench) and x.axes == "frame"]
    frames = [(x.name, frame_named(model, x.frame)) for x in wrenches]
    return [
        *of_pairs(x for x in found if isinstance(x, Bushing)),
        *_turned(Turned(name, frame.body, frame.at) for name, frame in frames),
    ]


def _turned(frames: Iterable[Turned]) -> list[Turned]:
    return [x for x in frames if x.at.rotation is not None]


def turned(doc: Manuscript, what: str, frames: Sequence[Turned]) -> None:
    """A table, where there is any."""
    if frames:
        doc.say(what)
        doc.listing(("of", "in", "turned"), frames, lambda x: _row(doc, x))


def _row(doc: Manuscript, x: Turned) -> tuple[Runs, ...]:
    return (Text(words(x.name)),), (Text(called(x.body)),), _turn(doc, x)


def _turn(doc: Manuscript, x: Turned) -> Runs:
    """By an angle where the axis is one of the body's, else axis by axis."""
    plane = doc.system.model.plane
    turn = _about_an_axis(x.at, plane)
    if turn is None:
        return joined([_axis(doc, x, j) for j in IN_PLANE[plane]], ", ")
    angle, axis = turn
    written = _formula(doc, x, angle) if isinstance(angle, Expression) else _degrees(doc, angle)
    return Text("by "), written, Text("" if plane else f" about {axis}")


def _axis(doc: Manuscript, x: Turned, j: int) -> Runs:
    """Where an axis of the frame points in the body; a line may end between the entries."""
    R, rows = x.at.rotation, IN_PLANE[doc.system.model.plane]
    assert R is not None
    entries: list[Runs] = [(doc.formula(R[i][j], x.name),) for i in rows]
    return Text(f"{AXES[j]} along ("), *joined(entries, ", "), Text(")")


def _about_an_axis(at: Placement, plane: str) -> tuple[Expression | float, str] | None:
    """The angle and the axis of the body, in a plane the only one; None where it is none alone."""
    assert at.rotation is not None
    for k, axis in enumerate(AXES):
        if plane or at.rotation[k][k] == ONE:
            i, j = IN_PLANE[plane][:2] if plane else ((k + 1) % 3, (k + 2) % 3)
            angle = _angle(at.rotation, i, j)
            return None if angle is None else (angle, axis)
    return None


def _angle(R: Rows, i: int, j: int) -> Expression | float | None:
    """By which axis i is turned towards axis j: a formula, or degrees; None where the entries are
    neither."""
    c, s = R[i][i], R[j][i]
    if isinstance(c, Number) and isinstance(s, Number):
        return math.degrees(math.atan2(s.value, c.value))
    if not isinstance(c, Call) or c.function != "cos":
        return None
    angle = c.arguments[0]
    sine = Call("sin", (angle,))
    if s in (sine, negated(sine)):
        return angle if s == sine else negated(angle)
    return None


def _formula(doc: Manuscript, x: Turned, angle: Expression) -> Run:
    """Of parameters; degrees where these are numbers in all formulas."""
    value = ca.SX(doc.system.symbols.scalar(angle))
    if value.is_constant():
        return _degrees(doc, math.degrees(float(value)))
    return doc.formula(angle, x.name)


def _degrees(doc: Manuscript, angle: float) -> Text:
    """With few digits; that 30° come from a sine and a cosine is not rounding."""
    few = f"{angle:.{FEW_DIGITS}g}"
    doc.rounded = doc.rounded or abs(float(few) - angle) > EXACT
    return Text(f"{few}°".replace("-", "−"))
