"""The symbols of a page: what each is called in SymPy and in LaTeX, so that no two look alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import sympy

from derive.formulations.records import Equations
from derive.mechanics.records import System
from derive.textbook import names
from derive.textbook.formulas.convert import Gravity, Reader
from derive.textbook.formulas.labels import labels, unlike, untaken
from derive.textbook.formulas.rounding import leftovers
from derive.textbook.formulas.terms import Terms

REACTION = "reaction."  # before the name of a row
LEAST_DIGITS = 4  # of "9.81": a rounder magnitude could be any number


@dataclass(frozen=True, eq=False)
class Extra:
    """A symbol that stands for a term before it is read: formulas may be written over `sx`, whose
    value is `value`."""

    sx: ca.SX
    symbol: sympy.Symbol
    latex: str
    value: ca.SX


class Notation:
    """`latex` has every symbol of the page in the order in which it was introduced, which is the
    order of symbols in a product: parameters first, then q, v, w, u and t."""

    def __init__(self, terms: Terms, extra: Sequence[Extra] = ()) -> None:
        self.terms, self.extra = terms, extra
        self.latex: dict[sympy.Expr, str] = {}
        model = terms.system.model
        self._labels = labels(model)
        self._taken = {"t", *self._labels.values()}  # in LaTeX
        self._given = dict(model.symbols)
        self.p = [self._declared(name) for name in self._free_parameters()]
        self.z = self.p[len(self.p) - len(model.states) :]
        self.q = [self._declared(c.name) for c in model.coordinates]
        self.v = [self._declared(x.name) for x in model.velocities]
        self.w = self._quasi_velocities()
        self.u = [self._declared(x.name) for x in model.inputs]
        self.t = self._new("t", "t")
        self.g = self._gravity()
        self.reactions, self.multipliers = self._reactions()
        self.vdot, self.accelerations = self._accelerations()
        for x in extra:
            self._call(x.symbol, x.latex)

    def _reactions(self) -> tuple[ca.SX, list[sympy.Symbol]]:
        """Multipliers of the ideal problem, which loads may use: λ with the name of the row."""
        known = self.terms.system.symbols
        rows = [x.removeprefix(REACTION) for x in known.names if x.startswith(REACTION)]
        symbols = [
            self._symbol(f"{REACTION}{row}", rf"\lambda_{{{names.upright(row)}}}") for row in rows
        ]
        return known.reactions(rows), symbols

    def multiplier(self, row: str) -> sympy.Symbol:
        """Of the row of that name."""
        known = self.terms.system.symbols
        rows = [x.removeprefix(REACTION) for x in known.names if x.startswith(REACTION)]
        return self.multipliers[rows.index(row)]

    def _accelerations(self) -> tuple[ca.SX, list[sympy.Symbol]]:
        """v̇, which outputs may use: with a dot, as where the equations of motion tell it."""
        if not self.terms.system.model.accelerations:
            return ca.SX(0, 1), []
        return self.terms.system.symbols.vdot, [self.rate(symbol) for symbol in self.v]

    def _gravity(self) -> Gravity | None:
        """The letter g for the file's number, unless the file has a g of its own."""
        value = magnitude(self.terms.system)
        model = self.terms.system.model
        if not value or self._is_another("g", value) or len(repr(value)) < LEAST_DIGITS:
            return None
        others = frozenset(abs(x.value) for x in model.parameters)
        self._taken.discard("g")
        return Gravity(self.fresh("g", "g"), value, others)

    def _is_another(self, latex: str, value: float) -> bool:
        """Whether something else is called so; a parameter that is fixed at the value is none."""
        same = {x.name for x in self.terms.system.model.parameters if x.value == value}
        fixed = same.intersection(self.terms.system.constants)
        others = {self._labels[name] for name in self._labels.keys() - fixed}
        return latex in others or latex in self.latex.values()

    def _free_parameters(self) -> list[str]:
        """And, behind them, the first-order states."""
        return [x.name for x in self.terms.system.given]

    def _quasi_velocities(self) -> list[sympy.Symbol]:
        """Of w; a speed that is one generalized velocity shares its symbol."""
        equations = self.terms.equations
        if equations.generalized_velocities:
            return list(self.v)
        alone = _alone(self.terms.named("B"))
        return [self._speed(alone.get(k), name) for k, name in enumerate(equations.w)]

    def _speed(self, j: int | None, name: str) -> sympy.Symbol:
        if j is not None:
            velocity = self.terms.system.model.velocities[j]
            if name in (f"{velocity.rate_of}_dot", velocity.name.replace(".", "_")):
                return self.v[j]
        return self._symbol(name, names.symbol(name, self._given))

    def _declared(self, name: str) -> sympy.Symbol:
        """A name of the model, called as its page and its figure call it."""
        return self._new(name, self._labels[name])

    def typeset(self, name: str) -> str:
        """A name of the model as LaTeX: no other looks so; else as its spelling suggests."""
        return self._labels.get(name) or names.symbol(name, self._given)

    def _symbol(self, name: str, latex: str) -> sympy.Symbol:
        """A new symbol; one whose LaTeX is taken already is printed upright, as it is spelled."""
        return self._new(name, unlike(name, latex, self._taken))

    def _new(self, name: str, latex: str) -> sympy.Symbol:
        symbol = sympy.Symbol(name)
        while symbol in self.latex:
            symbol = sympy.Symbol(symbol.name + "'")
        self.latex[symbol] = latex
        return symbol

    def _call(self, symbol: sympy.Symbol, latex: str) -> None:
        self.latex[symbol] = untaken(latex, self._taken)
        self._taken.add(self.latex[symbol])

    def fresh(self, name: str, latex: str) -> sympy.Symbol:
        """A symbol for a term of the page; its name is in brackets, so that no identifier of the
        model has it."""
        symbol = sympy.Symbol(name if "[" in name else f"{name}[]")
        if symbol not in self.latex:
            self._call(symbol, latex)
        return symbol

    def rate(self, symbol: sympy.Symbol) -> sympy.Symbol:
        """The symbol of its time derivative, with a dot."""
        return self.fresh(f"rate[{symbol.name}]", names.dotted(self.latex[symbol]))

    def reader(self) -> Reader:
        """Reads terms over these symbols."""
        s = self.terms.system
        tied = not self.terms.equations.generalized_velocities  # w has symbols of its own
        columns = [s.t, s.q, s.v, *([self.terms.w] if tied else []), s.u, s.p]
        symbols = [self.t, *self.q, *self.v, *(self.w if tied else []), *self.u, *self.p]
        return Reader(
            ca.vertcat(*columns, self.reactions, self.vdot, *[x.sx for x in self.extra]),
            [*symbols, *self.multipliers, *self.accelerations, *[x.symbol for x in self.extra]],
            not self.p,  # a file of numbers alone means them as it writes them
            self.g,
            leftovers(s.model),
        )

    def in_basic_symbols(self, value: ca.SX) -> ca.SX:
        """The term without the extra symbols, and with v̇ and λ of the motion."""
        if ca.depends_on(value, self.reactions):
            rows = [row.name for row in self.terms.system.rows]
            symbols = self.terms.system.symbols.reactions(rows)
            value = ca.substitute(value, symbols, self.terms.lam)
        if ca.depends_on(value, self.vdot):
            value = ca.substitute(value, self.vdot, self.terms.vdot)
        if not self.extra:
            return value
        symbols = ca.vertcat(*[x.sx for x in self.extra])
        return ca.substitute(value, symbols, ca.vertcat(*[x.value for x in self.extra]))


def magnitude(system: System) -> float:
    """Of gravity, in m/s², 0 where it is none or hangs on parameters."""
    entries = [ca.SX(x) for x in system.gravity]
    if not all(x.is_constant() for x in entries):
        return 0.0
    numbers = [abs(float(x)) for x in entries if not x.is_zero()]
    return numbers[0] if len(numbers) == 1 else 0.0


def _alone(B: ca.SX) -> dict[int, int]:
    """Row → column of its only entry, where that is the number one."""
    rows, columns = B.sparsity().get_triplet()
    many = Counter(rows)
    return {
        i: j
        for i, j, entry in zip(rows, columns, B.nonzeros())
        if many[i] == 1 and entry.is_constant() and float(entry) == 1.0
    }


def symbols_of(equations: Equations) -> dict[str, str]:
    """LaTeX of parameters, states and inputs by their names, as formulas have them."""
    notation = Notation(Terms(equations))
    groups = [equations.argument(name) for name in "pxu"]
    symbols = {name: notation.typeset(name) for group in groups for name in group.labels}
    symbols |= {str(symbol): latex for symbol, latex in notation.latex.items()}
    return symbols | {name: notation.latex[w] for name, w in zip(equations.w, notation.w)}
