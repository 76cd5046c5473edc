"""Columns of the tables of links: a value each, or numbers that parameters multiply."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from derive.diagnostics import AssumptionError
from derive.expressions.scalars import Scalar
from derive.formulations.rolled.factors import factored
from derive.formulations.rolled.rows import plain
from derive.mechanics.records import System

# symbols of columns that differ from link to link, with them; and what each value of a link is
Columns = tuple[list[tuple[ca.SX, tuple[Scalar, ...]]], list[Scalar]]


def together(table: Sequence[tuple[Scalar, ...]]) -> Columns:
    """Each value a column of its own."""
    columns: list[tuple[ca.SX, tuple[Scalar, ...]]] = []
    values: list[Scalar] = []
    for column in zip(*table):
        keys = {*signature(column)}
        if isinstance(column[0], float) and len(keys) == 1:
            values.append(column[0])
        else:
            symbol = ca.SX.sym(f"k{len(columns)}")
            columns.append((symbol, column))
            values.append(symbol)
    return columns, values


class Factors:
    """Formulas of parameters that links have in common."""

    def __init__(self, system: System) -> None:
        self._system = system
        self.symbols: list[ca.SX] = []
        self.formulas: list[ca.SX] = []

    def apart(self, table: Sequence[tuple[Scalar, ...]]) -> Columns:
        """Each value as numbers by link times formulas of parameters.

        Raises AssumptionError where a value is no combination of few formulas.
        """
        columns: list[tuple[ca.SX, tuple[Scalar, ...]]] = []
        values: list[Scalar] = []
        for column in zip(*table):
            made = factored(column, self._system.p, self._system.parameters)
            if made is None:
                raise AssumptionError(
                    f"parameters make {len(table)} links differ; `--constants` bakes them in"
                )
            total: Scalar = 0.0
            for formula, numbers in zip(made.formulas, zip(*made.numbers)):
                number: Scalar = numbers[0]
                if len(set(numbers)) > 1:
                    number = ca.SX.sym(f"k{len(columns)}")
                    columns.append((number, numbers))
                total = plain(total + number * self._symbol(formula))
            values.append(total)
        return columns, values

    def _symbol(self, formula: Scalar) -> Scalar:
        """What stands for the formula: a symbol, or a number times one that is there."""
        if not isinstance(formula, ca.SX):
            return formula
        for known, symbol in zip(self.formulas, self.symbols):
            both = factored((known, formula), self._system.p, self._system.parameters)
            if both is not None and len(both.formulas) == 1:
                return both.numbers[1][0] * symbol
        self.formulas.append(formula)
        self.symbols.append(ca.SX.sym(f"f{len(self.symbols)}"))
        return self.symbols[-1]


def stacked(symbols: Sequence[ca.SX]) -> ca.SX:
    """One column of them; none makes an empty one."""
    return ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


def signature(values: Sequence[Scalar]) -> tuple[object, ...]:
    """Equal for values that are written alike."""
    return tuple([x if isinstance(x, float) else str(x) for x in values])
