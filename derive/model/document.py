"""YAML text → plain nodes with places: what stands in the file, before anything is made of it.

Every scalar stays text (no YAML 1.1 surprises: `no`, `1e3` and `1:30` are what they look like).
Built from the event stream, not with `compose`: the depth is bounded before a deep file can hurt;
aliases, tags and duplicate keys are refused where they are.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn, TypeGuard

import yaml

from derive.diagnostics import Diagnostic, ModelError
from derive.model.records import Span

LARGEST = 16 << 20  # bytes
HANDED = ("/dev/fd/", "/dev/stdin", "/proc/self/fd/")
DEEPEST = 32  # levels
MOST_BODIES = 20_000  # reading them takes some tens of seconds, building them minutes
MOST_VALUES = 1_000_000  # 20,000 links of a robot have about 800,000
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\ud800-\udfff\ufffe\uffff]")
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_BRACED = re.compile(r"\w\{")  # of a name with an index, such as link{i}
_TAG = "tag:yaml.org,2002:"  # what !! stands for
COMMA = 'inside { } and [ ] a formula with a comma stands in quotes: "max(a, b)"'
BRACKETS = 'a formula that holds [ ] stands in quotes: "position(a, [0, 1 m]).x"'


def content(path: str | PathLike[str], most: int) -> bytes:
    """At most `most` + 1 bytes of a file. ModelError where it cannot be read: a pipe that nobody
    writes to would be waited for.

    What the shell hands over as /dev/fd/N or /dev/stdin is open already, and may be a pipe.
    """
    name = str(path)
    handed = name.startswith(HANDED)
    try:
        with open(name, "rb", opener=None if handed else _at_once) as file:
            if not handed and not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise OSError(errno.EINVAL, "it is no regular file")
            return file.read(most + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ModelError(Diagnostic(name, message=f"cannot be read: {reason}")) from None


def _at_once(name: str, flags: int) -> int:
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))


@dataclass(frozen=True)
class Scalar:
    """A piece of text and where it stands. `exact`: offsets in the text are offsets in the line."""

    text: str
    span: Span
    exact: bool
    plain: bool

    def at(self, offset: int, length: int = 1) -> Span:
        """The place of a character of the text; its beginning where the text was folded or
        escaped."""
        if not self.exact:
            return self.span
        return replace(self.span, column=self.span.column + offset, length=max(1, length))


class Key(str):
    """A mapping's key with its place."""

    span: Span

    def __new__(cls, text: str, span: Span) -> Key:
        key = super().__new__(cls, text)
        key.span = span
        return key

    def __getnewargs__(self) -> tuple[str, Span]:  # pyright: ignore[reportIncompatibleMethodOverride] so that it can be copied and pickled
        return str(self), self.span


class Items(list[Any]):
    """A YAML list with its place."""

    def __init__(self, entries: list[Any], span: Span) -> None:
        super().__init__(entries)
        self.span = span


class Entries(dict[str, Any]):
    """A YAML mapping with its place; its keys are Keys."""

    def __init__(self, entries: Mapping[Any, Any], span: Span) -> None:
        super().__init__(entries)
        self.span = span

    def key(self, name: str) -> Key:
        """The key as it stands in the file."""
        return next(key for key in self if isinstance(key, Key) and key == name)


Node = Scalar | Items | Entries


class Source:
    """The text of a model file, and messages that point into it.

    `folder`: where the files stand that it may refer to, None for a text in memory. `others`: those
    it does refer to; a place in the k-th of them has `file` k, and so has that one's `number`.
    """

    def __init__(self, text: str, file: str, folder: Path | None = None, number: int = 0) -> None:
        self.text, self.file, self.folder, self.number = text, file, folder, number
        self.lines = _BREAK.split(text)
        self.others: list[Source] = []

    def of(self, span: Span) -> Source:
        """The file that a place is in."""
        return self if span.file == self.number else self.others[span.file - 1]

    def line(self, span: Span) -> str:
        """The line that a place is in; "" where there is none."""
        lines = self.of(span).lines
        return lines[span.line - 1] if 0 < span.line <= len(lines) else ""

    def diagnostic(
        self, span: Span, message: str, expected: str = "", hint: str = ""
    ) -> Diagnostic:
        """A problem at a place of this file, with the line it stands in for the caret."""
        source, line = self.of(span), self.line(span)
        place = (source.file, span.line, span.column, span.length)
        return Diagnostic(*place, message, expected, hint, line, span.where)

    def refuse(self, span: Span, message: str, expected: str = "", hint: str = "") -> NoReturn:
        """Raises ModelError with that diagnostic: for what makes reading on pointless."""
        raise ModelError(self.diagnostic(span, message, expected, hint))

    def place(self, offset: int) -> Span:
        """Line and column of a character offset in the whole text."""
        before = _BREAK.split(self.text[:offset])
        return Span(len(before), len(before[-1]) + 1, file=self.number)


