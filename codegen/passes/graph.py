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

Reference = tuple[float, int]
ONE = 0
ZERO: Reference = (0.0, ONE)
EPSILON = 2.220446049250313e-16
NEARLY = 8 * EPSILON  # factors closer than this, relatively, differ by rounding only

ODD = frozenset({"sin", "tan", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "erf", "sign"})
EVEN = frozenset({"cos", "cosh", "fabs"})
CALLS: dict[str, Callable[..., Any] | None] = {
    "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan, "asin": math.asin, "acos": math.acos,
    "atan": math.atan, "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "asinh": math.asinh, "acosh": math.acosh,
    "atanh": math.atanh, "exp": math.exp, "log": math.log, "expm1": math.expm1, "log1p": math.log1p, "erf": math.erf,
    "fabs": abs, "floor": math.floor, "ceil": math.ceil, "pow": math.pow, "atan2": math.atan2, "hypot": math.hypot,
    "fmin": min, "fmax": max, "copysign": math.copysign, "fmod": math.fmod,
    "sign": None, "lt": None, "le": None, "eq": None, "ne": None, "and": None, "or": None, "not": None, "where": None,
}  # fmt: skip

_NARY = frozenset({"sum", "product"})


class Graph:
    """Nodes are tuples: ("one",), ("input", argument, index), ("literal", text) for inf and nan,
    ("sum", ((node, factor), …)), ("product", ((node, exponent), …)), ("call", function, (reference,
    …))."""

    def __init__(self) -> None:
        self.nodes: list[tuple[Any, ...]] = [("one",)]
        self.natural: dict[
            int, float
        ] = {}  # the factor with which a sum was first met: its own numbers, undivided
        self._ids: dict[tuple[Any, ...], int] = {("one",): ONE}
        self._operands: dict[int, tuple[int, ...]] = {}

    def node(self, key: tuple[Any, ...]) -> int:
        """The id of a node, made on first use."""
        found = self._ids.get(key)
        if found is None:
            found = self._ids[key] = len(self.nodes)
            self.nodes.append(key)
        return found

    def find(self, key: tuple[Any, ...]) -> int | None:
        """The id of a node if there is one."""
        return self._ids.get(key)

    def input(self, argument: str, index: int) -> Reference:
        return (1.0, self.node(("input", argument, index)))

    def constant(self, value: float) -> Reference:
        """A number; inf and nan are kept apart from arithmetic."""
        if math.isfinite(value):
            return (float(value), ONE)
        return (1.0, self.node(("literal", repr(float(value)))))

    def sum(self, terms: Iterable[Reference]) -> Reference:
        """Σ factor · node, equal nodes merged, scaled so that its first factor is 1."""
        merged: dict[int, float] = {}
        for factor, node in terms:
            merged[node] = nearly_sum(merged[node], factor) if node in merged else factor
        kept = sorted((node, factor) for node, factor in merged.items() if factor != 0.0)
        if not kept:
            return ZERO
        if len(kept) == 1:
            return (kept[0][1], kept[0][0])
        scale = _leading(kept)
        node = self.node(("sum", tuple((node, snapped(factor / scale)) for node, factor in kept)))
        self.natural.setdefault(node, abs(scale))
        return (scale, node)

    def product(self, factors: Iterable[tuple[Reference, int]]) -> Reference:
        """Π reference^exponent; constants move to the reference. x / x is 1 even where x = 0: the
        removable singularity goes."""
        scale = 1.0
        merged: dict[int, int] = {}
        for (factor, node), exponent in factors:
            scale *= _power(factor, exponent)
            if node != ONE:
                merged[node] = merged.get(node, 0) + exponent
        self._cancel(merged)
        if scale == 0.0:
            return ZERO
        kept = sorted((node, exponent) for node, exponent in merged.items() if exponent != 0)
        return self._scaled_product(scale, kept)

    def _cancel(self, merged: dict[int, int]) -> None:
        """Open products among the factors that another factor cancels against: l · (sin / l)."""
        for node in list(merged):
            outer = merged[node]
            inside = self.nodes[node][1] if self.nodes[node][0] == "product" else ()
            if any(merged.get(other, 0) * inner * outer < 0 for other, inner in inside):
                del merged[node]
                for other, inner in inside:
                    merged[other] = merged.get(other, 0) + inner * outer

    def _scaled_product(self, scale: float, kept: list[tuple[int, int]]) -> Reference:
        if not math.isfinite(scale):
            kept = sorted([*kept, (self.constant(scale)[1], 1)])
            scale = 1.0
        if not kept:
            return (scale, ONE)
        if len(kept) == 1 and kept[0][1] == 1:
            return (scale, kept[0][0])
        return (scale, self.node(("product", tuple(kept))))

    def call(self, function: str, operands: Sequence[Reference]) -> Reference:
        """A function of references; signs leave odd and even functions, constants are evaluated."""
        if all(node == ONE for _, node in operands):
            value = _evaluate(function, [factor for factor, _ in operands])
            if value is not None:
                return self.constant(value)
        sign, operands = _signs(function, tuple(operands))
        if function == "fabs" and operands[0][0] != 1.0:
            sign, operands = operands[0][0], ((1.0, operands[0][1]),)
        return (sign, self.node(("call", function, operands)))

    def operands(self, node: int) -> tuple[int, ...]:
        """The nodes that a node is computed from (the number one excluded)."""
        known = self._operands.get(node)
        if known is None:
            found = self.nodes[node]
            if found[0] in _NARY:
                known = tuple([other for other, _ in found[1] if other != ONE])
            else:
                known = (
                    tuple([other for _, other in found[2] if other != ONE])
                    if found[0] == "call"
                    else ()
                )
            self._operands[node] = known
        return known


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
        seen = {node for _, node in self.roots}
        stack = list(seen)
        while stack:
            fresh = [other for other in self.graph.operands(stack.pop()) if other not in seen]
            seen.update(fresh)
            stack += fresh
        seen.discard(ONE)
        return tuple(sorted(seen))


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
    short = float(f"{factor:.12g}")
    if abs(factor - short) <= 2 * EPSILON * abs(factor):
        return short
    if 1e-3 < abs(factor) < 1e3:
        for denominator in (3, 7, 9, 11, 15):
            near = round(factor * 4 * denominator) / (4 * denominator)
            if abs(factor - near) <= 2 * EPSILON * abs(factor):
                return near
    return factor


