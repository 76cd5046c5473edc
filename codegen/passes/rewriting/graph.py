"""The expression graph that the passes rewrite: hash-consed n-ary sums and products with constants
kept on the edges.

A reference is (factor, node). Signs and constant factors live on the references, so x − y and y −
x, 2x and −3x share one node; a sum is stored with leading factor 1. Node 0 is the number one, so a
constant c is the reference (c, 0). Node ids are given in the order of creation: operands come
before what uses them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from codegen.limits import CLOSE, MODEST, NEARLY

Reference = tuple[float, int]
ONE = 0
ZERO: Reference = (0.0, ONE)

ODD = frozenset({"sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "erf", "sign"})
EVEN = frozenset({"cos", "cosh", "fabs"})
CALLS: dict[str, Callable[..., Any] | None] = {
    "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan, "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "asinh": math.asinh,
    "acosh": math.acosh,
    "atanh": math.atanh, "exp": math.exp, "log": math.log, "expm1": math.expm1, "log1p": math.log1p,
    "erf": math.erf,
    "fabs": abs, "floor": math.floor, "ceil": math.ceil, "pow": math.pow, "atan2": math.atan2,
    "hypot": math.hypot,
    "fmin": min, "fmax": max, "copysign": math.copysign, "fmod": math.fmod,
    "sign": None, "lt": None, "le": None, "eq": None, "ne": None, "and": None, "or": None,
    "not": None, "where": None,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class One:
    """The number one."""


@dataclass(frozen=True, slots=True)
class Input:
    """Entry `index` of an argument."""

    argument: str
    index: int


@dataclass(frozen=True, slots=True)
class Literal:
    """What no arithmetic is done with: inf and nan."""

    text: str


@dataclass(frozen=True, slots=True)
class Sum:
    """Σ factor · node; the terms are (node, factor) in the order of the nodes."""

    terms: tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class Product:
    """Π node^exponent; the factors are (node, exponent) in the order of the nodes."""

    factors: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Call:
    """A function of references."""

    function: str
    operands: tuple[Reference, ...]


Node = One | Input | Literal | Sum | Product | Call


class Graph:
    """Nodes by their ids. Equal nodes are one: each kind is found again by what it holds, for plain
    tuples are hashed much faster than records."""

    def __init__(self) -> None:
        self.nodes: list[Node] = [One()]
        # by node: the nodes that it is computed from, the number one left out
        self.operands: list[tuple[int, ...]] = [()]
        # of sums the factor each was first met with: its own numbers, undivided
        self.natural: dict[int, float] = {}
        self._below: set[int] = set()  # products that divide
        self._inputs: dict[tuple[str, int], int] = {}
        self._literals: dict[str, int] = {}
        self._sums: dict[tuple[tuple[int, float], ...], int] = {}
        self._products: dict[tuple[tuple[int, int], ...], int] = {}
        self._calls: dict[tuple[str, tuple[Reference, ...]], int] = {}

    def _append(self, node: Node, operands: tuple[int, ...]) -> int:
        """The id of a new node; the number one is none of its operands."""
        self.nodes.append(node)
        self.operands.append(operands)
        return len(self.nodes) - 1

    def find_call(self, function: str, operands: tuple[Reference, ...]) -> int | None:
        """The id of that call if there is one."""
        return self._calls.get((function, operands))

    def leaf(self, node: One | Input | Literal) -> Reference:
        """A node without operands, as another graph has it."""
        if isinstance(node, Input):
            return self.input(node.argument, node.index)
        return (1.0, ONE) if isinstance(node, One) else self._literal(node.text)

    def input(self, argument: str, index: int) -> Reference:
        """The reference to an entry of an argument; the same node however often it is asked for."""
        node = self._inputs.get((argument, index))
        if node is None:
            node = self._append(Input(argument, index), ())
            self._inputs[argument, index] = node
        return (1.0, node)

    def constant(self, value: float) -> Reference:
        """A number; inf and nan are kept apart from arithmetic."""
        if math.isfinite(value):
            return (float(value), ONE)
        return self._literal(repr(float(value)))

    def _literal(self, text: str) -> Reference:
        node = self._literals.get(text)
        if node is None:
            node = self._literals[text] = self._append(Literal(text), ())
        return (1.0, node)

    def sum(self, terms: Iterable[Reference]) -> Reference:
        """Σ factor · node, equal nodes merged, scaled so that its first factor is 1."""
        merged: dict[int, float] = {}
        for factor, node in terms:
            merged[node] = nearly_sum(merged[node], factor) if node in merged else factor
        members = sorted([(node, factor) for node, factor in merged.items() if factor != 0.0])
        if not members:
            return ZERO
        if len(members) == 1:
            return (members[0][1], members[0][0])
        scale = _leading(members)
        if scale != 1.0:
            members = [(node, factor / scale) for node, factor in members]
        inside = tuple([(node, snapped(factor)) for node, factor in members])
        return (scale, self._sum_node(inside, abs(scale)))

    def product(self, factors: Iterable[tuple[Reference, int]]) -> Reference:
        """Π reference^exponent; constants move to the reference. x / x is 1 even where x = 0: the
        removable singularity goes."""
        members = list(factors)
        scale = 1.0
        divides = False
        merged: dict[int, int] = {}
        for (factor, node), exponent in members:
            if factor != 1.0:
                scale *= factor if exponent == 1 else power(factor, exponent)
            if node != ONE:
                merged[node] = merged[node] + exponent if node in merged else exponent
                divides = divides or exponent < 0
        # a constant that left the range of doubles may come back with the factors beside it
        if scale == 0.0 or scale == math.inf or scale == -math.inf:
            return self._extreme_product(scale, merged, members)
        if len(merged) > 1 and (divides or not self._below.isdisjoint(merged)):
            self._cancel(merged)
        inside = sorted([(node, exponent) for node, exponent in merged.items() if exponent != 0])
        return self._scaled_product(scale, inside)

    def _extreme_product(
        self, scale: float, merged: dict[int, int], factors: Sequence[tuple[Reference, int]]
    ) -> Reference:
        """A product whose constants together are zero or infinite. Where no single one is, they are
        left with their factors, whose values may make up for them."""
        if any(factor == 0.0 for (factor, _), _ in factors):
            if scale == 0.0:
                return ZERO
            inside = [(node, exponent) for node, exponent in merged.items() if exponent != 0]
            return self._scaled_product(scale, sorted(inside))
        return self.product(
            [((1.0, self._scaled_node(part)), exponent) for part, exponent in factors]
        )

    def bounded(self, reference: Reference) -> Reference:
        """The reference with a factor that is far from overflow: factors that grow or shrink along
        a long recursion stay inside of a node from time to time, and begin again at 1."""
        factor, node = reference
        if factor == 1.0 or node == ONE or factor == 0.0 or 1.0 / MODEST <= abs(factor) <= MODEST:
            return reference
        return (math.copysign(1.0, factor), self._scaled_node((abs(factor), node)))

    def _scaled_node(self, reference: Reference) -> int:
        """A node that is factor · node, the factor inside of it."""
        factor, node = reference
        return node if factor == 1.0 else self._sum_node(((node, factor),), 1.0)

    def _sum_node(self, inside: tuple[tuple[int, float], ...], natural: float) -> int:
        result = self._sums.get(inside)
        if result is None:
            operands = tuple([node for node, _ in inside if node != ONE])
            result = self._sums[inside] = self._append(Sum(inside), operands)
            self.natural[result] = natural
        return result

    def _cancel(self, merged: dict[int, int]) -> None:
        """Open products among the factors that another factor cancels against: l · (sin / l)."""
        for node in list(merged):
            inside = self.nodes[node]
            if not isinstance(inside, Product):
                continue
            outer = merged[node]
            if any(merged.get(other, 0) * inner * outer < 0 for other, inner in inside.factors):
                del merged[node]
                for other, inner in inside.factors:
                    merged[other] = merged.get(other, 0) + inner * outer

    def _scaled_product(self, scale: float, members: list[tuple[int, int]]) -> Reference:
        if not math.isfinite(scale):
            members = sorted([*members, (self.constant(scale)[1], 1)])
            scale = 1.0
        if not members:
            return (scale, ONE)
        if len(members) == 1 and members[0][1] == 1:
            return (scale, members[0][0])
        inside = tuple(members)
        result = self._products.get(inside)
        if result is None:
            result = self._append(Product(inside), tuple([node for node, _ in inside]))
            self._products[inside] = result
            if any(exponent < 0 for _, exponent in inside):
                self._below.add(result)
        return (scale, result)

    def call(self, function: str, operands: Sequence[Reference]) -> Reference:
        """A function of references; signs leave odd and even functions, constants are evaluated.

        sin(−x) = −sin x, cos(−x) = cos x and |c x| = |c| |x|, so that arguments of either sign
        share one node. What has no value at its constants stays a call.
        """
        if all(node == ONE for _, node in operands):
            value = _evaluate(function, [factor for factor, _ in operands])
            if value is not None:
                return self.constant(value)
        sign, inside = _signs(function, tuple(operands))
        if function == "fabs" and inside[0][0] != 1.0:
            sign, inside = inside[0][0], ((1.0, inside[0][1]),)
        result = self._calls.get((function, inside))
        if result is None:
            used = tuple([node for _, node in inside if node != ONE])
            result = self._append(Call(function, inside), used)
            self._calls[function, inside] = result
        return (sign, result)


@dataclass(frozen=True)
class Mark:
    """Where the entries of a named intermediate are in the graph: (entry label, reference)."""

    name: str
    about: str
    entries: tuple[tuple[str, Reference], ...]


@dataclass(frozen=True)
class Work:
    """One function on its way through the passes: a graph, the references to be computed, and named
    places in it."""

    graph: Graph
    roots: tuple[Reference, ...]
    marks: tuple[Mark, ...]

    @functools.cached_property
    def live(self) -> tuple[int, ...]:
        """Nodes that the roots need, in increasing order."""
        needed = bytearray(len(self.graph.nodes))
        for _, node in self.roots:
            needed[node] = 1
        operands = self.graph.operands
        # ids grow from operands to users: one walk down meets all users of a node before the node
        for node in range(len(needed) - 1, ONE, -1):
            if needed[node]:
                for other in operands[node]:
                    needed[other] = 1
        return tuple([node for node in range(ONE + 1, len(needed)) if needed[node]])


def scaled(factor: float, reference: Reference) -> Reference:
    """factor · reference."""
    return (factor * reference[0], reference[1])


def nearly_sum(a: float, b: float) -> float:
    """a + b, but 0 where the two differ by rounding only."""
    total = a + b
    return 0.0 if abs(total) <= NEARLY * max(abs(a), abs(b)) else total


@functools.lru_cache(maxsize=1 << 16)
def snapped(factor: float) -> float:
    """The factor, or the short decimal or fraction it differs from by rounding only: 14.715 for
    14.715000000000002."""
    size = abs(factor)
    # with twelve digits or one more before the point, a short decimal is nearly a whole number
    part = size * _TWELVE_DIGITS[math.frexp(size)[1]] % 1.0 if 1e-200 < size < 1e200 else 0.0
    if not 0.05 < part < 0.95:
        short = float(f"{factor:.12g}")
        if abs(factor - short) <= CLOSE * size:
            return short
    # every fraction that is tried is a whole number of these
    if 1e-3 < size < 1e3 and not 1e-6 < size * _COMMON_DENOMINATOR % 1.0 < 1.0 - 1e-6:
        return _fraction(factor)
    return factor


_COMMON_DENOMINATOR = 4.0 * 3465.0  # of all the fractions that `snapped` knows
# by binary exponent: the power of ten that takes twelve digits or one more before the point
_TWELVE_DIGITS = {
    exponent: 10.0 ** (11 - math.floor((exponent - 1) * math.log10(2.0)))
    for exponent in range(-700, 700)
}


def _fraction(factor: float) -> float:
    for denominator in (3, 7, 9, 11, 15):
        near = round(factor * 4 * denominator) / (4 * denominator)
        if abs(factor - near) <= CLOSE * abs(factor):
            return near
    return factor


def same(one: Work, other: Work) -> bool:
    """Are the graphs equal node by node, with the same roots?"""
    return one is other or (one.roots == other.roots and one.graph.nodes == other.graph.nodes)


def uses(work: Work, nodes: Iterable[int]) -> dict[int, int]:
    """How often each node is used, the roots' own uses included."""
    count: dict[int, int] = {}
    for node in nodes:
        for other in work.graph.operands[node]:
            count[other] = count.get(other, 0) + 1
    for _, node in work.roots:
        count[node] = count.get(node, 0) + 1
    return count


