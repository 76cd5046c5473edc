"""XML text → elements with places, read safely: no document type (and so no entities), bounded
size, depth and count.

expat is driven directly because the ready-made trees keep no places; the tree is walked and built
without recursion.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat
from xml.parsers.expat import errors as codes

from derive.diagnostics import Diagnostic, ModelError
from derive.model.document import content
from derive.robots.limits import MOST_BODIES

LARGEST = 64 << 20  # bytes
DEEPEST = MOST_BODIES + 100  # levels; a chain of bodies is one level per body in MJCF
MOST = 500_000  # elements; the largest robot that is allowed has a tenth of that
MOST_SHOWN = 80  # characters of a tag in a message
ROOTS = ("robot", "mujoco", "mujocoinclude")  # what a robot, or a part of one, starts with
_DECLARATION = re.compile(rb"""\s*<\?xml[^>]*\bencoding\s*=\s*["']([^"']*)["']""")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=]+)\s*=\s*("[^"]*"|'[^']*')""")
_UTF8 = frozenset({"utf-8", "utf8", "us-ascii", "ascii"})


@dataclass(frozen=True)
class File:
    """The text of an XML file, and messages that point into it."""

    name: str
    content: bytes  # UTF-8
    folder: Path

    def line(self, number: int) -> str:
        """The text of a line, counted from one; empty where there is none. Bytes that are not UTF-8
        are shown as replacement characters."""
        lines = self.content.splitlines()
        return lines[number - 1].decode("utf-8", "replace") if 0 < number <= len(lines) else ""

    def diagnostic(
        self, at: int, length: int, message: str, expected: str = "", hint: str = ""
    ) -> Diagnostic:
        """A message about the `length` bytes from offset `at`."""
        number = bisect_right(self._starts, at)
        start, text = self._starts[number - 1], self._text(number)
        before = at - start
        if not text.isascii():
            before = len(self.content[start:at].decode("utf-8", "replace"))
        return Diagnostic(self.name, number, before + 1, length, message, expected, hint, text)

    @cached_property
    def _starts(self) -> list[int]:
        """Offsets of the lines."""
        return [0, *(match.end() for match in re.finditer(b"\n", self.content))]

    @cached_property
    def _texts(self) -> dict[int, str]:
        return {}

    def _text(self, number: int) -> str:
        """A line, the same object whenever it is asked for: a robot may stand on one line of
        megabytes, and everything be wrong with it."""
        if number not in self._texts:
            start, *rest = self._starts[number - 1 : number + 1]
            line = self.content[start : rest[0] - 1 if rest else len(self.content)]
            self._texts[number] = line.decode("utf-8", "replace").rstrip("\r")
        return self._texts[number]


@dataclass
class Budget:
    """What may still be read of a robot, over all the files that it includes."""

    bytes: int = LARGEST
    elements: int = MOST
    bodies: int = MOST_BODIES


@dataclass(eq=False)
class Element:
    """An element with its attributes as text. `at` is the offset of its `<`."""

    tag: str
    attributes: dict[str, str]
    file: File
    at: int
    children: list[Element] = field(default_factory=lambda: [])
    text: str = ""

    def get(self, name: str, otherwise: str = "") -> str:
        """The attribute as text, or `otherwise`: whether it is a number is for the readers to
        check."""
        return self.attributes.get(name, otherwise)

    def all(self, *tags: str) -> list[Element]:
        """The children of these kinds, in the order of the file."""
        return [child for child in self.children if child.tag in tags]

    def first(self, tag: str) -> Element | None:
        """The first child with that tag, or None; further ones are for the caller to judge."""
        return next((child for child in self.children if child.tag == tag), None)

    def walk(self) -> Iterator[Element]:
        """The element and all below it, in the order of the file."""
        waiting: list[Element] = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))

    def diagnostic(
        self, message: str, expected: str = "", hint: str = "", attribute: str = ""
    ) -> Diagnostic:
        """A message about the element, or about one of its attributes."""
        at, length = self._place(attribute)
        return self.file.diagnostic(at, length, message, expected, hint)

    def refuse(
        self, message: str, expected: str = "", hint: str = "", attribute: str = ""
    ) -> NoReturn:
        """Raises ModelError at the element, or at one of its attributes."""
        raise ModelError(self.diagnostic(message, expected, hint, attribute))

    def slip(self, attribute: str, message: str, expected: str, hint: str) -> Diagnostic:
        """A message about the name of an attribute, not its value."""
        match = self._match(attribute)
        at, length = (match.start(1), len(attribute)) if match else self._place("")
        return self.file.diagnostic(at, length, message, expected, hint)

    def _place(self, attribute: str) -> tuple[int, int]:
        """Offset and length of the attribute's value; of the tag where there is none."""
        if match := self._match(attribute):
            return match.start(2) + 1, max(1, len(match[2].decode("utf-8", "replace")) - 2)
        return self.at, len(self.tag) + 1

    def _match(self, attribute: str) -> re.Match[bytes] | None:
        """An attribute where it stands in the file: its name and, in quotes, its value."""
        position = self.at + 1 + len(self.tag.encode())
        while attribute and (match := _ATTRIBUTE.match(self.file.content, position)):
            if match[1].decode("utf-8", "replace") == attribute:
                return match
            position = match.end()
        return None


