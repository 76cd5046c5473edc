"""Words of a robot's format: which elements and attributes are known where, so that a slip is told.

A reader looks for what it knows and passes over the rest, so that `<Axis xyz="0 1 0"/>` would leave
a joint with the axis that it has when nothing is said. An unknown word that is near a known one is
therefore refused. Another one may be of another program, or of a later version of the format: it is
noted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import SequenceMatcher

from derive.diagnostics import SEPARATORS, listed, nearest
from derive.robots.limits import MOST_UNKNOWN, SLIP
from derive.robots.markup import Element
from derive.robots.robot import Reading

OF_XML = ("xmlns", "xml:", "xsi:")  # how attributes begin that are XML's own


@dataclass(eq=False)
class Words:
    """What an element may have: attributes, and elements with their own words, or None where nobody
    looks inside. `once`: elements of which there is one at most."""

    attributes: frozenset[str]
    elements: dict[str, Words | None]
    once: frozenset[str]


def words(
    attributes: str = "",
    elements: Mapping[str, Words | None] | None = None,
    once: str = "",
    closed: str = "",
) -> Words:
    """Words of names with spaces between them; `closed` names elements that nobody looks into."""
    inside = dict(elements or {}) | dict.fromkeys(closed.split())
    return Words(frozenset(attributes.split()), inside, frozenset(once.split()))


@dataclass
class _Check:
    reading: Reading
    unread: dict[str, None] = field(default_factory=dict[str, None])
    near: dict[tuple[int, str], str] = field(default_factory=dict[tuple[int, str], str])

    def meant(self, name: str, known: Mapping[str, object] | frozenset[str]) -> str:
        """The known word that was meant by an unknown one; "" where none is near."""
        key = id(known), name
        if key not in self.near:
            compared = len(self.near) < MOST_UNKNOWN and ":" not in name
            self.near[key] = _meant(name, sorted(known)) if compared else ""
        return self.near[key]


def unread_words(reading: Reading, root: Element, known: Words) -> list[str]:
    """What is unknown in an element and below, once for each kind; slips and what stands there
    twice are reported."""
    check = _Check(reading)
    waiting: list[tuple[Element, Words]] = [(root, known)]
    while waiting:
        element, its = waiting.pop()
        _attributes(check, element, its)
        _once(check, element, its)
        for child in reversed(element.children):
            if child.tag not in its.elements:
                _unknown(check, child, element, its)
            elif (inner := its.elements[child.tag]) is not None:
                waiting.append((child, inner))
    return list(check.unread)


def _attributes(check: _Check, element: Element, its: Words) -> None:
    for name in element.attributes:
        if name in its.attributes or name.startswith(OF_XML):
            continue
        if meant := check.meant(name, its.attributes):
            check.reading.problems.append(
                element.slip(
                    name,
                    f"unknown attribute '{name}' of <{element.tag}>",
                    listed(sorted(its.attributes)),
                    f"did you mean '{meant}'?",
                )
            )
        else:
            check.unread[f"'{name}' of <{element.tag}>"] = None


def _unknown(check: _Check, child: Element, parent: Element, its: Words) -> None:
    if meant := check.meant(child.tag, its.elements):
        check.reading.report(
            child,
            f"unknown element <{child.tag}> in <{parent.tag}>",
            listed(f"<{tag}>" for tag in sorted(its.elements)),
            f"did you mean <{meant}>?",
        )
    else:
        where = "" if parent.tag == "robot" else f" in <{parent.tag}>"
        check.unread[f"<{child.tag}>{where}"] = None


def _once(check: _Check, element: Element, its: Words) -> None:
    first: dict[str, Element] = {}
    for child in element.children if its.once else ():
        if child.tag in its.once and first.setdefault(child.tag, child) is not child:
            there = first[child.tag].diagnostic("")
            place = f"line {there.line}" if there.file == child.file.name else there.file
            name = f" '{element.get('name')}'" if element.get("name") else ""
            problem = f"a second <{child.tag}> in the <{element.tag}>{name}"
            check.reading.report(child, problem, "one", f"the first is in {place}")


def _meant(name: str, known: list[str]) -> str:
    """The nearest known word, where so much of it is the same, or it has the same letters. Names of
    more parts, such as `gear_velocity`, are of something else."""
    near = nearest(name, known)
    if near is None:
        return ""
    its, of_near = name.lower(), near.lower()
    if sorted(its.translate(SEPARATORS)) == sorted(of_near.translate(SEPARATORS)):
        return near
    alike = SequenceMatcher(None, its, of_near).ratio() >= SLIP
    return near if alike and its.count("_") == of_near.count("_") else ""
