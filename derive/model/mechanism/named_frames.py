"""Named frames: those of `frames:`, every body's, every joint's on its child, and the ground's; and
the names of the functions that are asked for of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

from derive.diagnostics import AssumptionError, did_you_mean, listed
from derive.model.document import Key
from derive.model.language.place_entries import FrameEntry
from derive.model.mechanism.placements import rotation
from derive.model.mechanism.space import ORIGIN
from derive.model.mechanism.tree import some_body
from derive.model.reader import Reader
from derive.model.records import GROUND, Model, NamedFrame, Placement

if TYPE_CHECKING:
    from derive.model.language.shape import Document

AXES = ("", "_local", "_world")  # LOCAL_WORLD_ALIGNED, LOCAL and WORLD of Pinocchio
ON_AXES = ("jacobian", "jdot_v", "frame_velocity", "frame_acceleration")
IN_QUASI_VELOCITIES = ("jacobian_w", "jdot_w")
FAMILIES = (
    "pose",
    "pose_quaternion",
    "pose_jacobian",
    *(name + axes for name in (*ON_AXES, *IN_QUASI_VELOCITIES) for axes in AXES),
)
# what `jacobian_…` means already: a frame of such a name could not be asked for
TAKEN = tuple(
    f"jacobian_{rest}" for rest in ("u", "p", "t", "forward", "values", "u_values", "p_values")
)  # fmt: skip


def named_frame(reader: Reader, document: Document, key: Key, entry: FrameEntry) -> NamedFrame:
    """One entry of `frames:`: a body, or the ground, and where the frame sits in it. Position in m
    and turn as of a joint's frame."""
    body = some_body(reader, document, entry.body)
    position = reader.point(entry.position, "a point")
    return NamedFrame(str(key), body, Placement(position, rotation(reader, entry)))


def check_names(reader: Reader, document: Document) -> None:
    """A name of `frames:` is nobody else's, and neither are the names of the functions of the
    frame."""
    others: dict[str, str] = {GROUND: "the ground"}
    others |= {str(key): "a joint" for key in document.joints}
    others |= {str(key): "a body" for key in document.bodies}
    known = {*others, *map(str, document.frames)}
    for key in document.frames:
        name = reader.name(key)
        if name in others:
            problem = f"the frame '{name}' has the name of {others[name]}, which is a frame itself"
            reader.report(key.span, problem, "another name")
            continue
        clash = next(_clashes(name, known), None)
        if clash:
            reader.report(
                key.span, f"the frame '{name}' would make {clash} ambiguous", "another name"
            )


def _clashes(name: str, known: Collection[str]) -> Iterator[str]:
    """The functions of a frame whose names are those of other functions."""
    for family in FAMILIES:
        function = f"{family}_{name}"
        if function in TAKEN or len(readings(function, known)) > 1:
            yield function


def readings(function: str, known: Collection[str]) -> list[tuple[str, str]]:
    """What the name of a function may stand for: (family, frame), of known frames. One at most,
    unless names were chosen as unluckily as `hand` and `local_hand`."""
    split = [(family, function[len(family) + 1 :]) for family in FAMILIES]
    return [
        (family, frame)
        for family, frame in split
        if function not in TAKEN and frame in known and function == f"{family}_{frame}"
    ]


def frames_of(model: Model) -> dict[str, NamedFrame]:
    """Every frame of a model by name. A body and a joint that share a name are one frame where
    their frames are the same, as in URDF; else that name is nobody's frame."""
    result = {GROUND: NamedFrame(GROUND, GROUND, Placement(ORIGIN, None))}
    result |= {body.name: _own(body.name) for body in model.bodies}
    for joint in model.joints:
        frame = NamedFrame(joint.name, joint.child, joint.at_child)
        if joint.name in result and result[joint.name] != frame:
            del result[joint.name]
        else:
            result[joint.name] = frame
    return {**result, **{frame.name: frame for frame in model.frames}}


def frame_named(model: Model, name: str) -> NamedFrame:
    """The frame of that name. Raises AssumptionError with the nearest known one."""
    known = frames_of(model)
    if name not in known:
        if is_shared(model, name):
            raise AssumptionError(*shared_name(model, name))
        hint = did_you_mean(name, known)
        raise AssumptionError(
            f"{model.name} has no frame '{name}'", hint or f"it has {listed(known)}"
        )
    return known[name]


def is_shared(model: Model, name: str) -> bool:
    """Whether a body and a joint with frames of their own have that name, which then is no
    frame's."""
    return name not in frames_of(model) and any(body.name == name for body in model.bodies)


def shared_name(model: Model, name: str) -> tuple[str, str]:
    """What to say of such a name, and what to do."""
    problem = f"'{name}' is a body and a joint of {model.name}, whose frames differ"
    return problem, "name one of them under `frames:`"


def carrier(model: Model, name: str) -> NamedFrame:
    """The frame that a formula means by a name: a body's own before a joint's. Raises
    AssumptionError where there is none."""
    if name == GROUND or any(body.name == name for body in model.bodies):
        return _own(name)
    return frame_named(model, name)


def _own(body: str) -> NamedFrame:
    return NamedFrame(body, body, Placement(ORIGIN, None))
