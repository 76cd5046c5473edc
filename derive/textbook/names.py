"""Names of a model as LaTeX: Greek by name, digits below, rates with dots, words upright."""

from __future__ import annotations

import re
from collections.abc import Mapping

GREEK = frozenset(
    [
        "alpha",
        "beta",
        "gamma",
        "delta",
        "epsilon",
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
        "phi",
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
    ]
)
_SPECIAL = re.compile(r"([_%$#&{}])")
_INDEXED = re.compile(r"([A-Za-z]+?)_?(\d+)")
# what the page itself calls t, T, V, P and the entries of its matrices and vectors
_TAKEN = re.compile(
    r"(t|T|V|P)"
    r"|(N|M|A|B|R|S|P|D|h|c|F|Q|z"
    r"|\\Phi|\\beta|\\gamma|\\sigma|\\lambda|\\rho|\\delta|\\eta|\\zeta)_\{\d+\}"
)


# what people write for a Greek letter
SHORT = {
    "al": "alpha", "be": "beta", "ga": "gamma", "gam": "gamma", "del": "delta", "eps": "epsilon",
    "th": "theta", "ka": "kappa", "lam": "lambda", "sig": "sigma", "ph": "phi", "ps": "psi",
    "om": "omega", "Om": "Omega", "Lam": "Lambda", "Th": "Theta",
}  # fmt: skip
QUANTITIES = frozenset("abcdefghklmnpqrsuvwxyzACDEFGHIJKLMRSW")  # letters that take an index


def letter(word: str) -> str:
    """One letter stays italic, a Greek name becomes the letter, a longer word stands upright."""
    word = SHORT.get(word, word)
    if word in GREEK:
        return f"\\{word}"
    return word if len(word) == 1 else upright(word)


def upright(word: str) -> str:
    """A word in upright letters, as LaTeX; what TeX takes for a command is escaped."""
    return f"\\mathrm{{{_SPECIAL.sub(lambda m: _escaped(m[1]), word)}}}"


def _escaped(sign: str) -> str:
    return r"\," if sign == "_" else chr(92) + sign


def symbol(name: str, given: Mapping[str, str] | None = None) -> str:
    """LaTeX of a model's identifier: phi1 → φ₁, l_arm → l with index arm, th → upright th, q1_dot →
    q̇₁; `given` is what the file says of some names (`symbol:`)."""
    if given and name in given:
        return given[name]
    if name.endswith("_dot") and len(name) > 4:
        return dotted(symbol(name[:-4], given))
    latex = _parts(name)
    return upright(name) if _TAKEN.fullmatch(latex) else latex


def _parts(name: str) -> str:
    if name.endswith("_prime") and len(name) > 6:
        return f"{_parts(name[:-6])}'"
    if indexed := _INDEXED.fullmatch(name):
        return f"{letter(indexed[1])}_{{{indexed[2]}}}"
    stem, _, index = name.partition("_")
    if stem and index and (len(stem) == 1 or SHORT.get(stem, stem) in GREEK):
        return f"{letter(stem)}_{{{_index(index)}}}"
    if "_" in name:
        return upright(name.strip("_")) if name.strip("_") else upright(name)
    return _joined(name)


def _index(text: str) -> str:
    return letter(text) if len(text) == 1 or SHORT.get(text, text) in GREEK else upright(text)


def _joined(name: str) -> str:
    """rR, IBxx, mb: a letter of a quantity and what it belongs to; else a word."""
    split = len(name) > 1 and name[0] in QUANTITIES and SHORT.get(name, name) not in GREEK
    if split and (len(name) == 2 or (name[1].isupper() and name.isalnum())):
        index = name[1:] if len(name) == 2 and not name[1].isupper() else upright(name[1:])
        return f"{name[0]}_{{{index}}}"
    return letter(name) if name.isalpha() else upright(name)


def dotted(latex: str) -> str:
    """The time derivative: a dot over the stem, a second one over the first."""
    if latex.startswith(r"\dot{"):
        return r"\ddot{" + latex[5:]
    stem, index = _stem(latex)
    return f"\\dot{{{stem}}}{index}"


def _stem(latex: str) -> tuple[str, str]:
    """What carries the dot, and the indices after it."""
    if latex.startswith((r"\mathrm{", r"\mathbf{")):
        end = latex.index("}") + 1 if "\\_" not in latex else latex.rindex("}") + 1
        return latex[:end], latex[end:]
    accent = re.match(r"\\(hat|bar|tilde)\{[^{}]*\}", latex)
    if accent:
        return accent[0], latex[accent.end() :]
    stem = re.match(r"\\?[A-Za-z]+|.", latex)
    return (stem[0], latex[stem.end() :]) if stem else (latex, "")


def velocity(name: str, rate_of: str) -> str:
    """A generalized velocity: the rate of a coordinate, or `base.vx` → v_x with the joint above
    it."""
    if rate_of:
        return dotted(symbol(rate_of))
    owner, _, slot = name.rpartition(".")
    stem = r"\omega" if slot.startswith("w") else slot[:1]
    index = f"_{{{slot[1:]}}}" if slot[1:] else ""
    return f"{stem}{index}^{{{upright(owner) if len(owner) > 1 else owner}}}"


def body(name: str) -> str:
    """A body's name as an index."""
    return upright(name) if len(name) > 1 else name


def bold(latex: str) -> str:
    """Short hand of our own formulas: !v is a bold v, !!v its rate, ^T a transpose, !\\beta a bold
    β."""
    latex = re.sub(r"!(\\[a-zA-Z]+)", r"\\boldsymbol{\1}", latex).replace("^T", r"^{\mathsf{T}}")
    return re.sub(
        r"!([A-Za-z01])", r"\\mathbf{\1}", re.sub(r"!!([A-Za-z])", r"\\dot{\\mathbf{\1}}", latex)
    )


def unit(text: str) -> str:
    """kg*m^2/s → kg·m²/s, as text."""
    powers = {"2": "²", "3": "³", "4": "⁴"}
    printed = re.sub(r"\^([234])(?![.\d])", lambda m: powers[m[1]], text).replace("*", "·")
    return "–" if printed in ("", "1") else printed


def words(name: str) -> str:
    """A body's, joint's or constraint's name as it is read: rear_axle → rear axle."""
    return name.replace("_", " ")


def per_second(text: str) -> str:
    """The unit of a rate: m/s → m/s^2."""
    if text in ("", "1"):
        return "1/s"
    return f"{text}^2" if text.endswith("/s") else f"{text}/s"
