"""Joints and closures: the tree from the ground, and where its joints sit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from derive.diagnostics import did_you_mean, listed
from derive.expressions.tree import Expression
from derive.joints import CLOSURES, PLANAR_CLOSURES, joint_type
from derive.model.document import Items, Key, Scalar
from derive.model.language.entries import ClosureEntry
from derive.model.language.kind import Bodies
from derive.model.mechanism.axes import axis, axis2, pitch
from derive.model.mechanism.frames import Frame
from derive.model.mechanism.placements import placements
from derive.model.reader import Reader
from derive.model.records import GROUND, Closure, Joint

if TYPE_CHECKING:
    from derive.model.language.shape import Document


def ordered(reader: Reader, document: Document, frames: list[Frame]) -> list[Frame]:
    """The joints, parents before children; reports what is not a tree from the ground."""
    by_child: dict[str, Frame] = {}
    before = len(reader.problems)
    for frame in frames:
        _check_ends(reader, document, frame)
        child = frame.entry.child
        if child.text in by_child:
            other = by_child[child.text].name
            problem = (
                f"'{child.text}' is already the child of the joint '{other}', line "
                f"{other.span.line}"
            )
            reader.report(
                child.span,
                problem,
                "one joint per child",
                "a joint that closes a loop goes under `closures:`",
            )
        by_child.setdefault(child.text, frame)
    for key in document.bodies:
        reader.name(key)
    if len(reader.problems) == before:  # else most of it would be said twice
        _check_bodies(reader, document, by_child)
    return _by_depth(frames, by_child)


def _check_ends(reader: Reader, document: Document, frame: Frame) -> None:
    parent, child = frame.entry.parent, frame.entry.child
    if parent.text != GROUND and parent.text not in document.bodies:
        reader.word(parent, [*document.bodies, GROUND], "body")
    if child.text == GROUND:
        reader.report(child.span, "the ground as a child", f"a body; {GROUND} can only be a parent")
    else:
        reader.word(child, document.bodies, "body")
    if parent.text == child.text:
        reader.report(
            child.span, f"the joint '{frame.name}' joins '{child.text}' to itself", "two bodies"
        )


def _check_bodies(reader: Reader, document: Document, by_child: dict[str, Frame]) -> None:
    grounded = {GROUND}
    for key in document.bodies:
        if key not in by_child:
            hint = f"a {'planar' if reader.space.plane else 'free'} joint lets it move freely"
            reader.report(
                key.span, f"no joint carries the body '{key}'", f"a joint with child: {key}", hint
            )
        elif ring := _ring(key, by_child, grounded):
            joints = ", ".join(f"'{by_child[name].name}'" for name in ring[:8])
            problem = (
                f"the body '{key}' is not connected to the ground: the joints {joints} go in a ring"
            )
            reader.report(
                key.span,
                problem,
                "a chain of joints from the ground",
                "one of them goes under `closures:`",
            )


def _ring(name: str, by_child: dict[str, Frame], grounded: set[str]) -> list[str]:
    """The bodies of the ring that carries a body; [] where the ground does."""
    seen: list[str] = []
    while name in by_child and name not in seen and name not in grounded:
        seen.append(name)
        name = by_child[name].entry.parent.text
    if name in seen:
        return seen[seen.index(name) :]
    grounded |= set(
        seen
    )  # a name that nothing carries is reported for itself, not for those it carries
    return []


def _by_depth(frames: list[Frame], by_child: dict[str, Frame]) -> list[Frame]:
    """The order of the file, but each joint after the one that carries its parent."""
    placed: dict[str, Frame] = {}
    for frame in frames:
        chain: list[Frame] = []
        link: Frame | None = frame
        while link is not None and link.name not in placed and len(chain) < len(frames):
            chain.append(link)
            link = by_child.get(link.entry.parent.text)
        placed |= {x.name: x for x in reversed(chain)}
    return list(placed.values())


def joint(reader: Reader, frame: Frame) -> Joint:
    """Where a joint sits and which way it goes."""
    entry, kind = frame.entry, frame.type.name
    at_parent, at_child = placements(reader, frame.name, entry.at, entry)
    along = axis(reader, frame.name, entry, kind, frame.type.needs_axis)
    return Joint(
        name=str(frame.name),
        type=kind,
        parent=entry.parent.text,
        child=entry.child.text,
        at_parent=at_parent,
        at_child=at_child,
        axis=along,
        coordinates=tuple(coordinate.name for coordinate in frame.coordinates),
        velocities=tuple(velocity.name for velocity in frame.velocities),
        orientation=frame.orientation,
        span=frame.name.span,
        pitch=pitch(reader, frame.name, entry, kind),
        axis2=axis2(reader, frame.name, entry, kind, along),
        limits=_limits(reader, frame),
    )


def _limits(reader: Reader, frame: Frame) -> tuple[Expression, Expression] | None:
    given = frame.entry.limits
    if given is None:
        return None
    if len(frame.coordinates) != 1:
        count = len(frame.coordinates)
        reader.report(
            given.span,
            f"limits of a joint with {count or 'no'} coordinates",
            "a joint with one coordinate",
        )
        return None
    if len(given) != 2:
        reader.report(given.span, f"{len(given)} limits", "two: [lowest, highest]")
        return None
    low, high = (
        reader.formula(limit, "a limit", unit=frame.coordinates[0].unit) for limit in given
    )
    values = [reader.value(limit, scalar) for limit, scalar in zip((low, high), given)]
    if None not in values and values[0] > values[1]:  # type: ignore[operator]
        reader.report(
            given.span,
            f"the lowest limit {values[0]:g} is above the highest {values[1]:g}",
            "[lowest, highest]",
        )
    return low, high


def closure(reader: Reader, document: Document, key: Key, entry: ClosureEntry) -> Closure:
    """A joint that closes a loop."""
    known = PLANAR_CLOSURES if reader.space.plane else CLOSURES
    kind = reader.word(entry.type, known, "type of closure")
    pair, sides = (
        bodies(reader, document, key, entry.between),
        placements(reader, key, entry.at, entry),
    )
    if kind is None:
        return Closure(reader.name(key), "fixed", pair, sides, reader.space.normal, key.span)
    along = axis(reader, key, entry, kind, joint_type(kind).needs_axis)
    return Closure(
        name=reader.name(key),
        type=kind,
        bodies=pair,
        placements=sides,
        axis=along,
        span=key.span,
        axis2=axis2(reader, key, entry, kind, along),
        pitch=pitch(reader, key, entry, kind),
    )


def bodies(reader: Reader, document: Bodies, key: Key, between: Items) -> tuple[str, str]:
    """Two different bodies, one of which may be the ground."""
    if len(between) != 2:
        reader.report(between.span, f"'{key}' is between {len(between)} bodies", "two bodies")
        return GROUND, GROUND
    first, second = (some_body(reader, document, name) for name in between)
    if first == second and first in (*document.bodies, GROUND):
        reader.report(between.span, f"'{key}' is between '{first}' and itself", "two bodies")
    return first, second


def some_body(reader: Reader, document: Bodies, name: Scalar, ground: bool = True) -> str:
    """The name of a body that exists."""
    known = [*document.bodies, GROUND] if ground else list(document.bodies)
    if name.text not in known:
        reader.report(
            name.span, f"unknown body '{name.text}'", listed(known), did_you_mean(name.text, known)
        )
    return name.text
