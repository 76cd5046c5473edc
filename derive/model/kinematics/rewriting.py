"""Where bodies and frames are and how they move, in formulas: position(load), distance(a, b) …

A formula with such functions is rewritten into one of numbers. What stands for the mechanics in it
are measures, one number each: the x of the position of a point. They are names with a meaning that
derive.mechanics and the reference of verify each know from kinematics of their own.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from derive.expressions import tree
from derive.expressions.differentiate import rate
from derive.expressions.functions import KINEMATIC_FUNCTIONS
from derive.expressions.tree import Call, Expression, Name
from derive.model.kinematics.arguments import Arguments, Parts, Rewritten
from derive.model.kinematics.meanings import MEANINGS, orientation_entry
from derive.model.kinematics.products import PRODUCTS
from derive.model.kinematics.rates import Rates, is_long
from derive.model.quantities import negated, plus, times

WORDS = re.compile(rf"\b(?:{'|'.join(KINEMATIC_FUNCTIONS)})\s*\(|\bder\s*\(")


def _is_rate(node: Expression) -> bool:
    return isinstance(node, tree.Rate) or (isinstance(node, Call) and node.function == "der")


def speaks_of_motion(text: str) -> bool:
    """Whether a formula uses functions of this module."""
    return WORDS.search(text) is not None


@dataclass(frozen=True)
class Rewriting:
    """One formula on its way. `own` are functions of the model that may be called as some of the
    motion."""

    of: Arguments
    rates: Rates
    own: Collection[str] = ()

    def scalar(self, node: Expression) -> Expression:
        """The formula as one of numbers. Raises FormulaError where it is a vector."""
        result = self.rewritten(node)
        if isinstance(result, tuple):
            letters = " or ".join(f".{letter}" for letter in self.of.space.letters)
            expected = f"a component, {letters}, or norm(…) or dot(…, …)"
            raise self.of.fault("a vector where a number is needed", node, expected)
        return result

    def vector(self, node: Expression) -> Parts:
        """The formula as components. Raises FormulaError where it is a number."""
        result = self.rewritten(node)
        if not isinstance(result, tuple):
            expected = "position(…), a list, …"
            raise self.of.fault("a number where a vector is needed", node, expected)
        return result

    def rewritten(self, node: Expression) -> Rewritten:
        """A number, or the components of a vector."""
        match node:
            case tree.Vector(entries):
                return self._list(node, entries)
            case tree.Sum(terms, at):
                return self._sum(terms, at)
            case tree.Negative(argument, at):
                inner = self.rewritten(argument)
                if isinstance(inner, tuple):
                    return tuple(negated(x) for x in inner)
                return tree.Negative(inner, at)
            case tree.Product(factors, at):
                return self._product(factors, at)
            case tree.Quotient(above, below, at):
                return self._quotient(above, below, at)
            case tree.Power(base, exponent, at):
                return tree.Power(self.scalar(base), self.scalar(exponent), at)
            case Call():
                return self._call(node)
            case tree.Rate(name) if name in self.rates.definitions or self.rates.is_velocity(name):
                return self.rates.rate_of(Name(name, node.at), node.at)
            case _:
                pass
        return node

    def _list(self, node: Expression, entries: Parts) -> Parts:
        if len(entries) != self.of.space.size:
            raise self.of.fault(
                f"a vector with {len(entries)} components", node, self.of.components()
            )
        return tuple(self.scalar(entry) for entry in entries)

    def _sum(self, terms: Parts, at: int) -> Rewritten:
        result = [self.rewritten(term) for term in terms]
        vectors = [x for x in result if isinstance(x, tuple)]
        if not vectors:
            return tree.Sum(tuple(x for x in result if not isinstance(x, tuple)), at)
        for term, x in zip(terms, result):
            if not isinstance(x, tuple):
                raise self.of.fault("cannot add a number to a vector", term, "a vector")
        return tuple(plus(*parts) for parts in zip(*vectors))

    def _product(self, factors: Parts, at: int) -> Rewritten:
        result = [self.rewritten(factor) for factor in factors]
        vectors = [x for x in result if isinstance(x, tuple)]
        numbers = [x for x in result if not isinstance(x, tuple)]
        if not vectors:
            return tree.Product(tuple(numbers), at)
        if len(vectors) > 1:
            raise self.of.fault("a product of vectors", factors[-1], "dot(…, …) or cross(…, …)")
        return tuple(times(*numbers, x) for x in vectors[0])

    def _quotient(self, above: Expression, below: Expression, at: int) -> Rewritten:
        numerator, denominator = self.rewritten(above), self.scalar(below)
        if isinstance(numerator, tuple):
            return tuple(tree.Quotient(x, denominator) for x in numerator)
        return tree.Quotient(numerator, denominator, at)

    def _call(self, node: Call) -> Rewritten:
        if node.function.startswith("."):
            return self._component(node)
        if node.function == "der":
            return self._rate(node)
        if node.function in MEANINGS and node.function not in self.own:
            return MEANINGS[node.function](self.of, node)
        if node.function in PRODUCTS and node.function not in self.own:
            return PRODUCTS[node.function](self.of, node, self.vector)
        arguments = tuple(self.scalar(argument) for argument in node.arguments)
        return Call(node.function, arguments, node.at)

    def _component(self, node: Call) -> Expression:
        letters, inner = node.function[1:], node.arguments[0]
        axes = self.of.space.letters
        if isinstance(inner, Call) and inner.function == "orientation":
            if len(letters) != 2 or any(letter not in axes for letter in letters):
                expected = f".{axes[0]}{axes[-1]}: the {axes[0]} of the {axes[-1]} axis, …"
                raise self.of.fault(f"unknown entry '.{letters}' of an orientation", node, expected)
            row, column = letters
            return orientation_entry(self.of, inner, row, column)
        parts = self.vector(inner)
        if len(letters) != 1 or letters not in axes:
            raise self.of.fault(f"unknown component '.{letters}'", node, self.of.components())
        return parts[axes.index(letters)]

    def _rate(self, node: Call) -> Rewritten:
        """Of a number, or of each component of a vector. A rate of rates grows with the product of
        all: refused where it has too many terms, before and after it is written out."""
        (argument,) = node.arguments
        given = self.rewritten(argument)
        again = any(_is_rate(x) for x in tree.walk(argument))
        if again and is_long(given):
            raise self.rates.too_long("what is itself a rate", node)
        if not isinstance(given, tuple):
            found = self.rates.rate_of(given, node.at)
        else:
            rates = tuple(rate(x, self.rates.leaf, self.of.text) for x in given)
            found = self.rates.changing(rates, node.at)
        if again and is_long(found):
            raise self.rates.too_long("what is itself a rate", node)
        return found
