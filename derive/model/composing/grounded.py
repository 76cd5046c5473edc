"""What a part says of its ground by leaving it out, written out: the part's ground may be a body of
the whole, and what is left out there means that."""

from __future__ import annotations

from collections.abc import Iterator

from derive.expressions import tree
from derive.model.document import Entries, Key, Node, Scalar, Source
from derive.model.records import GROUND

# functions whose last argument is what they are seen from
SEEN = (
    *("position", "velocity", "acceleration", "direction", "orientation", "angle"),
    *("angular_velocity", "angular_acceleration"),
)
ALONG_AXES = ("direction", "angle")  # whose second argument may be a letter
COMPONENTS = {"force": "frame", "torque": "frame", "wrench": "axes"}
SURFACES = ("rolling", "point_on_surface", "contact")


def grounded(part: Entries, source: Source) -> Entries:
    """The part with `of`, `frame` and `axes` where loads and constraints say nothing. Raises
    ModelError at a `no_slip`, which is on the ground of the whole alone."""
    changed = {
        key: Entries({k: _entry(given.key(k), v, source) for k, v in given.items()}, given.span)
        for key, given in part.items()
        if key in ("loads", "constraints") and isinstance(given, Entries)
    }
    return Entries({**part, **changed}, part.span)


def _entry(key: Key, node: Node, source: Source) -> Node:
    kind = node.get("type") if isinstance(node, Entries) else None
    if not isinstance(node, Entries) or not isinstance(kind, Scalar):
        return node
    if kind.text == "no_slip":
        source.refuse(
            key.span,
            "a no_slip in a part whose ground is a body",
            "nonholonomic: dot(velocity(BODY, POINT), direction(BODY, y)), or a part on the ground",
        )
    if kind.text in COMPONENTS:
        return _with(node, COMPONENTS[kind.text], kind)
    if kind.text not in SURFACES:
        return node
    plane = node.get("plane")
    if isinstance(plane, Entries):
        return Entries({**node, "plane": _with(plane, "of", kind)}, node.span)
    return _with(node, "of", kind)


def _with(node: Entries, name: str, near: Scalar) -> Entries:
    if name in node:
        return node
    ground = Scalar(GROUND, near.span, False, True)
    return Entries({**node, Key(name, near.span): ground}, node.span)


def unsaid(text: str, formula: tree.Expression) -> Iterator[int]:
    """Where in a formula `, ground` is to be added: before the brackets of functions that leave out
    what they are seen from."""
    for node in tree.walk(formula):
        if isinstance(node, tree.Call) and node.function in SEEN and not _is_seen_from(node):
            yield _end(text, node.at)


def _is_seen_from(call: tree.Call) -> bool:
    """Whether a name of a frame stands behind the first one."""
    letters = tuple("xyz") if call.function in ALONG_AXES else ()
    return any(
        isinstance(argument, tree.Name) and argument.name not in letters
        for argument in call.arguments[1:]
    )


def _end(text: str, at: int) -> int:
    """The bracket that closes the first one from there on."""
    depth = 0
    for place in range(text.index("(", at), len(text)):
        depth += {"(": 1, ")": -1}.get(text[place], 0)
        if not depth:
            return place
    return len(text)
