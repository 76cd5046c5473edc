"""Long decimals of formulas get names, which are explained once."""

from __future__ import annotations

from collections.abc import Callable

import sympy

from derive.textbook.formulas.layout import MOST_DIGITS
from derive.textbook.formulas.ring import ROUNDING
from derive.textbook.formulas.typeset import digits


class Constants:
    """`name` gives the symbol of a number that has none, and explains it."""

    def __init__(self, name: Callable[[int, sympy.Float], sympy.Symbol]) -> None:
        self.name = name
        self.symbols: dict[sympy.Float, sympy.Symbol] = {}

    def named(self, x: sympy.Expr) -> sympy.Expr:
        """The expression over symbols in place of long decimals."""
        numbers: set[sympy.Float] = x.atoms(sympy.Float)  # pyright: ignore[reportAssignmentType]
        long = sorted((n for n in numbers if len(digits(n)) > MOST_DIGITS), key=float)
        return x.xreplace({n: self._symbol(n) for n in long}) if long else x

    def _symbol(self, n: sympy.Float) -> sympy.Expr:
        """The name of a number or of its negative, a new one where it has none."""
        for known, symbol in self.symbols.items():
            if abs(abs(float(known)) - abs(float(n))) <= ROUNDING * abs(float(n)):
                return symbol if float(known) * float(n) > 0 else -symbol
        self.symbols[n] = self.name(len(self.symbols) + 1, n)
        return self.symbols[n]
