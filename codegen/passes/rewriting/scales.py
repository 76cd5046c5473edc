"""scales: which multiple of each node to compute, so that as few multiplications by constants as
possible remain.

Two starts: what the users ask for, and the numbers the derivation had (which cost nothing extra).
From the better one, and from both where they are alike, nodes are rescaled one by one as long as
that saves a multiplication; the better end is taken.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from codegen.limits import LONG_SCALES, MOST_GAIN, WIDE_SCALE
from codegen.passes.rewriting.graph import ONE, Call, Graph, Product, Sum, Work, snapped, uses
from codegen.passes.rewriting.rescale import (
    Balance,
    Factors,
    free_scale,
    is_modest,
    ratio,
    structure_of,
)

_ONLY = frozenset({1.0})


@dataclass(frozen=True)
class Starts:
    """The two starts for one graph; `first` has the signs that the users ask for."""

    first: dict[int, float]
    users: Balance
    origin: Balance

    @property
    def constants(self) -> int:
        """How many multiplications by constants the better start needs."""
        return min(self.users.total(), self.origin.total())


def starts(work: Work, loose: set[int]) -> Starts:
    """`loose` numbers the roots whose constant does not matter."""
    nodes = work.live
    wants = _wants(work, nodes, loose)
    structure = structure_of(work.graph, nodes, wants)
    first = _from_users(work, nodes, wants)
    return Starts(first, Balance(structure, first), Balance(structure, _from_origin(work, nodes)))


def scales(known: Starts) -> dict[int, float]:
    """For every live sum and product the multiple of it to compute; `known` is settled by that.

    The value that is computed is scale · node; a use of it with a factor costs a multiplication
    unless factor / scale is ±1.
    """
    best = _settled(known)
    return {node: _signed(best.scales[node], known.first[node]) for node in best.structure.order}


def _settled(known: Starts) -> Balance:
    """The start that begins better is settled; the other one where it may still end better."""
    both = known.users, known.origin
    first, second = sorted(both, key=Balance.total)
    first.settle()
    # it can end with MOST_GAIN of what it has at best; in a large graph, where settling takes long,
    # it has to be the better one as it stands
    gain = 1.0 if len(first.structure.nodes) > LONG_SCALES else MOST_GAIN
    if gain * second.total() < first.total():
        second.settle()
    return min(both, key=Balance.total)


def _signed(size: float, like: float) -> float:
    return -size if like < 0 else size


def _wants(work: Work, nodes: Sequence[int], loose: set[int]) -> dict[int, list[float]]:
    """Multiples that have to be there: of roots and of arguments of functions."""
    wants: dict[int, list[float]] = {}
    for i, (factor, node) in enumerate(work.roots):
        if i not in loose and node != ONE:
            wants.setdefault(node, []).append(factor)
    for node in nodes:
        call = work.graph.nodes[node]
        for factor, other in call.operands if isinstance(call, Call) else ():
            wants.setdefault(other, []).append(factor)
    return wants


# ---- the numbers of the derivation


def _from_origin(work: Work, nodes: Sequence[int]) -> dict[int, float]:
    """Sums as they were first met, products of what there is."""
    origin: dict[int, float] = {}
    for node in nodes:
        inside = work.graph.nodes[node]
        if isinstance(inside, Sum):
            origin[node] = work.graph.natural[node]
        elif isinstance(inside, Product):
            size = abs(snapped(free_scale(inside.factors, origin)))
            # what has grown or shrunk along a long recursion is brought back by one multiplication
            origin[node] = size if is_modest(size) else 1.0
    return origin


def missing_size(product: int, factors: Factors, known: dict[int, float]) -> float:
    """By what a product is multiplied so that it has the scale that was chosen for it."""
    return ratio(known[product], free_scale(factors, known))


# ---- from the roots down


def _from_users(
    work: Work, nodes: Sequence[int], wants: dict[int, list[float]]
) -> dict[int, float]:
    """Every node is told which multiples its users want, chooses one and tells its own operands."""
    wanted: dict[int, list[float]] = {node: list(wants.get(node, ())) for node in (ONE, *nodes)}
    used = uses(work, nodes)
    named = {node: abs(factor) for mark in work.marks for _, (factor, node) in mark.entries}
    chosen: dict[int, float] = {}
    for node in reversed(nodes):
        inside = work.graph.nodes[node]
        if isinstance(inside, Sum):
            natural = named.get(node, work.graph.natural[node])
            chosen[node] = _sum_scale(inside.terms, wanted[node], natural)
            _want_terms(inside.terms, chosen[node], wanted)
        elif isinstance(inside, Product):
            chosen[node] = _product_scale(work.graph, inside.factors, wanted[node], used)
            _want_factors(work.graph, inside.factors, chosen[node], wanted, used)
    return chosen


def _distinct(factors: Iterable[float]) -> int:
    """How many multiplications by constants a set of factors needs."""
    return len({abs(factor) for factor in factors} - {1.0})


def _sum_scale(terms: Sequence[tuple[int, float]], wants: Sequence[float], natural: float) -> float:
    """The cheapest scale; among equals the one with the numbers that the derivation had."""
    factors = [factor for node, factor in terms if node != ONE]
    sign = -1.0 if _prefers_negative(wants) and any(factor < 0 for _, factor in terms) else 1.0
    if natural == 1.0 and not _distinct(factors) and not _distinct(wants):
        return sign
    candidates = [natural, 1.0, *dict.fromkeys(abs(want) for want in wants)]
    sizes, wanted = {abs(factor) for factor in factors}, {abs(want) for want in wants}
    if len(set(factors)) <= WIDE_SCALE:
        candidates += dict.fromkeys(snapped(1.0 / abs(factor)) for factor in factors)

    def cost(scale: float) -> int:
        inside = {snapped(scale * size) for size in sizes} - _ONLY
        return len(inside) + len({snapped(want / scale) for want in wanted} - _ONLY)

    return sign * min(filter(is_modest, dict.fromkeys(candidates)), key=cost)


def _prefers_negative(wants: Sequence[float]) -> bool:
    return sum(1 if want < 0 else -1 for want in wants) > 0


def _product_scale(
    graph: Graph, factors: Sequence[tuple[int, int]], wants: Sequence[float], used: dict[int, int]
) -> float:
    sizes = list(dict.fromkeys(abs(want) for want in wants))
    reciprocal = all(exponent < 0 for _, exponent in factors)
    if sizes == [1.0] and not reciprocal and not _prefers_negative(wants):
        return 1.0

    def cost(scale: float) -> tuple[float, bool]:
        own = 0 if scale == 1.0 or reciprocal else 1
        return own + _distinct(snapped(want / scale) for want in wants), scale not in sizes

    best = min([1.0, *filter(is_modest, sizes)], key=cost)
    flips = best != 1.0 or reciprocal or _absorber(graph, factors, used, -1.0) is not None
    return -best if flips and _prefers_negative(wants) else best


def _absorber(
    graph: Graph, factors: Sequence[tuple[int, int]], used: dict[int, int], factor: float
) -> int | None:
    """A factor of a product that takes the constant in: a sum used here alone; for a mere sign one
    with a minus in it."""
    for node, exponent in factors:
        inside = graph.nodes[node]
        if not isinstance(inside, Sum) or exponent != 1 or used[node] != 1:
            continue
        if factor > 0 or any(own < 0 for _, own in inside.terms):
            return node
    return None


def _want_factors(
    graph: Graph,
    factors: Sequence[tuple[int, int]],
    scale: float,
    wanted: dict[int, list[float]],
    used: dict[int, int],
) -> None:
    takes = None if scale == 1.0 else _absorber(graph, factors, used, scale)
    for node, _ in factors:
        wanted[node].append(scale if node == takes else 1.0)


def _want_terms(
    terms: Sequence[tuple[int, float]], scale: float, wanted: dict[int, list[float]]
) -> None:
    """Terms with a factor of their own may bring it along; a group with the same factor is
    multiplied once."""
    groups: dict[float, list[int]] = {}
    for node, factor in terms:
        groups.setdefault(abs(snapped(scale * factor)), []).append(node)
    for size, members in groups.items():
        for node in members:
            wanted[node].append(size if len(members) == 1 else 1.0)
