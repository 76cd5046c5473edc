"""The author's desk: what has been defined so far, and how a term is put on the page.

A term is printed whole where it is short, over named sub-terms where it is not, and not at all
where even that would be unreadable. Later formulas are written over the entries' symbols, which is
why they stay short.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import sympy

from derive.expressions.tree import Expression
from derive.formulations.records import Equations, Function
from derive.mechanics.records import System
from derive.textbook import names
from derive.textbook.compose import operations
from derive.textbook.convert import BEARABLE, FEW_PIECES, MOST_PIECES, READABLE, Piece, Reader
from derive.textbook.records import (
    Block,
    Display,
    Document,
    Items,
    Law,
    Line,
    Math,
    Paragraph,
    Printed,
    Run,
    Runs,
    Section,
    Table,
    Text,
)
from derive.textbook.typeset import Typesetter, width

CELL = 26  # a wider entry gets a line of its own before the matrix
COLUMN = 44  # the same where the matrix has one column
ROW = 66  # a wider matrix shows its widest entries by their symbols
SYMBOL = 5  # the width of an entry's symbol, with the gap after it
BROAD = 12  # more columns than this are not shown as a matrix
MOST_ENTRIES = 4000  # a larger matrix is not read at all
WORTH_NAMES = (
    30  # operations that all entries together must have before symbols of other terms are put in
)
Rows = list[list[sympy.Expr]]


@dataclass
class Meaning:
    """A line of the table of symbols."""

    latex: str
    about: str
    unit: str = ""


@dataclass(frozen=True, eq=False)
class Extra:
    """A symbol that stands for a term before it is read: formulas may be written over `sx`, whose
    value is `value`."""

    sx: ca.SX
    symbol: sympy.Symbol
    latex: str
    value: ca.SX


@dataclass
class Author:
    """Collects sections; `entries` holds, for each printed matrix or vector, what later formulas
    write for its entries (a symbol, or the entry itself where it is short); `exact` the entries of
    matrices as they were printed."""

    equations: Equations
    extra: Sequence[Extra] = ()
    names: dict[sympy.Symbol, str] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)  # the names in LaTeX
    entries: dict[str, Rows] = field(default_factory=dict)
    exact: dict[str, Rows] = field(default_factory=dict)
    meanings: list[Meaning] = field(default_factory=list)
    printed: list[Printed] = field(default_factory=list)
    laws: list[Law] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    title: str = ""
    rates: list[sympy.Symbol] = field(default_factory=list)
    number: int = 0

    def __post_init__(self) -> None:
        self.p = self._parameters()
        self.q = [self._symbol(c.name, names.symbol(c.name)) for c in self.system.model.coordinates]
        self.v = [
            self._symbol(x.name, names.velocity(x.name, x.rate_of))
            for x in self.system.model.velocities
        ]
        self.w = self._quasi_velocities()
        self.u = [self._symbol(x.name, names.symbol(x.name)) for x in self.system.model.inputs]
        self.t = self._symbol("t", "t")
        for x in self.extra:
            self._call(x.symbol, self._untaken(x.latex))
        self.typeset = Typesetter(self.names, len(self.p))
        self.reader = self._reader()

    @property
    def system(self) -> System:
        return self.equations.system

    # symbols

    def _symbol(self, name: str, latex: str) -> sympy.Symbol:
        """A new symbol; one whose LaTeX is taken already is printed upright, as it is spelled."""
        symbol = sympy.Symbol(name)
        while symbol in self.names:
            symbol = sympy.Symbol(symbol.name + "'")
        self._call(symbol, names.upright(name) if latex in self.taken else latex)
        return symbol

    def _call(self, symbol: sympy.Symbol, latex: str) -> None:
        self.names[symbol] = latex
        self.taken.add(latex)

    def _parameters(self) -> list[sympy.Symbol]:
        free = [x.name for x in self.system.model.parameters if x.name not in self.system.constants]
        return [self._symbol(name, names.symbol(name)) for name in free]

    @property
    def free_velocities(self) -> bool:
        """The quasi-velocities are the generalized velocities themselves (nothing is
        eliminated)."""
        return self.equations.generalized_velocities

    def _quasi_velocities(self) -> list[sympy.Symbol]:
        """Of w; a speed that is one generalized velocity shares its symbol."""
        if self.free_velocities:
            return list(self.v)
        return [self._speed(k, name) for k, name in enumerate(self.equations.w)]

    def _speed(self, k: int, name: str) -> sympy.Symbol:
        row = self.named("B")[k, :]
        columns = row.sparsity().get_triplet()[1]
        if (
            len(columns) == 1
            and row[0, columns[0]].is_constant()
            and float(row[0, columns[0]]) == 1.0
        ):
            velocity = self.system.model.velocities[columns[0]]
            if name in (f"{velocity.rate_of}_dot", velocity.name.replace(".", "_")):
                return self.v[columns[0]]
        return self._symbol(name, names.symbol(name))

    def _reader(self) -> Reader:
        s = self.system
        columns = (
            [s.t, s.q, s.v, s.u, s.p]
            if self.free_velocities
            else [s.t, s.q, s.v, self.w_symbols, s.u, s.p]
        )
        ours = [
            self.t,
            *self.q,
            *self.v,
            *([] if self.free_velocities else self.w),
            *self.u,
            *self.p,
        ]
        symbols = ca.vertcat(*columns, *[x.sx for x in self.extra])
        return Reader(
            symbols, [*ours, *[x.symbol for x in self.extra]], bool(s.constants) and not self.p
        )

    @property
    def w_symbols(self) -> ca.SX:
        x = next(a for a in self.equations.arguments if a.name == "x").symbols
        return x[self.system.q.numel() :]

    def fresh(self, name: str, latex: str) -> sympy.Symbol:
        """A symbol for a term of the page; its name is in brackets, so that no identifier of the
        model has it."""
        symbol = sympy.Symbol(name if "[" in name else f"{name}[]")
        if symbol not in self.names:
            self._call(symbol, self._untaken(latex))
        return symbol

    def _untaken(self, latex: str) -> str:
        """With a tilde where the model has a symbol that looks the same."""
        while latex in self.taken:
            latex = rf"\tilde{{{latex}}}"
        return latex

    # terms

    def named(self, name: str) -> ca.SX:
        """A named term of the equations, else of the system."""
        found = next((x.value for x in self.equations.named if x.name == name), None)
        return getattr(self.system, name) if found is None else found

    def has(self, name: str) -> bool:
        return any(x.name == name for x in self.equations.named)

    def function(self, name: str) -> Function | None:
        return next((f for f in self.equations.functions if f.name == name), None)

    @cached_property
    def wdot(self) -> ca.SX:
        found = self.function("dynamics")
        assert found is not None  # every formulation has it
        return found.result.value[len(self.q) :]

    @cached_property
    def vdot(self) -> ca.SX:
        """v̇ = S ẇ + σ; of the augmented system v̇ = ẇ."""
        return (
            self.wdot
            if self.free_velocities
            else ca.mtimes(self.named("S"), self.wdot) + self.named("sigma")
        )

    @cached_property
    def lam(self) -> ca.SX:
        found = self.function("reactions")
        return ca.SX(0, 1) if found is None else found.result.value

    @cached_property
    def kept(self) -> list[int]:
        """Independent constraint rows: those that stand in Y, where they are not combined there."""
        if not self.has("Y"):
            return []
        return (
            _first_of_each(self.named("E"))
            if self.has("E")
            else _kept(self.named("A"), self.system.A)
        )

    def of_independent(self, column: ca.SX) -> ca.SX:
        """c or β of the rows of Y."""
        return ca.mtimes(self.named("E"), column) if self.has("E") else column[self.kept]

    def entries_of_independent(self, name: str) -> list[sympy.Expr]:
        """The same as they are printed."""
        column = [row[0] for row in self.entries[name]]
        if not self.has("E"):
            return [column[i] for i in self.kept]
        return [sympy.Add(*[x * y for x, y in zip(row, column)]) for row in self.entries["E"]]

    # prose

    def section(self, title: str) -> None:
        """Closes the running section and opens the next."""
        self.close()
        self.title, self.blocks = title, []

    def close(self) -> None:
        if self.blocks:
            self.sections.append(
                Section(self.title, f"section-{len(self.sections) + 1}", tuple(self.blocks))
            )

    def document(self, title: str, subtitle: str, version: str) -> Document:
        self.close()
        return Document(
            title, subtitle, tuple(self.sections), tuple(self.printed), tuple(self.laws), version
        )

    def runs(self, template: str, **given: str | Math) -> Runs:
        """`$…$` in our own text is mathematics (see names.bold); `{name}` in it is the user's text,
        or Math."""
        result: list[Run] = []
        for i, part in enumerate(template.split("$")):
            result += [Math(names.bold(part))] if i % 2 else _filled(part, given)
        return tuple(x for x in result if x != Text(""))

    def say(self, template: str, **given: str | Math) -> None:
        self.blocks.append(Paragraph(self.runs(template, **given)))

    def table(self, head: Sequence[str], rows: Iterable[Sequence[Runs]]) -> None:
        self.blocks.append(Table(tuple(head), tuple(tuple(row) for row in rows)))

    def items(self, items: Iterable[Runs]) -> None:
        self.blocks.append(Items(tuple(items)))

    def mean(self, latex: str, about: str, unit: str = "") -> None:
        self.meanings.append(Meaning(names.bold(latex), about, unit))

    # formulas

    def display(self, lines: Sequence[Line]) -> int:
        self.number += 1
        self.blocks.append(Display(tuple(lines), self.number))
        return self.number

    def law(self, name: str, left: str, right: str, residual: ca.SX) -> int:
        """A matrix equation, checked as a whole; in names.bold's short hand."""
        left, right = names.bold(left), names.bold(right)
        self.laws.append(Law(name, f"{left} = {right}", residual))
        return self.display([Line(left, (right,))])

    def state(self, left: str, right: str) -> int:
        """An equation that says how things are called; there is nothing to evaluate."""
        return self.display([Line(names.bold(left), (names.bold(right),))])

    def record(
        self, name: str, latex: str, left: Sequence[sympy.Symbol | None], right: Rows, value: ca.SX
    ) -> None:
        self.printed.append(
            Printed(
                name,
                latex,
                tuple(left),
                sympy.ImmutableDenseMatrix(right),
                self._in_basic_symbols(value),
            )
        )

    def _in_basic_symbols(self, value: ca.SX) -> ca.SX:
        if not self.extra:
            return value
        return ca.substitute(
            value,
            ca.vertcat(*[x.sx for x in self.extra]),
            ca.vertcat(*[x.value for x in self.extra]),
        )

    def lines(
        self,
        name: str,
        symbols: Sequence[sympy.Symbol],
        found: Sequence[sympy.Expr],
        value: ca.SX,
        left: str = "",
    ) -> int:
        """One line per entry, symbol = expression; `value` is the column of the same terms."""
        lines = [Line(left or self.names[s], self.typeset.lines(x)) for s, x in zip(symbols, found)]
        text = r" \\ ".join(f"{line.left} = {''.join(line.right)}" for line in lines)
        self.record(name, text, symbols, [[x] for x in found], value)
        return self.display(lines)

    def pieces(self, found: Sequence[Piece], value: ca.SX) -> None:
        if found:
            self.say("With the abbreviations")
            self.lines(
                "abbreviations", [x.symbol for x in found], [x.expression for x in found], value
            )

    def read(self, value: ca.SX, most: int = READABLE) -> list[sympy.Expr] | None:
        """Entries row by row, whole or over abbreviations, which are then printed; None where
        neither can be read."""
        bearable = self._whole(value, max(most, BEARABLE))
        if bearable is not None and all(operations(x) <= most for x in bearable):
            return bearable
        found = self.reader.in_pieces(value, self._piece, FEW_PIECES if bearable else MOST_PIECES)
        if found is None:
            return bearable
        self.pieces(found[0], self.reader.terms([x.node for x in found[0]]))
        return found[1]

    def _whole(self, value: ca.SX, most: int) -> list[sympy.Expr] | None:
        """Over the basic symbols, or over everything that has a name where that is much shorter."""
        whole, over_names = self.reader.whole(value, most), self.reader.over_names(value, most)
        if over_names is not None and (whole is None or _much_shorter(over_names, whole)):
            return over_names
        return whole

    def _piece(self, k: int) -> sympy.Symbol:
        return self.fresh(f"z[{k}]", f"z_{{{k}}}")

    def scalar(
        self, name: str, latex: str, value: ca.SX, about: str, unit: str = ""
    ) -> sympy.Symbol | None:
        """symbol = expression."""
        found = self.read(ca.SX(value))
        symbol = self.fresh(name, latex)
        self.mean(self.names[symbol], about, unit)
        if found is None:
            self.too_long(latex)
            return None
        self.lines(name, [symbol], found, ca.SX(value))
        return symbol

    def vector(
        self, name: str, stem: str, value: ca.SX, found: Sequence[sympy.Expr] | None = None
    ) -> bool:
        """The entries that are not zero, one line each. False where they could not be printed."""
        found = self.read(value) if found is None else found
        if found is None:
            self.too_long(stem)
            return False
        symbols = [self.fresh(f"{name}[{i + 1}]", f"{stem}_{{{i + 1}}}") for i in range(len(found))]
        shown = [i for i, x in enumerate(found) if x != 0]
        self.entries[name] = [[x if plain(x) else s] for s, x in zip(symbols, found)]
        if shown:
            self.lines(
                name,
                [symbols[i] for i in shown],
                [found[i] for i in shown],
                ca.densify(value)[shown],
            )
        return True

    def too_long(self, latex: str) -> None:
        self.say(
            "The entries of {term} are too long to be read here; the generated code has them.",
            term=Math(latex),
        )

    def matrix(
        self,
        name: str,
        bold: str,
        stem: str,
        value: ca.SX,
        found: Sequence[sympy.Expr] | None = None,
        symmetric: bool = False,
    ) -> bool:
        """Wide entries line by line, then the matrix. False where it could not be printed."""
        bold = names.bold(bold)
        readable = value.numel() <= MOST_ENTRIES
        found = self.read(value) if found is None and readable else found
        if found is None or not readable:
            self.too_long(bold)
            return False
        n, m = value.shape
        rows = [list(found[i * m : (i + 1) * m]) for i in range(n)]
        symbols = [
            [self.fresh(f"{name}[{i + 1},{j + 1}]", _entry(stem, i, j)) for j in range(m)]
            for i in range(n)
        ]
        if symmetric:
            symbols = [[symbols[min(i, j)][max(i, j)] for j in range(m)] for i in range(n)]
        shown = self._listed(name, rows, symbols, value, symmetric)
        self.entries[name] = [
            [x if simple(x) else s for x, s in zip(*pair)] for pair in zip(rows, symbols)
        ]
        self.exact[name] = rows
        self.reader.name(value, [x for row in self.entries[name] for x in row])
        if n * m == 1:
            if shown[0][0] != symbols[0][0]:
                self.lines(name, [symbols[0][0]], [rows[0][0]], value)
        elif m <= BROAD:
            left = [s for row in symbols for s in row]
            latex = self.typeset.matrix(shown)
            self.record(name, f"{bold} = {latex}", left, shown, value)
            self.display([Line(bold, (latex,))])
        return True

    def _listed(
        self,
        name: str,
        rows: Rows,
        symbols: list[list[sympy.Symbol]],
        value: ca.SX,
        symmetric: bool,
    ) -> Rows:
        """Prints the entries that do not fit into the matrix; returns what the matrix shows."""
        wide = self._wide(rows)
        listed = [(i, j) for i, j in sorted(wide) if not symmetric or i <= j]
        if listed:
            self.say("With the entries")
            where = [(symbols[i][j], rows[i][j]) for i, j in listed]
            column = ca.vertcat(*[ca.densify(value)[i, j] for i, j in listed])
            self.lines(f"{name} entries", [s for s, _ in where], [x for _, x in where], column)
        return [
            [symbols[i][j] if (i, j) in wide else x for j, x in enumerate(row)]
            for i, row in enumerate(rows)
        ]

    def _wide(self, rows: Rows) -> set[tuple[int, int]]:
        """Places of the entries that get a line of their own: too wide ones, then the widest until
        the matrix fits."""
        cells = {
            (i, j): width(self.typeset.latex(x))
            for i, row in enumerate(rows)
            for j, x in enumerate(row)
        }
        most = CELL if len(rows[0]) > 1 else COLUMN
        listed = {place for place, w in cells.items() if w > most}
        for place in sorted(cells, key=lambda place: (-cells[place], place)):
            across = sum(
                max(SYMBOL if (i, j) in listed else cells[i, j] for i in range(len(rows)))
                for j in range(len(rows[0]))
            )
            if across <= ROW or cells[place] <= SYMBOL:
                break
            listed.add(place)
        return listed

    def formula(self, expression: Expression | float, about: str) -> Math:
        """A formula of the model inside a table; it too is evaluated by the test."""
        s = self.system.symbols
        value = ca.SX(expression if isinstance(expression, float | int) else s.scalar(expression))
        value = ca.substitute(value, s.qd, self.system.qdot)
        found = self.reader.whole(value)
        if found is None:
            return Math(r"\ldots")
        latex = self.typeset.latex(found[0])
        self.record(about, latex, (None,), [found], value)
        return Math(latex)


