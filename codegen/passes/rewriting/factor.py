"""factor: flatten sums and products that are used once, then take common factors out: a x + b x →
(a + b) x.

A node with several users is never opened, so nothing that is shared is computed twice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

from codegen.passes.rewriting.graph import (
    ONE,
    Call,
    Graph,
    Node,
    Product,
    Reference,
    Sum,
    Work,
    copied,
    nearly_sum,
    power,
    rewrite,
    scaled,
    uses,
)

Factors = tuple[tuple[int, int], ...]  # (node, exponent), …
Term = tuple[float, Factors]
Factor = tuple[int, int]  # node, ±1: as a factor or as a divisor


def factor(work: Work) -> Work:
    """Every sum flattened and factored."""
    opened = _opened(work)

    def rule(graph: Graph, node: int, done: dict[int, Reference]) -> Reference | None:
        if node in opened:
            return None  # its user does it
        old = work.graph.nodes[node]
        if isinstance(old, Sum):
            terms = _terms(work, graph, node, done, opened)
            return factored(graph, pythagoras(graph, terms))
        if isinstance(old, Product):
            return graph.product(_open_product(work, node, done, opened))
        return copied(work, graph, node, done)

    return rewrite(work, rule)


@dataclass(frozen=True, slots=True)
class _Spot:
    """Where a node is used last: in a sum or in a product with an exponent."""

    in_sum: bool
    exponent: int


_IN_SUM = _Spot(True, 1)


def _opened(work: Work) -> set[int]:
    """Sums used once in a sum, products used once in a sum or as a plain factor of a product."""
    nodes = work.live
    count = uses(work, nodes)
    spots: dict[int, _Spot] = {}
    for node in nodes:
        user = work.graph.nodes[node]
        if isinstance(user, Sum):
            spots.update((other, _IN_SUM) for other, _ in user.terms)
        elif isinstance(user, Product):
            spots.update((other, _Spot(False, exponent)) for other, exponent in user.factors)
    rooted = {node for _, node in work.roots}
    return {
        node
        for node in nodes
        if count[node] == 1
        and node in spots
        and node not in rooted
        and _opens(work.graph.nodes[node], spots[node])
    }


def _opens(node: Node, spot: _Spot) -> bool:
    """(a b)² stays, for a² b² needs one multiplication more."""
    if isinstance(node, Sum):
        return spot.in_sum
    return isinstance(node, Product) and abs(spot.exponent) == 1


def _terms(
    work: Work, graph: Graph, node: int, done: dict[int, Reference], opened: set[int]
) -> list[Term]:
    """The terms of a flattened sum over the new graph."""
    terms: list[Term] = []
    stack = [(node, 1.0)]
    while stack:
        current, outer = stack.pop()
        for other, own in reversed(_inside(work, current)):
            if other not in opened:
                terms.append(_term(graph, scaled(outer * own, done[other])))
            elif isinstance(work.graph.nodes[other], Sum):
                stack.append((other, outer * own))
            else:
                terms.append(
                    _product_term(graph, outer * own, _open_product(work, other, done, opened))
                )
    return _collected(terms)


def _inside(work: Work, node: int) -> tuple[tuple[int, float], ...]:
    """The terms of a sum."""
    inside = work.graph.nodes[node]
    return inside.terms if isinstance(inside, Sum) else ()


def _term(graph: Graph, reference: Reference) -> Term:
    """A node as a term. Of products only squares of a sine or cosine are opened, for they may meet
    their like."""
    factor, node = reference
    inside = graph.nodes[node]
    if isinstance(inside, Product) and len(inside.factors) == 1:
        base, exponent = inside.factors[0]
        if exponent == 2 and _angle(graph, base) is not None:
            return factor, inside.factors
    return factor, () if node == ONE else ((node, 1),)


def _open_product(
    work: Work, node: int, done: dict[int, Reference], opened: set[int]
) -> list[tuple[Reference, int]]:
    """The factors of a flattened product over the new graph."""
    factors: list[tuple[Reference, int]] = []
    stack = [(node, 1)]
    while stack:
        current, outer = stack.pop()
        product = work.graph.nodes[current]
        assert isinstance(product, Product)  # sums are opened in sums alone
        for other, own in product.factors:
            if other in opened:
                stack.append((other, outer * own))
            else:
                factors.append((done[other], outer * own))
    return factors


def _product_term(graph: Graph, outer: float, factors: Sequence[tuple[Reference, int]]) -> Term:
    """A product as a term, its constants in front."""
    front = outer
    merged: dict[int, int] = {}
    for (value, node), exponent in factors:
        front *= power(value, exponent)
        if node != ONE:
            merged[node] = merged.get(node, 0) + exponent
    if not math.isfinite(front) or front == 0.0:
        return _term(graph, scaled(outer, graph.product(factors)))
    return front, tuple(sorted((node, exponent) for node, exponent in merged.items() if exponent))


def _collected(terms: Iterable[Term]) -> list[Term]:
    """Equal products added up."""
    sums: dict[Factors, float] = {}
    for value, factors in terms:
        sums[factors] = sums.get(factors, 0.0) + value
    return [(value, factors) for factors, value in sums.items() if value != 0.0]


# ---- sin² + cos² = 1


def pythagoras(graph: Graph, terms: Sequence[Term]) -> list[Term]:
    """a y sin² + b y cos² → b y + (a − b) y sin², with whatever y; y − y sin² → y cos²."""
    sums = {factors: value for value, factors in terms}
    for _, factors in terms:
        for node, exponent in factors:
            if exponent >= 2 and factors in sums:
                _square(graph, sums, factors, node)
    return [(value, factors) for factors, value in sums.items() if value != 0.0]


def _square(graph: Graph, sums: dict[Factors, float], factors: Factors, node: int) -> None:
    other = _angle(graph, node)
    if other is None:
        return
    rest = _without(_without(factors, (node, 1)), (node, 1))
    twin = tuple(sorted([*rest, (other, 2)]))
    # a y sin² + b y cos²: cos² becomes 1 − sin²
    if twin in sums:
        value = sums.pop(twin)
        sums[factors] = nearly_sum(sums[factors], -value)
        sums[rest] = nearly_sum(sums.get(rest, 0.0), value)
    elif rest in sums and nearly_sum(sums[rest], sums[factors]) == 0.0:
        sums[twin] = sums.pop(rest)
        del sums[factors]


def _angle(graph: Graph, node: int) -> int | None:
    """For sin θ the node cos θ and the other way round, where the graph has it."""
    call = graph.nodes[node]
    if not isinstance(call, Call) or call.function not in ("sin", "cos"):
        return None
    return graph.find_call("cos" if call.function == "sin" else "sin", call.operands)


# ---- common factors


def factored(graph: Graph, terms: Sequence[Term]) -> Reference:
    """The sum of the terms, the factor that saves most taken out first: a x + b x + c → (a + b) x +
    c, again inside and outside until nothing is saved (greedy, so not always the least)."""
    if _saves_something(terms):
        terms = _with_factors_out(graph, terms)
    return graph.sum(_product(graph, term) for term in terms)


def _with_factors_out(graph: Graph, terms: Sequence[Term]) -> Sequence[Term]:
    by_factor = _ByFactor(terms)
    while (best := by_factor.best()) is not None:
        inside = [(value, _without(factors, best)) for value, factors in by_factor.taken(best)]
        product = graph.product([(factored(graph, inside), 1), ((1.0, best[0]), best[1])])
        by_factor.put(_term(graph, product))
    return by_factor.terms


def _product(graph: Graph, term: Term) -> Reference:
    return scaled(term[0], graph.product(((1.0, node), exponent) for node, exponent in term[1]))


def _saves(term: Term) -> int:
    """Multiplications or divisions that fall away where a factor of it is taken out: none of a bare
    factor, a x + a → a (x + 1)."""
    value, factors = term
    return min(1, sum(abs(exponent) for _, exponent in factors) - (abs(value) == 1.0))


def _factors(term: Term) -> list[Factor]:
    return [(node, 1 if exponent > 0 else -1) for node, exponent in term[1]]


def _saves_something(terms: Sequence[Term]) -> bool:
    """Whether a factor of two terms may be taken out."""
    saved: set[Factor] = set()
    for term in terms:
        if not _saves(term):
            continue
        found = _factors(term)
        if any(key in saved for key in found):
            return True
        saved.update(found)
    return False


class _ByFactor:
    """The terms of a sum by their factors, so that a long one is not looked through again for each
    factor that is taken out."""

    def __init__(self, terms: Iterable[Term]) -> None:
        self._terms: dict[int, Term] = {}  # by number, in order
        self._holders: dict[Factor, dict[int, None]] = {}  # numbers of the terms, in order
        self._saved: dict[Factor, int] = {}
        self._queue: list[tuple[int, Factor]] = []  # most saved first, what has changed too
        self._next = 0
        for term in terms:
            self.put(term)

    @property
    def terms(self) -> list[Term]:
        """Those that are left, in the order in which they came."""
        return list(self._terms.values())

    def put(self, term: Term) -> None:
        """One more."""
        for key in _factors(term):
            self._holders.setdefault(key, {})[self._next] = None
            self._count(key, _saves(term))
        self._terms[self._next] = term
        self._next += 1

    def taken(self, wanted: Factor) -> list[Term]:
        """The terms with that factor, which are no longer among these."""
        numbers = list(self._holders[wanted])
        found = [self._terms.pop(number) for number in numbers]
        for number, term in zip(numbers, found):
            for key in _factors(term):
                del self._holders[key][number]
                self._count(key, -_saves(term))
        return found

    def _count(self, key: Factor, more: int) -> None:
        if not more:
            return
        self._saved[key] = self._saved.get(key, 0) + more
        heappush(self._queue, (-self._saved[key], key))

    def best(self) -> Factor | None:
        """The factor whose extraction saves most multiplications or divisions, k − 1 of k terms;
        None where none saves any."""
        while self._queue:
            saved, key = self._queue[0]
            if -saved == self._saved[key]:
                return key if -saved > 1 else None
            heappop(self._queue)  # as it was before
        return None


def _without(factors: Factors, taken: Factor) -> Factors:
    lowered = (
        (node, exponent - taken[1] if node == taken[0] else exponent) for node, exponent in factors
    )
    return tuple((node, exponent) for node, exponent in lowered if exponent)
