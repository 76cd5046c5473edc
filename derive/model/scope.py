"""The names a formula may use, what each is, and where which kinds are allowed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.dimensions import Inferred
from derive.expressions.linearity import FREE, Degree
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import Expression
from derive.expressions.units import UNITS

# kinds of names, and sets of them for the places where formulas stand
PARAMETER, COORDINATE, VELOCITY, INPUT, TIME = (
    "a parameter",
    "a coordinate",
    "a velocity",
    "an input",
    "time",
)
REACTION = "a reaction"
ACCELERATION = "an acceleration"
STATE = "a state"
CONSTANT = frozenset({PARAMETER})
POSITION = frozenset({PARAMETER, COORDINATE, TIME})
ROW = frozenset({PARAMETER, COORDINATE, VELOCITY})
MOTION = POSITION | {VELOCITY}
ANYTHING = MOTION | {INPUT, STATE}
NONIDEAL = ANYTHING | {REACTION}
OUTPUT = ANYTHING | {REACTION, ACCELERATION}


# how others write the rate of a coordinate: q_dot, qdot, q_d; dq, dq_dt, Dq, d_q, dot_q; and qd1
_OF_BODY = re.compile(r"(\w+)\.(?=w|v[xyz])([wv])([xyz]?)")
_RATES = tuple(
    re.compile(way)
    for way in (
        r"(?P<q>\w+?)_?(?:dot|d)",
        r"(?:dot_?|[dD]_?)(?P<q>\w+?)(?:_?dt)?",
        r"(?P<q>[a-z]+)(?:dot|d)(?P<number>_?\d+)",
    )
)


@dataclass(frozen=True)
class Symbol:
    """`kinds` is what the name is, or, for a definition, what its formula uses; `because` names one
    culprit of each kind. `unit` is for coordinates and velocities."""

    kinds: frozenset[str]
    dimension: Inferred
    degree: Degree = FREE
    because: tuple[tuple[str, str], ...] = ()
    unit: str = ""


def rate_meant(name: str, usable: Sequence[str]) -> str:
    """Which der(q) a name may stand for, as a question; nothing where there is none."""
    matches = [way.fullmatch(name) for way in _RATES]
    guesses = ["".join(match.groups()) for match in matches if match]
    found = next((rate for q in guesses if (rate := f"der({q})") in usable), "")
    return f"did you mean '{found}'?" if found else ""


def motion_meant(name: str) -> str:
    """Of a component that may be meant of a body's velocity: rotor.wx."""
    found = _OF_BODY.fullmatch(name)
    if not found:
        return ""
    body, quantity, axis = found.groups()
    word = "velocity" if quantity == "v" else "angular_velocity"
    if not axis:
        return f"of a body it is {word}({body})"
    return f'of a body it is "dot({word}({body}), direction({body}, {axis}))"'


def unit_meant(name: str) -> str:
    """Where a unit may stand, of a name that is one; nothing of others."""
    return f"a unit stands behind a number: 1 {name}, 1 1/{name}, x/(1 {name})" * (name in UNITS)