def _much_shorter(x: Sequence[sympy.Expr], y: Sequence[sympy.Expr]) -> bool:
    return sum(map(operations, x)) < 0.6 * sum(map(operations, y)) > WORTH_NAMES


def plain(x: sympy.Expr) -> bool:
    """A number, a symbol or its negative."""
    return bool(x.is_Number or x.is_Symbol or (-x).is_Symbol)


def simple(x: sympy.Expr) -> bool:
    """Short enough to be written instead of a symbol for it."""
    return operations(x) <= 1 and not x.has(sympy.Function)


def _entry(stem: str, i: int, j: int) -> str:
    comma = "," if max(i, j) > 8 else ""
    return f"{stem}_{{{i + 1}{comma}{j + 1}}}"


def _filled(template: str, given: dict[str, str | Math]) -> list[Run]:
    """Text around {name} places."""
    result: list[Run] = []
    for i, part in enumerate(template.replace("{", "}").split("}")):
        value = given[part] if i % 2 else part
        result.append(value if isinstance(value, Math) else Text(value))
    return result


def _kept(ours: ca.SX, theirs: ca.SX) -> list[int]:
    """Indices of the rows of the system's A that stand in the A of the equations."""
    if ours.size1() == theirs.size1():
        return list(range(ours.size1()))
    found: list[int] = []
    for i in range(ours.size1()):
        found.append(
            next(
                k
                for k in range(theirs.size1())
                if k not in found and ca.is_equal(ours[i, :], theirs[k, :], 8)
            )
        )
    return found


def _first_of_each(E: ca.SX) -> list[int]:
    """The rows of A that the combinations are made around: the first entry of each."""
    return [min(E[k, :].sparsity().get_triplet()[1]) for k in range(E.size1())]
