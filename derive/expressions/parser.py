"""Text of a formula → expression tree: a precedence parser with a whitelist grammar. Nothing is
ever evaluated as Python.

    sum     = product (("+" | "-") product)*
    product = unary (("*" | "/") unary)*
    unary   = ("+" | "-")* power
    power   = atom [("**" | "^") unary]    right-associative, and binds tighter than a minus
    atom    = number [unit] | name | "der" "(" sum ")" ["." letters]
            | function "(" sum ("," sum)* ")" ["." letters]
            | "(" sum ")" ["." letters] | "[" sum, … "]"

derive.expressions.quantities reads numbers with their units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from typing import NoReturn

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.evaluate import check_constants
from derive.expressions.functions import (
    FUNCTIONS,
    INDEX_FUNCTIONS,
    KINEMATIC_FUNCTIONS,
    OUTPUT_FUNCTIONS,
    Function,
)
from derive.expressions.mistakes import FormulaError
from derive.expressions.quantities import Quantities, plain_number, quantity
from derive.expressions.tokens import Token
from derive.expressions.tree import Expression

NESTING = 60  # brackets, calls and exponents inside each other
HEIGHT = 120  # levels of the finished tree: everything downstream may recurse over it

_DATE = re.compile(r"\s*[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}\s*")


def expression(
    text: str,
    names: Container[str] = (),
    functions: Mapping[str, Function] = FUNCTIONS,
    vectors: bool = False,
) -> Expression:
    """The tree of a formula. `names` are the model's own, which a unit symbol may not be mistaken
    for."""
    plain = plain_number(text)
    if plain is not None:
        return plain
    if _DATE.fullmatch(text):
        difference = re.sub("-0?", " - ", text.strip())
        raise FormulaError(
            f"'{text.strip()}' is a date",
            text,
            expected=f"a number: dates are not part of the model language; or {difference}",
        )
    parser = _Parser(text, names, functions, vectors)
    result = parser.sum()
    parser.finish()
    _check_height(result, text)
    check_constants(result, text)
    return result


class _Parser(Quantities):
    def __init__(
        self, text: str, names: Container[str], functions: Mapping[str, Function], vectors: bool
    ) -> None:
        super().__init__(text, names, functions)
        self.vectors = vectors
        self.depth = 0
        self.about = 0  # functions of bodies that the place is inside of

    def sum(self) -> Expression:
        """`product (("+" | "-") product)*`. A sum is kept flat, so that a long one is no deep tree;
        its sign is in its terms."""
        at = self.token.at
        terms = [self._signed_product()]
        while self.token.text in ("+", "-"):
            terms.append(self._signed_product())
        return terms[0] if len(terms) == 1 else tree.Sum(tuple(terms), at)

    def _signed_product(self) -> Expression:
        at, minus = self.token.at, self.signs()
        result = self._product()
        return _negated(result, at) if minus else result

    def _product(self) -> Expression:
        at = self.token.at
        factors: list[Expression] = [self._unary()]
        while self.token.text in ("*", "/"):
            if self.take().text == "*":
                factors.append(self._unary())
            else:
                factors = [tree.Quotient(_product_of(factors, at), self._denominator(), at)]
        return _product_of(factors, at)

    def _denominator(self) -> Expression:
        start = self.token
        result = self._unary()
        if start.kind == "number" and isinstance(result, tree.Number) and result.unit:
            # `1/2 kg` reads as 1/(2 kg) by the rules and as half a kilogram by eye: let the author
            # say which
            self.refuse(
                "a number with a unit right after '/' can be read two ways",
                start.at,
                "(2 kg) in brackets, or 0.5 kg",
            )
        return result

    def _unary(self) -> Expression:
        at, minus = self.token.at, self.signs()
        result = self._power()
        return _negated(result, at) if minus else result

    def _power(self) -> Expression:
        at = self.token.at
        base = self._atom()
        if self.token.text not in ("**", "^"):
            return base
        self._enter(self.take())
        exponent = self._unary()
        self.depth -= 1
        return tree.Power(base, exponent, at)

    def _atom(self) -> Expression:
        token = self.token
        if token.kind == "number":
            return self.number()
        if token.kind == "name":
            return self._named()
        if token.text == "(":
            return self._component(self._bracketed_quantity() or self._bracketed(")")[0])
        if token.text == "[" and self.vectors:
            return tree.Vector(tuple(self._bracketed("]", many=True)), token.at)
        if token.text == "[":
            self.refuse(
                "a list inside a formula", token.at, "a number, a name, a function or a bracket"
            )
        self.refuse_token(token, "a number, a name, a function or a bracket")

    def _bracketed_quantity(self) -> tree.Number | None:
        """(0.1 N*m): a number and its unit alone in brackets, whatever the model calls its own
        things."""
        start, end = self.token.at, self.text.find(")", self.token.at)
        number = quantity(self.text[start + 1 : end]) if end > 0 else None
        if number is None or not number.unit:
            return None
        self.token = self.read(end + 1)
        return tree.Number(number.value, number.unit, start)

    def _named(self) -> Expression:
        token = self.take()
        if self.token.text != "(":
            # bodies may be called so, and stand between the brackets of such a function
            own = token.text in KINEMATIC_FUNCTIONS and (self.about or token.text in self.names)
            if not own and (token.text in self.functions or token.text == "der"):
                self.refuse(
                    f"the function '{token.text}' has no argument", token.at, f"{token.text}(…)"
                )
            return (
                tree.Number(math.pi, "", token.at)
                if token.text == "pi"
                else tree.Name(token.text, token.at)
            )
        if token.text == "der":
            return self._component(self._rate(token))
        if token.text not in self.functions:
            self._refuse_function(token)
        return self._component(self._call(token))

    def _component(self, part: Expression) -> Expression:
        """`position(b).x`: a component of what a function gives, or brackets with one, as a call of
        the function `.x`."""
        if self.token.text != "." or not _is_kinematic(part):
            return part
        self.take()
        letters = self.take()
        if letters.kind != "name":
            given = part.function if isinstance(part, tree.Call) else ""
            self.refuse_token(letters, f"a component, such as {given}(…).x")
        return tree.Call(f".{letters.text}", (part,), part.at)

    def _refuse_function(self, token: Token) -> NoReturn:
        if token.text in self.names:
            self.refuse(
                f"'{token.text}' is not a function",
                token.at,
                "an operator before the bracket, such as 2*(…)",
            )
        if token.text in OUTPUT_FUNCTIONS:
            self.refuse(
                f"{token.text}() stands alone in an entry of `outputs:` and not in a formula",
                token.at,
                "coordinates, velocities and the usual functions",
                "reaction.NAME is a reaction, in `nonideal:`" if token.text == "reaction" else "",
            )
        known = [*self.functions, "der"]
        self.refuse(
            f"unknown function '{token.text}'",
            token.at,
            listed(known, 24),
            _in_braces(token.text) or did_you_mean(token.text, known),
        )

    def _rate(self, token: Token) -> Expression:
        """der(q), the rate of a coordinate; of anything else a call of `der`."""
        opening = self.token
        name = self.read(self.after(opening))
        closing = self.read(self.after(name))
        if name.kind == "name" and closing.text == ")":
            self.token = self.read(self.after(closing))
            return tree.Rate(name.text, token.at)
        if name.text == ")" or not self.vectors:
            self.refuse("der() takes the name of one coordinate", name.at, "der(q)")
        return tree.Call("der", tuple(self._bracketed(")")), token.at)

    def _call(self, token: Token) -> tree.Call:
        kinematic = token.text in KINEMATIC_FUNCTIONS
        self.about += kinematic
        arguments = self._bracketed(")", many=True)
        self.about -= kinematic
        least, most = self.functions[token.text].arity
        if not least <= len(arguments) <= most:
            wanted = str(least) if least == most else f"{least} to {most}"
            given = f"{len(arguments)} argument{'s' * (len(arguments) != 1)}"
            self.refuse(
                f"{token.text}() does not take {given}",
                token.at,
                f"{wanted} argument{'s' * (wanted != '1')}",
            )
        return tree.Call(token.text, tuple(arguments), token.at)

    def _bracketed(self, closing: str, many: bool = False) -> list[Expression]:
        opening = self.take()
        self._enter(opening)
        entries = [self.sum()]
        while many and self.token.text == ",":
            self.take()
            entries.append(self.sum())
        if self.token.text != closing:
            self._refuse_unclosed(opening, closing)
        self.take()
        self.depth -= 1
        return entries

    def _refuse_unclosed(self, opening: Token, closing: str) -> NoReturn:
        if self.token.kind == "end":
            self.refuse(f"'{opening.text}' is never closed", opening.at, f"'{closing}'")
        self.refuse_follower(closing)

    def _enter(self, token: Token) -> None:
        self.depth += 1
        if self.depth > NESTING:
            self.refuse(
                "the formula is nested too deeply",
                token.at,
                f"at most {NESTING} levels",
                "name a part in `where:`",
            )


def _in_braces(name: str) -> str:
    """Where a function stands that no formula has; nothing of others."""
    if name not in INDEX_FUNCTIONS:
        return ""
    return f"{name}() stands in braces, of indices of `repeat:`, as in {{{name}(i, 2) + 1}}"


def _negated(argument: Expression, at: int) -> Expression:
    if isinstance(argument, tree.Number):
        return tree.Number(-argument.value, argument.unit, at)
    return argument.argument if isinstance(argument, tree.Negative) else tree.Negative(argument, at)


def _product_of(factors: list[Expression], at: int) -> Expression:
    return factors[0] if len(factors) == 1 else tree.Product(tuple(factors), at)


def _is_kinematic(part: Expression) -> bool:
    """Whether it may be a vector: whether it is one is seen where bodies have places."""
    calls = (x for x in tree.walk(part) if isinstance(x, tree.Call))
    return any(call.function in KINEMATIC_FUNCTIONS for call in calls)


def _check_height(expression: Expression, text: str) -> None:
    heights: list[int] = []  # a stack of finished operands, in the order `walk` leaves them
    for node in tree.walk(expression):
        count = len(tree.children(node))
        below = max(heights[len(heights) - count :], default=0) if count else 0
        if below >= HEIGHT:
            raise FormulaError(
                "the formula is nested too deeply", text, node.at, hint="name a part in `where:`"
            )
        del heights[len(heights) - count :]
        heights.append(below + 1)
