"""The links and joints of a URDF file by their names, and whether they are a tree."""

from __future__ import annotations

from dataclasses import dataclass, field

from derive.robots.markup import Element
from derive.robots.robot import Body, Joint, Reading, quoted

WORLD = "world"  # a parent that no file has to declare


@dataclass
class Tree:
    """The links and joints of a file by their own names."""

    links: dict[str, Element] = field(default_factory=dict[str, Element])
    joints: dict[str, Element] = field(default_factory=dict[str, Element])
    bodies: dict[str, Body] = field(default_factory=dict[str, Body])
    made: dict[str, Joint] = field(default_factory=dict[str, Joint])


def collect(reading: Reading, root: Element, tree: Tree) -> None:
    """All links and joints by their names; reports those that have none, or one of another."""
    for tag, table in (("link", tree.links), ("joint", tree.joints)):
        for element in root.all(tag):
            name = element.get("name")
            if not name.strip():
                reading.report(element, f"a {tag} without a name", f'<{tag} name="…">')
            elif name in table:
                reading.report(
                    element, f"a second {tag} '{name}'", "names that differ", attribute="name"
                )
            table.setdefault(name, element)
    if not tree.links:
        root.refuse("the robot has no links", '<link name="…">')
    _world(tree)


def _world(tree: Tree) -> None:
    """The link `world` where joints start from it and nothing declares it, as Drake and Gazebo take
    it."""
    parents = [joint.first("parent") for joint in tree.joints.values()]
    found = [parent for parent in parents if parent is not None and parent.get("link") == WORLD]
    if found and WORLD not in tree.links:
        place = found[0]
        tree.links[WORLD] = Element("link", {"name": WORLD}, place.file, place.at)


def _end(reading: Reading, tree: Tree, joint: Element, tag: str) -> str:
    """The parent or child link of a joint; "" after reporting that there is none."""
    end = joint.first(tag)
    if end is None or not end.get("link"):
        reading.report(
            end or joint, f"the joint '{joint.get('name')}' has no {tag}", f'<{tag} link="…"/>'
        )
        return ""
    if end.get("link") not in tree.links:
        reading.unknown(end, "link", "link", list(tree.links))
        return ""
    return end.get("link")


def root_of(reading: Reading, tree: Tree) -> str:
    """The one link that no joint carries; reports what is not a tree."""
    above: dict[str, Element] = {}
    parents: dict[str, str] = {}
    for joint in tree.joints.values():
        parent, child = _end(reading, tree, joint, "parent"), _end(reading, tree, joint, "child")
        if child in above:
            other = above[child].get("name")
            problem = (
                f"a kinematic loop: the link '{child}' is already the child of the joint '{other}'"
            )
            hint = (
                "import the tree without this joint, then close the loop under `closures:` "
                "of the model"
            )
            reading.report(
                joint.first("child") or joint, problem, "one joint per child link", hint, "link"
            )
        elif child:
            above[child], parents[child] = joint, parent
    reading.finish()
    return _only_root(reading, tree, parents)


def _only_root(reading: Reading, tree: Tree, parents: dict[str, str]) -> str:
    roots = [name for name in tree.links if name not in parents]
    for extra in roots[1:]:
        problem = f"the link '{extra}' is not connected to '{roots[0]}': no joint carries it"
        reading.report(
            tree.links[extra],
            problem,
            "one root link; every other is the child of a joint",
            attribute="name",
        )
    for circle in _circles(tree, parents):
        problem = (
            "a kinematic loop without a beginning: "
            f"{' → '.join(quoted(name) for name in [*circle, circle[0]][:10])}"
        )
        reading.report(tree.links[circle[0]], problem, "a tree of links", attribute="name")
    return roots[0] if roots else ""


def _circles(tree: Tree, parents: dict[str, str]) -> list[list[str]]:
    """Links that carry each other in a circle, from parent to child."""
    done: set[str] = set()
    circles: list[list[str]] = []
    for name in tree.links:
        chain: list[str] = []
        while name in parents and name not in done:
            done.add(name)
            chain.append(name)
            name = parents[name]
        if name in chain:
            circles.append(chain[chain.index(name) :][::-1])
    return circles
