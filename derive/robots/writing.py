"""Robot → the text of a model, with the element that every line was made from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from derive.robots.markup import Element
from derive.robots.naming import model_name
from derive.robots.numbers import written
from derive.robots.parameters import MOMENTS
from derive.robots.robot import Body, Closure, Entry, Joint, Robot
from derive.robots.rotations import ORIGIN, Matrix, is_identity, to_rpy, whole_degrees

WIDEST = 32  # names longer than this are not aligned to
LINE = 118  # of comments at the head
Line = tuple[str, Element | None]


@dataclass(frozen=True)
class Written:
    """`origins[i]` is what line i + 1 was made from."""

    text: str
    origins: tuple[Element | None, ...]


def text_of(robot: Robot, source: str) -> Written:
    """The model file; `source` is the name of the file it was made from."""
    lines = [*_head(robot, source), *_sections(robot)]
    return Written("".join(f"{line}\n" for line, _ in lines), tuple(origin for _, origin in lines))


def _head(robot: Robot, source: str) -> list[Line]:
    said = [
        f"Made from {_one_line(source)} ({robot.kind}) by `hamel import`; numbers without a "
        "unit are in SI units."
    ]
    said += [f"- {note}" for note in (*robot.changed, *robot.assumed)] + [
        f"- LEFT OUT: {note}" for note in robot.left_out
    ]
    comments: list[Line] = [
        (f"# {part}", None) for sentence in said for part in _wrapped(_one_line(sentence))
    ]
    gravity = ", ".join(written(g) for g in robot.gravity)
    head: list[Line] = [(f"model: {model_name(robot.name)}", robot.root)]
    return comments + head + ([(f"gravity: [{gravity}]", robot.root)] if any(robot.gravity) else [])


def _wrapped(sentence: str) -> list[str]:
    lines, indent = [""], "  " if sentence.startswith("- ") else ""
    for word in sentence.split(" "):
        if lines[-1].strip() and len(lines[-1]) + 1 + len(word) > LINE:
            lines.append(indent + word)
        else:
            lines[-1] += f" {word}" if lines[-1].strip() else word
    return lines


def _sections(robot: Robot) -> list[Line]:
    lines = _entries("parameters", robot.parameters)
    lines += _section(
        "bodies", [(body.name, _body(body), body.notes, body.place) for body in robot.bodies]
    )
    lines += _section(
        "joints", [(joint.name, _joint(joint), joint.notes, joint.place) for joint in robot.joints]
    )
    lines += _section(
        "closures",
        [(closure.name, _closure(closure), [], closure.place) for closure in robot.closures],
    )
    lines += _entries("paths", robot.paths)
    lines += _entries("constraints", robot.constraints)
    lines += _entries("frames", robot.frames)
    lines += (
        _entries("loads", robot.loads)
        + _entries("inputs", robot.inputs)
        + _entries("states", robot.states)
        + _entries("initial", robot.initial)
    )
    return lines


def _entries(title: str, entries: Iterable[Entry]) -> list[Line]:
    return _section(title, [(e.name, e.text, [e.note] if e.note else [], e.place) for e in entries])


def _section(title: str, rows: Sequence[tuple[str, str, Sequence[str], Element]]) -> list[Line]:
    if not rows:
        return []
    width = max((len(name) for name, *_ in rows if len(name) <= WIDEST), default=0) + 1
    lines: list[Line] = [("", None), (f"{title}:", None)]
    for name, text, notes, place in rows:
        comment = f"  # {_one_line('; '.join(notes))}" if notes else ""
        lines.append((f"  {f'{name}:':<{width}} {text}{comment}", place))
    return lines


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _body(body: Body) -> str:
    if not body.mass and not any(body.inertia) and not body.symbols:
        return "{mass: 0}"
    parts = [f"mass: {body.symbols.get('m') or written(body.mass) + ' kg'}"]
    first = body.first_moment
    kind, key, place = ("c", "com", body.com) if first is None else ("h", "first_moment", first)
    words = [body.symbols.get(f"{kind}_{x}") or written(value) for x, value in zip("xyz", place)]
    if any(word != "0" for word in words):
        parts.append(f"{key}: [{', '.join(words)}]")
    if any(body.inertia):
        entries = zip(MOMENTS, body.inertia if any(body.inertia[3:]) else body.inertia[:3])
        moments = [body.symbols.get(f"I_{x}") or written(value) for x, value in entries]
        tensor = f"[{', '.join(moments)}]"
        parts.append(
            f"inertia: {tensor}"
            if first is None
            else f"inertia: {{tensor: {tensor}, about: origin}}"
        )
    if not body.physical:
        parts.append("physical: false")
    return _braced(parts)


def _joint(joint: Joint) -> str:
    parts = [
        f"type: {joint.type}",
        f"parent: {joint.parent}",
        f"child: {joint.child}",
        *_placed(joint),
    ]
    if joint.axis is not None:
        parts.append(f"axis: {_axis(joint.axis)}")
    if joint.type == "free":
        parts.append("orientation: quaternion")
    if joint.limits:
        parts.append(f"limits: {_vector(joint.limits)}")
    if joint.spring:
        stiffness, rest = (written(x) for x in joint.spring)
        parts.append(
            f"spring: {{stiffness: {stiffness}{f', rest: {rest}' if joint.spring[1] else ''}}}"
        )
    if joint.damper:
        parts.append(f"damper: {written(joint.damper)}")
    if joint.coulomb:
        parts.append(
            f"friction: {{coulomb: {written(joint.coulomb)}, "
            f"smoothing: {written(joint.smoothing)}}}"
        )
    if joint.armature:
        parts.append(f"armature: {written(joint.armature)}")
    return _braced(parts)


def _placed(joint: Joint) -> list[str]:
    """Where the joint's frame sits in parent and child."""
    turned, turned_child = _turned(joint.rpy, joint.rotation), _turned(None, joint.rotation_child)
    if turned_child:
        sides = (("parent", joint.at, turned), ("child", joint.at_child, turned_child))
        placed = (
            f"{side}: {_braced([f'position: {_vector(at)}', *turn])}" for side, at, turn in sides
        )
        return [f"at: {_braced(list(placed))}"]
    if joint.at_child != ORIGIN:
        return [f"at: [{_vector(joint.at)}, {_vector(joint.at_child)}]", *turned]
    return ([f"at: {_vector(joint.at)}"] if joint.at != ORIGIN else []) + turned


