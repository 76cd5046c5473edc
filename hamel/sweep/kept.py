"""What is kept of every motion: `tip.x`, `reach = highest(tip.x)`, `at(q1, 2.5)`, `count(stop)`,
`balance`, `growth`."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from derive.diagnostics import ModelError, did_you_mean, listed
from derive.expressions import tree
from derive.expressions.dimensions import infer
from derive.expressions.evaluate import value
from derive.expressions.mistakes import FormulaError
from derive.expressions.parser import expression
from derive.expressions.quantities import unit as parsed_unit
from derive.expressions.tree import Expression
from derive.expressions.units import pretty

OVER_MOTION = ("highest", "lowest", "mean", "rms")
OF_EVENTS = ("count", "first", "last")
OF_MOTION = (*OVER_MOTION, *OF_EVENTS, "at", "final")  # no functions of formulas
COUNTED = {  # what a motion says of itself, with its unit
    "steps": "",
    "end": "s",
    "balance": "",
    "error": "",
    "violation": "",
}
OF_MODES = {"growth": "1/s", "frequency": "rad/s"}  # of the eigenvalue with the largest real part
SINGLE = "`simulate -o FILE.csv` has the reactions of one motion"
_LABEL = re.compile(r"\s*([A-Za-z_]\w*)\s*=(.*)", re.DOTALL)
_CALL = re.compile(r"\s*([A-Za-z_]\w*)\s*\((.*)\)\s*", re.DOTALL)


@dataclass(frozen=True)
class Kept:
    """A column of the result. `how`: final, at, one of OVER_MOTION, OF_EVENTS, `counted` or `mode`;
    `time` is that of `at`."""

    label: str
    how: str
    text: str
    unit: str = ""
    formula: Expression | None = None
    time: float | None = None

    @property
    def whole(self) -> bool:
        """Whether it needs the rows of the whole motion."""
        return self.how in OVER_MOTION or (self.how, self.text) == ("counted", "balance")


@dataclass(frozen=True)
class Names:
    """What formulas may name, with units: `states` are what `state` stands for."""

    units: Mapping[str, str]
    states: tuple[str, ...]
    energies: tuple[str, ...]
    events: tuple[str, ...]
    reactions: tuple[str, ...] = ()  # outputs that are some


def kept(texts: Collection[str], names: Names) -> tuple[Kept, ...]:
    """The columns that were asked for. Raises ModelError with the text that is wrong."""
    quantities: list[Kept] = []
    for text in texts:
        quantities += _kept(text, names)
    _check_once(quantities)
    modes = [each.how == "mode" for each in quantities]
    if any(modes) and not all(modes):
        raise ModelError(
            f"{listed(OF_MODES)} are of a steady motion, the other names of one that is integrated",
            "two sweeps",
        )
    return tuple(quantities)


def _check_once(quantities: Sequence[Kept]) -> None:
    labels = [each.label for each in quantities]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice:
        raise ModelError(f"'{twice}' is kept twice", f"give one another name: other = {twice}")


def told_apart(columns: Sequence[Kept], taken: Collection[str]) -> tuple[Kept, ...]:
    """Kept quantities beside names that other columns have: what is called like one of them is
    its value at the end, and a name that was given is refused."""
    apart = tuple(_told_apart(each, taken) for each in columns)
    _check_once(apart)
    return apart


def _told_apart(each: Kept, taken: Collection[str]) -> Kept:
    if each.label not in taken:
        return each
    is_given = each.label != each.text or each.how in (*OVER_MOTION, *OF_EVENTS, "at")
    if is_given:
        raise ModelError(
            f"something kept is to be called '{each.label}', but another column has that name",
            f"another name, such as my_{each.label} = …",
        )
    return replace(each, label=f"final({each.label})")


def _kept(text: str, names: Names) -> list[Kept]:
    labelled = _LABEL.fullmatch(text)
    label, what = (labelled[1], labelled[2].strip()) if labelled else ("", text.strip())
    several = {"state": names.states, "energy": names.energies}.get(what)
    if several is not None and not label:
        return [_formula(name, names, "final") for name in several]
    one = _one(what, names)
    return [replace(one, label=label) if label else one]


def _one(what: str, names: Names) -> Kept:
    if what in OF_MODES:
        return Kept(what, "mode", what, OF_MODES[what])
    if what in COUNTED and what not in names.units:
        return Kept(what, "counted", what, COUNTED[what])
    call = _CALL.fullmatch(what)
    how, inside = (call[1], call[2].strip()) if call else ("", "")
    _check_alone(what, call is not None)
    if how in OF_EVENTS:
        return _of_event(what, how, inside, names)
    if how in OVER_MOTION or how == "final":
        return replace(_formula(inside, names, how), label=what)
    if how == "at":
        formula, comma, time = inside.rpartition(",")
        if not comma:
            raise ModelError(f"'{what}' is kept", "at(formula, seconds), such as at(q1, 2.5)")
        return replace(_formula(formula.strip(), names, how), label=what, time=_seconds(what, time))
    return _formula(what, names, "final")


def _check_alone(what: str, is_call: bool) -> None:
    """What is of a whole motion is no part of a formula; such a word is told from functions, which
    are, and a bracket that is missing from both."""
    word = what.partition("(")[0].strip()
    if is_call or "(" not in what or word not in OF_MOTION:
        return
    arguments = {"at": "formula, seconds", **dict.fromkeys(OF_EVENTS, "event")}
    whole = f"{word}({arguments.get(word, 'formula')})"
    if what.count("(") > what.count(")"):
        raise ModelError(f"'{what}' is kept, but a closing bracket is missing", whole)
    raise ModelError(f"'{what}' is kept, but {whole} stands alone", f"{word} of the whole formula")


def _seconds(what: str, text: str) -> float:
    try:
        seconds = value(expression(text.strip()), {}, {}, {})
        return float(seconds)
    except (FormulaError, TypeError, KeyError, ValueError):
        raise ModelError(f"'{what}' is kept, but '{text.strip()}' is no time") from None


def _of_event(what: str, how: str, name: str, names: Names) -> Kept:
    if name not in names.events:
        near = did_you_mean(name, names.events) or f"it has {listed(names.events) or 'none'}"
        raise ModelError(f"'{what}' is kept, but '{name}' is no event of the model; {near}")
    return Kept(what, how, name, "" if how == "count" else "s")


def _formula(text: str, names: Names, how: str) -> Kept:
    try:
        parsed = expression(text, names.units)
        for node in tree.walk(parsed):
            name = _name(node)
            if name in names.reactions or (name or "").startswith("reaction."):
                raise FormulaError(
                    f"'{name}' is a reaction, and sweeps compute none", text, node.at, "", SINGLE
                )
            if name is not None and name not in names.units:
                known = [*names.units, *COUNTED, *OF_MODES]
                near = did_you_mean(name, known)
                raise FormulaError(f"unknown name '{name}'", text, node.at, near or listed(known))
        known = {name: parsed_unit(unit).dimension for name, unit in names.units.items()}
        dimension = infer(parsed, known, text)
    except FormulaError as error:
        raise ModelError(
            [replace(diagnostic, file=f"kept '{text}'") for diagnostic in error.diagnostics]
        ) from None
    unit = pretty(dimension) if isinstance(dimension, tuple) else ""
    own = names.units.get(text)
    return Kept(text, how, text, unit if own is None else own, parsed)


def _name(node: Expression) -> str | None:
    if isinstance(node, tree.Rate):
        return f"der({node.name})"
    return node.name if isinstance(node, tree.Name) else None


def used(columns: Sequence[Kept]) -> frozenset[str]:
    """All names in the formulas."""
    nodes = [n for each in columns if each.formula is not None for n in tree.walk(each.formula)]
    return frozenset(name for node in nodes if (name := _name(node)) is not None)


# ---- values


def _folded(function: Callable[..., Any]) -> Callable[..., Any]:
    def folded(*arguments: Any) -> Any:
        return reduce(function, arguments)

    return folded


NUMPY: dict[str, Callable[..., Any]] = {
    **{n: getattr(np, n) for n in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log")},
    **{"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2},
    **{"sqrt": np.sqrt, "abs": np.abs, "sign": np.sign},
    "min": _folded(np.minimum),
    "max": _folded(np.maximum),
}


class Lookup(Mapping[str, np.ndarray]):
    """Names that are only computed where a formula uses them."""

    def __init__(self, known: Collection[str], of: Callable[[str], np.ndarray]) -> None:
        self._known, self._of = known, of

    def __getitem__(self, name: str) -> np.ndarray:
        return self._of(name)

    def __iter__(self) -> Any:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


def evaluated(formula: Expression, known: Collection[str], of: Callable[[str], Any]) -> Any:
    """The formula where `of` gives the values of names and of der(q)."""
    with np.errstate(all="ignore"):
        return value(formula, Lookup(known, of), Lookup(known, lambda q: of(f"der({q})")), NUMPY)
