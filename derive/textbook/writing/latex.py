"""Document → a standalone LaTeX article (pdfLaTeX with amsmath, amssymb, graphicx, longtable)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from importlib.resources import files

from jinja2 import Environment, StrictUndefined

from derive.textbook.formulas.measure import letters
from derive.textbook.formulas.typeset import merged, width
from derive.textbook.records import Display, Document, Line, Pattern, Ref, Run, Runs, Table, Text

TEXT_WIDTH = 82  # visible characters of text that fit on a line
LETTERS = 74.0  # of mathematics that do, beside the number of the equation
SIGN = 4.0  # letters of an equals sign and the indentation of later lines
LONG_CELL = 24  # characters beyond which a cell of a table is broken into lines
GAP = 3  # characters between columns
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "…": r"\ldots{}",
    "⋮": r"\ensuremath{\vdots}",
    "–": "--",
    "—": "---",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
    "·": r"\ensuremath{\cdot}",
    "×": r"\ensuremath{\times}",
    "−": r"\ensuremath{-}",
    "±": r"\ensuremath{\pm}",
    "≤": r"\ensuremath{\le}",
    "≥": r"\ensuremath{\ge}",
    "→": r"\ensuremath{\to}",
    "∂": r"\ensuremath{\partial}",
    "½": r"\ensuremath{\tfrac{1}{2}}",
    "²": r"\ensuremath{^{2}}",
    "³": r"\ensuremath{^{3}}",
    "⁴": r"\ensuremath{^{4}}",
    "⁻": r"\ensuremath{^{-}}",
    "¹": r"\ensuremath{^{1}}",
    "₁": r"\ensuremath{_{1}}",
    "₂": r"\ensuremath{_{2}}",
    "ᵀ": r"\ensuremath{^{\mathsf{T}}}",
    "°": r"\ensuremath{^{\circ}}",
    "\u0307": "",  # a dot above that is no letter of its own
}
_DOTTED = {
    "q̇": "q",
    "v̇": "v",
    "ẇ": "w",
    "ẋ": "x",
    "Ḃ": "B",
    "Ȧ": "A",
    "ċ": "c",
    "Ṡ": "S",
    "ẏ": "y",
    "ż": "z",
}
_GREEK = dict(
    zip(
        "αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΥΦΨΩ",
        [
            "alpha",
            "beta",
            "gamma",
            "delta",
            "varepsilon",
            "zeta",
            "eta",
            "theta",
            "iota",
            "kappa",
            "lambda",
            "mu",
            "nu",
            "xi",
            "pi",
            "rho",
            "sigma",
            "tau",
            "upsilon",
            "varphi",
            "chi",
            "psi",
            "omega",
            "Gamma",
            "Delta",
            "Theta",
            "Lambda",
            "Xi",
            "Pi",
            "Sigma",
            "Upsilon",
            "Phi",
            "Psi",
            "Omega",
        ],
    )
)
_SPECIAL.update({letter: rf"\ensuremath{{\{name}}}" for letter, name in _GREEK.items()})
_LIST = re.compile(r"\\left\(((?:(?!\\left|\\right).)*,(?:(?!\\left|\\right).)*)\\right\)")
_COMMA = re.compile(r",\\[,;] ?")


def article(document: Document, figure: str = "") -> str:
    """The same sections as the page, numbered by LaTeX; `figure` is a tikzpicture of our own."""
    environment = Environment(
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        block_start_string="<%",
        block_end_string="%>",
        variable_start_string="<<",
        variable_end_string=">>",
        comment_start_string="<#",
        comment_end_string="#>",
    )
    template = environment.from_string(
        files("derive.textbook.writing").joinpath("article.tex.j2").read_text("utf-8")
    )
    return template.render(
        document=document,
        figure=figure,
        kind=_kind,
        escape=escape,
        runs=_runs,
        rows=_rows,
        stated=_stated,
        explaining=_explaining,
        columns=_columns,
        pattern=_pattern,
        folded=_folded,
    )


def _kind(block: object) -> str:
    return type(block).__name__


def escape(text: str) -> str:
    """Text that LaTeX prints as it is; letters it has no font for are printed as their code
    points."""
    for pair, letter in _DOTTED.items():
        text = text.replace(pair, f"\ue000{letter}\ue001")
    return "".join(_escaped(c) for c in text)


def _escaped(c: str) -> str:
    if c == "\ue000":
        return r"\ensuremath{\dot{"
    if c == "\ue001":
        return "}}"
    if c in _SPECIAL:
        return _SPECIAL[c]
    if c in "\t\n\r":
        return " "
    known = " " <= c <= "~" or 0xC0 <= ord(c) <= 0x17E  # Latin letters that inputenc and T1 have
    return c if known else rf"\texttt{{U+{ord(c):04X}}}"


def _runs(runs: Runs) -> str:
    return "".join(map(_run, runs))


def _run(run: Run) -> str:
    if isinstance(run, Ref):
        return rf"(\ref{{equation-{run.number}}})"
    return escape(run.text) if isinstance(run, Text) else f"${_breakable(run.latex)}$"


def _breakable(latex: str) -> str:
    """A formula in a line: TeX ends no line behind a comma, nor between brackets that stretch, so a
    list is told where it may end."""
    listed = _LIST.fullmatch(latex)
    if listed:
        latex = f"({listed[1]})"
    return _COMMA.sub(r"\g<0>\\allowbreak ", latex)


def _rows(lines: Sequence[Line]) -> str:
    """Lines of an align environment; one number for all of them."""
    rows: list[str] = []
    explained = False
    for line in lines:
        first, *rest = _pieces(line)
        starts = line.where and not explained and bool(rows)
        explained = explained or line.where
        rows += [r"\intertext{where}" + "\n" + first if starts else first, *rest]
    return " \\nonumber \\\\\n".join(rows)


def _stated(display: Display) -> list[Line]:
    """What stands in a box."""
    return [line for line in display.lines if not line.where]


def _explaining(display: Display) -> list[Line]:
    """What stands below a box: empheq bears no intertext."""
    return [line for line in display.lines if line.where]


def _pattern(pattern: Pattern) -> str:
    """Dots for terms, circles for numbers."""
    marks = {" ": r"\cdot", "1": r"\circ", "x": r"\bullet"}
    body = r" \\ ".join(" & ".join(marks[x] for x in row) for row in pattern.marks)
    columns = "c" * len(pattern.marks[0])
    return (
        rf"${pattern.name}:\; \arraycolsep=2pt\left[\begin{{array}}{{{columns}}} {body} "
        r"\end{array}\right]$ (terms $\bullet$, numbers $\circ$)"
    )


def _folded(display: Display) -> str:
    """What is not in the article: it is in the page, to be unfolded."""
    lefts = [line.left for line in display.lines if not line.where] or [display.lines[0].left]
    shown = lefts[0] if len(lefts) == 1 else rf"{lefts[0]},\ldots,{lefts[-1]}"
    return (
        rf"\refstepcounter{{equation}}\label{{equation-{display.number}}}({display.number}) "
        rf"${shown}$: written out in the web page."
    )


def _pieces(line: Line) -> Iterable[str]:
    room = LETTERS - letters(line.left) - SIGN
    first, *rest = merged(line.right, room)
    yield f"{line.left} &{line.relation} {_fitted(first, room)}"
    for piece in rest:
        yield f"&\\quad {_fitted(piece.strip(), room)}"


def _fitted(latex: str, room: float) -> str:
    """Made narrower where it would not fit on the page."""
    if letters(latex) <= room:
        return latex
    part = max(room, 20.0) / (LETTERS + SIGN)
    return rf"\resizebox{{{part:.2f}\linewidth}}{{!}}{{$\displaystyle {latex}$}}"


def _columns(table: Table) -> str:
    """Short columns as wide as they are; long ones share what is left of the line."""
    lengths = _lengths(table)
    if sum(lengths) + GAP * len(lengths) <= TEXT_WIDTH:
        return "l" * len(lengths)
    long = [k for k, n in enumerate(lengths) if n > LONG_CELL] or [lengths.index(max(lengths))]
    short = sum(n + GAP for k, n in enumerate(lengths) if k not in long)
    # three hundredths of the line go to the space between columns, for each long one and at the end
    left = max(0.97 - short / TEXT_WIDTH - 0.03 * len(long), 0.2)
    whole = sum(lengths[k] for k in long)
    columns = ["l"] * len(lengths)
    for k in long:
        columns[k] = rf"p{{{left * lengths[k] / whole:.2f}\linewidth}}"
    return "".join(columns)


def _lengths(table: Table) -> list[int]:
    """Of each column its widest cell, in characters."""
    columns = zip(table.head, *table.rows)
    return [max(len(title), *map(_length, cells)) for title, *cells in columns]


def _length(runs: Runs) -> int:
    return sum(map(_run_length, runs))


def _run_length(run: Run) -> int:
    if isinstance(run, Ref):
        return len(str(run.number)) + 2
    return len(run.text) if isinstance(run, Text) else width(run.latex)
