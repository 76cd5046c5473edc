"""Document → one self-contained HTML page."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from html import escape
from itertools import groupby
from typing import Any

from markupsafe import Markup

from derive.textbook.formulas.measure import letters, parts
from derive.textbook.formulas.typeset import OPENING
from derive.textbook.records import (
    Display,
    Document,
    Line,
    Math,
    Pattern,
    Ref,
    Run,
    Runs,
    Section,
    Table,
    Text,
)
from derive.textbook.writing.mathml import mathml
from derive.textbook.writing.pages import rendered

MARGIN = 3.0  # letters between left and right side
LONG_LEFT = 12.0  # letters of a left side that does not get a column of its own
FEW_COLUMNS = 1  # of a matrix of numbers that stands beside its formula
NARROW = 18.0  # letters that fit beside an equation number on the narrowest screen
LONG_IN_TEXT = 26.0  # letters of a formula that fits in a line of the narrowest screen
NARROW_TABLE = 38  # letters of a row that fit on the narrowest screen
GAP = 2  # letters between columns
THIN = r"\,"
NOTHING = 1e-13  # a value below this is shown as zero
_SIGN_AFTER = re.compile(r"(<math(?:(?!<math).)*?</math>)([.,:;)]+)")


def page(document: Document, figure: str = "") -> str:
    """MathML and CSS inside; no script, no network, the same bytes every time. `figure` is an SVG
    element of our own."""
    return rendered(
        "derive.textbook.writing/page.html.j2",
        title=document.title,
        version=document.version,
        figure=Markup(figure),
        wide=any(section.column for section in document.sections),
        **parts_of(document),
    )


def parts_of(document: Document) -> dict[str, Any]:
    """What `sections.html.j2` is given: a page of another kind may hold a derivation, too."""
    return {
        "document": document,
        "groups": _groups(document),
        "kind": _kind,
        "runs": _runs,
        "rows": partial(_rows, document),
        "head": _head,
        "stacked": _stacked,
        "cells": _cells,
        "inline": _inline,
    }


@dataclass(frozen=True)
class _Group:
    """Sections below each other, or in two columns; each with its number."""

    parts: tuple[tuple[tuple[int, Section], ...], ...]

    @property
    def columns(self) -> int:
        return len(self.parts)


def _groups(document: Document) -> list[_Group]:
    """Runs of sections with and without columns, in order."""
    numbered = list(enumerate(document.sections, 1))
    groups: list[_Group] = []
    for beside, run in groupby(numbered, key=lambda pair: pair[1].column > 0):
        sections = list(run)
        columns = (1, 2) if beside else (0,)
        parts = [tuple(pair for pair in sections if pair[1].column == k) for k in columns]
        groups.append(_Group(tuple(parts)))
    return groups


def _inline(latex: str) -> Markup:
    return Markup(mathml(latex))


def _kind(block: object) -> str:
    return type(block).__name__


def _runs(runs: Runs) -> Markup:
    """Text escaped, mathematics as MathML; a line does not end between a formula and the sign after
    it."""
    text = "".join(map(_run, runs))
    return Markup(_SIGN_AFTER.sub(r'<span class="kept">\1\2</span>', text))


def _run(run: Run) -> str:
    if isinstance(run, Ref):
        return f'<a href="#equation-{run.number}">({run.number})</a>'
    return escape(run.text) if isinstance(run, Text) else _in_text(run.latex)


def _in_text(latex: str) -> str:
    """A formula inside a line; a long one may be broken, and gets smaller on narrow screens."""
    if letters(latex) < LONG_IN_TEXT:
        return mathml(latex)
    pieces = [piece.strip() for piece in parts(latex)]
    return " ".join(
        mathml(f"{{}} {piece}" if piece[:1] in "+-" and k else piece).replace(
            "<math", f'<math class="broad" style="--w:{letters(piece):.0f}"', 1
        )
        for k, piece in enumerate(pieces)
    )


@dataclass(frozen=True)
class _Row:
    """A line of a display; `where` starts the lines that explain symbols."""

    left: Markup
    right: Markup
    number: Markup
    below: bool  # the number stands in a row of its own
    where: bool


def _rows(document: Document, display: Display) -> list[_Row]:
    """Left side, right side and value of every line."""
    rows: list[_Row] = []
    explained = False
    for line in display.lines:
        starts = line.where and not explained and bool(rows)
        explained = explained or line.where
        number, below = Markup(_value(document, line)), _is_wide(document, line)
        long = letters(line.left) > LONG_LEFT
        left = "" if long else _fitted(line.left)
        right = _left_and_right(line) if long else _right(line)
        rows.append(_Row(Markup(left), Markup(right), number, below, starts))
    return rows


def _is_wide(document: Document, line: Line) -> bool:
    """Whether the numbers of the line are a matrix that stands better below it."""
    if line.place is None or line.place[1] >= 0:
        return False
    return document.printed[line.place[0]].right.shape[1] > FEW_COLUMNS


def _left_and_right(line: Line) -> str:
    """One after the other, where the left side is long itself."""
    pieces = [*parts(line.left), f"{line.relation} {line.right[0]}", *line.right[1:]]
    return " ".join(_fitted(piece.strip(), MARGIN if k else 0.0) for k, piece in enumerate(pieces))


def _right(line: Line) -> str:
    """The pieces one after the other; a line may end between them."""
    room = letters(line.left) + MARGIN
    first, *rest = line.right
    # between factors stands the space at which the line may end
    pieces = [f"{line.relation} {first}", *(x.strip().removeprefix(THIN) for x in rest)]
    # a line may end after an opening bracket too, but no space stands there
    breaks = ["<wbr>" if piece.endswith(OPENING) else " " for piece in pieces]
    return "".join(_fitted(piece, room) + end for piece, end in zip(pieces, breaks)).rstrip()


def _fitted(latex: str, room: float = 0.0) -> str:
    """A formula that gets smaller where the column is too narrow for it."""
    wide = letters(latex) + room
    # a sign at the beginning is a sum's: an empty term before it gives it its spaces
    text = mathml(f"{{}} {latex}" if latex[:1] in "+-" and room else latex, True)
    if wide < NARROW:
        return text
    return text.replace("<math", f'<math style="--w:{wide:.0f}"', 1)


def _value(document: Document, line: Line) -> str:
    """The numbers of the line at the document's state."""
    if line.place is None or not document.numbers:
        return ""
    formula, entry = line.place
    values = document.numbers[formula]
    if entry >= 0:
        return _number(values[entry])
    columns = document.printed[formula].right.shape[1]
    rows = [values[k : k + columns] for k in range(0, len(values), columns)]
    body = "".join(f"<tr>{''.join(f'<td>{_number(x)}</td>' for x in row)}</tr>" for row in rows)
    return f"<table>{body}</table>"


