"""Document → one self-contained HTML page."""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape
from itertools import groupby

from markupsafe import Markup

from derive.textbook.mathml import mathml
from derive.textbook.pages import rendered
from derive.textbook.records import Display, Document, Line, Ref, Run, Runs, Section, Text

_SIGN_AFTER = re.compile(r"(<math(?:(?!<math).)*?</math>)([.,:;)]+)")


def page(document: Document, figure: str = "") -> str:
    """MathML and CSS inside; no script, no network, the same bytes every time. `figure` is an SVG
    element of our own."""
    return rendered(
        "derive.textbook/page.html.j2",
        title=document.title,
        version=document.version,
        document=document,
        figure=Markup(figure),
        groups=_groups(document),
        wide=any(section.column for section in document.sections),
        kind=_kind,
        runs=_runs,
        rows=_rows,
    )


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
    return escape(run.text) if isinstance(run, Text) else mathml(run.latex)


def _rows(display: Display) -> list[tuple[Markup, Markup]]:
    """Left side and right side of every line; a right side in pieces fills further lines."""
    rows = [row for line in display.lines for row in _pieces(line)]
    return [(Markup(left), Markup(right)) for left, right in rows]


def _pieces(line: Line) -> list[tuple[str, str]]:
    first, *rest = line.right
    rows = [(mathml(line.left, True), mathml(f"{line.relation} {first}", True))]
    return rows + [("", mathml(rf"\quad {piece.strip()}", True)) for piece in rest]
