"""Numbers with units in a formula, and units alone.

number  = digits [unit]
unit    = (symbol ["^" integer] | "1" "/" symbol ["^" integer])
          (("*" | "/") (symbol ["^" integer] | "(" unit ")"))*
"""

from __future__ import annotations

import functools
import math
import re
from fractions import Fraction
from typing import NoReturn

from derive.diagnostics import did_you_mean, listed
from derive.expressions import tree
from derive.expressions.limits import ABOVE, BELOW, MOST_POWER, MOST_SI, too_large, too_small
from derive.expressions.mistakes import FormulaError
from derive.expressions.tokens import Token, Tokens
from derive.expressions.units import PREFIXES, SI, UNITS, Factor, Unit, compound

LONGEST_SYMBOL = max(map(len, UNITS))
_PLAIN = re.compile(r"[+-]?(?:0|[1-9][0-9]*)(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?")


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
    parser = Quantities(text)
    if parser.token.text == "1":
        parser.take()
        parts = [] if parser.token.kind == "end" else parser.unit_tail(parser.token.at)
    else:
        parts = [] if parser.token.kind == "end" else parser.unit_parts()
    parser.finish()
    return compound(parts)


def quantity(text: str) -> tree.Number | None:
    """A number with its unit and nothing else; None where the text is anything else."""
    parser = Quantities(text)
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


class Quantities(Tokens):
    """Reads a number, or a unit, where the cursor is."""

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
            self.refuse("the number is too large", token.at, BELOW)
        if too_small(scaled):
            self.refuse("the number is too small to tell from zero", token.at, ABOVE)
        return tree.Number(scaled, given.si, token.at)

    def _inverse_unit_follows(self) -> bool:
        """Whether `1/s` stands directly after a number, as in 2 1/s."""
        if self.token.kind != "number" or self.token.text != "1":
            return False
        slash = self.read(self.end)
        if slash.text != "/":
            return False
        below = self.after(slash)
        return self.read(below).text in UNITS or bool(self._unit_bracket(below))

    def unit_parts(self) -> list[Factor]:
        """Symbols and powers of a unit that starts here: `kg*m^2/s` gives kg 1, m 2, s −1."""
        parts = [self._unit_symbol(1)]
        return parts + self.unit_tail(self.token.at)

    def unit_tail(self, at: int) -> list[Factor]:
        """The further factors of a unit. A `*` or `/` before anything but a unit ends it: in `3
        m*x` the x is a factor of the formula and not a unit."""
        parts: list[Factor] = []
        while self.token.text in ("*", "/"):
            bracket = self._unit_bracket(self.end)
            if not bracket and not self._unit_follows():
                break
            sign = 1 if self.take().text == "*" else -1
            if bracket:
                parts += [(symbol, sign * n) for symbol, n in bracket]
                self.token = self.read(self.text.index(")", self.token.at) + 1)
            else:
                parts.append(self._unit_symbol(sign))
        return parts

    def _unit_bracket(self, at: int) -> list[Factor]:
        """`(rad*s)` at an offset, as in N*m/(rad*s): symbols of units alone, none of them a name of
        the model; [] where there is no bracket, or one of anything else."""
        opening = self.read(at)
        end = self.text.find(")", opening.at)
        if opening.text != "(" or end < 0:
            return []
        inside = Quantities(self.text[opening.at + 1 : end])
        try:
            parts = inside.unit_parts()
            inside.finish()
        except FormulaError:
            return []
        return [] if any(symbol in self.names for symbol, _ in parts) else parts

    def _unit_follows(self) -> bool:
        following = self.read(self.end)
        if (
            following.kind != "name"
            or following.text not in UNITS
            or self.read(self.after(following)).text == "("
        ):
            return False
        if following.text in self.names:
            self.refuse(
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
        minus = self.signs()
        at = self.token.at
        found = (
            self._bracketed_fraction()
            if self.token.text == "("
            else self._fraction(r"\d{1,2}(\.\d)?")
        )
        if found is None or found > most:
            self.refuse("the power of a unit is no small number", at, "such as s^2 or m^1.5")
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

    def _refuse_unit(self, token: Token) -> NoReturn:
        if token.text in self.names or token.text in self.functions or token.text == "der":
            self.refuse(
                f"'{token.text}' stands directly after a number",
                token.at,
                "an operator, such as 2*x",
            )
        split, number = _split_unit(token.text), _prefixed(token.text)
        hint = f"did you mean '{split}'?" if split else did_you_mean(token.text, UNITS)
        hint = f"that is {number}" if number and not split else hint
        self.refuse(f"unknown unit '{token.text}'", token.at, listed(UNITS, 8), hint)


def _finite(token: Token, text: str) -> float:
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