def read(path: str | PathLike[str]) -> File:
    """The content of a file; ModelError where it cannot be had as UTF-8 text."""
    name = str(path)
    text = content(path, LARGEST)
    if len(text) > LARGEST:
        raise ModelError(
            Diagnostic(
                name, message="the file is too large", expected=f"at most {LARGEST >> 20} MiB"
            )
        )
    return as_file(text, name, Path(path).parent)


def as_file(content: bytes, name: str, folder: Path) -> File:
    """Content in memory as a File; ModelError where it is not UTF-8."""
    file = File(name, content.removeprefix(b"\xef\xbb\xbf"), folder)
    try:
        file.content.decode("utf-8")
    except UnicodeDecodeError as error:
        problem = "the file is not UTF-8 text"
        raise ModelError(
            unquoted(file.diagnostic(error.start, 1, problem, "text saved as UTF-8"))
        ) from None
    declared = _DECLARATION.match(file.content)
    if (
        declared
        and declared[1].decode("utf-8", "replace").lower() not in _UTF8
        and not file.content.isascii()
    ):
        problem = f"the file says that it is {declared[1].decode()!r} text"
        raise ModelError(
            file.diagnostic(declared.start(1), len(declared[1]), problem, "text saved as UTF-8")
        )
    return file


def parsed(file: File, budget: Budget | None = None) -> Element:
    """The root element of a file; what it needs is taken from the budget before it is built."""
    if not file.content.strip():
        raise ModelError(
            Diagnostic(file.name, message="the file is empty", expected="a URDF or MJCF robot")
        )
    builder = _Builder(file, budget or Budget())
    try:
        builder.parser.Parse(file.content, True)
    except expat.ExpatError as error:
        _refuse_syntax(file, error, builder)
    assert builder.root is not None  # expat refuses a text without elements
    return builder.root


def _refuse_syntax(file: File, error: expat.ExpatError, builder: _Builder) -> NoReturn:
    """The line and what is in it are shown of a robot, not of another file."""
    problem = codes.messages[error.code]
    start = sum(len(line) for line in file.content.splitlines(keepends=True)[: error.lineno - 1])
    at = min(start + error.offset, len(file.content))
    if not file.content.lstrip().startswith(b"<"):
        expected = "a URDF or MJCF robot, which starts with `<`"
        raise ModelError(unquoted(file.diagnostic(at, 1, "the file is not XML", expected)))
    if not builder.is_robot:
        raise ModelError(unquoted(file.diagnostic(at, 1, f"not valid XML: {problem}")))
    problem, expected = _explained(problem, builder.open)
    raise ModelError(file.diagnostic(at, 1, f"not valid XML: {problem}", expected))


def _explained(problem: str, unclosed: Sequence[Element]) -> tuple[str, str]:
    """What expat found wrong, and what was expected of the elements that were not closed."""
    if problem == codes.XML_ERROR_UNCLOSED_TOKEN:
        return "the file ends in what starts here", "the rest of the file"
    if not unclosed or problem not in (codes.XML_ERROR_NO_ELEMENTS, codes.XML_ERROR_TAG_MISMATCH):
        return problem, ""
    inner = unclosed[-1]
    tag, line = inner.tag[:MOST_SHOWN], inner.diagnostic("").line
    if problem == codes.XML_ERROR_NO_ELEMENTS:
        problem = f"the file ends inside <{tag}>"
    return problem, f"</{tag}>, the end of the <{tag}> of line {line}"


def unquoted(problem: Diagnostic) -> Diagnostic:
    """Without the line of the file: a file that is no robot is nobody's to show."""
    return replace(problem, source_line="")


class _Builder:
    """Elements from expat's calls."""

    def __init__(self, file: File, budget: Budget) -> None:
        self.file, self.budget = file, budget
        self.root: Element | None = None
        self.open: list[Element] = []
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.StartDoctypeDeclHandler = self.document_type
        self.parser.EntityDeclHandler = self.document_type

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins. Raises ModelError where the file is nested too deeply, or holds too
        many elements or bodies."""
        element = Element(tag, attributes, self.file, self.parser.CurrentByteIndex)
        self.budget.elements -= 1
        self.budget.bodies -= tag == "body" or (tag == "link" and len(self.open) == 1)
        if len(self.open) >= DEEPEST:
            element.refuse("the file is nested too deeply", f"at most {DEEPEST} levels")
        if self.budget.elements < 0:
            element.refuse(
                "the file has too many elements", f"at most {MOST}, included files counted"
            )
        if self.budget.bodies < 0:
            element.refuse(
                f"the robot has more than {MOST_BODIES} bodies",
                f"at most {MOST_BODIES}, included files counted",
            )
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    @property
    def is_robot(self) -> bool:
        """Whether the root has a tag that a robot description starts with."""
        return self.root is not None and self.root.tag in ROOTS

    def end(self, tag: str) -> None:
        """An element ends; expat has seen to it that tags match."""
        self.open.pop()

    def characters(self, text: str) -> None:
        """Text of the innermost element; expat may hand it over in pieces."""
        if self.open and not text.isspace():
            self.open[-1].text += text

    def document_type(self, *declaration: object) -> None:
        """Raises ModelError: entities of a document type can grow a small file without bound."""
        problem = "a document type, which can declare entities"
        raise ModelError(
            self.file.diagnostic(
                self.parser.CurrentByteIndex, 1, problem, "a file without <!DOCTYPE>"
            )
        )
