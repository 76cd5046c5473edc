"""Document → one self-contained HTML page."""

from __future__ import annotations

import re
from html import escape
from importlib.resources import files

from derive.textbook.mathml import mathml
from derive.textbook.records import Display, Document, Line, Runs, Text

_SIGN_AFTER = re.compile(r"(<math(?:(?!<math).)*?</math>)([.,:;)]+)")


def page(document: Document) -> str:
    """MathML and CSS inside; no script, no network, the same bytes every time."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        files("derive.textbook").joinpath("page.html.j2").read_text("utf-8")
    )
    return template.render(
        document=document, kind=lambda block: type(block).__name__, runs=_runs, rows=_rows
    )


def _runs(runs: Runs):
    """Text escaped, mathematics as MathML; a line does not end between a formula and the sign after
    it."""
    from markupsafe import Markup

    shown = "".join(
        escape(run.text) if isinstance(run, Text) else mathml(run.latex) for run in runs
    )
    return Markup(_SIGN_AFTER.sub(r'<span class="kept">\1\2</span>', shown))


def _rows(display: Display):
    """Left side and right side of every line; a right side in pieces fills further lines."""
    from markupsafe import Markup

    return [
        (Markup(left), Markup(right)) for line in display.lines for left, right in _pieces(line)
    ]


def _pieces(line: Line) -> list[tuple[str, str]]:
    first, *rest = line.right
    found = [(mathml(line.left, True), mathml(f"{line.relation} {first}", True))]
    return found + [("", mathml(rf"\quad {piece.strip()}", True)) for piece in rest]