Rule = Callable[[Graph, int, dict[int, Reference]], Reference | None]


def rewrite(work: Work, rule: Rule) -> Work:
    """A new graph in which each live node became rule(new graph, node, earlier results), None where
    its user needs no node of it.

    Nodes are visited in increasing order, so a rule finds its operands done. Roots keep their
    factors, and marks follow where their nodes survive. What becomes equal on the way is one node,
    for the new graph is hash-consed as well.
    """
    graph = Graph()
    done: dict[int, Reference] = {ONE: (1.0, ONE)}
    for node in work.live:
        image = rule(graph, node, done)
        if image is not None:
            done[node] = graph.bounded(image)
            _keep_origin(work.graph, node, graph, image)
    roots = tuple(scaled(factor, done[node]) for factor, node in work.roots)
    return Work(graph, roots, tuple(_follow(mark, done) for mark in work.marks))


def _keep_origin(old: Graph, node: int, graph: Graph, found: Reference) -> None:
    """A sum that became another keeps the numbers it was first met with."""
    if node in old.natural and found[1] in graph.natural:
        graph.natural[found[1]] = abs(snapped(old.natural[node] * found[0]))


def copied(work: Work, graph: Graph, node: int, done: dict[int, Reference]) -> Reference:
    """The node as it was, over rewritten operands."""
    old = work.graph.nodes[node]
    if isinstance(old, Sum):
        return graph.sum([scaled(factor, done[other]) for other, factor in old.terms])
    if isinstance(old, Product):
        return graph.product([(done[other], exponent) for other, exponent in old.factors])
    if isinstance(old, Call):
        return graph.call(
            old.function, [scaled(factor, done[other]) for factor, other in old.operands]
        )
    return graph.leaf(old)


