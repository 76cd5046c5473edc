"""How wide a formula is, in letters: fractions as their wider half, matrices by their columns."""

from __future__ import annotations

import re
from functools import cache

_TOKEN = re.compile(r"\\begin\{bmatrix\}|\\end\{bmatrix\}|\\\\|\\[A-Za-z]+|\\.|[{}&^_]|\S")
_SILENT = frozenset([r"\left", r"\right", r"\Bigl", r"\Bigr", r"\displaystyle"]) | frozenset(
    [r"\mathrm", r"\mathbf", r"\boldsymbol", r"\mathsf"]
)
_ACCENTS = frozenset([r"\dot", r"\ddot", r"\hat", r"\bar", r"\tilde"])
_NAMES = re.compile(r"\\(a?(?:rc)?(?:sinh?|cosh?|tanh?)|ln|min|max|exp)$")
SCRIPT = 0.7  # of the size of letters
IN_CELL = 0.8  # of a fraction in a matrix: its letters are small, its functions' gaps are not
CAPITAL = 1.25  # of an upper-case letter
COLUMN = 2.0  # between the columns of a matrix
WIDE = {
    "=": 2.2,
    "+": 2.2,
    "-": 2.0,
    r"\cdot": 1.4,
    r"\le": 2.2,
    r"\ge": 2.2,
    r"\quad": 2.0,
    r"\qquad": 4.0,
    r"\,": 0.4,
    r"\mathbf": 0.6,
    r"\boldsymbol": 0.6,
}


@cache
def letters(latex: str) -> float:
    """The width in letters of ordinary size."""
    return _row(_TOKEN.findall(latex), 0)[0]


def _row(tokens: list[str], k: int) -> tuple[float, int]:
    """A run of tokens up to a closing brace, a cell's or matrix's end; and where it ends."""
    total = 0.0
    while k < len(tokens) and tokens[k] not in ("}", "&", r"\\", r"\end{bmatrix}"):
        size, k = _atom(tokens, k)
        total += size
    return total, k


def _atom(tokens: list[str], k: int) -> tuple[float, int]:
    token = tokens[k]
    if token == "{":
        size, k = _row(tokens, k + 1)
        return size, k + 1
    if token in ("^", "_"):
        size, k = _atom(tokens, k + 1)
        return SCRIPT * size, k
    if token in (r"\frac", r"\tfrac"):
        over, k = _atom(tokens, k + 1)
        under, k = _atom(tokens, k)
        return max(over, under) + 0.5, k
    if token == r"\sqrt":
        size, k = _atom(tokens, k + 1)
        return size + 1.2, k
    if token == r"\begin{bmatrix}":
        return _matrix(tokens, k + 1)
    return _letter(token), k + 1


def _letter(token: str) -> float:
    if token in WIDE:
        return WIDE[token]
    if token in _SILENT or token in _ACCENTS:
        return 0.0
    if match := _NAMES.match(token):
        return len(match[1]) + 0.6
    return CAPITAL if token.isupper() else 1.0


def _matrix(tokens: list[str], k: int) -> tuple[float, int]:
    """Columns as wide as their widest cells."""
    columns: list[float] = []
    column = 0
    while k < len(tokens) and tokens[k] != r"\end{bmatrix}":
        if tokens[k] in ("&", r"\\"):
            column = column + 1 if tokens[k] == "&" else 0
            k += 1
            continue
        size, k = _cell(tokens, k)
        columns += [0.0] * (column + 1 - len(columns))
        columns[column] = max(columns[column], size)
        if k < len(tokens) and tokens[k] == "}":  # unbalanced: what is between cells is skipped
            k += 1
    return sum(columns) + COLUMN * max(len(columns) - 1, 0) + 1.6, k + 1


def _cell(tokens: list[str], k: int) -> tuple[float, int]:
    """An entry of a matrix, in which fractions are small."""
    total = 0.0
    while k < len(tokens) and tokens[k] not in ("}", "&", r"\\", r"\end{bmatrix}"):
        small = IN_CELL if tokens[k] in (r"\frac", r"\tfrac") else 1.0
        size, k = _atom(tokens, k)
        total += small * size
    return total, k


_OPEN = ("{", "(", "[", r"\left", r"\begin{bmatrix}", r"\Bigl")
_CLOSE = ("}", ")", "]", r"\right", r"\end{bmatrix}", r"\Bigr")
_PART = re.compile(
    r"\\begin\{bmatrix\}|\\end\{bmatrix\}|\\(?:left|right|Bigl|Bigr)\W?|\\[A-Za-z]+|\\.|."
)


def parts(latex: str) -> tuple[str, ...]:
    """A formula cut before the signs of its outermost sum and its relations: between the parts a
    line may end."""
    depth, pieces = 0, [""]
    for token in _PART.findall(latex):
        if depth == 0 and token in ("+", "-", "=") and _ended(pieces[-1]):
            pieces.append("")
        if depth == 0 and token in (r"\qquad", r"\quad") and pieces[-1].strip():
            pieces.append("")
            continue
        depth += token.startswith(_OPEN) - token.startswith(_CLOSE)
        pieces[-1] += token
    return tuple(piece for piece in pieces if piece.strip())


def _ended(piece: str) -> bool:
    """Whether a sign after it stands between two terms."""
    text = piece.strip()
    return bool(text) and not text.endswith(("+", "-", "=", r"\cdot", r"\times", "^", "_"))
