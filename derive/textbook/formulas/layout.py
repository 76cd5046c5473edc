"""What fits on a line or a page: which entries of a matrix are written in it and which beside it,
which numbers are too long to be read, and what is shown of a long list."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import casadi as ca
import sympy

from derive.textbook.formulas.compose import operations
from derive.textbook.formulas.typeset import digits

CELL = 26  # a wider entry gets a line of its own before the matrix
COLUMN = 44  # the same where the matrix has one column
ROW = 40  # a wider matrix shows its widest entries by their symbols: legible at 390 pixels
SYMBOL = 3  # the width of an entry's symbol
GAP = 2  # between columns
MUCH_SHORTER = 0.6  # of the operations over the basic symbols
WORTH_NAMES = 30  # operations of all entries, before symbols of other terms are put into them
FEW_DIGITS = 6  # of a number in a table
MOST_DIGITS = 7  # a decimal of more gets a name
MOST_ROWS = 40  # of a table or list that is printed whole
KEPT = 10  # of a longer one

Item = TypeVar("Item")
Rows = list[list[sympy.Expr]]
Places = set[tuple[int, int]]


def wide_entries(widths: Sequence[Sequence[int]]) -> Places:
    """Places of the entries that get a line of their own: too wide ones, then the widest until the
    matrix fits."""
    cells = {(i, j): w for i, row in enumerate(widths) for j, w in enumerate(row)}
    most = CELL if any(len(row) > 1 for row in widths) else COLUMN
    listed = {place for place, w in cells.items() if w > most}
    for place in sorted(cells, key=lambda place: (-cells[place], place)):
        if _across(widths, listed) <= ROW or cells[place] <= SYMBOL:
            break
        listed.add(place)
    return listed


def _across(widths: Sequence[Sequence[int]], listed: Places) -> int:
    """The width of the matrix, its columns as wide as their widest entries."""
    columns = [list(column) for column in zip(*widths)]
    for i, j in listed:
        columns[j][i] = SYMBOL
    return sum(max(column) for column in columns) + GAP * (len(columns) - 1)


def plain(x: sympy.Expr) -> bool:
    """A number, a symbol or its negative."""
    return bool(x.is_Number or x.is_Symbol or (-x).is_Symbol)


def simple(x: sympy.Expr) -> bool:
    """Short enough to be written instead of a symbol for it."""
    return operations(x) <= 1 and not x.has(sympy.Function)


def entry_index(stem: str, i: int, j: int) -> str:
    """stem with row and column below, from one; a comma where one of them has two digits."""
    comma = "," if max(i, j) > 8 else ""
    return f"{stem}_{{{i + 1}{comma}{j + 1}}}"


def rows_of(entries: Sequence[sympy.Expr], shape: tuple[int, int]) -> Rows:
    """Entries given row by row, as rows."""
    n, m = shape
    return [list(entries[i * m : (i + 1) * m]) for i in range(n)]


def sum_of(weights: Sequence[sympy.Expr], terms: Sequence[sympy.Expr]) -> sympy.Expr:
    """Σ weight · term."""
    return sympy.Add(*[x * y for x, y in zip(weights, terms)])


def much_shorter(x: Sequence[sympy.Expr], y: Sequence[sympy.Expr]) -> bool:
    """Whether formulas over names of other terms save enough to be read instead."""
    total = sum(map(operations, y))
    return sum(map(operations, x)) < MUCH_SHORTER * total > WORTH_NAMES


def identity(n: int) -> Rows:
    """Ones on the diagonal."""
    return [[sympy.Integer(i == j) for j in range(n)] for i in range(n)]


def short_or_symbol(row: Sequence[sympy.Expr], symbols: Sequence[sympy.Symbol]) -> list[sympy.Expr]:
    """Entries of a row that are short, and the symbols of the others."""
    return [x if simple(x) else symbol for x, symbol in zip(row, symbols)]


def rounded(x: sympy.Expr) -> sympy.Expr:
    """A formula of a table with few digits in its numbers; a number alone is a decimal, as it is
    given."""
    if isinstance(x, sympy.Rational) and len(digits(x)) <= FEW_DIGITS and not x.is_Integer:
        return sympy.Float(repr(float(x)), 15)
    return x.xreplace({n: sympy.Float(f"{float(n):.{FEW_DIGITS}g}") for n in _long(x)})


def is_long(x: sympy.Expr) -> bool:
    """Whether `rounded` takes digits away."""
    return bool(_long(x))


def _long(x: sympy.Expr) -> list[sympy.Float]:
    """Its numbers of many digits."""
    numbers: set[sympy.Float] = x.atoms(sympy.Float)  # pyright: ignore[reportAssignmentType]
    return [n for n in numbers if len(digits(n)) > MOST_DIGITS]


def mark(x: ca.SX) -> str:
    """What a picture of a pattern shows of an entry: nothing, a number, or a term."""
    if x.is_zero():
        return " "
    return "1" if x.is_constant() else "x"


def ends(
    items: Sequence[Item], most: int = MOST_ROWS
) -> tuple[Sequence[Item], int, Sequence[Item]]:
    """Of a long list the first, how many are left out, and the last two; all of a shorter one."""
    if len(items) <= most:
        return items, 0, ()
    return items[: KEPT - 2], len(items) - KEPT, items[-2:]


def more(count: int) -> str:
    """What stands in the place of so many."""
    return f"⋮ {count} more"
