"""Chapters to pages: contents, a page for every chapter, an index, and all of it on one page to
print."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from markupsafe import Markup

import hamel
from derive.textbook.writing.pages import rendered
from hamel.book.chapter import Chapter, objectives
from hamel.book.topics import TOPICS

CONTENTS, INDEX, PRINT = "index.html", "terms.html", "print.html"
_ANCHOR = re.compile(r'(\bid="|href="#|\bfor="|aria-labelledby=")([^"]*)')
_CHAPTER = re.compile(r'href="(\w+)\.html"')


@dataclass(frozen=True)
class Placed:
    """A chapter in its place: its number, what is new in it, where the rest was met first."""

    number: int
    chapter: Chapter
    new: tuple[str, ...]
    known: Mapping[str, str]

    @property
    def file(self) -> str:
        return f"{self.chapter.name}.html"


def placed(chapters: Sequence[Chapter]) -> list[Placed]:
    """By topic; short models first."""
    order = sorted(chapters, key=lambda one: (one.topic, one.length, one.name))
    first: dict[str, str] = {}
    places: list[Placed] = []
    for number, one in enumerate(order, 1):
        new = tuple(thing for thing in one.things if thing not in first)
        known = {thing: first[thing] for thing in one.things if thing in first}
        first |= dict.fromkeys(new, one.name)
        places.append(Placed(number, one, new, known))
    return places


def pages(title: str, chapters: Sequence[Placed]) -> dict[str, str]:
    """The text of every file."""
    data = {"book": title, "version": hamel.__version__, "parts": _parts(chapters)}
    texts = {
        CONTENTS: rendered("hamel.book/contents.html.j2", title=title, **data),
        INDEX: rendered("hamel.book/terms.html.j2", title="Index", terms=terms(chapters), **data),
    }
    for k, place in enumerate(chapters):
        texts[place.file] = rendered(
            "hamel.book/chapter.html.j2",
            title=f"{place.number}. {place.chapter.title}",
            before=chapters[k - 1] if k else None,
            after=chapters[k + 1] if k + 1 < len(chapters) else None,
            **data,
            **_shown(place, chapters),
        )
    bodies = [(place, Markup(_printed(place, chapters))) for place in chapters]
    texts[PRINT] = rendered(
        "hamel.book/print.html.j2", title=title, bodies=bodies, terms=terms(chapters), **data
    )
    return texts


def terms(chapters: Sequence[Placed]) -> list[tuple[str, list[Placed]]]:
    """The index: things in the order of the alphabet, and the chapters that have them."""
    names = sorted({thing for place in chapters for thing in place.chapter.things})
    return [(name, [x for x in chapters if name in x.chapter.things]) for name in names]


def _parts(chapters: Sequence[Placed]) -> list[tuple[str, str, list[Placed]]]:
    """Topics that have chapters."""
    parts = [
        (topic.title, topic.about, [x for x in chapters if x.chapter.topic == k])
        for k, topic in enumerate(TOPICS)
    ]
    return [part for part in parts if part[2]]


def _shown(place: Placed, chapters: Sequence[Placed]) -> dict[str, object]:
    """What `body.html.j2` is given."""
    one = place.chapter
    numbers = {x.chapter.name: x.number for x in chapters}
    return {
        "place": place,
        "one": one,
        "topic": TOPICS[one.topic],
        "objectives": objectives(one, place.new, place.known),
        "known": [(thing, name, numbers[name]) for thing, name in place.known.items()],
        "figure": Markup(one.figure),
        "derivation": Markup(one.derivation),
        "plot": Markup(one.motion.plot if one.motion else ""),
        "errors": Markup(one.motion.errors if one.motion else ""),
    }


def _printed(place: Placed, chapters: Sequence[Placed]) -> str:
    """The body of a chapter whose anchors are its own among those of all, and whose links stay on
    the one page."""
    body = rendered("hamel.book/body.html.j2", **_shown(place, chapters))
    names = {x.chapter.name for x in chapters}

    def link(match: re.Match[str]) -> str:
        return f'href="#{match[1]}"' if match[1] in names else match[0]

    name = place.chapter.name

    def anchor(match: re.Match[str]) -> str:
        whole = " ".join(f"{name}-{part}" for part in match[2].split())
        return match[1] + whole

    folded = body.replace("<details", "<details open")
    return _CHAPTER.sub(link, _ANCHOR.sub(anchor, folded))