def _number(x: float) -> str:
    text = f"{x + 0.0:.4g}" if abs(x) > NOTHING else "0"
    return text.replace("-", "−")


def _cells(pattern: Pattern) -> list[tuple[int, int, str]]:
    """Row, column and kind of every entry that is not zero."""
    return [
        (i, j, "number" if mark == "1" else "term")
        for i, row in enumerate(pattern.marks)
        for j, mark in enumerate(row)
        if mark != " "
    ]


def _stacked(table: Table) -> bool:
    """Whether a narrow screen shows every row of it as lines below each other."""
    columns = zip(table.head, *table.rows)
    widest = [max(len(title), *map(_length, cells)) for title, *cells in columns]
    return sum(widest) + GAP * len(widest) > NARROW_TABLE


def _length(runs: Runs) -> float:
    return sum(letters(x.latex) if isinstance(x, Math) else len(_plain(x)) for x in runs)


def _plain(run: Text | Ref) -> str:
    return f"({run.number})" if isinstance(run, Ref) else run.text


def _head(display: Display) -> Markup:
    """What a folded display is about."""
    lefts = [line.left for line in display.lines if not line.where] or [display.lines[0].left]
    shown = lefts[0] if len(lefts) == 1 else rf"{lefts[0]},\;\ldots,\;{lefts[-1]}"
    return Markup(mathml(shown))
