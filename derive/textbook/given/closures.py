"""What a closure does, by its kind: whether points meet, and along or about which axis the bodies
move against each other."""

from __future__ import annotations

from collections.abc import Callable

from derive.joints import joint_type
from derive.model.records import Closure
from derive.textbook.given.sentences import called, direction, measured, place
from derive.textbook.manuscript import Manuscript
from derive.textbook.prose import runs
from derive.textbook.records import Math, Runs

MEET = "the points of {one} at {first} and of {other} at {second} meet"
AXIS = "through {first} along {axis} in {one}, through {second} along {axis_there} in {other}"
NORMAL = (
    "through {first} normal to {axis} in {one}, through {second} normal to {axis_there} in {other}"
)
SENTENCES = {
    "fixed": f"weld: {MEET}, and {{parallel}}",
    "revolute": f"hinge: {MEET}, and the bodies turn about one axis: along {{axis}} in {{one}}, "
    "along {axis_there} in {other}",
    "ball": f"{MEET}, and the bodies turn freely against each other",
    "prismatic": f"the bodies slide along one line: {AXIS}; {{parallel}}",
    "cylindrical": f"the bodies slide along one axis and turn about it: {AXIS}",
    "screw": "the bodies turn about one axis and advance along it by {pitch} a turn, as a "
    f"right-hand screw: {AXIS}",
    "planar": f"the bodies slide and turn in one plane: {NORMAL}",
    "universal": f"{MEET}, and the axis {{axis}} of {{one}} stays at right angles to the axis "
    "{second_axis} of {other}",
}
IN_PLANE = {"revolute": f"hinge: {MEET}"}
ANY = "{about}, between {one} at {first} and {other} at {second}"  # of a kind that somebody adds


def closure(doc: Manuscript, x: Closure) -> Runs:
    """What it does; points and axes are in the axes of their body."""
    known = SENTENCES | (IN_PLANE if doc.system.model.plane else {})
    template = known.get(x.type, ANY)
    words = {name: word for name, word in WORDS.items() if f"{{{name}}}" in template}
    return runs(template, **{name: word(doc, x) for name, word in words.items()})


def _parallel(doc: Manuscript, x: Closure) -> str:
    """What keeps the bodies from turning: axes of their own, or those of frames in them."""
    first, second = (at.rotation for at in x.placements)
    if first == second:
        return "their axes stay parallel"
    return "the axes of its frame in one stay parallel to those of its frame in the other"


WORDS: dict[str, Callable[[Manuscript, Closure], str | Math]] = {
    "about": lambda doc, x: joint_type(x.type).about,
    "one": lambda doc, x: called(x.bodies[0]),
    "other": lambda doc, x: called(x.bodies[1]),
    "first": lambda doc, x: place(doc, x.placements[0]),
    "second": lambda doc, x: place(doc, x.placements[1]),
    "axis": lambda doc, x: direction(doc, x.axis, x.placements[0], x.name),
    "axis_there": lambda doc, x: direction(doc, x.axis, x.placements[1], x.name),
    "second_axis": lambda doc, x: direction(doc, x.axis2 or x.axis, x.placements[1], x.name),
    "parallel": _parallel,
    "pitch": lambda doc, x: measured(doc, x.pitch, x.name, "m"),
}
