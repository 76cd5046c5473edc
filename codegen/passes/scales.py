"""scales: which multiple of each node to compute, so that as few multiplications by constants as possible remain.

Two starts: what the users ask for, and the numbers the derivation had (which cost nothing extra). From both, nodes are rescaled
one by one as long as that saves a multiplication; the better end is taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

from codegen.passes.graph import ONE, Graph, Work, snapped, uses

_WIDE = 16  # sums with more distinct factors than this are not searched for the best scale
_BUSY = 24  # nodes with more users than this keep their scale
_SWEEPS = 4
_LONG = 2_000  # graphs with more nodes than this are swept once
_LARGE = 10_000  # graphs with more nodes than this keep the numbers of the derivation
Key = tuple[object, ...]  # a multiplication by a constant; equal ones are done once


def scales(work: Work, nodes: Sequence[int], loose: set[int]) -> dict[int, float]:
    """For every live node the multiple of it to compute."""
    if len(nodes) > _LARGE:
        return _from_origin(work, nodes)
    wants = _wants(work, nodes, loose)
    starts = [_from_users(work, nodes, wants), _from_origin(work, nodes)]
    balances = [_Balance(work.graph, nodes, wants, start) for start in starts]
    for balance in balances:
        balance.settle()
    best = min(balances, key=lambda balance: len(balance.needed))
    return {node: _signed(best.scales[node], starts[0][node]) for node in best.scales}


def _signed(size: float, like: float) -> float:
    return -size if like < 0 else size


def _wants(work: Work, nodes: Sequence[int], loose: set[int]) -> dict[int, list[float]]:
    """Multiples that have to be there: of roots and of arguments of functions."""
    wants: dict[int, list[float]] = {}
    for i, (factor, node) in enumerate(work.roots):
        if i not in loose and node != ONE:
            wants.setdefault(node, []).append(factor)
    for node in nodes:
        kind, *rest = work.graph.nodes[node]
        for factor, other in rest[1] if kind == "call" else ():
            wants.setdefault(other, []).append(factor)
    return wants


def _is_free(kind: str) -> bool:
    return kind in ("sum", "product")


# ---- the numbers of the derivation


def _from_origin(work: Work, nodes: Sequence[int]) -> dict[int, float]:
    """Sums as they were first met, products of what there is."""
    found: dict[int, float] = {}
    for node in nodes:
        kind, *rest = work.graph.nodes[node]
        if kind == "sum":
            found[node] = work.graph.natural[node]
        elif kind == "product":
            found[node] = abs(snapped(free_scale(rest[0], found)))
    return found


def free_scale(factors: Iterable[tuple[int, int]], known: dict[int, float]) -> float:
    """The scale that a product has when its factors are multiplied as they are."""
    free = 1.0
    for node, exponent in factors:
        if node in known:
            free *= known[node] ** exponent
    return free


# ---- from the roots down


def _from_users(work: Work, nodes: Sequence[int], wants: dict[int, list[float]]) -> dict[int, float]:
    """Every node is told which multiples its users want, chooses one and tells its own operands."""
    wanted: dict[int, list[float]] = {node: list(wants.get(node, ())) for node in (ONE, *nodes)}
    used = uses(work, nodes)
    named = {node: abs(factor) for mark in work.marks for _, (factor, node) in mark.entries}
    found: dict[int, float] = {}
    for node in reversed(nodes):
        kind, *rest = work.graph.nodes[node]
        if kind == "sum":
            found[node] = _sum_scale(rest[0], wanted[node], named.get(node, work.graph.natural[node]))
            _want_terms(rest[0], found[node], wanted)
        elif kind == "product":
            found[node] = _product_scale(work.graph, rest[0], wanted[node], used)
            _want_factors(work.graph, rest[0], found[node], wanted, used)
    return found


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
    if len(set(factors)) <= _WIDE:
        candidates += dict.fromkeys(snapped(1.0 / abs(factor)) for factor in factors)

    def cost(scale: float) -> int:
        inside = _distinct(snapped(scale * factor) for factor in factors)
        return inside + _distinct(snapped(want / scale) for want in wants)

    return sign * min(candidates, key=cost)


def _prefers_negative(wants: Sequence[float]) -> bool:
    return sum(1 if want < 0 else -1 for want in wants) > 0


def _product_scale(graph: Graph, factors: Sequence[tuple[int, int]], wants: Sequence[float], used: dict[int, int]) -> float:
    sizes = list(dict.fromkeys(abs(want) for want in wants))
    reciprocal = all(exponent < 0 for _, exponent in factors)

    def cost(scale: float) -> tuple[float, bool]:
        own = 0 if scale == 1.0 or reciprocal else 1
        return own + _distinct(snapped(want / scale) for want in wants), scale not in sizes

    best = min([1.0, *sizes], key=cost)
    flips = best != 1.0 or reciprocal or _absorber(graph, factors, used, -1.0) is not None
    return -best if flips and _prefers_negative(wants) else best


def _absorber(graph: Graph, factors: Sequence[tuple[int, int]], used: dict[int, int], factor: float) -> int | None:
    """A factor of a product that takes the constant in: a sum used here alone; for a mere sign one with a minus in it."""
    for node, exponent in factors:
        kind, *rest = graph.nodes[node]
        if kind == "sum" and exponent == 1 and used[node] == 1 and (factor > 0 or any(f < 0 for _, f in rest[0])):
            return node
    return None


def _want_factors(
    graph: Graph, factors: Sequence[tuple[int, int]], scale: float, wanted: dict[int, list[float]], used: dict[int, int]
) -> None:
    takes = None if scale == 1.0 else _absorber(graph, factors, used, scale)
    for node, _ in factors:
        wanted[node].append(scale if node == takes else 1.0)


def _want_terms(terms: Sequence[tuple[int, float]], scale: float, wanted: dict[int, list[float]]) -> None:
    """Terms with a factor of their own may bring it along; a group with the same factor is multiplied once."""
    groups: dict[float, list[int]] = {}
    for node, factor in terms:
        groups.setdefault(abs(snapped(scale * factor)), []).append(node)
    for size, members in groups.items():
        for node in members:
            wanted[node].append(size if len(members) == 1 else 1.0)


# ---- one by one


class _Balance:
    """Scales, and the multiplications by constants that they need."""

    def __init__(self, graph: Graph, nodes: Sequence[int], wants: dict[int, list[float]], start: dict[int, float]) -> None:
        self.graph = graph
        self.scales = {node: abs(scale) for node, scale in start.items()}
        self.order = [node for node in nodes if node in start]
        self.wants = {node: sorted({abs(want) for want in wanted}) for node, wanted in wants.items()}
        self.users: dict[int, list[int]] = {}
        self.fixed: set[int] = set()  # terms of wide sums: each trial would look at all the others
        for node in self.order:
            operands = graph.operands(node)
            for other in operands:
                self.users.setdefault(other, []).append(node)
            self.fixed.update(operands if len(operands) > _WIDE else ())
        self.keys = {node: keys for node in nodes if (keys := self._keys(node))}
        self.needed = Counter(key for keys in self.keys.values() for key in keys)
        self.sweeps = _SWEEPS if len(nodes) <= _LONG else 1

    def settle(self) -> None:
        """Sweep up and down until no node can be rescaled with profit."""
        ways: tuple[Callable[[Iterable[int]], Iterable[int]], ...] = (lambda n: reversed(list(n)), lambda n: n)
        for sweep in range(self.sweeps):
            changed = [self._improve(node) for node in ways[sweep % 2](self.order)]
            if not any(changed):
                break

    def _improve(self, node: int) -> bool:
        users = self.users.get(node, [])
        if len(users) > _BUSY or node in self.fixed:
            return False
        near = [node, *users]
        before = [key for one in near for key in self.keys.get(one, ())]
        if not before:
            return False
        own = self.scales[node]
        self.needed.subtract(before)
        best, least = own, self._fresh(before)
        for candidate in dict.fromkeys(self._candidates(node, users)):
            self.scales[node] = candidate
            cost = self._fresh(key for one in near for key in self._keys(one))
            if cost < least:
                best, least = candidate, cost
        self.scales[node] = best
        if best != own:
            self.keys.update((one, self._keys(one)) for one in near)
        self.needed.update(key for one in near for key in self.keys.get(one, ()))
        for key in before:
            if not self.needed[key]:
                del self.needed[key]
        return best != own

    def _fresh(self, keys: Iterable[Key]) -> int:
        """How many of the keys nothing else needs."""
        return sum(self.needed[key] <= 0 for key in set(keys))

    def _scale(self, node: int) -> float:
        return self.scales.get(node, 1.0)

    def _keys(self, node: int) -> list[Key]:
        """Multiplications by constants inside a node, and of the node for those who want a certain multiple."""
        kind, *rest = self.graph.nodes[node]
        own = self._scale(node)
        keys: list[Key] = [(size, node) for want in self.wants.get(node, ()) if (size := _ratio(want, own)) != 1.0]
        if kind == "product":
            size = _ratio(own, free_scale(rest[0], self.scales))
            if size != 1.0 and any(exponent > 0 for _, exponent in rest[0]):
                keys.append((size, node, "product"))
        elif kind == "sum":
            keys += self._sum_keys(node, rest[0], own)
        return keys

    def _sum_keys(self, node: int, terms: Sequence[tuple[int, float]], own: float) -> Iterator[Key]:
        groups: dict[float, list[int]] = {}
        for other, factor in terms:
            if other != ONE:
                groups.setdefault(_ratio(own * abs(factor), self._scale(other)), []).append(other)
        groups.pop(1.0, None)
        for size, members in groups.items():
            yield (size, members[0]) if len(members) == 1 else (size, node, "sum")

    def _candidates(self, node: int, users: Sequence[int]) -> Iterator[float]:
        """Scales with which some multiplication near the node falls away."""
        kind, terms = self.graph.nodes[node]
        if kind == "product":
            yield abs(snapped(free_scale(terms, self.scales)))
        elif len(terms) <= _WIDE:
            yield self.graph.natural[node]
            yield from (_ratio(self._scale(other), abs(factor)) for other, factor in terms if other != ONE)
        yield from self.wants.get(node, ())
        for user in users:
            yield from self._wanted_by(user, node)

    def _wanted_by(self, user: int, node: int) -> Iterator[float]:
        kind, terms = self.graph.nodes[user]
        own = self.scales[user]
        if kind == "sum":
            factor = next(abs(factor) for other, factor in terms if other == node)
            sizes = {_ratio(own * abs(f), self._scale(o)) for o, f in terms[:_WIDE] if o not in (ONE, node)}
            yield from (_ratio(own * factor, size) for size in (1.0, *sorted(sizes)))
        elif (node, 1) in terms:
            rest = free_scale([term for term in terms if term[0] != node], self.scales)
            yield _ratio(own, rest)


def _ratio(above: float, below: float) -> float:
    return 1.0 if above == below else abs(snapped(above / below))
