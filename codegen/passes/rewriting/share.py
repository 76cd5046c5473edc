"""share: pairs of terms or factors that several sums or products have in common are computed
once."""

from __future__ import annotations

import heapq
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from itertools import chain

from codegen.passes.rewriting.graph import (
    ONE,
    Graph,
    Product,
    Reference,
    Sum,
    Work,
    copied,
    rewrite,
    snapped,
)

Pair = tuple[
    int, int, float
]  # two nodes and the ratio of their factors; in products the ratio is 1 (above) or −1 (below)
Item = tuple[int, float]  # a member and its factor or exponent
# of members in order; of wide sums and products neighbours alone
Pairs = Callable[[Sequence[Item], bool], Iterator[Pair]]
_WIDE = 48  # in wider sums and products only neighbours are looked at


def share(work: Work) -> Work:
    """Common pairs of products, then common pairs of sums, each the most frequent first."""
    return _share(_share(work, "product"), "sum")


def _share(work: Work, kind: str) -> Work:
    members: dict[int, dict[int, float]] = {}
    for node in work.live:
        inside = work.graph.nodes[node]
        if kind == "sum" and isinstance(inside, Sum):
            members[node] = {other: factor for other, factor in inside.terms if other != ONE}
        elif kind == "product" and isinstance(inside, Product):
            members[node] = {other: float(exponent) for other, exponent in inside.factors}
    extracted = _extract(
        members, len(work.graph.nodes), _product_pairs if kind == "product" else _sum_pairs
    )
    return _rebuild(work, kind, members, extracted) if extracted else work


def _product_pairs(items: Sequence[Item], wide: bool) -> Iterator[Pair]:
    """Pairs above the line, pairs below it, and squares."""
    for i, (a, p) in enumerate(items):
        if abs(p) >= 2:
            yield a, a, 1.0 if p > 0 else -1.0
        for b, q in items[i + 1 : (i + 2 if wide else None)]:
            if p * q > 0:
                yield a, b, 1.0 if p > 0 else -1.0


def _sum_pairs(items: Sequence[Item], wide: bool) -> Iterator[Pair]:
    for i, (a, p) in enumerate(items):
        for b, q in items[i + 1 : (i + 2 if wide else None)]:
            yield a, b, snapped(q / p)


def _all_pairs(inside: dict[int, float], pairs: Pairs) -> Iterator[Pair]:
    return pairs(sorted(inside.items()), len(inside) > _WIDE)


def _extract(
    members: dict[int, dict[int, float]],
    fresh: int,
    pairs: Pairs,
) -> dict[int, Pair]:
    """Replace the most frequent pair by a new member, again and again. Returns what the new members
    stand for."""
    where: dict[Pair, set[int]] = {}
    for node, inside in members.items():
        for pair in _all_pairs(inside, pairs):
            where.setdefault(pair, set()).add(node)
    heap = [(-len(nodes), pair) for pair, nodes in where.items() if len(nodes) > 1]
    heapq.heapify(heap)
    extracted: dict[int, Pair] = {}
    while heap:
        size, pair = heapq.heappop(heap)
        nodes = where.get(pair, set())
        # counts change while a pair waits in the heap: an outdated one goes back with its present
        # count
        if len(nodes) < 2 or len(nodes) != -size:
            if len(nodes) > 1:
                heapq.heappush(heap, (-len(nodes), pair))
            continue
        extracted[fresh] = pair
        for node in sorted(nodes):
            _replace(members[node], node, pair, fresh, where, pairs, heap)
        fresh += 1
    return extracted


def _replace(
    inside: dict[int, float],
    node: int,
    pair: Pair,
    fresh: int,
    where: dict[Pair, set[int]],
    pairs: Pairs,
    heap: list[tuple[int, Pair]],
) -> None:
    """In one sum or product: the pair out, the new member in; the counts follow."""
    near = _neighbours(inside, pair) if len(inside) > _WIDE else None
    for old in _all_pairs(inside, pairs) if near is None else pairs(_items(inside, near), True):
        where[old].discard(node)
    if pairs is _product_pairs:
        _take_factors(inside, pair, fresh)
    else:
        inside[fresh] = inside.pop(pair[0])
        del inside[pair[1]]
    for new in _new_pairs(inside, near, fresh, pairs):
        users = where.setdefault(new, set())
        users.add(node)
        if fresh in new[:2] and len(users) > 1:
            heapq.heappush(heap, (-len(users), new))


def _neighbours(inside: dict[int, float], pair: Pair) -> list[int]:
    """The two members of a wide sum or product, which stand side by side, with those beside them:
    all other pairs stay as they are. Members are in order, as nodes have them."""
    members = list(inside)
    place = bisect_left(members, pair[0])
    return members[max(0, place - 1) : place + (2 if pair[0] == pair[1] else 3)]


def _new_pairs(
    inside: dict[int, float], near: list[int] | None, fresh: int, pairs: Pairs
) -> Iterator[Pair]:
    """Those that may not have been there before; the new member is the last one."""
    if near is None or len(inside) <= _WIDE:
        return _all_pairs(inside, pairs)
    *_, last, _ = inside
    left = [member for member in near if member in inside]
    if left[-1:] == [last]:
        return pairs(_items(inside, [*left, fresh]), True)
    return chain(pairs(_items(inside, left), True), pairs(_items(inside, [last, fresh]), True))


def _items(inside: dict[int, float], members: Sequence[int]) -> list[Item]:
    return [(member, inside[member]) for member in members]


def _take_factors(inside: dict[int, float], pair: Pair, fresh: int) -> None:
    for taken in pair[:2]:
        inside[taken] -= pair[2]
        if not inside[taken]:
            del inside[taken]
    inside[fresh] = inside.get(fresh, 0.0) + pair[2]


def _rebuild(
    work: Work, kind: str, members: dict[int, dict[int, float]], extracted: dict[int, Pair]
) -> Work:
    images: dict[int, Reference] = {}

    def found(graph: Graph, member: int, done: dict[int, Reference]) -> Reference:
        """A member in the new graph; extracted pairs are made when first needed."""
        if member not in extracted:
            return done[member]
        if member not in images:
            a, b, ratio = extracted[member]
            left, right = found(graph, a, done), found(graph, b, done)
            if kind == "product":
                images[member] = graph.product([(left, 1), (right, 1)])
            else:
                images[member] = graph.sum([left, (ratio * right[0], right[1])])
        return images[member]

    def rule(graph: Graph, node: int, done: dict[int, Reference]) -> Reference:
        if node not in members:
            return copied(work, graph, node, done)
        parts = [(found(graph, member, done), value) for member, value in members[node].items()]
        if kind == "product":
            return graph.product((reference, int(value)) for reference, value in parts)
        old = work.graph.nodes[node]
        terms = old.terms if isinstance(old, Sum) else ()
        constant = [(value, ONE) for other, value in terms if other == ONE]
        return graph.sum(
            [*constant, *((value * factor, other) for (factor, other), value in parts)]
        )

    return rewrite(work, rule)