@dataclass
class Scope:
    """`symbols` by name; the rate of a coordinate as "der(q)". `aliases`: J.w → the coordinate
    whose rate it is.

    `dimensions` and `degrees` are the same table read by column, kept beside it for large models.
    """

    symbols: dict[str, Symbol] = field(default_factory=dict[str, Symbol])
    aliases: dict[str, str] = field(default_factory=dict[str, str])
    dimensions: dict[str, Inferred] = field(default_factory=dict[str, Inferred])
    degrees: dict[str, Degree] = field(default_factory=dict[str, Degree])
    used: set[str] = field(default_factory=set[str])  # names that formulas have used
    version: int = 0  # another one wherever the names change

    def add(self, name: str, symbol: Symbol) -> None:
        """Enter a name. The first of two stays: collisions are reported elsewhere."""
        self.version += 1
        if self.symbols.setdefault(name, symbol) is symbol:
            self.dimensions[name], self.degrees[name] = symbol.dimension, symbol.degree

    def remove(self, name: str) -> None:
        """Forgets a name: it was allowed in some formulas only. Raises KeyError where it is not
        known."""
        self.version += 1
        for table in (self.symbols, self.dimensions, self.degrees):
            del table[name]

    def put(self, name: str, symbol: Symbol) -> None:
        """Enter a name over another of the same spelling."""
        self.version += 1
        self.symbols[name], self.dimensions[name], self.degrees[name] = (
            symbol,
            symbol.dimension,
            symbol.degree,
        )

    def only(self, kinds: frozenset[str]) -> Scope:
        """The part of the scope that holds nothing but the given kinds."""
        inner = Scope(used=self.used)
        for name in self.names(kinds):
            inner.put(name, self.symbols[name])
        return inner

    def names(self, allowed: frozenset[str] = ANYTHING) -> list[str]:
        """The names that may be used where `allowed` kinds may."""
        return [name for name, symbol in self.symbols.items() if symbol.kinds <= allowed]

    def usable(self, allowed: frozenset[str]) -> Usable:
        """The same as a test of one name, for places where listing them all would take too long."""
        return Usable(self, allowed)

    def coordinates(self) -> list[str]:
        """Names of what formulas may use as a coordinate, in the order of the model."""
        return self.of_kind(COORDINATE)

    def of_kind(self, kind: str) -> list[str]:
        """Names that are of this kind and of no other."""
        alone = frozenset({kind})
        return [name for name, symbol in self.symbols.items() if symbol.kinds == alone]

    def resolved(
        self, expression: Expression, allowed: frozenset[str], where: str, text: str
    ) -> Expression:
        """The formula with aliases replaced; FormulaError at a name that is unknown or out of
        place."""
        aliased = False
        for node in tree.walk(expression):
            if isinstance(node, tree.Name):
                aliased |= node.name in self.aliases
                self.used.add(node.name)
                self._check_name(node, allowed, where, text)
            elif isinstance(node, tree.Rate):
                self._check_rate(node, allowed, where, text)
        return tree.rebuilt(expression, self._without_alias) if aliased else expression

    def _without_alias(self, leaf: Expression) -> Expression:
        if isinstance(leaf, tree.Name) and leaf.name in self.aliases:
            return tree.Rate(self.aliases[leaf.name], leaf.at)
        return leaf

    def _check_name(self, node: tree.Name, allowed: frozenset[str], where: str, text: str) -> None:
        name = f"der({self.aliases[node.name]})" if node.name in self.aliases else node.name
        if name not in self.symbols:
            self._check_rows(node, text)
            usable = self.names(allowed)
            known = [known for known in usable if "(" not in known]
            expected = listed(known)
            if allowed == ROW:  # nothing but velocities can stand alone
                known = [*usable, *self.aliases]
                expected = f"{listed(self.of_kind(VELOCITY))}, each with a factor if need be"
            hints = (
                rate_meant(node.name, usable)
                or did_you_mean(node.name, known)
                or (motion_meant(node.name) if VELOCITY in allowed else ""),
                unit_meant(node.name),
            )
            hint = "; ".join(filter(None, hints))
            raise FormulaError(f"unknown name '{node.name}'", text, node.at, expected, hint)
        self._check_kind(node.name, self.symbols[name], node.at, allowed, where, text)

    def _check_rows(self, node: tree.Name, text: str) -> None:
        """A reaction of several rows, or of a row that is none of them."""
        whole = ".".join(node.name.split(".")[:2])
        rows = [name for name in self.of_kind(REACTION) if name.startswith(f"{whole}.")]
        if node.name == whole and rows:
            raise FormulaError(
                f"'{node.name}' is {len(rows)} reactions, one for each row",
                text,
                node.at,
                listed(rows),
            )
        if rows:
            raise FormulaError(
                f"unknown row '{node.name}'",
                text,
                node.at,
                listed(rows),
                did_you_mean(node.name, rows),
            )

    def _check_rate(self, node: tree.Rate, allowed: frozenset[str], where: str, text: str) -> None:
        known = self.coordinates()
        at = text.find(node.name, node.at + 3) if node.name in text[node.at + 3 :] else node.at
        if node.name in self.of_kind(STATE):
            raise FormulaError(
                f"der() of the state '{node.name}'",
                text,
                at,
                "the formula under its `rate:`",
                "a rate that needs rates of states, its own or others', is no explicit equation",
            )
        if node.name in self.symbols and node.name not in known:
            raise FormulaError(
                f"der() of '{node.name}', which is not a coordinate", text, at, listed(known)
            )
        if node.name not in known:
            raise FormulaError(
                f"unknown coordinate '{node.name}'",
                text,
                at,
                listed(known),
                did_you_mean(node.name, known),
            )
        self._check_kind(
            f"der({node.name})", self.symbols[f"der({node.name})"], node.at, allowed, where, text
        )

    def _check_kind(
        self, name: str, symbol: Symbol, at: int, allowed: frozenset[str], where: str, text: str
    ) -> None:
        wrong = sorted(symbol.kinds - allowed)
        if not wrong:
            return
        culprit = dict(symbol.because).get(wrong[0], "")
        what = (
            f"'{name}' is {wrong[0]}" if not culprit else f"'{name}' uses '{culprit}', {wrong[0]},"
        )
        hint = (
            "a formula with rates goes under `nonholonomic:`"
            if wrong[0] == VELOCITY and allowed == POSITION
            else ""
        )
        raise FormulaError(
            f"{what} and cannot stand in {where}", text, at, _allowed_words(allowed), hint
        )


@dataclass(frozen=True)
class Usable:
    """The names of a scope that may stand where `allowed` kinds may."""

    scope: Scope
    allowed: frozenset[str]

    def __contains__(self, name: object) -> bool:
        symbol = self.scope.symbols.get(name) if isinstance(name, str) else None
        return symbol is not None and symbol.kinds <= self.allowed


def _allowed_words(allowed: frozenset[str]) -> str:
    plural = {
        PARAMETER: "parameters",
        COORDINATE: "coordinates",
        VELOCITY: "velocities",
        INPUT: "inputs",
        STATE: "states",
        TIME: "t",
        REACTION: "reactions",
        ACCELERATION: "accelerations",
    }
    words = [word for kind, word in plural.items() if kind in allowed] or ["numbers"]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def used(expression: Expression, scope: Scope) -> dict[str, str]:
    """Kind → one name of that kind which the (resolved) formula uses, through definitions too."""
    uses: dict[str, str] = {}
    for node in tree.walk(expression):
        if isinstance(node, tree.Name | tree.Rate):
            name = f"der({node.name})" if isinstance(node, tree.Rate) else node.name
            symbol = scope.symbols.get(name)
            for kind in symbol.kinds if symbol else ():
                uses.setdefault(kind, dict(symbol.because).get(kind, name) if symbol else name)
    return uses