# behind a declaration and comments
_ROBOT = re.compile(
    r"(?>\s*+(?:<\?.*?\?>|<!--.*?-->))*+\s*+<(robot|mujoco|mujocoinclude)\b", re.DOTALL
)
_ROBOTS = {
    "robot": ("URDF", ".urdf"),
    "mujoco": ("MJCF", ".xml"),
    "mujocoinclude": ("MJCF", ".xml"),
}


def decoded(content: bytes, file: str) -> str:
    """The text of a file's bytes; ModelError where they are not UTF-8 or too many."""
    if len(content) > LARGEST:
        raise ModelError(
            Diagnostic(
                file,
                message=f"the file has {len(content)} bytes",
                expected=f"at most {LARGEST} bytes",
            )
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        source = Source(content[: error.start].decode("utf-8-sig", "replace"), file)
        source.refuse(
            source.place(len(source.text)), "the file is not UTF-8 text", "text saved as UTF-8"
        )


def parsed(source: Source) -> Entries:
    """The mapping a model file holds."""
    if len(source.text) > LARGEST:
        raise ModelError(
            Diagnostic(
                source.file,
                message="the text is too long",
                expected=f"at most {LARGEST} characters",
            )
        )
    if bad := _CONTROL.search(source.text):
        source.refuse(
            source.place(bad.start()),
            f"the control character {bad.group()!a} in the file",
            "printable text",
        )
    if robot := _ROBOT.match(source.text):
        kind, ending = _ROBOTS[robot[1]]
        source.refuse(
            source.place(robot.start(1) - 1),
            f"this is {kind}, which describes a robot",
            f"the ending {ending} for it, or a model in YAML",
        )
    try:
        node = _Builder(source).document()
    except yaml.MarkedYAMLError as error:
        _refuse_yaml(source, error)
    except yaml.YAMLError as error:
        source.refuse(Span(1, 1, file=source.number), f"not valid YAML: {error}".splitlines()[0])
    if node is None or (isinstance(node, Scalar) and not node.text):
        source.refuse(
            Span(1, 1, file=source.number),
            "the file is empty",
            "a mapping that starts with `model: a_name`",
        )
    if not isinstance(node, Entries):
        source.refuse(
            _opening(node.span),
            f"{described(node)} at the top of the file",
            "a mapping that starts with `model: a_name`",
        )
    return node


def described(node: Any) -> str:
    """What kind of thing stands there, for messages."""
    if isinstance(node, Items):
        return "a list"
    if isinstance(node, Entries):
        return "a mapping"
    if not isinstance(node, Scalar) or not node.plain:
        return "text"
    return "a number" if NUMBER.fullmatch(node.text) else "text" if node.text else "nothing"


def is_cut(node: Node) -> TypeGuard[Scalar]:
    """Whether a text ends within its brackets, as max(a, b) does at the comma where no quotes
    are."""
    if not isinstance(node, Scalar):
        return False
    return node.plain and node.text.count("(") > node.text.count(")")


def check_commas(source: Source, values: Iterable[Node]) -> None:
    """Of max(1, 1, 2) without quotes in [ ] and { } each comma starts an entry: it is no number of
    components that is wrong, what is given twice is no key, and a bracket is closed."""
    for value in values:
        if is_cut(value) and _is_before_comma(source, value):
            source.refuse(
                value.span,
                f"'{value.text}' ends at a comma, within its brackets",
                "a formula in quotes",
                COMMA,
            )


def _is_before_comma(source: Source, value: Scalar) -> bool:
    line = source.line(value.span)
    return line[value.span.column - 1 + len(value.text) :].lstrip().startswith(",")


def _opening(span: Span) -> Span:
    return replace(span, length=1)


def _refuse_yaml(source: Source, error: yaml.MarkedYAMLError) -> NoReturn:
    mark = error.problem_mark or error.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    span = Span(line, column, file=source.number)
    text = source.lines[span.line - 1] if span.line <= len(source.lines) else ""
    if "\t" in text[: len(text) - len(text.lstrip())]:
        source.refuse(
            replace(span, column=text.index("\t") + 1), "a tab in the indentation", "spaces"
        )
    since = ""
    if error.context and error.context_mark and error.context_mark.line + 1 != span.line:
        since = f" ({error.context} that starts on line {error.context_mark.line + 1})"
    source.refuse(
        span,
        f"not valid YAML: {error.problem or error.context}{since}",
        _yaml_advice(error.problem or "", error.context or "", text),
        BRACKETS if text[: span.column - 1].rstrip().endswith("]") else "",
    )


def _yaml_advice(problem: str, context: str, line: str) -> str:
    if "mapping values are not allowed" in problem:
        return "quotes around a text that holds ': '"
    if _BRACED.search(line):
        return "',' or '}'; inside { } and [ ], quotes around a name such as \"link{i}\""
    if "while scanning a quoted scalar" in context:
        return "a quote at the end of the text, of the kind it starts with"
    if "cannot start any token" in problem:
        return "quotes around a text that starts with such a character"
    return "',' or '}'" if "',' or '}'" in problem else ""


class _Builder:
    """Nodes from parser events."""

    def __init__(self, source: Source) -> None:
        self.source = source
        loader = getattr(yaml, "CLoader", yaml.Loader)
        self.count = 0
        # its stub leaves the stream open
        parse: Callable[..., Iterator[Any]] = yaml.parse  # pyright: ignore[reportUnknownMemberType,reportUnknownVariableType]
        self.events = iter(parse(source.text, Loader=loader))

    def document(self) -> Node | None:
        """The one document of the stream, or None where the file is empty. Raises ModelError at a
        second one."""
        node = None
        for event in self.events:
            if isinstance(event, yaml.DocumentStartEvent) and node is not None:
                self.source.refuse(
                    _span(event, self.source.number),
                    "a second document in the file",
                    "one model per file",
                )
            if isinstance(event, yaml.NodeEvent):
                node = self.node(event, 0)
        return node

    def node(self, event: Any, depth: int) -> Node:
        """One value with all that is in it. Raises ModelError for an alias, a tag, or too many or
        too deeply nested values: a small file could otherwise stand for an endless one."""
        span = _span(event, self.source.number)
        self.count += 1
        if self.count > MOST_VALUES:
            self.source.refuse(
                span, f"the file holds more than {MOST_VALUES} values", "a smaller model"
            )
        if isinstance(event, yaml.AliasEvent):
            self.source.refuse(
                span,
                f"an alias '*{event.anchor}'",
                "the value itself: aliases are not part of the model language",
            )
        if event.tag is not None:
            self.source.refuse(
                span,
                f"a tag '{event.tag.replace(_TAG, '!!')}'",
                "a plain value: tags are not part of the model language",
            )
        if depth > DEEPEST:
            self.source.refuse(span, "the file is nested too deeply", f"at most {DEEPEST} levels")
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(event, span)
        if isinstance(event, yaml.SequenceStartEvent):
            entries = self.items(depth)
            if event.flow_style:
                check_commas(self.source, entries[:-1])
            return Items(entries, span)
        return Entries(self.entries(depth), span)

    def items(self, depth: int) -> list[Node]:
        """The values of a list, up to its end event."""
        entries: list[Node] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            entries.append(self.node(event, depth + 1))
        return entries

    def entries(self, depth: int) -> dict[Key, Node]:
        """The entries of a mapping in the order of the file. Raises ModelError where a key is given
        twice: YAML would silently take the last."""
        entries: dict[Key, Node] = {}
        places: dict[str, Span] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            key = self.key(event)
            if key in places:
                check_commas(self.source, entries.values())
                first = places[key]
                self.source.refuse(
                    key.span,
                    f"'{key}' is given twice; first on line {first.line}, column {first.column}",
                    "one of the two",
                )
            places[key] = key.span
            entries[key] = self.node(next(self.events), depth + 1)
        return entries

    def key(self, event: Any) -> Key:
        """The key of an entry, with its place. Raises ModelError where it is no plain text."""
        node = (
            self.node(event, 0) if isinstance(event, yaml.ScalarEvent | yaml.AliasEvent) else None
        )
        if not isinstance(node, Scalar):
            self.source.refuse(
                _span(event, self.source.number),
                "a list or a mapping as a key",
                "a name; a formula with brackets within { } stands in quotes",
            )
        return Key(node.text, node.span)

    def scalar(self, event: Any, span: Span) -> Scalar:
        """A scalar as the text that stands in the file, with its place.

        `exact` says whether the text stands there letter by letter. Only then can an error in a
        formula point at its own column; a quoted or folded text is pointed at as a whole. Raises
        ModelError at control characters.
        """
        text = event.value
        plain = not event.style  # None or "", as the parser has it
        # what is plain stands in the file, which was searched as a whole
        if not plain and (bad := _CONTROL.search(text)):
            self.source.refuse(
                span, f"the control character {bad.group()!a} in a text", "printable text"
            )
        shift = 0 if plain else 1
        line = self.source.lines[span.line - 1] if span.line <= len(self.source.lines) else ""
        start = span.column - 1 + shift
        exact = line[start : start + len(text)] == text
        if exact:
            span = _narrowed(span, span.column + shift, max(1, len(text)))
        return Scalar(text, span, exact, plain)


def _narrowed(span: Span, column: int, length: int) -> Span:
    same = column == span.column and length == span.length
    return span if same else replace(span, column=column, length=length)


def _span(event: Any, file: int) -> Span:
    start, end = event.start_mark, event.end_mark
    length = end.column - start.column if end.line == start.line else 1
    return Span(start.line + 1, start.column + 1, max(1, length), file)
