"""<replicate>: a part of the tree several times, each copy moved on from the one before, with a
number behind every name; what refers to these names is copied with them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from derive.robots.markup import MOST, Budget, Element
from derive.robots.mjcf.inertia import Frame
from derive.robots.mjcf.settings import Settings
from derive.robots.numbers import scalar, vector
from derive.robots.robot import Reading
from derive.robots.rotations import ORIGIN, from_euler, to_quaternion

Names = dict[str, set[str]]  # by kind
KINDS = {"body": "body", "joint": "joint", "freejoint": "joint", "site": "site", "geom": "geom"}
REFERENCES = {
    "body": "body",
    "body1": "body",
    "body2": "body",
    "joint": "joint",
    "joint1": "joint",
    "joint2": "joint",
    "jointinparent": "joint",
    "site": "site",
    "site1": "site",
    "site2": "site",
    "refsite": "site",
    "cranksite": "site",
    "slidersite": "site",
    "sidesite": "site",
    "geom": "geom",
    "tendon": "tendon",
    "tendon1": "tendon",
    "tendon2": "tendon",
}
SECTIONS = ("tendon", "equality", "actuator")  # tendons are referred to by the others


def replicate(reading: Reading, root: Element, found: Settings, budget: Budget) -> None:
    """Puts <frame>s with copies in the place of every <replicate>, from the inside out."""
    for world in root.all("worldbody"):
        for element in reversed(list(world.walk())):
            if any(child.tag == "replicate" for child in element.children):
                element.children = [
                    one
                    for child in element.children
                    for one in _replaced(reading, root, child, found, budget)
                ]


def _replaced(
    reading: Reading, root: Element, child: Element, found: Settings, budget: Budget
) -> list[Element]:
    if child.tag != "replicate":
        return [child]
    count = scalar(reading, child, "count")
    if count < 1 or count != int(count):
        reading.report(child, "a replicate without a count", '<replicate count="2">')
        return []
    _spend(budget, child, int(count), child.walk())
    suffixes = [f"{child.get('sep')}{k:0{len(str(int(count)))}d}" for k in range(int(count))]
    names = _names(child)
    poses = _poses(reading, child, len(suffixes), found)
    copies = [Element("frame", pose, child.file, child.at) for pose in poses]
    for copy, suffix in zip(copies, suffixes):
        copy.children = [_copied(inside, suffix, names) for inside in child.children]
    for section in (section for tag in SECTIONS for section in root.all(tag)):
        section.children = [
            one
            for element in section.children
            for one in _referring(child, element, suffixes, names, budget)
        ]
    return copies


def _spend(budget: Budget, place: Element, times: int, elements: Iterable[Element]) -> None:
    kinds = [element.tag for element in elements]
    budget.elements -= times * len(kinds)
    budget.bodies -= times * kinds.count("body")
    if min(budget.elements, budget.bodies) < 0:
        place.refuse("so many copies are too large a file", f"at most {MOST} elements in all")


def _names(child: Element) -> Names:
    names: Names = {kind: set() for kind in (*KINDS.values(), "tendon")}
    for element in child.walk():
        if element.tag in KINDS and "name" in element.attributes:
            names[KINDS[element.tag]].add(element.get("name"))
    return names


def _poses(
    reading: Reading, child: Element, count: int, found: Settings
) -> Iterator[dict[str, str]]:
    """Of the frames: turned by k · euler, and moved on by the offset in the frame of the copy
    before."""
    offset, euler = vector(reading, child, "offset"), vector(reading, child, "euler")
    owner = {"childclass": child.get("childclass")} if "childclass" in child.attributes else {}
    at = ORIGIN
    for k in range(count):
        turn = from_euler(found.sequence, [found.angle(k * angle) for angle in euler])
        yield owner | {"pos": _numbers(at), "quat": _numbers(to_quaternion(turn))}
        at = Frame(at, turn).then(offset, turn).at


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(repr, values))


def _referring(
    place: Element, element: Element, suffixes: list[str], names: Names, budget: Budget
) -> list[Element]:
    """The element once for each copy of what it refers to; itself where it refers to none."""
    inside = list(element.walk())
    if not any(one.get(key) in names[kind] for one in inside for key, kind in REFERENCES.items()):
        return [element]
    _spend(budget, place, len(suffixes), inside)
    copies = [_copied(element, suffix, names) for suffix in suffixes]
    if element.tag in ("fixed", "spatial"):
        names["tendon"].add(element.get("name"))
    return copies


def _copied(element: Element, suffix: str, names: Names) -> Element:
    """A copy of the element and all below it, with the suffix behind names and references to
    them."""
    top = _renamed(element, suffix, names)
    waiting = [(element, top)]
    while waiting:
        original, copy = waiting.pop()
        copy.children = [_renamed(child, suffix, names) for child in original.children]
        waiting += zip(original.children, copy.children)
    return top


def _renamed(element: Element, suffix: str, names: Names) -> Element:
    attributes = dict(element.attributes)
    for key, kind in REFERENCES.items():
        if attributes.get(key) in names[kind]:
            attributes[key] += suffix
    if "name" in attributes:
        attributes["name"] += suffix
    return Element(element.tag, attributes, element.file, element.at, [], element.text)
