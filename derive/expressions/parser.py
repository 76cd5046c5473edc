"""Text of a formula → expression tree: a precedence parser with a whitelist grammar. Nothing is
ever evaluated as Python.

    sum     = product (("+" | "-") product)*
    product = unary (("*" | "/") unary)*
    unary   = ("+" | "-")* power
    power   = atom [("**" | "^") unary]    right-associative, and binds tighter than a minus
    atom    = number [unit] | name | "der" "(" sum ")" ["." letters]
            | function "(" sum ("," sum)* ")" ["." letters]
            | "(" sum ")" ["." letters] | "[" sum, … "]"
    unit    = (symbol ["^" integer] | "1" "/" symbol ["^" integer])
              (("*" | "/") (symbol ["^" integer] | "(" unit ")"))*
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Container, Mapping
from fractions import Fraction
from typing import NamedTuple, NoReturn

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
from derive.expressions.limits import (
    ABOVE,
    BELOW,
    MOST_POWER,
    MOST_SI,
    too_large,
    too_small,
)
from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import Expression
from derive.expressions.units import PREFIXES, SI, UNITS, Factor, Unit, compound

NESTING = 60  # brackets, calls and exponents inside each other
HEIGHT = 120  # levels of the finished tree: everything downstream may recurse over it
LONGEST = 1 << 20  # characters
LONGEST_SYMBOL = max(map(len, UNITS))

_PLAIN = re.compile(r"[+-]?(?:0|[1-9][0-9]*)(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?")
_DATE = re.compile(r"\s*[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}\s*")
RATIO = re.compile(r"([0-9.]+)\s*:\s*([0-9.]+)")  # as gears have it
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*)"
    r"|(?P<sign>\*\*|[-+*/^(),\[\]])|(?P<end>$)|(?P<other>.))",
    re.DOTALL,
)


# Characters of set type, and how formulas write them.
TYPESET = {
    "°": "deg",
    "µ": "u",
    "μ": "u",
    "·": "*",
    "×": "*",
    "²": "^2",
    "³": "^3",
    "−": "-",
    "÷": "/",
    "√": "sqrt(…)",
}


class _Token(NamedTuple):
    kind: str
    text: str
    at: int


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


def plain_number(text: str) -> tree.Number | None:
    """A number without a unit and nothing else, as `expression` reads it; None where the text is
    anything else, or a number that no model may have. Long models are mostly such numbers."""
    if not _PLAIN.fullmatch(text):
        return None
    value = float(text)
    vanished = value == 0.0 and text.strip("+-.0")
    if vanished or too_large(value) or too_small(value):
        return None
    return tree.Number(value, "", int(text.startswith("+")))


@functools.lru_cache(maxsize=1024)
def unit(text: str) -> Unit:
    """A unit on its own, such as `N*m`; "1" and "" are the plain number."""
    parser = _Parser(text, (), {}, False)
    if parser.token.text == "1":
        parser.take()
        parts = [] if parser.token.kind == "end" else parser.unit_tail(parser.token.at)
    else:
        parts = [] if parser.token.kind == "end" else parser.unit_parts()
    parser.finish()
    return compound(parts)


def quantity(text: str) -> tree.Number | None:
    """A number with its unit and nothing else; None where the text is anything else."""
    parser = _Parser(text, (), {}, False)
    sign = -1.0 if parser.token.text == "-" else 1.0
    if parser.token.text in ("-", "+"):
        parser.take()
    if parser.token.kind != "number":
        return None
    try:
        number = parser.number()
        parser.finish()
    except FormulaError:
        return None
    return tree.Number(sign * number.value, number.unit)


class _Parser:
    def __init__(
        self, text: str, names: Container[str], functions: Mapping[str, Function], vectors: bool
    ) -> None:
        self.text, self.names, self.functions, self.vectors = text, names, functions, vectors
        if len(text) > LONGEST:
            raise FormulaError(
                f"a formula of {len(text)} characters", expected=f"at most {LONGEST}"
            )
        self.depth = 0
        self.about = 0  # functions of bodies that the place is inside of
        self.token = self._read(0)

    def sum(self) -> Expression:
        """`product (("+" | "-") product)*`. A sum is kept flat, so that a long one is no deep tree;
        its sign is in its terms."""
        at = self.token.at
        terms = [self._signed_product()]
        while self.token.text in ("+", "-"):
            terms.append(self._signed_product())
        return terms[0] if len(terms) == 1 else tree.Sum(tuple(terms), at)

    def finish(self) -> None:
        """Asks that nothing is left of the text. Raises ModelError at the first token that follows
        a whole formula."""
        if self.token.kind != "end":
            self._refuse_follower()

    def _signed_product(self) -> Expression:
        at, minus = self.token.at, self._signs()
        result = self._product()
        return _negated(result, at) if minus else result

    def _signs(self) -> bool:
        minus = False
        while self.token.text in ("+", "-"):
            minus ^= self.take().text == "-"
        return minus

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
            self._refuse(
                "a number with a unit right after '/' can be read two ways",
                start.at,
                "(2 kg) in brackets, or 0.5 kg",
            )
        return result

    def _unary(self) -> Expression:
        at, minus = self.token.at, self._signs()
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
            self._refuse(
                "a list inside a formula", token.at, "a number, a name, a function or a bracket"
            )
        self._refuse_token(token, "a number, a name, a function or a bracket")

    def _bracketed_quantity(self) -> tree.Number | None:
        """(0.1 N*m): a number and its unit alone in brackets, whatever the model calls its own
        things."""
        start, end = self.token.at, self.text.find(")", self.token.at)
        number = quantity(self.text[start + 1 : end]) if end > 0 else None
        if number is None or not number.unit:
            return None
        self.token = self._read(end + 1)
        return tree.Number(number.value, number.unit, start)

    def number(self) -> tree.Number:
        """A number with the unit that may follow it, in SI: `3 cm` is 0.03 m, `2 /s` is 2 1/s.

        Raises ModelError where its value in SI is too large, or too small to be told from zero.
        """
        token = self.take()
        value = _finite(token, self.text)
        # a number may be large in its unit and not in SI, or the other way round
        if self._inverse_unit_follows():
            self.take()
            given = compound(self.unit_tail(self.token.at))
        elif self.token.kind == "name":
            given = compound(self.unit_parts())
        else:
            given = compound(())
        scaled = value * given.factor
        if too_large(scaled):
            self._refuse("the number is too large", token.at, BELOW)
        if too_small(scaled):
            self._refuse("the number is too small to tell from zero", token.at, ABOVE)
        return tree.Number(scaled, given.si, token.at)

    def _inverse_unit_follows(self) -> bool:
        """Whether `1/s` stands directly after a number, as in 2 1/s."""
        if self.token.kind != "number" or self.token.text != "1":
            return False
        slash = self._read(self._end)
        if slash.text != "/":
            return False
        below = self._after(slash)
        return self._read(below).text in UNITS or bool(self._unit_bracket(below))

    def unit_parts(self) -> list[Factor]:
        """Symbols and powers of a unit that starts here: `kg*m^2/s` gives kg 1, m 2, s −1."""
        parts = [self._unit_symbol(1)]
        return parts + self.unit_tail(self.token.at)

    def unit_tail(self, at: int) -> list[Factor]:
        """The further factors of a unit. A `*` or `/` before anything but a unit ends it: in `3
        m*x` the x is a factor of the formula and not a unit."""
        parts: list[Factor] = []
        while self.token.text in ("*", "/"):
            bracket = self._unit_bracket(self._end)
            if not bracket and not self._unit_follows():
                break
            sign = 1 if self.take().text == "*" else -1
            if bracket:
                parts += [(symbol, sign * n) for symbol, n in bracket]
                self.token = self._read(self.text.index(")", self.token.at) + 1)
            else:
                parts.append(self._unit_symbol(sign))
        return parts

    def _unit_bracket(self, at: int) -> list[Factor]:
        """`(rad*s)` at an offset, as in N*m/(rad*s): symbols of units alone, none of them a name of
        the model; [] where there is no bracket, or one of anything else."""
        opening = self._read(at)
        end = self.text.find(")", opening.at)
        if opening.text != "(" or end < 0:
            return []
        inside = _Parser(self.text[opening.at + 1 : end], (), {}, False)
        try:
            parts = inside.unit_parts()
            inside.finish()
        except FormulaError:
            return []
        return [] if any(symbol in self.names for symbol, _ in parts) else parts

    def _unit_follows(self) -> bool:
        following = self._read(self._end)
        if (
            following.kind != "name"
            or following.text not in UNITS
            or self._read(self._after(following)).text == "("
        ):
            return False
        if following.text in self.names:
            self._refuse(
                f"'{following.text}' can be the unit or the model's own name here",
                following.at,
                f"brackets: (2 N*{following.text}) for the unit, (2 N)*{following.text} for the "
                "name",
            )
        return True

    def _unit_symbol(self, sign: int) -> Factor:
        token = self.token
        if token.kind != "name" or token.text not in UNITS:
            self._refuse_unit(token)
        self.take()
        if self.token.text not in ("^", "**"):
            return token.text, Fraction(sign)
        # powers of SI units are exact; those of others may leave what a double holds
        most = MOST_SI if UNITS[token.text][0] == 1.0 else MOST_POWER
        self.take()
        return token.text, sign * self._unit_exponent(most)

    def _unit_exponent(self, most: int) -> Fraction:
        """`2`, `1.5`, `-1` or `(3/2)`."""
        minus = self._signs()
        at = self.token.at
        found = (
            self._bracketed_fraction()
            if self.token.text == "("
            else self._fraction(r"\d{1,2}(\.\d)?")
        )
        if found is None or found > most:
            self._refuse("the power of a unit is no small number", at, "such as s^2 or m^1.5")
        return -found if minus else found

    def _bracketed_fraction(self) -> Fraction | None:
        self.take()
        above = self._fraction(r"\d{1,3}")
        slash = self.take().text
        below = self._fraction(r"\d")
        closed = self.take().text == ")"
        return above / below if above is not None and below and slash == "/" and closed else None

    def _fraction(self, pattern: str) -> Fraction | None:
        token = self.take()
        return Fraction(token.text) if re.fullmatch(pattern, token.text, re.ASCII) else None

    def _refuse_unit(self, token: _Token) -> NoReturn:
        if token.text in self.names or token.text in self.functions or token.text == "der":
            self._refuse(
                f"'{token.text}' stands directly after a number",
                token.at,
                "an operator, such as 2*x",
            )
        split, number = _split_unit(token.text), _prefixed(token.text)
        hint = f"did you mean '{split}'?" if split else did_you_mean(token.text, UNITS)
        hint = f"that is {number}" if number and not split else hint
        self._refuse(f"unknown unit '{token.text}'", token.at, listed(UNITS, 8), hint)

    def _named(self) -> Expression:
        token = self.take()
        if self.token.text != "(":
            # bodies may be called so, and stand between the brackets of such a function
            own = token.text in KINEMATIC_FUNCTIONS and (self.about or token.text in self.names)
            if not own and (token.text in self.functions or token.text == "der"):
                self._refuse(
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
            self._refuse_token(letters, f"a component, such as {given}(…).x")
        return tree.Call(f".{letters.text}", (part,), part.at)

    def _refuse_function(self, token: _Token) -> NoReturn:
        if token.text in self.names:
            self._refuse(
                f"'{token.text}' is not a function",
                token.at,
                "an operator before the bracket, such as 2*(…)",
            )
        if token.text in OUTPUT_FUNCTIONS:
            self._refuse(
                f"{token.text}() stands alone in an entry of `outputs:` and not in a formula",
                token.at,
                "coordinates, velocities and the usual functions",
                "reaction.NAME is a reaction, in `nonideal:`" if token.text == "reaction" else "",
            )
        known = [*self.functions, "der"]
        self._refuse(
            f"unknown function '{token.text}'",
            token.at,
            listed(known, 24),
            _in_braces(token.text) or did_you_mean(token.text, known),
        )

    def _rate(self, token: _Token) -> Expression:
        """der(q), the rate of a coordinate; of anything else a call of `der`."""
        opening = self.token
        name = self._read(self._after(opening))
        closing = self._read(self._after(name))
        if name.kind == "name" and closing.text == ")":
            self.token = self._read(self._after(closing))
            return tree.Rate(name.text, token.at)
        if name.text == ")" or not self.vectors:
            self._refuse("der() takes the name of one coordinate", name.at, "der(q)")
        return tree.Call("der", tuple(self._bracketed(")")), token.at)

    def _call(self, token: _Token) -> tree.Call:
        kinematic = token.text in KINEMATIC_FUNCTIONS
        self.about += kinematic
        arguments = self._bracketed(")", many=True)
        self.about -= kinematic
        least, most = self.functions[token.text].arity
        if not least <= len(arguments) <= most:
            wanted = str(least) if least == most else f"{least} to {most}"
            given = f"{len(arguments)} argument{'s' * (len(arguments) != 1)}"
            self._refuse(
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

    def _refuse_unclosed(self, opening: _Token, closing: str) -> NoReturn:
        if self.token.kind == "end":
            self._refuse(f"'{opening.text}' is never closed", opening.at, f"'{closing}'")
        self._refuse_follower(closing)

    def _refuse_follower(self, closing: str = "") -> NoReturn:
        after = (
            f"an operator or '{closing}'" if closing else "an operator or the end of the formula"
        )
        if self.token.kind == "name" and self.token.text in UNITS:
            self._refuse(
                f"unexpected '{self.token.text}'",
                self.token.at,
                after,
                "a unit stands directly after a number, as in 3 kg*m^2",
            )
        self._refuse_token(self.token, after)

    def _refuse_token(self, token: _Token, expected: str) -> NoReturn:
        if token.kind == "end":
            self._refuse(
                "the formula ends too early" if self.text.strip() else "the formula is empty",
                token.at,
                expected,
            )
        if token.kind != "other":
            self._refuse(f"unexpected '{token.text}'", token.at, expected)
        plain = TYPESET.get(token.text)
        hint = f"in a formula it is written {plain}" if plain else ""
        if token.text == "=":
            hint = "a formula is made zero as it stands: without the sign and what is behind it"
        ratio = RATIO.fullmatch(self.text.strip())
        if ratio and token.text == ":":
            hint = f"a ratio is a quotient: {ratio[1]}/{ratio[2]}"
        self._refuse(f"unexpected character {token.text!r}", token.at, expected, hint)

    def _enter(self, token: _Token) -> None:
        self.depth += 1
        if self.depth > NESTING:
            self._refuse(
                "the formula is nested too deeply",
                token.at,
                f"at most {NESTING} levels",
                "name a part in `where:`",
            )

    def _refuse(self, message: str, at: int, expected: str = "", hint: str = "") -> NoReturn:
        raise FormulaError(message, self.text, at, expected, hint)

    def take(self) -> _Token:
        """The token under the cursor; the cursor goes on to the next."""
        token = self.token
        self.token = self._read(self._end)
        return token

    @property
    def _end(self) -> int:
        return self._after(self.token)

    @staticmethod
    def _after(token: _Token) -> int:
        return token.at + len(token.text)

    def _read(self, at: int) -> _Token:
        match = _TOKEN.match(self.text, at)
        if match is None or match.lastgroup is None:
            return _Token("end", "", len(self.text))
        kind = match.lastgroup
        return _Token(kind, match.group(kind), match.start(kind))


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


def _finite(token: _Token, text: str) -> float:
    value = float(token.text)
    if math.isinf(value):
        raise FormulaError("the number is too large", text, token.at, BELOW)
    mantissa = re.split("[eE]", token.text)[0]
    if re.match("0[0-9]", mantissa):
        expected = f"{mantissa.lstrip('0') or 0}: octal numbers are not part of the model language"
        raise FormulaError(
            f"the number '{token.text}' starts with a zero", text, token.at, expected
        )
    if value == 0.0 and mantissa.strip("0."):
        raise FormulaError(
            "the number is too small to tell from zero",
            text,
            token.at,
            ABOVE,
        )
    return value


def _is_kinematic(part: Expression) -> bool:
    """Whether it may be a vector: whether it is one is seen where bodies have places."""
    calls = (x for x in tree.walk(part) if isinstance(x, tree.Call))
    return any(call.function in KINEMATIC_FUNCTIONS for call in calls)


def _split_unit(text: str) -> str:
    """`Nm` → `N*m`: two or three symbols run together, if possible without a prefix."""
    if len(text) > 3 * LONGEST_SYMBOL:  # a file may have thousands of letters here
        return ""
    splits = [
        (text[:i], *filter(None, (text[i:k], text[k:])))
        for i in range(1, len(text))
        for k in range(i + 1, len(text) + 1)
    ]
    known = [parts for parts in splits if all(part in UNITS for part in parts)]
    # nobody means kg*g or m*cm
    known = [parts for parts in known if len({str(UNITS[x][1]) for x in parts}) == len(parts)]
    return "*".join(min(known, key=lambda parts: sum(part not in SI for part in parts), default=""))


def _prefixed(text: str) -> str:
    """`pN` as `1e-12 N`: a prefix that no unit of the table has."""
    power = PREFIXES.get(text[:1])
    return f"{power:g} {text[1:]}" if power and text[1:] in (*SI, "g") else ""


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
