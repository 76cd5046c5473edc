"""der(…) of numbers of the motion, by the rates of what they are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice

from derive.expressions import tree
from derive.expressions.differentiate import rate
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import ONE, ZERO, Expression, Name
from derive.expressions.units import TIME, quotient_of
from derive.model.kinematics.arguments import ALONE, Arguments, Parts, Rewritten
from derive.model.kinematics.measures import ACCELERATIONS, POSITIONS, SPEEDING, VELOCITIES, Spot
from derive.model.limits import LONGEST_RATE
from derive.model.mechanism.space import ORIGIN
from derive.model.records import GROUND, Measure
from derive.model.scope import ACCELERATION, COORDINATE, PARAMETER, STATE, VELOCITY, Symbol


@dataclass(frozen=True)
class Rates:
    """Those of one formula."""

    of: Arguments
    definitions: Mapping[str, Expression]
    found: dict[str, Expression] = field(default_factory=dict[str, Expression])  # of definitions

    def rate_of(self, expression: Expression, at: int) -> Expression:
        """Of a number. Raises FormulaError where it does not change."""
        (derivative,) = self.changing((rate(expression, self.leaf, self.of.text),), at)
        return derivative

    def changing(self, rates: Parts, at: int) -> Parts:
        """The same rates. Raises FormulaError where all are zero."""
        if all(x == ZERO for x in rates):
            message, expected = "der() of what does not change", "a formula of coordinates or t"
            raise FormulaError(message, self.of.text, at, expected)
        return rates

    def is_velocity(self, name: str) -> bool:
        """Whether it is a generalized velocity, as base.vx, or how one may be called: hinge.w."""
        symbol = self.of.scope.symbols.get(name) if "." in name else None
        own = symbol is not None and symbol.kinds == frozenset({VELOCITY})
        return name in self.of.scope.aliases or (own and name not in self.of.measures.found)

    def leaf(self, node: Name | tree.Rate) -> Expression:
        """Of a name. Raises FormulaError for what has no rate, or none here."""
        if isinstance(node, tree.Rate):
            return self._rate_of_speed(node, node.name, f"the rate of '{node.name}'")
        if node.name == "t":
            return ONE
        measure = self.of.measures.found.get(node.name)
        if measure is not None and measure.quantity not in ACCELERATIONS:
            return self._rate_of_measure(measure, node)
        if node.name in self.definitions:
            return self._definition_rate(node)
        if self.is_velocity(node.name):
            of = self.of.scope.aliases.get(node.name, node.name)
            return self._rate_of_speed(node, of, f"'{node.name}', a velocity")
        symbol = self.of.scope.symbols.get(node.name)
        if symbol is None:
            return node  # reported when names are looked up
        if symbol.kinds == frozenset({PARAMETER}):
            return ZERO
        if STATE in symbol.kinds:
            raise self.of.fault(
                f"der() of the state '{node.name}'",
                node,
                self._smooth(),
                "a rate that needs rates of states, its own or others', is no explicit equation",
            )
        if symbol.kinds == frozenset({COORDINATE}):
            return tree.Rate(node.name, node.at)
        kind = min(symbol.kinds)
        raise self.of.fault(f"der() of '{node.name}', {kind}", node, self._smooth())

    def _smooth(self) -> str:
        """What has a rate."""
        return "coordinates, velocities and t" if self.of.accelerations else "coordinates and t"

    def _rate_of_measure(self, measure: Measure, node: Name) -> Expression:
        if measure.quantity in VELOCITIES:
            self._check_place(f"der() of '{measure.name}', a velocity", node)
        quantity = {**POSITIONS, **VELOCITIES}[measure.quantity]
        letters = "".join("xyz"[k] for k in measure.component)
        spot = Spot(measure.frame, measure.point)
        return self.of.measure(quantity, spot, measure.relative, letters, node)

    def _rate_of_speed(self, node: Name | tree.Rate, name: str, what: str) -> Expression:
        """Of the rate of a coordinate or of a generalized velocity; `what` it is, for the
        message."""
        speed = self.of.scope.symbols.get(name if "." in name else f"der({name})")
        if speed is None:
            return node  # reported when names are looked up
        self._check_place(f"der() of {what}", node)
        return self._speeding(name, speed, node)

    def _speeding(self, name: str, speed: Symbol, node: Name | tree.Rate) -> Expression:
        """The rate of the rate of a coordinate, or of a generalized velocity."""
        stem = f"der({name})" if "." in name else f"der(der({name}))"
        given = self.of.measures.named(Measure(stem, SPEEDING, name, ORIGIN, GROUND, ()))
        known = speed.dimension
        dimension = quotient_of(known, TIME) if isinstance(known, tuple) else known
        self.of.scope.add(given, Symbol(frozenset({ACCELERATION}), dimension))
        return Name(given, node.at)

    def _check_place(self, what: str, node: Expression) -> None:
        if not self.of.accelerations:
            raise self.of.fault(what, node, self._smooth(), ALONE)

    def _definition_rate(self, node: Name) -> Expression:
        """It is written out, and each product of definitions makes it longer: refused where it has
        too many terms to be walked through."""
        found = self.found.get(node.name)
        if found is None:
            found = rate(self.definitions[node.name], self.leaf, self.of.text)
            if is_long(found):
                raise self.too_long(f"'{node.name}'", node)
            self.found[node.name] = found
        return found

    def too_long(self, what: str, node: Expression) -> FormulaError:
        """What to say of a rate that is too long to be written out."""
        message = f"der() of {what}, which is written out in {LONGEST_RATE} terms"
        return self.of.fault(message, node, "shorter definitions, or a rate in formulas of its own")


def is_long(given: Rewritten) -> bool:
    """Whether a rate of it would be a product of too many terms."""
    parts = given if isinstance(given, tuple) else (given,)
    return any(any(islice(tree.walk(part), LONGEST_RATE, None)) for part in parts)