def same(one: Work, other: Work) -> bool:
    """Are the graphs equal node by node, with the same roots?"""
    return one is other or (one.roots == other.roots and one.graph.nodes == other.graph.nodes)


def uses(work: Work, nodes: Iterable[int]) -> dict[int, int]:
    """How often each node is used, the roots' own uses included."""
    count: dict[int, int] = {}
    for node in nodes:
        for other in work.graph.operands(node):
            count[other] = count.get(other, 0) + 1
    for _, node in work.roots:
        count[node] = count.get(node, 0) + 1
    return count


Rule = Callable[[Graph, int, dict[int, Reference]], Reference | None]


def rewrite(work: Work, rule: Rule) -> Work:
    """A new graph in which each live node became rule(new graph, node, earlier results), None where
    its user needs no node of it.

    Marks follow where their nodes survive.
    """
    graph = Graph()
    done: dict[int, Reference] = {ONE: (1.0, ONE)}
    for node in work.live:
        found = rule(graph, node, done)
        if found is not None:
            done[node] = found
            _keep_origin(work.graph, node, graph, found)
    roots = tuple(scaled(factor, done[node]) for factor, node in work.roots)
    return Work(graph, roots, tuple(_follow(mark, done) for mark in work.marks))


def _keep_origin(old: Graph, node: int, graph: Graph, found: Reference) -> None:
    """A sum that became another keeps the numbers it was first met with."""
    if node in old.natural and graph.nodes[found[1]][0] == "sum":
        graph.natural[found[1]] = abs(snapped(old.natural[node] * found[0]))


def copied(work: Work, graph: Graph, node: int, done: dict[int, Reference]) -> Reference:
    """The node as it was, over rewritten operands."""
    kind, *rest = work.graph.nodes[node]
    if kind == "sum":
        return graph.sum(scaled(factor, done[other]) for other, factor in rest[0])
    if kind == "product":
        return graph.product((done[other], exponent) for other, exponent in rest[0])
    if kind == "call":
        return graph.call(rest[0], [scaled(factor, done[other]) for factor, other in rest[1]])
    return (1.0, graph.node(work.graph.nodes[node]))


def _follow(mark: Mark, done: dict[int, Reference]) -> Mark:
    kept = tuple(
        (label, scaled(factor, done[node]))
        for label, (factor, node) in mark.entries
        if node in done
    )
    return Mark(mark.name, mark.about, kept)


def _leading(kept: list[tuple[int, float]]) -> float:
    """The factor that a sum is divided by: that of its first term that is not the constant."""
    return kept[0][1] if kept[0][0] != ONE else kept[1][1]


def _power(factor: float, exponent: int) -> float:
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
    evaluate = CALLS[function] or _LOGIC.get(function)
    try:
        return float(evaluate(*values)) if evaluate else None
    except (ValueError, OverflowError, ZeroDivisionError):
        return None


_LOGIC: dict[str, Callable[..., float]] = {
    "sign": lambda a: (a > 0) - (a < 0),
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b,
    "ne": lambda a, b: a != b,
    "and": lambda a, b: bool(a and b),
    "or": lambda a, b: bool(a or b),
    "not": lambda a: not a,
    "where": lambda a, b: b if a else 0.0,
}
