"""scales: which multiple of each node to compute, so that as few multiplications by constants as
possible remain.

Two starts: what the users ask for, and the numbers the derivation had (which cost nothing extra).
From both, nodes are rescaled one by one as long as that saves a multiplication; the better end is
taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from codegen.limits import (
    BUSY_SCALE,
    LARGE_SCALES,
    LONG_SCALES,
    MODEST,
    SCALE_SWEEPS,
    WIDE_SCALE,
)
from codegen.passes.graph import ONE, Call, Graph, Product, Sum, Work, power, snapped, uses

_ONLY = frozenset({1.0})
Terms = tuple[tuple[int, float], ...]
Factors = tuple[tuple[int, int], ...]
# A multiplication by a constant; equal ones are done once: (size, node), of a node wherever it is
# used, or (size, node, "sum" or "product"), of a part or of the whole of what a node is made of.
Key = tuple[float, int] | tuple[float, int, str]


def scales(work: Work, nodes: Sequence[int], loose: set[int]) -> dict[int, float]:
    """For every live node the multiple of it to compute."""
    if len(nodes) > LARGE_SCALES:
        return _from_origin(work, nodes)
    wants = _wants(work, nodes, loose)
    first = _from_users(work, nodes, wants)
    structure = _structure(work.graph, nodes, wants)
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


def is_modest(size: float) -> bool:
    """Is it far enough from overflow and underflow to be multiplied by its like?"""
    return 1.0 / MODEST <= size <= MODEST


def free_scale(factors: Iterable[tuple[int, int]], known: dict[int, float]) -> float:
    """The scale that a product has when its factors are multiplied as they are."""
    free = 1.0
    for node, exponent in factors:
        scale = known.get(node, 1.0)
        if scale != 1.0:
            free *= power(scale, exponent)
    return free


def missing_size(product: int, factors: Factors, known: dict[int, float]) -> float:
    """By what a product is multiplied so that it has the scale that was chosen for it."""
    return _ratio(known[product], free_scale(factors, known))


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


# ---- one by one


@dataclass(frozen=True)
class _Structure:
    """Sums, products and who uses what: the same for every choice of scales."""

    graph: Graph
    nodes: Sequence[int]
    order: list[int]  # sums and products
    wants: dict[int, list[float]]  # by node the sizes that have to be there
    users: dict[int, list[int]]
    terms: dict[int, list[tuple[int, float]]]  # of sums: no constants, and sizes of factors
    places: dict[int, dict[int, int]]  # of sums: where each term stands
    factors: dict[int, Factors]  # of products
    fixed: set[int]  # terms of wide sums: each trial would look at all the others


def _structure(graph: Graph, nodes: Sequence[int], wants: dict[int, list[float]]) -> _Structure:
    sizes = {node: sorted({abs(want) for want in wanted}) for node, wanted in wants.items()}
    structure = _Structure(graph, nodes, [], sizes, {}, {}, {}, {}, set())
    for node in nodes:
        inside = graph.nodes[node]
        if isinstance(inside, Sum):
            terms = [(other, abs(factor)) for other, factor in inside.terms if other != ONE]
            structure.terms[node] = terms
            structure.places[node] = {other: place for place, (other, _) in enumerate(terms)}
        elif isinstance(inside, Product):
            structure.factors[node] = inside.factors
        else:
            continue
        structure.order.append(node)
        operands = graph.operands[node]
        for other in operands:
            structure.users.setdefault(other, []).append(node)
        structure.fixed.update(operands if len(operands) > WIDE_SCALE else ())
    return structure


@dataclass
class _Surroundings:
    """What does not change around a node while one scale after another is tried for it.

    `steady` counts the multiplications that nothing else needs, by who else near the node needs
    them; `sums` are the users whose own multiplications depend on the scale: number, multiple of
    the node that is wanted, and the sizes of the other terms with the only term of each, or −1.
    """

    steady: dict[Key, int] = field(default_factory=dict[Key, int])
    sums: list[tuple[int, float, dict[float, int]]] = field(
        default_factory=list[tuple[int, float, dict[float, int]]]
    )
    products: list[int] = field(default_factory=list[int])


class _Balance:
    """Scales, and the multiplications by constants that they need."""

    def __init__(self, structure: _Structure, start: dict[int, float]) -> None:
        self.structure = structure
        self.scales = dict.fromkeys(structure.nodes, 1.0)
        self.scales |= {node: abs(scale) for node, scale in start.items()}
        self.sizes = {node: self._sizes(node) for node in structure.terms}
        self.keys: dict[int, list[Key]] = {}  # by node, where there are any
        self.needed: dict[Key, int] = {}  # by how many nodes
        for node in structure.nodes:
            self._renew(node)
            for key in self.keys.get(node, ()):
                self.needed[key] = self.needed.get(key, 0) + 1
        self.sweeps = SCALE_SWEEPS if len(structure.nodes) <= LONG_SCALES else 1

    def settle(self) -> None:
        """Sweep up and down until no node can be rescaled with profit; after the first sweep only
        near what changed."""
        order = self.structure.order
        due = set(order if self.needed else ())
        for sweep in range(self.sweeps):
            stirred: set[int] = set()
            for node in order if sweep % 2 else reversed(order):
                if node in due and self._improve(node):
                    stirred |= self._neighbours(node)
            due = stirred
            if not due:
                break

    def _neighbours(self, node: int) -> set[int]:
        """The nodes whose multiplications may be the same as those of the node or of its users."""
        users, operands = self.structure.users, self.structure.graph.operands
        near = {node, *users.get(node, ())}
        for one in list(near):
            near.update(operands[one])
        for one in list(near):
            above = users.get(one, ())
            if len(above) <= BUSY_SCALE:
                near.update(above)
        return near

    def _improve(self, node: int) -> bool:
        users = self.structure.users.get(node, ())
        if len(users) > BUSY_SCALE or node in self.structure.fixed:
            return False
        near = [node, *users]
        before = [key for one in near if one in self.keys for key in self.keys[one]]
        if not before:
            return False
        needed = self.needed
        for key in before:
            needed[key] -= 1
        own = best = self.scales[node]
        least = sum(needed[key] <= 0 for key in set(before))
        if least:
            best = self._best(node, users, least)
        if best != own:
            self._rescale(node, best)
        for one in near:
            for key in self.keys.get(one, ()):
                needed[key] = needed.get(key, 0) + 1
        for key in before:
            if not needed.get(key, 1):
                del needed[key]
        return best != own

    def _rescale(self, node: int, scale: float) -> None:
        self.scales[node] = scale
        if node in self.sizes:
            self.sizes[node] = self._sizes(node)
        self._renew(node)
        for user in self.structure.users.get(node, ()):
            if user in self.sizes:
                place = self.structure.places[user][node]
                factor = self.structure.terms[user][place][1]
                self.sizes[user][place] = _ratio(self.scales[user] * factor, scale)
            self._renew(user)

    def _renew(self, node: int) -> None:
        keys = self._keys(node)
        if keys:
            self.keys[node] = keys
        else:
            self.keys.pop(node, None)

    # ---- the multiplications of one node

    def _sizes(self, node: int) -> list[float]:
        """By what the terms of a sum are multiplied."""
        own, scales = self.scales[node], self.scales
        return [_ratio(own * factor, scales[other]) for other, factor in self.structure.terms[node]]

    def _keys(self, node: int) -> list[Key]:
        """Multiplications by constants inside a node, and of the node for those who want a certain
        multiple."""
        keys = self._wanted_keys(node, self.scales[node])
        if node in self.structure.factors:
            keys += self._product_keys(node)
        elif node in self.sizes:
            keys += _sum_keys(node, _groups(self.structure.terms[node], self.sizes[node]))
        return keys

    def _wanted_keys(self, node: int, scale: float) -> list[Key]:
        wants = self.structure.wants.get(node, ())
        return [(size, node) for want in wants if (size := _ratio(want, scale)) != 1.0]

    def _product_keys(self, node: int) -> list[Key]:
        factors = self.structure.factors[node]
        size = _ratio(self.scales[node], free_scale(factors, self.scales))
        if size != 1.0 and any(exponent > 0 for _, exponent in factors):
            return [(size, node, "product")]
        return []

    # ---- trials

    def _best(self, node: int, users: Sequence[int], least: int) -> float:
        """The scale with the fewest multiplications that nothing else needs."""
        own = best = self.scales[node]
        around = self._surroundings(node, users)
        slack = least - len(around.steady)
        if slack <= 0:  # what the users multiply anyhow is all there is
            return own
        for candidate in dict.fromkeys(self._candidates(node, users)):
            if candidate == own or not is_modest(candidate):
                continue  # costs `slack`, or leads to overflow
            cost = self._cost(node, candidate, around, slack)
            if cost < slack:
                best, slack = candidate, cost
                if not cost:
                    break
        return best

    def _surroundings(self, node: int, users: Sequence[int]) -> _Surroundings:
        around = _Surroundings()
        scales, structure = self.scales, self.structure
        for user in users:
            keys = self._wanted_keys(user, scales[user])
            if user in self.sizes:
                place = structure.places[user][node]
                terms, sizes = structure.terms[user], self.sizes[user]
                groups = _groups(
                    [*terms[:place], *terms[place + 1 :]], [*sizes[:place], *sizes[place + 1 :]]
                )
                keys += _sum_keys(user, groups)
                around.sums.append((user, scales[user] * terms[place][1], groups))
            else:
                around.products.append(user)
            for key in set(keys):
                if self.needed.get(key, 0) <= 0:
                    around.steady[key] = around.steady.get(key, 0) + 1
        return around

    def _cost(self, node: int, scale: float, around: _Surroundings, most: int) -> int:
        """How many multiplications that nothing else needs come to the steady ones if the node has
        that scale; counted no further than `most`."""
        fresh, left = self._fresh_in_sums(node, scale, around)
        own = self.scales[node]
        self.scales[node] = scale
        for keys in self._dependent_keys(node, scale, around.products):
            if len(fresh) - len(left) >= most:
                break
            fresh.update(self._fresh(keys, around.steady, left))
        self.scales[node] = own
        return len(fresh) - len(left)

    def _fresh_in_sums(
        self, node: int, scale: float, around: _Surroundings
    ) -> tuple[set[Key], set[Key]]:
        """What the sums that use the node need for it, and which steady multiplications they give
        up, because the term is now added to the node first. These are never more than the sums."""
        keys: list[Key] = []
        gone: dict[Key, int] = {}
        for user, wanted, groups in around.sums:
            size = 1.0 if wanted == scale else abs(snapped(wanted / scale))
            if size == 1.0:
                continue
            only = groups.get(size)
            if only is None:
                keys.append((size, node))
            elif only >= 0:
                gone[size, only] = gone.get((size, only), 0) + 1
                keys.append((size, user, "sum"))
        left = {key for key, count in gone.items() if around.steady.get(key) == count}
        return set(self._fresh(keys, around.steady, left)), left

    def _fresh(self, keys: Iterable[Key], steady: dict[Key, int], left: set[Key]) -> list[Key]:
        """Those that nothing else needs."""
        needed = self.needed
        return [
            key for key in keys if needed.get(key, 0) <= 0 and (key not in steady or key in left)
        ]

    def _dependent_keys(
        self, node: int, scale: float, products: Sequence[int]
    ) -> Iterator[list[Key]]:
        """The multiplications that depend on the scale of a node, besides those in sums that use
        it; `scales` has the scale already. The quickest to find come first."""
        yield self._wanted_keys(node, scale)
        for product in products:
            yield self._product_keys(product)
        if node in self.structure.factors:
            yield self._product_keys(node)
        elif node in self.sizes:
            yield _sum_keys(node, _groups(self.structure.terms[node], self._sizes(node)))

    def _candidates(self, node: int, users: Sequence[int]) -> Iterator[float]:
        """Scales with which some multiplication near the node falls away."""
        scales, structure = self.scales, self.structure
        if node in structure.factors:
            yield abs(snapped(free_scale(structure.factors[node], scales)))
        elif _width(structure.graph, node) <= WIDE_SCALE:
            yield structure.graph.natural[node]
            yield from [_ratio(scales[other], factor) for other, factor in structure.terms[node]]
        yield from structure.wants.get(node, ())
        for user in users:
            yield from self._wanted_by(user, node)

    def _wanted_by(self, user: int, node: int) -> Iterator[float]:
        own, structure = self.scales[user], self.structure
        if user in self.sizes:
            place = structure.places[user][node]
            wanted = own * structure.terms[user][place][1]
            sizes = self.sizes[user][:WIDE_SCALE]
            if place < len(sizes):
                del sizes[place]
            yield from [_ratio(wanted, size) for size in (1.0, *sorted(set(sizes)))]
        elif (node, 1) in structure.factors[user]:
            others = [term for term in structure.factors[user] if term[0] != node]
            yield _ratio(own, free_scale(others, self.scales))


def _width(graph: Graph, node: int) -> int:
    """How many terms a sum has, a constant included."""
    inside = graph.nodes[node]
    return len(inside.terms) if isinstance(inside, Sum) else 0


def _groups(terms: Sequence[tuple[int, float]], sizes: Sequence[float]) -> dict[float, int]:
    """By size the only term that is multiplied by it, or −1 for several."""
    groups: dict[float, int] = {}
    for (other, _), size in zip(terms, sizes):
        if size != 1.0:
            groups[size] = -1 if size in groups else other
    return groups


def _sum_keys(node: int, groups: dict[float, int]) -> list[Key]:
    """Terms of the same size are added before they are multiplied."""
    return [(size, node, "sum") if only < 0 else (size, only) for size, only in groups.items()]


def _settled(balance: _Balance) -> _Balance:
    balance.settle()
    return balance


def _ratio(above: float, below: float) -> float:
    if above == below:
        return 1.0
    return abs(snapped(above / below)) if below else math.inf
