"""LaTeX → MathML by latex2mathml, with what browsers need to show it well."""

from __future__ import annotations

import re
from functools import cache
from html import unescape

from latex2mathml.converter import convert

_UPRIGHT = re.compile(r'<mrow>((?:<mi mathvariant="normal">[^<]+</mi>|<mn>[^<]+</mn>)+)</mrow>')
_BOLD = re.compile(r'<mi mathvariant="bold-italic">([^<]+)</mi>')
_NAMES = "sin|cos|tan|sinh|cosh|tanh|ln|exp|arcsin|arccos|arctan|atan2|sign|min|max"
_CALL = re.compile(rf"<m[io]>({_NAMES})</m[io]>(</?\w+>)?(<mo stretchy)?")
_RAISED = re.compile(
    r"(<msup><mo [^>]*>[a-z]+</mo><mrow>(?:(?!</msup>).)*</mrow></msup>)(?!<mrow><mo stretchy)"
)
_DIGIT = re.compile(r"\\mathbf\{(\d)\}")  # a digit loses its bold face in latex2mathml
_ALONE = re.compile(r"\\mathrm\{([A-Za-z])\}")  # and a letter alone its upright one
_LETTER = re.compile(r"<mtext>([A-Za-z])</mtext>")
ROW, END = "<mrow>", "</mrow></math>"
_TOKEN = re.compile(
    r"\\(?:begin|end)\{\w+\}|\\(?:left|right)(?![a-z])|\\[A-Za-z]+|\\.|[^\\{}+\-]+|."
)
_OPEN = ("{", r"\begin", r"\left")
_CLOSE = ("}", r"\end", r"\right")
_CUTS = (r"\,", "+", "-")
_BOLD_GREEK = 0x1D6C2 - 0x3B1  # α → bold α
_BOLD_GREEK_CAPITAL = 0x1D6A8 - 0x391


@cache
def mathml(latex: str, display: bool = False) -> str:
    """One <math> element."""
    latex = _DIGIT.sub(lambda m: chr(0x1D7CE + int(m[1])), latex)
    latex = _ALONE.sub(r"\\text{\1}", latex)
    text = f"<math><mrow>{''.join(map(_converted, _factors(latex)))}</mrow></math>"
    text = _UPRIGHT.sub(
        lambda m: f"<mi>{_letters(m[1])}</mi>" if len(_letters(m[1])) > 1 else m[0], text
    )
    text = _BOLD.sub(lambda m: f"<mi>{_bold(unescape(m[1]))}</mi>", text)
    text = _LETTER.sub(r'<mi mathvariant="normal">\1</mi>', text)
    text = text.replace("&#x003D5;", "&#x003C6;").replace(
        "<mi>&#x1D5B3;</mi>", '<mi mathvariant="normal">T</mi>'
    )
    text = _CALL.sub(_operator, text)
    text = text.replace("<mover>", '<mover accent="true">')
    text = text.replace(
        "<mo>&#x0005B;</mo><mtable>", '<mspace width="0.2em" /><mtable class="matrix">'
    ).replace("</mtable><mo>&#x0005D;</mo>", '</mtable><mspace width="0.2em" />')
    text = _RAISED.sub(r'\1<mspace width="0.167em" />', text)
    style = ' displaystyle="true"' if display else ""
    return text.replace("<math>", f"<math{style}>", 1)


@cache
def _converted(latex: str) -> str:
    """What stands in the element: factors recur from formula to formula."""
    text = convert(latex)
    return text[text.index(ROW) + len(ROW) : text.rindex(END)]


def _factors(latex: str) -> list[str]:
    """A formula cut at the spaces and signs outside of every bracket: put together, their elements
    are those of the whole."""
    depth, pieces = 0, [""]
    for token in _TOKEN.findall(latex):
        depth += token.startswith(_OPEN) - token.startswith(_CLOSE)
        if depth == 0 and token in _CUTS and not pieces[-1].rstrip().endswith(("^", "_")):
            pieces += [token, ""]
        else:
            pieces[-1] += token
    return [piece for piece in pieces if piece.strip()]


def _letters(mixed: str) -> str:
    return re.sub(r"<[^>]+>", "", mixed)


def _bold(letter: str) -> str:
    code = ord(letter)
    return chr(code + (_BOLD_GREEK if code >= 0x3B1 else _BOLD_GREEK_CAPITAL))


def _operator(call: re.Match[str]) -> str:
    """A function's name is an operator with a thin space on both sides, none before a bracket."""
    after = (call[2] or "") + (call[3] or "")
    space = "0" if call[3] else "0.167em"
    return f'<mo form="prefix" lspace="0.167em" rspace="{space}">{call[1]}</mo>{after}'