def _follow(mark: Mark, done: dict[int, Reference]) -> Mark:
    entries = tuple(
        (label, scaled(factor, done[node]))
        for label, (factor, node) in mark.entries
        if node in done
    )
    return Mark(mark.name, mark.about, entries)


def _leading(terms: list[tuple[int, float]]) -> float:
    """The factor that a sum is divided by: that of its first term that is not the constant."""
    return terms[0][1] if terms[0][0] != ONE else terms[1][1]


def power(factor: float, exponent: float) -> float:
    """factor^exponent, infinite where Python has an exception: whether that matters is seen when
    all constants of a product are together."""
    if factor == 0.0 and exponent < 0:
        return math.copysign(math.inf, factor) if exponent % 2 else math.inf
    try:
        return factor**exponent
    except OverflowError:
        return math.inf


def _signs(function: str, operands: tuple[Reference, ...]) -> tuple[float, tuple[Reference, ...]]:
    if operands[0][0] < 0 and function in ODD:
        return -1.0, ((-operands[0][0], operands[0][1]),)
    if operands[0][0] < 0 and function in EVEN:
        return 1.0, ((-operands[0][0], operands[0][1]),)
    return 1.0, operands


def _evaluate(function: str, values: Sequence[float]) -> float | None:
    """The value at constants; None outside of the function's domain, so that the generated code
    meets it at run time and answers as it does for all other arguments."""
    evaluate = CALLS[function] or _LOGIC.get(function)
    try:
        return float(evaluate(*values)) if evaluate else None
    except (ValueError, OverflowError, ZeroDivisionError):
        return None


_OF_ONE: dict[str, Callable[[float], float]] = {
    "sign": lambda a: (a > 0) - (a < 0),
    "not": lambda a: not a,
}
_OF_TWO: dict[str, Callable[[float, float], float]] = {
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "and": lambda a, b: bool(a and b),
    "or": lambda a, b: bool(a or b),
    "where": lambda a, b: b if a else 0.0,
}
_LOGIC: dict[str, Callable[..., float]] = {**_OF_ONE, **_OF_TWO}
