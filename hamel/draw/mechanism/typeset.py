"""Names on a drawing: LaTeX of one symbol as runs of letters, and how wide they are."""

from __future__ import annotations

import re
from dataclasses import dataclass

SIZE = 14.0  # pixels of a letter
SMALL = 0.72  # of an index
WIDE = 0.96  # of the widest capital letters, in sizes
LETTERS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ",
    "eta": "η", "theta": "θ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν",
    "xi": "ξ", "pi": "π", "rho": "ρ", "sigma": "σ", "tau": "τ", "upsilon": "υ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ", "Delta": "Δ", "Theta": "Θ",
    "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Upsilon": "Υ", "Phi": "Φ", "Psi": "Ψ",
    "Omega": "Ω",
}  # fmt: skip
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|[_^{}]|.", re.DOTALL)
_ACCENTS = {
    "dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304", "tilde": "\u0303"
}  # fmt: skip
_VARIANTS = {"varepsilon": "ε", "vartheta": "ϑ", "varphi": "φ", "ell": "ℓ"}
_UPRIGHT = {"mathrm": "upright", "text": "upright", "mathbf": "bold"}


@dataclass(frozen=True)
class Run:
    """Letters of one look: "italic", "upright" or "bold"; `level` is −1 below, 1 above, 0 on the
    line."""

    text: str
    look: str
    level: int = 0


def runs(latex: str) -> tuple[Run, ...]:
    """The letters of a symbol: what names.symbol writes is all that is read."""
    pieces, _ = _group(_TOKEN.findall(latex), 0, "italic", 0)
    return tuple(_joined(pieces))


def _group(tokens: list[str], k: int, look: str, level: int) -> tuple[list[Run], int]:
    """Runs up to the closing brace, and where reading goes on."""
    pieces: list[Run] = []
    while k < len(tokens) and tokens[k] != "}":
        part, k = _piece(tokens, k, look, level)
        pieces += part
    return pieces, k + 1


def _piece(tokens: list[str], k: int, look: str, level: int) -> tuple[list[Run], int]:
    token = tokens[k]
    if token == "{":
        return _group(tokens, k + 1, look, level)
    if token in "_^" and k + 1 < len(tokens):
        return _piece(tokens, k + 1, look, -1 if token == "_" else 1)
    if token in (r"\_", r"\,"):
        return [Run(" ", look, level)], k + 1
    name = token[1:] if token.startswith("\\") else ""
    if name in _UPRIGHT and k + 1 < len(tokens):
        return _piece(tokens, k + 1, _UPRIGHT[name], level)
    if name in _ACCENTS and k + 1 < len(tokens):
        inner, k = _piece(tokens, k + 1, look, level)
        word = inner[-1].text
        middle = (len(word) + 1) // 2  # a mark stands over the letter before it
        dotted = word[:middle] + _ACCENTS[name] + word[middle:]
        return [*inner[:-1], Run(dotted, inner[-1].look, level)], k
    if name in _VARIANTS:
        return [Run(_VARIANTS[name], "italic", level)], k + 1
    if name in LETTERS:
        return [Run(LETTERS[name], "italic" if name[0].islower() else "upright", level)], k + 1
    digit = token.isdigit()
    return [Run(name or token, "upright" if digit else look, level)], k + 1


def _joined(pieces: list[Run]) -> list[Run]:
    """Neighbours of one look in one run."""
    result: list[Run] = []
    for piece in pieces:
        last = result[-1] if result else None
        if last and (last.look, last.level) == (piece.look, piece.level):
            result[-1] = Run(last.text + piece.text, last.look, last.level)
        else:
            result.append(piece)
    return result


def extent(latex: str) -> tuple[float, float, float]:
    """Width, height above and depth below the line, in pixels: no font is at hand, so a bound for
    the common ones."""
    parts = runs(latex)
    width = sum(_width(part) for part in parts)
    below = any(part.level < 0 for part in parts)
    above = any(part.level > 0 for part in parts)
    return width, SIZE * (1.02 if above else 0.80), SIZE * (0.42 if below else 0.26)


def _width(run: Run) -> float:
    size = SIZE * (SMALL if run.level else 1.0)
    return size * sum(_letter(c) for c in run.text)


def _letter(c: str) -> float:
    """In sizes: above what Times, DejaVu Serif and system fonts need."""
    if c in _ACCENTS.values():
        return 0.0
    if c in "ijlI.,:;'|()[] 1":
        return 0.42
    if c in "mwMWω":
        return WIDE
    return 0.74 if c.isupper() else 0.64
