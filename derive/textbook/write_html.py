"""Document → one self-contained HTML page."""

from __future__ import annotations

import re
from html import escape

from markupsafe import Markup

from derive.textbook.mathml import mathml
from derive.textbook.pages import rendered
from derive.textbook.records import Display, Document, Line, Runs, Text

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
        kind=_kind,
        runs=_runs,
        rows=_rows,
    )


def _kind(block: object) -> str:
    return type(block).__name__


def _runs(runs: Runs) -> Markup:
    """Text escaped, mathematics as MathML; a line does not end between a formula and the sign after
    it."""
    text = "".join(escape(x.text) if isinstance(x, Text) else mathml(x.latex) for x in runs)
    return Markup(_SIGN_AFTER.sub(r'<span class="kept">\1\2</span>', text))


def _rows(display: Display) -> list[tuple[Markup, Markup]]:
    """Left side and right side of every line; a right side in pieces fills further lines."""
    rows = [row for line in display.lines for row in _pieces(line)]
    return [(Markup(left), Markup(right)) for left, right in rows]


def _pieces(line: Line) -> list[tuple[str, str]]:
    first, *rest = line.right
    rows = [(mathml(line.left, True), mathml(f"{line.relation} {first}", True))]
    return rows + [("", mathml(rf"\quad {piece.strip()}", True)) for piece in rest]
