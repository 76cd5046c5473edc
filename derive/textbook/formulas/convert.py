"""CasADi terms → SymPy expressions to be read: whole where they are short, else over sub-terms that
get names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import casadi as ca
import sympy
from sympy import Expr

from derive.textbook.formulas.compose import FUNCTIONS, Composer, number, operations
from derive.textbook.formulas.graph import Graph, Node
from derive.textbook.formulas.ring import Exact, Poly, Ring, TooBig, over, rational, tidied

READABLE = 44  # operations in one printed entry
PIECE = 18  # a sub-term longer than this gets a name
SHARED = 3  # so does one of at least so many operations that occurs twice
BEARABLE = 80  # up to here, where the term would otherwise need many named sub-terms
FEW_PIECES = 8
ROUNDER = 2  # digits that a number has more than its share of gravity
SHARE = 10  # digits of that share: one of fifty numbers has two digits less than sixteen by chance
MOST_PIECES = 48  # a term that would need more sub-terms is not written out
LARGEST = 20_000  # operations of a term, written out, beyond which reading it whole is not tried
MOST_NODES = 6000  # and in pieces


@dataclass(frozen=True)
class Piece:
    """A named sub-term: where it sits in the graph, its symbol and what it is made of."""

    node: int
    symbol: sympy.Symbol
    expression: Expr


@dataclass(frozen=True)
class Gravity:
    """The magnitude of gravity, which stays a letter. `others` are the numbers of the file, which
    mean themselves."""

    symbol: sympy.Symbol
    value: float
    others: frozenset[float] = frozenset()

    def times(self, x: float) -> Exact | None:
        """x / g where x is gravity times a much rounder number; None for any other number."""
        if x == 0.0 or abs(x) in self.others:
            return None
        exact = rational(x)
        times = over(exact, rational(self.value))
        digits = len(_digits(float(times)))
        rounder = digits <= SHARE and digits + ROUNDER <= len(_digits(x))
        return (
            times
            if rounder and abs(float(times * rational(self.value)) - x) <= 4e-16 * abs(x)
            else None
        )


def _digits(x: float) -> str:
    """The significant digits."""
    return repr(abs(x)).partition("e")[0].replace(".", "").strip("0")


@dataclass(frozen=True)
class _Form:
    """Entries as polynomials of a ring, and what writes them."""

    composer: Composer
    polys: tuple[Poly, ...]


class Reader:
    """Turns terms over fixed symbols into expressions. Terms that were named before are recognised
    by value."""

    def __init__(
        self,
        symbols: ca.SX,
        names: Sequence[sympy.Symbol],
        decimal: bool,
        gravity: Gravity | None = None,
        left: Callable[[float], bool] = lambda x: False,
    ) -> None:
        """`left` says which numbers rounding left, where the model means zero."""
        self.graph, self.gravity, self.left = Graph(symbols), gravity, left
        self.names, self.decimal = tuple(names), decimal
        self.known: dict[int, Expr] = {}
        self.pieces = 0
        self.long: set[int] = set()  # entries of the term read last that are long

    def whole(self, value: ca.SX, most: int = READABLE) -> list[Expr] | None:
        """Every entry over the basic symbols alone; None where one would have more than `most`
        operations."""
        return self._within(self.graph.read(value), {}, most)

    def over_names(self, value: ca.SX, most: int = READABLE) -> list[Expr] | None:
        """The same over everything that has a name already; None also where nothing in the term has
        one."""
        roots = self.graph.read(value)
        if not any(k in self.known for k in self.graph.below(roots)):
            return None
        return self._within(roots, self.known, most)

    def _within(self, roots: Sequence[int], names: dict[int, Expr], most: int) -> list[Expr] | None:
        if self._unrolled(roots, names) > LARGEST:
            return None
        return self._shortest(roots, names, most)

    def _unrolled(self, roots: Sequence[int], names: dict[int, Expr]) -> int:
        """Operations when nothing is shared, counted no further than just above LARGEST: along a
        recursion they double from link to link."""
        sizes: dict[int, int] = {}
        for k in self.graph.below(roots, frozenset(names)):
            size = 0 if k in names else sum(1 + sizes[i] for i in self.graph.nodes[k].operands)
            sizes[k] = min(size, LARGEST + 1)
        return sum(sizes[k] for k in roots)

    def name(self, value: ca.SX, symbols: Sequence[Expr]) -> None:
        """From now on these entries are recognised as these symbols."""
        for node, symbol in zip(self.graph.read(value), symbols):
            if self.graph.nodes[node].operands and symbol.is_Symbol:
                self.known.setdefault(node, symbol)

    def name_long(self, value: ca.SX, symbols: Sequence[Expr]) -> None:
        """The same of entries that would have got a name if they were no entries."""
        if not self.long:
            return
        for node, symbol in zip(self.graph.read(value), symbols):
            if node in self.long:
                self.known.setdefault(node, symbol)
        self.long = set()

    def in_pieces(
        self, value: ca.SX, fresh: Callable[[int], sympy.Symbol], most: int = MOST_PIECES
    ) -> tuple[list[Piece], list[Expr]] | None:
        """The entries over named sub-terms, old and new (their symbols from `fresh`); None where
        there would be too many."""
        roots = self.graph.read(value)
        order = self.graph.below(roots, frozenset(self.known))
        cuts = self._cuts(order, roots) if len(order) <= MOST_NODES else None
        if cuts is None or len(cuts) > most:
            return None
        names: dict[int, Expr] = {k: self.known[k] for k in order if k in self.known}
        pieces: list[Piece] = []
        for k in cuts:
            (expression,) = self._expressions([k], names)
            if operations(expression) > 1:
                self.pieces += 1
                pieces.append(Piece(k, fresh(self.pieces), expression))
                names[k] = self.known[k] = pieces[-1].symbol
        alone = {k: self._expressions([k], names) for k in roots if self._is_long(k)}
        together = iter(self._expressions([k for k in roots if k not in alone], names))
        return pieces, [alone[k][0] if k in alone else next(together) for k in roots]

    def _is_long(self, k: int) -> bool:
        """Of an entry: it is read by itself, as a piece would be."""
        node = self.graph.nodes[k]
        return k in self.long or (node.op == ca.OP_NEG and node.operands[0] in self.long)

    def terms(self, nodes: Sequence[int]) -> ca.SX:
        """The CasADi terms of the given nodes, as a column."""
        terms: dict[int, ca.SX] = {}
        for k in self.graph.below(nodes):
            node = self.graph.nodes[k]
            if node.op == ca.OP_INPUT:
                terms[k] = self.graph.symbols[int(node.number)]
            elif node.op == ca.OP_CONST:
                terms[k] = ca.SX(node.number)
            else:
                apply = ca.SX.unary if len(node.operands) == 1 else ca.SX.binary
                terms[k] = apply(node.op, *[terms[i] for i in node.operands])
        return ca.vertcat(*[terms[k] for k in nodes])

    def _entries(self, roots: Sequence[int], uses: Counter[int]) -> set[int]:
        """Nodes that are an entry, or its negative, and nothing else: a name for one would only be
        an alias."""
        whole = {k for k in roots if not uses[k]}
        nodes = [self.graph.nodes[k] for k in sorted(whole)]
        inside = {x.operands[0] for x in nodes if x.op == ca.OP_NEG}
        return whole | {k for k in inside if uses[k] == 1}

    def _cuts(self, order: Sequence[int], roots: Sequence[int]) -> list[int]:
        """Nodes to name: shared ones worth it, and those that have grown long and are more than an
        entry."""
        uses = self._uses(order)
        entries = self._entries(roots, uses)
        sizes: dict[int, int] = {}  # operations down to the nearest names
        cuts: list[int] = []
        self.long = set()
        for k in order:
            node = self.graph.nodes[k]
            sizes[k] = 0
            if k in self.known or not node.operands:
                continue
            size = (node.op != ca.OP_NEG) + sum(sizes[i] for i in node.operands)
            if size > PIECE and k in entries:
                self.long.add(k)
            elif size > PIECE or (uses[k] > 1 and size >= SHARED):
                cuts.append(k)
            else:
                sizes[k] = size
        return cuts

    def _uses(self, order: Sequence[int]) -> Counter[int]:
        """How often each node is an operand of those without a name."""
        unnamed = [self.graph.nodes[k] for k in order if k not in self.known]
        return Counter(i for node in unnamed for i in node.operands)

    def _expressions(self, roots: Sequence[int], names: dict[int, Expr]) -> list[Expr]:
        plain = self._plain(roots, names)
        shortest = self._shortest(roots, names)
        if shortest is None:
            return plain
        return [min(pair, key=operations) for pair in zip(shortest, plain)]

    def _shortest(
        self, roots: Sequence[int], names: dict[int, Expr], most: float = inf
    ) -> list[Expr] | None:
        """The shorter of product and Fourier form, entry by entry; None where neither stays within
        its budget, or an entry has more than `most` operations: the rest is not looked at then."""
        trigonometric = any(
            self.graph.nodes[k].op in (ca.OP_SIN, ca.OP_COS, ca.OP_TAN)
            for k in self.graph.below(roots)
        )
        forms = [self._formed(roots, names, False)]
        if trigonometric:
            forms.append(self._formed(roots, names, True))
        within = [form for form in forms if form is not None]
        entries: list[Expr] = []
        for polys in zip(*[form.polys for form in within]):
            shapes = [x.composer.shortest(poly, most) for x, poly in zip(within, polys)]
            entries.append(min(shapes, key=operations))
            if operations(entries[-1]) > most:
                return None
        return entries if within else None

    def _formed(self, roots: Sequence[int], names: dict[int, Expr], fourier: bool) -> _Form | None:
        """The entries as sums of products; None where they grow beyond bounds."""
        ring = Ring(fourier)
        values: dict[int, Poly] = {}
        try:
            for k in self.graph.below(roots, frozenset(names)):
                values[k] = (
                    ring.symbol(names[k])
                    if k in names
                    else self._poly(ring, self.graph.nodes[k], values)
                )
            polys = [ring.pythagorean(ring.over_roots(tidied(values[k]))) for k in roots]
        except (TooBig, OverflowError, ValueError, ZeroDivisionError):
            return None
        return _Form(Composer(ring, self.decimal), tuple(polys))

    def _poly(self, ring: Ring, node: Node, values: dict[int, Poly]) -> Poly:
        if node.op == ca.OP_INPUT:
            return ring.symbol(self.names[int(node.number)])
        if node.op == ca.OP_CONST:
            return self._number(ring, node.number)
        return _applied(ring, node.op, [values[i] for i in node.operands])

    def _number(self, ring: Ring, x: float) -> Poly:
        """A number, or how often it holds gravity."""
        if self.left(x):
            return {}
        times = self.gravity.times(x) if self.gravity else None
        if self.gravity is None or times is None:
            return ring.number(x)
        return ring.scaled(ring.symbol(self.gravity.symbol), times)

    def _plain(self, roots: Sequence[int], names: dict[int, Expr]) -> list[Expr]:
        """As CasADi has it, operation by operation."""
        values: dict[int, Expr] = {}
        for k in self.graph.below(roots, frozenset(names)):
            node = self.graph.nodes[k]
            if k in names:
                values[k] = names[k]
            elif node.op == ca.OP_INPUT:
                values[k] = self.names[int(node.number)]
            elif node.op == ca.OP_CONST:
                x = 0.0 if self.left(node.number) else node.number
                values[k] = number(rational(x), self.decimal)
            else:
                values[k] = PLAIN[node.op](*[values[i] for i in node.operands])
        return [values[k] for k in roots]


def _applied(ring: Ring, op: int, x: list[Poly]) -> Poly:
    if op in _RING:
        return _RING[op](ring, *x)
    if op not in _CALLS:
        raise TooBig
    return ring.call(_CALLS[op], tuple(x))


def _powered(ring: Ring, a: Poly, b: Poly) -> Poly:
    if len(b) == 1 and ((), ()) in b:
        n = b[(), ()]
        if n.denominator == 1 and abs(n) <= 8:
            return ring.power(a, int(n))
        if n.denominator == 2 and abs(n) <= 8:
            return ring.power(ring.root(a), int(2 * n))
    return ring.call("pow", (a, b))


def _tangent(ring: Ring, a: Poly) -> Poly:
    return ring.quotient(ring.sine(a), ring.cosine(a))


_RING_OF_ONE: dict[int, Callable[[Ring, Poly], Poly]] = {
    ca.OP_INV: Ring.inverse,
    ca.OP_NEG: lambda ring, a: ring.scaled(a, -1),
    ca.OP_SQ: lambda ring, a: ring.product(a, a),
    ca.OP_TWICE: lambda ring, a: ring.scaled(a, 2),
    ca.OP_SQRT: Ring.root,
    ca.OP_SIN: Ring.sine,
    ca.OP_COS: Ring.cosine,
    ca.OP_TAN: _tangent,
    ca.OP_ASSIGN: lambda ring, a: a,
}

_RING_OF_TWO: dict[int, Callable[[Ring, Poly, Poly], Poly]] = {
    ca.OP_ADD: Ring.sum,
    ca.OP_SUB: lambda ring, a, b: ring.sum(a, b, -1),
    ca.OP_MUL: Ring.product,
    ca.OP_DIV: Ring.quotient,
    ca.OP_POW: _powered,
    ca.OP_CONSTPOW: _powered,
}

_RING: dict[int, Callable[..., Poly]] = {**_RING_OF_ONE, **_RING_OF_TWO}

_CALLS = {
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_FABS: "abs",
    ca.OP_SIGN: "sign",
    ca.OP_FMIN: "min",
    ca.OP_FMAX: "max",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
}


def _either(condition: Expr, value: Expr) -> Expr:
    return sympy.Piecewise((value, sympy.Ne(condition, 0)), (0, True))


def _truth(relation: Callable[[Expr, Expr], sympy.Basic]) -> Callable[[Expr, Expr], Expr]:
    return lambda a, b: sympy.Piecewise((1, relation(a, b)), (0, True))


_UNARY: dict[int, Callable[[Expr], Expr]] = {
    ca.OP_INV: lambda a: 1 / a,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a**2,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_SQRT: sympy.sqrt,
    ca.OP_SIN: sympy.sin,
    ca.OP_COS: sympy.cos,
    ca.OP_TAN: sympy.tan,
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_NOT: lambda a: 1 - a,
    ca.OP_LOG1P: lambda a: sympy.log(1 + a),
    ca.OP_EXPM1: lambda a: sympy.exp(a) - 1,
    ca.OP_ERF: sympy.erf,
    ca.OP_ASINH: sympy.asinh,
    ca.OP_ACOSH: sympy.acosh,
    ca.OP_ATANH: sympy.atanh,
}

_BINARY: dict[int, Callable[[Expr, Expr], Expr]] = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_POW: sympy.Pow,
    ca.OP_CONSTPOW: sympy.Pow,
    ca.OP_LT: _truth(sympy.Lt),
    ca.OP_LE: _truth(sympy.Le),
    ca.OP_EQ: _truth(sympy.Eq),
    ca.OP_NE: _truth(sympy.Ne),
    ca.OP_AND: sympy.Min,
    ca.OP_OR: sympy.Max,
    ca.OP_IF_ELSE_ZERO: _either,
    ca.OP_FMOD: lambda a, b: a - b * (sympy.sign(a / b) * sympy.floor(sympy.Abs(a / b))),
    ca.OP_COPYSIGN: lambda a, b: sympy.Abs(a) * sympy.sign(b),
    ca.OP_HYPOT: lambda a, b: sympy.sqrt(a**2 + b**2),
}

PLAIN: dict[int, Callable[..., Expr]] = {
    **_UNARY,
    **_BINARY,
    **{op: FUNCTIONS[name] for op, name in _CALLS.items()},
}
