"""Tokens of a formula, read where the cursor is, and what is said of those that do not belong."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping
from typing import NamedTuple, NoReturn

from derive.expressions.functions import Function
from derive.expressions.mistakes import FormulaError
from derive.expressions.units import UNITS

LONGEST = 1 << 20  # characters
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


class Token(NamedTuple):
    """A piece of the text: its kind as in `_TOKEN`, and where it stands."""

    kind: str
    text: str
    at: int


class Tokens:
    """A text, and the token under the cursor. `names` are the model's own, `functions` what may be
    called."""

    def __init__(
        self, text: str, names: Container[str] = (), functions: Mapping[str, Function] | None = None
    ) -> None:
        self.text, self.names, self.functions = text, names, functions or {}
        if len(text) > LONGEST:
            raise FormulaError(
                f"a formula of {len(text)} characters", expected=f"at most {LONGEST}"
            )
        self.token = self.read(0)

    def take(self) -> Token:
        """The token under the cursor; the cursor goes on to the next."""
        token = self.token
        self.token = self.read(self.end)
        return token

    @property
    def end(self) -> int:
        """Behind the token under the cursor."""
        return self.after(self.token)

    @staticmethod
    def after(token: Token) -> int:
        """Behind that token."""
        return token.at + len(token.text)

    def read(self, at: int) -> Token:
        """The token from an offset on."""
        match = _TOKEN.match(self.text, at)
        if match is None or match.lastgroup is None:
            return Token("end", "", len(self.text))
        kind = match.lastgroup
        return Token(kind, match.group(kind), match.start(kind))

    def signs(self) -> bool:
        """Takes signs; whether they are a minus."""
        minus = False
        while self.token.text in ("+", "-"):
            minus ^= self.take().text == "-"
        return minus

    def finish(self) -> None:
        """Asks that nothing is left of the text. Raises ModelError at the first token that follows
        a whole formula."""
        if self.token.kind != "end":
            self.refuse_follower()

    def refuse(self, message: str, at: int, expected: str = "", hint: str = "") -> NoReturn:
        """Raises FormulaError there."""
        raise FormulaError(message, self.text, at, expected, hint)

    def refuse_token(self, token: Token, expected: str) -> NoReturn:
        """What is said where another token has to stand."""
        if token.kind == "end":
            self.refuse(
                "the formula ends too early" if self.text.strip() else "the formula is empty",
                token.at,
                expected,
            )
        if token.kind != "other":
            self.refuse(f"unexpected '{token.text}'", token.at, expected)
        plain = TYPESET.get(token.text)
        hint = f"in a formula it is written {plain}" if plain else ""
        if token.text == "=":
            hint = "a formula is made zero as it stands: without the sign and what is behind it"
        ratio = RATIO.fullmatch(self.text.strip())
        if ratio and token.text == ":":
            hint = f"a ratio is a quotient: {ratio[1]}/{ratio[2]}"
        self.refuse(f"unexpected character {token.text!r}", token.at, expected, hint)

    def refuse_follower(self, closing: str = "") -> NoReturn:
        """What is said of a token behind a whole formula, or where a bracket has to be closed."""
        after = (
            f"an operator or '{closing}'" if closing else "an operator or the end of the formula"
        )
        if self.token.kind == "name" and self.token.text in UNITS:
            self.refuse(
                f"unexpected '{self.token.text}'",
                self.token.at,
                after,
                "a unit stands directly after a number, as in 3 kg*m^2",
            )
        self.refuse_token(self.token, after)
