"""scales: which multiple of each node to compute, so that as few multiplications by constants as
possible remain.

Two starts: what the users ask for, and the numbers the derivation had (which cost nothing extra).
From both, nodes are rescaled one by one as long as that saves a multiplication; the better end is
taken.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from codegen.passes.graph import ONE, Graph, Work, snapped, uses

_ONLY = frozenset({1.0})
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
    first = _from_users(work, nodes, wants)
    structure = _Structure(work.graph, nodes, wants)
    best = _settled(_Balance(structure, first))
    if best.needed:
        best = min(
            best,
            _settled(_Balance(structure, _from_origin(work, nodes))),
            key=lambda b: len(b.needed),
        )
    return {node: _signed(best.scales[node], first[node]) for node in structure.order}


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


def _from_users(
    work: Work, nodes: Sequence[int], wants: dict[int, list[float]]
) -> dict[int, float]:
    """Every node is told which multiples its users want, chooses one and tells its own operands."""
    wanted: dict[int, list[float]] = {node: list(wants.get(node, ())) for node in (ONE, *nodes)}
    used = uses(work, nodes)
    named = {node: abs(factor) for mark in work.marks for _, (factor, node) in mark.entries}
    found: dict[int, float] = {}
    for node in reversed(nodes):
        kind, *rest = work.graph.nodes[node]
        if kind == "sum":
            found[node] = _sum_scale(
                rest[0], wanted[node], named.get(node, work.graph.natural[node])
            )
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

    sizes, wanted = {abs(factor) for factor in factors}, {abs(want) for want in wants}

    def cost(scale: float) -> int:
        inside = {snapped(scale * size) for size in sizes} - _ONLY
        return len(inside) + len({snapped(want / scale) for want in wanted} - _ONLY)

    return sign * min(dict.fromkeys(candidates), key=cost)


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

    best = min([1.0, *sizes], key=cost)
    flips = best != 1.0 or reciprocal or _absorber(graph, factors, used, -1.0) is not None
    return -best if flips and _prefers_negative(wants) else best


def _absorber(
    graph: Graph, factors: Sequence[tuple[int, int]], used: dict[int, int], factor: float
) -> int | None:
    """A factor of a product that takes the constant in: a sum used here alone; for a mere sign one
    with a minus in it."""
    for node, exponent in factors:
        kind, *rest = graph.nodes[node]
        if (
            kind == "sum"
            and exponent == 1
            and used[node] == 1
            and (factor > 0 or any(f < 0 for _, f in rest[0]))
        ):
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


# ---- one by one


class _Structure:
    """Sums, products and who uses what: the same for every choice of scales."""

    def __init__(self, graph: Graph, nodes: Sequence[int], wants: dict[int, list[float]]) -> None:
        self.graph = graph
        self.nodes = nodes
        self.order = [node for node in nodes if graph.nodes[node][0] in ("sum", "product")]
        self.wants = {
            node: sorted({abs(want) for want in wanted}) for node, wanted in wants.items()
        }
        self.users: dict[int, list[int]] = {}
        self.sums: dict[
            int, list[tuple[int, float]]
        ] = {}  # the terms that are no constants, and the sizes of their factors
        self.products: dict[int, tuple[tuple[int, int], ...]] = {}
        self.fixed: set[int] = set()  # terms of wide sums: each trial would look at all the others
        for node in self.order:
            self._note(node)

    def _note(self, node: int) -> None:
        kind, terms = self.graph.nodes[node]
        operands = self.graph.operands(node)
        if kind == "sum":
            self.sums[node] = [(other, abs(factor)) for other, factor in terms if other != ONE]
        else:
            self.products[node] = terms
        for other in operands:
            self.users.setdefault(other, []).append(node)
        self.fixed.update(operands if len(operands) > _WIDE else ())


class _Balance:
    """Scales, and the multiplications by constants that they need."""

    def __init__(self, structure: _Structure, start: dict[int, float]) -> None:
        self.graph, self.order, self.wants = structure.graph, structure.order, structure.wants
        self.users, self.sums, self.products, self.fixed = (
            structure.users,
            structure.sums,
            structure.products,
            structure.fixed,
        )
        nodes = structure.nodes
        self.scales = dict.fromkeys(nodes, 1.0) | {
            node: abs(scale) for node, scale in start.items()
        }
        self.keys = {node: keys for node in nodes if (keys := self._keys(node))}
        self.needed = Counter([key for keys in self.keys.values() for key in keys])
        self.sweeps = _SWEEPS if len(nodes) <= _LONG else 1

    def settle(self) -> None:
        """Sweep up and down until no node can be rescaled with profit; after the first sweep only
        near what changed."""
        due = set(self.order if self.needed else ())
        for sweep in range(self.sweeps):
            stirred: set[int] = set()
            for node in self.order if sweep % 2 else reversed(self.order):
                if node in due and self._improve(node):
                    stirred |= self._neighbours(node)
            due = stirred
            if not due:
                break

    def _neighbours(self, node: int) -> set[int]:
        """The nodes whose multiplications may be the same as those of the node or of its users."""
        near = {node, *self.users.get(node, ())}
        near.update(other for one in list(near) for other in self.graph.operands(one))
        near.update(
            user
            for one in list(near)
            for user in self.users.get(one, ())
            if len(self.users[one]) <= _BUSY
        )
        return near

    def _improve(self, node: int) -> bool:
        users = self.users.get(node, ())
        if len(users) > _BUSY or node in self.fixed:
            return False
        near = [node, *users]
        before = [key for one in near if one in self.keys for key in self.keys[one]]
        if not before:
            return False
        own = self.scales[node]
        needed = self.needed
        for key in before:
            needed[key] -= 1
        best, least = own, sum(needed[key] <= 0 for key in set(before))
        if least:
            best = self._best(node, near, own, least)
        if best != own:
            self.scales[node] = best
            self.keys.update((one, self._keys(one)) for one in near)
        for one in near:
            for key in self.keys.get(one, ()):
                needed[key] += 1
        for key in before:
            if not needed[key]:
                del needed[key]
        return best != own

    def _best(self, node: int, near: Sequence[int], own: float, least: int) -> float:
        """The scale with the fewest multiplications that nothing else needs."""
        best = own
        for candidate in dict.fromkeys(self._candidates(node, near[1:])):
            if candidate == own:
                continue  # costs `least`
            self.scales[node] = candidate
            cost = self._fresh(near, least)
            if cost < least:
                best, least = candidate, cost
                if not cost:
                    break
        self.scales[node] = own
        return best

    def _fresh(self, near: Sequence[int], least: int) -> int:
        """How many multiplications near a node nothing else needs; counted only up to `least`."""
        needed = self.needed
        fresh: set[Key] = set()
        for one in near:
            for key in self._keys(one):
                if needed[key] <= 0:
                    fresh.add(key)
            if len(fresh) >= least:
                break
        return len(fresh)

    def _keys(self, node: int) -> list[Key]:
        """Multiplications by constants inside a node, and of the node for those who want a certain
        multiple."""
        own = self.scales[node]
        keys: list[Key] = []
        if node in self.wants:
            keys += [
                (size, node) for want in self.wants[node] if (size := _ratio(want, own)) != 1.0
            ]
        if node in self.products:
            factors = self.products[node]
            size = _ratio(own, free_scale(factors, self.scales))
            if size != 1.0 and any(exponent > 0 for _, exponent in factors):
                keys.append((size, node, "product"))
        elif node in self.sums:
            self._sum_keys(node, own, keys)
        return keys

    def _sum_keys(self, node: int, own: float, keys: list[Key]) -> None:
        scales = self.scales
        groups: dict[float, int] = {}  # the only term with a factor, or −1 for several
        for other, factor in self.sums[node]:
            above, below = own * factor, scales[other]
            if above != below:
                size = abs(snapped(above / below))
                if size != 1.0:
                    groups[size] = -1 if size in groups else other
        for size, member in groups.items():
            keys.append((size, node, "sum") if member < 0 else (size, member))

    def _candidates(self, node: int, users: Sequence[int]) -> Iterator[float]:
        """Scales with which some multiplication near the node falls away."""
        scales = self.scales
        if node in self.products:
            yield abs(snapped(free_scale(self.products[node], scales)))
        elif len(self.graph.nodes[node][1]) <= _WIDE:
            yield self.graph.natural[node]
            yield from [_ratio(scales[other], factor) for other, factor in self.sums[node]]
        yield from self.wants.get(node, ())
        for user in users:
            yield from self._wanted_by(user, node)

    def _wanted_by(self, user: int, node: int) -> Iterator[float]:
        own = self.scales[user]
        if user in self.sums:
            terms = self.sums[user]
            factor = next(factor for other, factor in terms if other == node)
            sizes = {_ratio(own * f, self.scales[o]) for o, f in terms[:_WIDE] if o != node}
            yield from (_ratio(own * factor, size) for size in (1.0, *sorted(sizes)))
        elif (node, 1) in self.products[user]:
            rest = free_scale(
                [term for term in self.products[user] if term[0] != node], self.scales
            )
            yield _ratio(own, rest)


def _settled(balance: _Balance) -> _Balance:
    balance.settle()
    return balance


def _ratio(above: float, below: float) -> float:
    return 1.0 if above == below else abs(snapped(above / below))
