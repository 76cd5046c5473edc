"""Spring, damper, friction and armature that a joint itself is given."""

from __future__ import annotations

from collections.abc import Sequence

from derive.diagnostics import listed
from derive.model.actuators import velocity_of
from derive.model.document import Scalar
from derive.model.loads.armature import armature_at
from derive.model.loads.damper import damper_at
from derive.model.loads.expression import At
from derive.model.loads.friction import friction_at
from derive.model.loads.spring import ball_spring, is_quaternion, spring_at
from derive.model.mechanism.frames import QUATERNION, Frame, Names
from derive.model.reader import Reader
from derive.model.records import Load


def in_joint(reader: Reader, names: Names, frame: Frame) -> list[Load]:
    """Spring, damper, friction and armature that the joint itself is given, named after it."""
    entry, key = frame.entry, frame.name
    given = [name for name in IN_JOINT if getattr(entry, name) is not None]
    if not given:
        return []
    if frame.orientation and len(frame.velocities) == len("xyz"):
        return _in_ball(reader, frame, given)
    if len(frame.velocities) > 1:
        reader.report(
            key.span,
            f"{given[0]} in the joint '{key}', which has {len(frame.velocities)} velocities",
            _elsewhere(frame, given[0]),
        )
        return []
    if not frame.velocities:
        velocity_of(
            reader, key, At(joint=Scalar(str(key), key.span, True, True)), names.velocities
        )  # says what is wrong
        return []
    return [_in_joint(reader, frame, name) for name in given]


def _in_ball(reader: Reader, frame: Frame, given: Sequence[str]) -> list[Load]:
    """A spring that turns back, and a damper about each axis."""
    key, entry = frame.name, frame.entry
    quaternion = is_quaternion(frame.coordinates, frame.velocities)
    result: list[Load] = []
    for name in given:
        if name == "spring" and entry.spring is not None and quaternion:
            own = frame.coordinates, frame.velocities
            result.append(ball_spring(reader, key, f"{key}_spring", str(key), entry.spring, *own))
        elif name == "damper" and entry.damper is not None:
            about = (f"{key}_damper_{axis}" for axis in "xyz")
            result += [
                damper_at(reader, key, each, entry.damper, velocity)
                for each, velocity in zip(about, frame.velocities)
            ]
        else:
            message = f"{name} in the joint '{key}', which has {len(frame.velocities)} velocities"
            reader.report(key.span, message, _elsewhere(frame, name))
    return result


def _in_joint(reader: Reader, frame: Frame, kind: str) -> Load:
    key, target = frame.name, frame.velocities[0]
    name, given = f"{key}_{kind}", getattr(frame.entry, kind)
    if kind == "spring":
        return spring_at(reader, key, name, given, frame.coordinates[0])
    if kind == "damper":
        return damper_at(reader, key, name, given, target)
    if kind == "friction":
        return friction_at(reader, key, name, given, target)
    return armature_at(reader, key, name, given, target)


def _elsewhere(frame: Frame, kind: str) -> str:
    """What to write where the joint cannot say which of its velocities is meant."""
    rates = [velocity.rate_of for velocity in frame.velocities if velocity.rate_of]
    if rates:
        return f"an entry under loads: {{type: {kind}, coordinate: one of {listed(rates)}}}"
    if kind == "spring" and frame.orientation not in ("", QUATERNION):
        angles = listed(x.name for x in frame.coordinates[-3:])
        return (
            "no `orientation`, for a spring against all turns, or an entry under loads: "
            f"{{type: spring, coordinate: one of {angles}}}"
        )
    if kind == "spring":
        return "a joint with one velocity, or an entry under loads: {type: bushing, …}"
    names = listed(velocity.name for velocity in frame.velocities)
    return f"an entry under loads: {{type: {kind}, velocity: one of {names}}}"


IN_JOINT = ("spring", "damper", "friction", "armature")
