"""The manuscript of a derivation: its sections so far, and how a term is put on the page.

A term is printed whole where it is short, over named sub-terms where it is not, and not at all
where even that would be unreadable. Later formulas are written over the entries' symbols, which is
why they stay short.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import casadi as ca
import sympy

from derive.expressions.deferred import Deferred
from derive.expressions.tree import Expression
from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.textbook import names
from derive.textbook.formulas.compose import operations
from derive.textbook.formulas.constants import Constants
from derive.textbook.formulas.convert import BEARABLE, FEW_PIECES, MOST_PIECES, READABLE, Piece
from derive.textbook.formulas.layout import (
    MOST_ROWS,
    Rows,
    ends,
    entry_index,
    is_long,
    mark,
    more,
    much_shorter,
    plain,
    rounded,
    rows_of,
    short_or_symbol,
    sum_of,
    wide_entries,
)
from derive.textbook.formulas.measure import parts
from derive.textbook.formulas.notation import Extra, Notation
from derive.textbook.formulas.terms import Terms
from derive.textbook.formulas.typeset import Typesetter, width
from derive.textbook.prose import left_alone, runs
from derive.textbook.records import (
    Block,
    Display,
    Document,
    Items,
    Law,
    Line,
    Math,
    Meaning,
    Paragraph,
    Pattern,
    Printed,
    Ref,
    Runs,
    Section,
    Table,
    Text,
)

Item = TypeVar("Item")
Residual = ca.SX | Deferred[ca.SX]

BROAD = 12  # more columns than this are not shown as a matrix
MOST_ENTRIES = 4000  # a larger matrix is not read at all
MOST_READ = 400  # entries of a term that is tried to be read
MOST_NODES = 60_000  # operations of one
LONG = 900  # characters of a display that is folded
MOST_LINES = 14  # so is one of more lines


class Manuscript:
    """Collects sections.

    `entries` holds, for each printed matrix or vector, what later formulas write for its entries (a
    symbol, or the entry itself where it is short); `exact` the entries of matrices as they were
    printed; `rates` the symbols of ẇ once these are printed.
    """

    def __init__(self, equations: Equations, extra: Sequence[Extra] = ()) -> None:
        self.terms = Terms(equations)
        self.notation = Notation(self.terms, extra)
        self.q, self.v = self.notation.q, self.notation.v  # symbols, in the order of the arrays
        self.w, self.u = self.notation.w, self.notation.u
        self.z = self.notation.z
        self.typesetter = Typesetter(self.notation.latex, len(self.notation.p))
        self.reader = self.notation.reader()
        self.entries: dict[str, Rows] = {}
        self.exact: dict[str, Rows] = {}
        self.meanings: list[Meaning] = []
        self.printed: list[Printed] = []
        self.rates: list[sympy.Symbol] = []
        self._laws: list[Law] = []
        self._sections: list[Section] = []
        self._title, self._blocks, self._side = "", list[Block](), 0
        self._number = 0  # of the last display
        self._numbers: dict[str, int] = {}  # of displays, by the name of what is in them
        self.column = 0  # of the sections that follow, see Section
        self.rounded = False  # whether a number of a table was
        self.folding = False  # of displays that follow, whatever their length
        self._told: set[tuple[str, int]] = set()  # what is told once in a column of the page
        self._explained = False  # what abbreviations are
        self._conditions = False  # whether one stands in a formula
        self._explained_conditions = False
        self._pending: list[Line] = []  # of symbols that the next display has to explain
        self._constants = Constants(self._constant)

    @property
    def equations(self) -> Equations:
        """The equations that are derived on these pages."""
        return self.terms.equations

    @property
    def system(self) -> System:
        """Their system: the mechanics before any choice."""
        return self.terms.system

    # prose

    def section(self, title: str) -> None:
        """Closes the running section and opens the next."""
        self._close()
        self._title, self._blocks, self._side = title, [], self.column

    def _close(self) -> None:
        if self._blocks:
            anchor = f"section-{len(self._sections) + 1}"
            self._sections.append(Section(self._title, anchor, tuple(self._blocks), self._side))

    def has_section(self, title: str) -> bool:
        """Whether a section of this title is closed."""
        return any(section.title == title for section in self._sections)

    def document(self, title: str, subtitle: str, version: str) -> Document:
        """All sections, formulas and laws so far."""
        self._close()
        return Document(
            title,
            subtitle,
            tuple(self._sections),
            tuple(self.printed),
            tuple(self._laws),
            version,
        )

    def ref(self, name: str) -> Ref:
        """The number of the display that shows a term or law; 0 where none does."""
        return Ref(self._numbers.get(name, 0))

    def say(self, template: str, **given: str | Math | Ref) -> None:
        """A paragraph. `$…$` in our own text is mathematics (see names.bold); `{name}` in it is the
        user's text, or Math."""
        self.add(runs(template, **given))

    def add(self, text: Runs) -> None:
        """A paragraph of runs."""
        self._blocks.append(Paragraph(text))

    def first(self, subject: str) -> bool:
        """Whether this is the first time that a subject is told in this column of the page."""
        told = self.has_told(subject)
        self._told.add((subject, self.column))
        return not told

    def has_told(self, subject: str) -> bool:
        """Whether it was told in this column of the page."""
        return (subject, self.column) in self._told

    def display(self, display: Display) -> None:
        """Equations that say how something is computed, and are no terms of the model."""
        self._blocks.append(display)

    def table(
        self, head: Sequence[str], rows: Iterable[Sequence[Runs]], most: int = MOST_ROWS
    ) -> None:
        """Adds a table: a head of texts, and rows whose cells are runs of text and formulas."""
        self.listing(head, list(rows), lambda row: row, most)

    def listing(
        self,
        head: Sequence[str],
        items: Sequence[Item],
        row: Callable[[Item], Sequence[Runs]],
        most: int = MOST_ROWS,
    ) -> None:
        """A table of many things: a row for each, of long lists for the first and the last."""
        first, left_out, last = ends(items, most)
        gap = tuple((Text("⋮" if k else more(left_out)),) for k in range(len(head)))
        between = [gap] if left_out else []
        rows = [*(tuple(row(x)) for x in first), *between, *(tuple(row(x)) for x in last)]
        self._blocks.append(Table(tuple(head), tuple(rows)))

    def items(self, items: Sequence[Item], runs_of: Callable[[Item], Runs]) -> None:
        """Adds a list without numbers, of a long one the first and the last."""
        first, left_out, last = ends(items)
        between: list[Runs] = [(Text(more(left_out)),)] if left_out else []
        self._blocks.append(Items((*map(runs_of, first), *between, *map(runs_of, last))))

    def mean(
        self, latex: str, about: str, unit: str | None = None, /, **given: str | Math | Ref
    ) -> None:
        """A line for the table of symbols, in the short hand of names.bold; `about` is a template
        as in `say`. What has several units, or none of its own, is given none."""
        printed = "" if unit is None else names.unit(unit)
        self.meanings.append(Meaning(names.bold(latex), runs(about, **given), printed))

    def too_long(self, latex: str) -> None:
        """Says that a term is left out of the page and where it is to be had."""
        self._show_nothing()
        self.say(
            "The entries of {term} are too long to be read here; the generated code has them.",
            term=Math(latex),
        )

    def _show_nothing(self) -> None:
        """What was said last does not lead to anything."""
        last = self._blocks[-1] if self._blocks else None
        if isinstance(last, Paragraph):
            said = left_alone(last.runs)
            self._blocks[-1:] = [Paragraph(said)] if said else []

    # displays

    def _display(self, name: str, lines: Sequence[Line], boxed: bool = False) -> None:
        """The lines, and what explains their symbols; folded where it is long."""
        self._number += 1
        self._numbers[name] = self._number
        whole = [*lines, *self._pending]
        folded = not boxed and (self.folding or _is_long(whole))
        self._blocks.append(Display(tuple(whole), self._number, boxed, folded))
        if folded and self._pending and not self._explained:
            self._explained = True
            self.say(
                r"Letters $z$ with an index abbreviate terms, $\kappa$ numbers. Each is explained "
                "below the formula in which it occurs first, which may be a folded one."
            )
        if self._conditions and not self._explained_conditions:
            self._explained_conditions = True
            self.say(
                "A condition in brackets is a factor: one where it holds, zero where it does not."
            )
        self._pending = []

    def law(
        self, name: str, left: str, right: str, residual: Residual, boxed: bool = False
    ) -> None:
        """A matrix equation, checked as a whole; in the short hand of names.bold."""
        left, right = names.bold(left), names.bold(right)
        self._laws.append(Law(name, f"{left} = {right}", residual))
        self._display(name, [Line(left, parts(right))], boxed)

    def check(self, name: str, residual: ca.SX) -> None:
        """An equation that is checked like the printed ones; it stands in words."""
        self._laws.append(Law(name, name, residual))

    def state(self, left: str, right: str) -> None:
        """An equation that says how things are called; there is nothing to evaluate."""
        self._display("", [Line(names.bold(left), parts(names.bold(right)))])

    def lines(
        self,
        name: str,
        symbols: Sequence[sympy.Symbol],
        expressions: Sequence[sympy.Expr],
        value: ca.SX,
        boxed: bool = False,
    ) -> None:
        """One line per entry, symbol = expression; `value` is the column of the same terms."""
        self._display(name, self._lines(name, symbols, expressions, value), boxed)
        self.reader.name_long(value, symbols)

    def _lines(
        self,
        name: str,
        symbols: Sequence[sympy.Symbol],
        expressions: Sequence[sympy.Expr],
        value: ca.SX,
        where: bool = False,
    ) -> list[Line]:
        """The lines, recorded but not displayed."""
        shown = [self._constants.named(x) for x in expressions]
        pieces = [self.typesetter.pieces(x) for x in shown]
        labels = [self.notation.latex[symbol] for symbol in symbols]
        text = r" \\ ".join(f"{left} = {''.join(right)}" for left, right in zip(labels, pieces))
        self._record(name, text, symbols, [[x] for x in shown], value)
        place = len(self.printed) - 1
        return [
            Line(left, right, place=(place, k), where=where)
            for k, (left, right) in enumerate(zip(labels, pieces))
        ]

    def _constant(self, k: int, n: sympy.Float) -> sympy.Symbol:
        """The name of a number; the next display explains it."""
        symbol = self.notation.fresh(f"kappa[{k}]", rf"\kappa_{{{k}}}")
        self._record(f"kappa[{k}]", "", [symbol], [[n]], ca.SX(float(n)))
        place, latex = (len(self.printed) - 1, 0), self.notation.latex[symbol]
        self._pending.append(Line(latex, self.typesetter.pieces(n), place=place, where=True))
        return symbol

    def _record(
        self, name: str, latex: str, left: Sequence[sympy.Symbol | None], right: Rows, value: ca.SX
    ) -> None:
        """What is printed, for the test that evaluates it."""
        value = self.notation.in_basic_symbols(value)
        entries = sympy.ImmutableDenseMatrix(right)
        self._conditions = self._conditions or any(
            x.has(sympy.Piecewise) for row in right for x in row
        )
        self.printed.append(Printed(name, latex, tuple(left), entries, value))

    def formula(self, expression: Expression | float, about: str) -> Math:
        """A formula of the model inside a table; it too is evaluated by the test, but where it
        uses reactions or accelerations, which are no part of the state."""
        number = isinstance(expression, float | int)
        value = ca.SX(expression if number else self.system.symbols.scalar(expression))
        return self.term(value, about)

    def term(self, value: ca.SX, about: str) -> Math:
        """The same of a term over the symbols of the model's formulas."""
        if not value.is_constant():
            value = ca.substitute(value, self.system.symbols.qd, self.system.qdot)
        entries = self.reader.whole(value)
        if entries is None:
            return Math(r"\ldots")
        later = ca.vertcat(self.notation.reactions, self.notation.vdot)
        if not ca.depends_on(value, later):
            self._record(about, "", (None,), [entries], value)
        self.rounded = self.rounded or is_long(entries[0])
        return Math(self.typesetter.latex(rounded(entries[0])))

    # terms

    def read(self, value: ca.SX, most: int = READABLE) -> list[sympy.Expr] | None:
        """Entries row by row, whole or over abbreviations, which are then printed; None where
        neither can be read."""
        if value.numel() > MOST_READ or ca.n_nodes(ca.SX(value)) > MOST_NODES:
            return None
        bearable = self._whole(value, max(most, BEARABLE))
        if bearable is not None and all(operations(x) <= most for x in bearable):
            return bearable
        few = FEW_PIECES if bearable else MOST_PIECES
        abbreviated = self.reader.in_pieces(value, self._abbreviation, few)
        if abbreviated is None:
            return bearable
        pieces, entries = abbreviated
        self._abbreviations(pieces)
        return entries

    def _whole(self, value: ca.SX, most: int) -> list[sympy.Expr] | None:
        """Over the basic symbols, or over everything that has a name where that is much shorter."""
        whole, over_names = self.reader.whole(value, most), self.reader.over_names(value, most)
        if over_names is not None and (whole is None or much_shorter(over_names, whole)):
            return over_names
        return whole

    def _abbreviation(self, k: int) -> sympy.Symbol:
        return self.notation.fresh(f"z[{k}]", f"z_{{{k}}}")

    def _abbreviations(self, pieces: Sequence[Piece]) -> None:
        """They are explained below the formula that needs them."""
        if pieces:
            symbols, expressions = zip(*[(x.symbol, x.expression) for x in pieces])
            value = self.reader.terms([x.node for x in pieces])
            self._pending += self._lines("abbreviations", symbols, expressions, value, True)

    def called(self, name: str, latex: str) -> str:
        """LaTeX of a term of the page."""
        return self.notation.latex[self.notation.fresh(name, latex)]

    def scalar(self, name: str, latex: str, value: ca.SX, about: str, unit: str = "") -> None:
        """symbol = expression."""
        entries = self.read(ca.SX(value))
        symbol = self.notation.fresh(name, latex)
        self.mean(self.notation.latex[symbol], about, unit)
        if entries is None:
            self.too_long(self.notation.latex[symbol])
        else:
            self.lines(name, [symbol], entries, ca.SX(value))

    def vector(
        self, name: str, stem: str, value: ca.SX, entries: Sequence[sympy.Expr] | None = None
    ) -> bool:
        """The entries that are not zero, one line each. False where they could not be printed."""
        entries = self.read(value) if entries is None else entries
        if entries is None:
            self.too_long(stem)
            return False
        symbols = [
            self.notation.fresh(f"{name}[{i}]", f"{stem}_{{{i}}}")
            for i in range(1, len(entries) + 1)
        ]
        self.entries[name] = [[x if plain(x) else s] for s, x in zip(symbols, entries)]
        shown = [i for i, x in enumerate(entries) if x != 0]
        if shown:
            column = ca.densify(value)[shown]
            self.lines(name, [symbols[i] for i in shown], [entries[i] for i in shown], column)
        else:
            self._show_nothing()
        if 0 < len(shown) < len(entries) and self.first("zeros"):
            self.say("Entries that are not listed are zero, here and below.")
        return True

    def matrix(
        self,
        name: str,
        bold: str,
        stem: str,
        value: ca.SX,
        entries: Sequence[sympy.Expr] | None = None,
        symmetric: bool = False,
    ) -> bool:
        """Wide entries line by line, then the matrix. False where it could not be printed."""
        bold = names.bold(bold)
        if value.numel() > MOST_ENTRIES or ca.n_nodes(ca.SX(value)) > MOST_NODES:
            entries = None
        elif entries is None:
            entries = self.read(value)
        if entries is None:
            self.too_long(bold)
            return False
        rows = rows_of(entries, value.shape)
        symbols = self._entry_symbols(name, stem, value, symmetric)
        shown, beside = self._listed(name, rows, symbols, value, symmetric)
        self.exact[name] = rows
        self.entries[name] = [short_or_symbol(*pair) for pair in zip(rows, symbols)]
        self.reader.name(value, [x for row in self.entries[name] for x in row])
        self._matrix(name, bold, symbols, shown, value, beside)
        return True

    def named_matrix(self, name: str, bold: str) -> None:
        """A matrix that the equations named. What is too large to be read is not formed, either."""
        if self.terms.size(name) > MOST_ENTRIES:
            self.too_long(names.bold(bold))
        else:
            self.matrix(name, bold, name, self.terms.named(name))

    def _entry_symbols(
        self, name: str, stem: str, value: ca.SX, symmetric: bool
    ) -> list[list[sympy.Symbol]]:
        n, m = value.shape
        symbols = [
            [
                self.notation.fresh(f"{name}[{i + 1},{j + 1}]", entry_index(stem, i, j))
                for j in range(m)
            ]
            for i in range(n)
        ]
        if not symmetric:
            return symbols
        return [[symbols[min(i, j)][max(i, j)] for j in range(m)] for i in range(n)]

    def _matrix(
        self,
        name: str,
        bold: str,
        symbols: list[list[sympy.Symbol]],
        shown: Rows,
        value: ca.SX,
        beside: Sequence[Line],
    ) -> None:
        """As what it shows, and the entries beside it; a matrix of one entry as a line, unless that
        stands there already."""
        lines: list[Line] = []
        if value.numel() == 1:
            if shown[0][0] != symbols[0][0]:
                lines = self._lines(name, [symbols[0][0]], [shown[0][0]], value)
        elif value.size2() <= BROAD:
            left = [symbol for row in symbols for symbol in row]
            shown = [[self._constants.named(x) for x in row] for row in shown]
            latex = self.typesetter.matrix(shown)
            self._record(name, f"{bold} = {latex}", left, shown, value)
            lines = [Line(bold, (latex,), place=(len(self.printed) - 1, -1))]
        if not lines and not beside:
            return
        if _is_long([*lines, *beside, *self._pending]) and value.numel() > 1:
            self._pattern(bold, value)
        self._display(name, [*lines, *beside])

    def _pattern(self, bold: str, value: ca.SX) -> None:
        """Which entries are there, as a picture."""
        n, m = value.shape
        marks = tuple("".join(mark(value[i, j]) for j in range(m)) for i in range(n))
        self._blocks.append(Pattern(bold, marks))

    def _listed(
        self,
        name: str,
        rows: Rows,
        symbols: list[list[sympy.Symbol]],
        value: ca.SX,
        symmetric: bool,
    ) -> tuple[Rows, list[Line]]:
        """The entries that do not fit into the matrix, as lines; and what the matrix shows."""
        wide = wide_entries([[width(self.typesetter.latex(x)) for x in row] for row in rows])
        listed = [(i, j) for i, j in sorted(wide) if not symmetric or i <= j]
        lines: list[Line] = []
        if listed:
            column = ca.vertcat(*[ca.densify(value)[i, j] for i, j in listed])
            left, right = zip(*[(symbols[i][j], rows[i][j]) for i, j in listed])
            lines = self._lines(f"{name} entries", left, right, column, value.numel() > 1)
        shown = [list(row) for row in rows]
        for i, j in wide:
            shown[i][j] = symbols[i][j]
        return shown, lines

    def entries_of_independent(self, name: str) -> list[sympy.Expr]:
        """c or β of the rows of Y, as they are printed."""
        column = [row[0] for row in self.entries[name]]
        if self.terms.has("E"):
            return [sum_of(row, column) for row in self.entries["E"]]
        return [column[i] for i in self.terms.independent]


def _is_long(lines: Sequence[Line]) -> bool:
    """Whether a display holds more than a reader takes in with the text."""
    total = sum(width("".join(line.right)) for line in lines)
    return len(lines) > MOST_LINES or total > LONG
