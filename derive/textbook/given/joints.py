"""The joints: their types with their axes, what they connect, where, and with which coordinates."""

from __future__ import annotations

from collections.abc import Callable

from derive.model.records import Joint
from derive.textbook import names
from derive.textbook.given.frames import of_joints, turned
from derive.textbook.given.sentences import called, direction, joined, measured, place
from derive.textbook.manuscript import Manuscript
from derive.textbook.prose import runs
from derive.textbook.records import Math, Runs, Text

# in space; an axis is that of the body that the joint carries, unless it says whose it is
TYPES = {
    "revolute": "revolute about {axis}",
    "prismatic": "prismatic along {axis}",
    "cylindrical": "cylindrical, along and about {axis}",
    "screw": "screw about {axis}, right-handed, advancing by {pitch} a turn",
    "universal": "universal, about {first} of {parent} and {second} of {child}",
    "planar": "planar, normal to {axis}",
    "point": "point, normal to {axis}",
}
IN_PLANE = {"prismatic": TYPES["prismatic"]}  # all others have the normal of the plane


def joints(doc: Manuscript) -> None:
    """The table, and the frames that are turned."""
    model = doc.system.model
    unturned = all(x.at_parent.rotation == x.at_child.rotation for x in model.joints)
    zero = ", and where all coordinates are zero the axes of all are parallel" if unturned else ""
    axes = any("{axis}" in _template(doc, x) for x in model.joints)
    whose = "; axes are given in those of the body that a joint leads to" if axes else ""
    doc.say(f"Joints connect them, from the ground outwards{zero}{whose}:")
    head = ("joint", "type", "from → to", "at, in each body / m", "coordinates")
    doc.listing(head, model.joints, lambda x: _joint(doc, x))
    turned(
        doc,
        "Every joint has a frame in each of its bodies, and where its coordinates are zero the two "
        "agree. These frames are turned in their body:",
        of_joints(model.joints),
    )


def _joint(doc: Manuscript, x: Joint) -> tuple[Runs, ...]:
    places = (place(doc, x.at_parent), Text("; "), place(doc, x.at_child))
    way = Text(names.words(f"{x.parent} → {x.child}"))
    name = Text(names.words(x.name))
    return (name,), _type(doc, x), (way,), places, _coordinates(doc, x)


def _template(doc: Manuscript, x: Joint) -> str:
    """What is said of its type; of one that somebody adds its name."""
    return (IN_PLANE if doc.system.model.plane else TYPES).get(x.type, x.type)


def _type(doc: Manuscript, x: Joint) -> Runs:
    template = _template(doc, x)
    words = {name: word for name, word in WORDS.items() if f"{{{name}}}" in template}
    return runs(template + _turning(x), **{name: word(doc, x) for name, word in words.items()})


def _turning(x: Joint) -> str:
    """How a free joint turns, or a ball joint."""
    if not x.orientation:
        return ""
    if x.orientation == "quaternion":
        return ", turned by a quaternion"
    return f", turning about {', '.join(x.orientation)}"


WORDS: dict[str, Callable[[Manuscript, Joint], str | Math]] = {
    "axis": lambda doc, x: direction(doc, x.axis, x.at_child, f"axis of {x.name}"),
    "first": lambda doc, x: direction(doc, x.axis, x.at_parent, f"axis of {x.name}"),
    "second": lambda doc, x: direction(doc, x.axis2 or x.axis, x.at_child, f"axis of {x.name}"),
    "parent": lambda doc, x: called(x.parent),
    "child": lambda doc, x: called(x.child),
    "pitch": lambda doc, x: measured(doc, x.pitch, x.name, "m"),
}


def _coordinates(doc: Manuscript, x: Joint) -> Runs:
    """Those of the joint; a line may end between them."""
    own: list[Runs] = [
        (Math(doc.notation.latex[symbol]),)
        for symbol, coordinate in zip(doc.q, doc.system.model.coordinates)
        if coordinate.owner == x.name
    ]
    return joined(own, ", ") if own else (Text("none"),)