def frame_text(body: str, position: Sequence[float], rotation: Matrix) -> str:
    """An entry of `frames:`."""
    placed = [f"position: {_vector(position)}"] if any(position) else []
    return _braced([f"body: {body}", *placed, *_turned(None, rotation)])


def _closure(closure: Closure) -> str:
    first, second = closure.at
    parts = [
        f"type: {closure.type}",
        f"between: [{', '.join(closure.between)}]",
        f"at: [{_vector(first)}, {_vector(second)}]",
    ]
    return _braced([*parts, *_turned(None, closure.rotation)])


def _turned(rpy: Sequence[float] | None, rotation: Matrix) -> list[str]:
    """`rpy:` as the file gives it or as the rotation has it; nothing where nothing turns."""
    if rpy is None:
        rpy = ORIGIN if is_identity(rotation) else to_rpy(rotation)
    angles = [_angle(angle) for angle in rpy]
    return [] if all(angle == "0" for angle in angles) else [f"rpy: [{', '.join(angles)}]"]


def _angle(angle: float) -> str:
    degrees = whole_degrees(angle)
    if degrees is None:
        return written(angle)
    turned = degrees - 360 * ((degrees + 179) // 360)  # between −179 and 180
    return f"{turned} deg" if turned else "0"


def _axis(axis: Sequence[float]) -> str:
    for letter, sign in (
        ("x", 1.0),
        ("y", 1.0),
        ("z", 1.0),
        ("-x", -1.0),
        ("-y", -1.0),
        ("-z", -1.0),
    ):
        if list(axis) == [sign if letter.endswith(c) else 0.0 for c in "xyz"]:
            return letter
    return _vector(axis)


def _vector(numbers: Iterable[float]) -> str:
    return f"[{', '.join(written(x) for x in numbers)}]"


def _braced(parts: Sequence[str]) -> str:
    return f"{{{', '.join(parts)}}}"
