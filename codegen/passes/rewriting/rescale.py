"""rescale: nodes are rescaled one by one as long as that saves a multiplication by a constant.

A trial of one scale looks at everything near the node, so almost all of them are left out: every
scale with which a multiplication may fall away is one vote, votes are sorted, and only a scale with
more votes than the present one is counted through.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from codegen.limits import BUSY_SCALE, LONG_SCALES, MODEST, NEAR_SCALE, SCALE_SWEEPS, WIDE_SCALE
from codegen.passes.rewriting.graph import ONE, Graph, Product, Sum, power, snapped

Factors = tuple[tuple[int, int], ...]
Terms = list[tuple[int, float]]


def is_modest(size: float) -> bool:
    """Is it far enough from overflow and underflow to be multiplied by its like?"""
    return 1.0 / MODEST <= size <= MODEST


def free_scale(factors: Iterable[tuple[int, int]], known: dict[int, float]) -> float:
    """The scale that a product has when its factors are multiplied as they are."""
    free = 1.0
    for node, exponent in factors:
        scale = known.get(node, 1.0)
        if scale != 1.0:
            free *= scale if exponent == 1 else power(scale, exponent)
    return free


def ratio(above: float, below: float) -> float:
    """The size of above / below, 1 where the two are the same."""
    if above == below:
        return 1.0
    return abs(snapped(above / below)) if below else math.inf


@dataclass(frozen=True)
class Structure:
    """Sums, products and who uses what: the same for every choice of scales."""

    graph: Graph
    nodes: Sequence[int]
    order: list[int]  # sums and products
    wants: dict[int, list[float]]  # by node the sizes that have to be there
    users: dict[int, list[int]]
    terms: dict[int, Terms]  # of sums: no constants, and sizes of factors
    places: dict[int, dict[int, int]]  # of sums: where each term stands
    factors: dict[int, Factors]  # of products
    fixed: set[int]  # terms of wide sums: each trial would look at all the others


def structure_of(graph: Graph, nodes: Sequence[int], wants: dict[int, list[float]]) -> Structure:
    """`wants` holds by node the multiples that have to be there."""
    sizes = {node: sorted({abs(want) for want in wanted}) for node, wanted in wants.items()}
    structure = Structure(graph, nodes, [], sizes, {}, {}, {}, {}, set())
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


@dataclass(slots=True)
class _Uses:
    """The multiplications by constants that a node needs: multiples of nodes, (node, size), which
    are done once for all who need them; and how many inside of it, which are its own."""

    multiples: list[tuple[int, float]]
    own: int


@dataclass(slots=True)
class _Near:
    """What does not change around a node while one scale after another is tried for it.

    `steady` counts the multiples that nothing else needs, by how many near the node need them, and
    `inside` the multiplications inside of its users; `sums` are the users whose multiplications
    depend on the scale: the multiple of the node that is wanted, and the sizes of the other terms
    with the only term of each, or −1.
    """

    steady: dict[tuple[int, float], int] = field(default_factory=dict[tuple[int, float], int])
    inside: int = 0
    sums: list[tuple[float, dict[float, int]]] = field(
        default_factory=list[tuple[float, dict[float, int]]]
    )
    products: list[int] = field(default_factory=list[int])


class Balance:
    """Scales, and the multiplications by constants that they need."""

    def __init__(self, structure: Structure, start: dict[int, float]) -> None:
        self.structure = structure
        self.scales = dict.fromkeys(structure.nodes, 1.0)
        self.scales |= {node: abs(scale) for node, scale in start.items()}
        self.sizes = {node: self._sizes(node) for node in structure.terms}
        self.uses: dict[int, _Uses] = {}  # by node, where there are any
        # by node: its multiples that are needed, and by how many
        self.needed: dict[int, dict[float, int]] = {node: {} for node in structure.nodes}
        # what is neither made of others nor wanted has no multiplications
        wanted = [node for node in structure.wants if node != ONE]
        for node in dict.fromkeys([*structure.order, *wanted]):
            self._renew(node)
            if node in self.uses:
                self._count(self.uses[node].multiples)
        self.sweeps = SCALE_SWEEPS if len(structure.nodes) <= LONG_SCALES else 1

    def total(self) -> int:
        """How many multiplications by constants there are."""
        return sum(map(len, self.needed.values())) + sum(uses.own for uses in self.uses.values())

    def settle(self) -> None:
        """Sweep up and down until no node can be rescaled with profit; after the first sweep only
        near what changed."""
        order = self.structure.order
        due = set(order if self.uses else ())
        for sweep in range(self.sweeps):
            stirred: set[int] = set()
            for node in order if sweep % 2 else reversed(order):
                if node in due and self._improve(node) and sweep + 1 < self.sweeps:
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
        near = [self.uses[one] for one in (node, *users) if one in self.uses]
        least = self._discount(near)
        own = self.scales[node]
        best = self._best(node, users, least) if least else own
        if best != own:
            self._rescale(node, best)
            near = [self.uses[one] for one in (node, *users) if one in self.uses]
        for uses in near:
            self._count(uses.multiples)
        return best != own

    def _count(self, multiples: Sequence[tuple[int, float]]) -> None:
        for node, size in multiples:
            sizes = self.needed[node]
            sizes[size] = sizes.get(size, 0) + 1

    def _discount(self, near: Sequence[_Uses]) -> int:
        """Take what these need out of the count; returns how much of it nothing else needs."""
        alone = 0
        for uses in near:
            alone += uses.own
            for node, size in uses.multiples:
                sizes = self.needed[node]
                sizes[size] -= 1
                if not sizes[size]:
                    del sizes[size]
                    alone += 1
        return alone

    def _rescale(self, node: int, scale: float) -> None:
        self.scales[node] = scale
        if node in self.sizes:
            self.sizes[node] = self._sizes(node)
        self._renew(node)
        for user in self.structure.users.get(node, ()):
            if user in self.sizes:
                place = self.structure.places[user][node]
                factor = self.structure.terms[user][place][1]
                self.sizes[user][place] = ratio(self.scales[user] * factor, scale)
            self._renew(user)

    # ---- the multiplications of one node

    def _renew(self, node: int) -> None:
        multiples, own = self._multiples(node, self.scales[node]), 0
        if node in self.sizes:
            groups = _groups(self.structure.terms[node], self.sizes[node])
            multiples += [(only, size) for size, only in groups.items() if only >= 0]
            own = sum(only < 0 for only in groups.values())
        elif node in self.structure.factors:
            own = self._product_costs(node)
        if multiples or own:
            self.uses[node] = _Uses(multiples, own)
        else:
            self.uses.pop(node, None)

    def _sizes(self, node: int) -> list[float]:
        """By what the terms of a sum are multiplied."""
        own, scales = self.scales[node], self.scales
        return [ratio(own * factor, scales[other]) for other, factor in self.structure.terms[node]]

    def _multiples(self, node: int, scale: float) -> list[tuple[int, float]]:
        """Multiples of the node for those who want certain ones."""
        wants = self.structure.wants.get(node)
        if not wants:
            return []
        return [(node, size) for want in wants if (size := ratio(want, scale)) != 1.0]

    def _product_costs(self, node: int) -> int:
        """1 where a product is multiplied by a constant as a whole."""
        factors = self.structure.factors[node]
        if ratio(self.scales[node], free_scale(factors, self.scales)) == 1.0:
            return 0
        return int(any(exponent > 0 for _, exponent in factors))

    # ---- trials

    def _best(self, node: int, users: Sequence[int], least: int) -> float:
        """The scale with the fewest multiplications that nothing else needs."""
        own = best = self.scales[node]
        near = self._near(node, users)
        slack = least - len(near.steady) - near.inside
        if slack <= 0:  # what the users multiply anyhow is all there is
            return own
        promising = self._promising(node, near, slack)
        for candidate in dict.fromkeys(self._candidates(node, users)) if promising else ():
            if candidate == own or not is_modest(candidate):
                continue  # costs `slack`, or leads to overflow
            if not any(low <= candidate <= high for low, high in promising):
                continue
            cost = self._cost(node, candidate, near)
            if cost < slack:
                best, slack = candidate, cost
                if not cost:
                    break
        return best

    def _near(self, node: int, users: Sequence[int]) -> _Near:
        near = _Near()
        scales, structure, steady = self.scales, self.structure, near.steady
        for user in users:
            multiples = self._multiples(user, scales[user])
            if user in self.sizes:
                place = structure.places[user][node]
                terms, sizes = structure.terms[user], self.sizes[user]
                groups = _groups(terms, sizes, place)
                multiples += [(only, size) for size, only in groups.items() if only >= 0]
                near.inside += sum(only < 0 for only in groups.values())
                near.sums.append((scales[user] * terms[place][1], groups))
            else:
                near.products.append(user)
            for key in set(multiples):
                if key[1] not in self.needed[key[0]]:
                    steady[key] = steady.get(key, 0) + 1
        return near

    def _cost(self, node: int, scale: float, near: _Near) -> int:
        """How many multiplications that nothing else needs come to the steady ones if the node has
        that scale.

        Multiples of the node are needed near it alone. Where a term of a sum has the size of
        another, the two are added first: the multiple of the other may fall away.
        """
        sizes = {size for _, size in self._multiples(node, scale)}
        savings: dict[tuple[int, float], int] = {}
        for wanted, groups in near.sums:
            size = ratio(wanted, scale)
            only = None if size == 1.0 else groups.get(size, ONE)
            if only == ONE:
                sizes.add(size)
            elif only is not None and only >= 0:
                savings[only, size] = savings.get((only, size), 0) + 1
        left = {key for key, count in savings.items() if near.steady.get(key) == count}
        before = self.scales[node]
        self.scales[node] = scale
        cost = sum(map(self._product_costs, near.products))
        cost += self._own_costs(node, near, left)
        self.scales[node] = before
        return cost + len(sizes) + sum(savings.values()) - len(left)

    def _own_costs(self, node: int, near: _Near, left: set[tuple[int, float]]) -> int:
        """Of the node itself: what is multiplied inside of it, and multiples that nothing else
        needs."""
        if node in self.structure.factors:
            return self._product_costs(node)
        if node not in self.sizes:
            return 0
        groups = _groups(self.structure.terms[node], self._sizes(node))
        return sum(
            only < 0
            or (
                size not in self.needed[only]
                and ((only, size) not in near.steady or (only, size) in left)
            )
            for size, only in groups.items()
        )

    def _candidates(self, node: int, users: Sequence[int]) -> Iterator[float]:
        """Scales with which some multiplication near the node falls away."""
        scales, structure = self.scales, self.structure
        if node in structure.factors:
            yield abs(snapped(free_scale(structure.factors[node], scales)))
        elif _width(structure.graph, node) <= WIDE_SCALE:
            yield structure.graph.natural[node]
            yield from [ratio(scales[other], factor) for other, factor in structure.terms[node]]
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
            yield from [ratio(wanted, size) for size in (1.0, *sorted(set(sizes)))]
        elif (node, 1) in structure.factors[user]:
            others = [term for term in structure.factors[user] if term[0] != node]
            yield ratio(own, free_scale(others, self.scales))

    # ---- which trials are worth their time

    def _promising(self, node: int, near: _Near, slack: int) -> list[tuple[float, float]]:
        """Between which bounds there can be scales that leave fewer than `slack` multiplications.

        Each of `most` multiplications falls away with the scales that are its votes, up to
        rounding. What two votes of one multiplication say counts twice: too many trials, never too
        few.
        """
        multiples = [*self.structure.wants.get(node, ()), *(wanted for wanted, _ in near.sums)]
        votes = _apart(multiples)
        most = len(votes)
        for wanted, groups in near.sums:
            votes += [wanted / size for size in groups]
        for product in near.products:
            known = self._product_votes(product, node)
            most, votes = most + (known is not None), votes + (known or [])
        if node in self.structure.factors:
            most += 1
            votes.append(free_scale(self.structure.factors[node], self.scales))
        elif node in self.sizes:
            own = [self.scales[other] / factor for other, factor in self.structure.terms[node]]
            apart = _apart(own)
            most += len(apart)
            votes += apart
            votes += self._shared_votes(node, near, own)
        return _crowded(votes, most - slack)

    def _product_votes(self, product: int, node: int) -> list[float] | None:
        """The scale of the node with which a product that uses it needs no constant; None where it
        never has one."""
        factors = self.structure.factors[product]
        if all(exponent < 0 for _, exponent in factors):
            return None
        exponent = next(exponent for other, exponent in factors if other == node)
        others = free_scale([term for term in factors if term[0] != node], self.scales)
        wanted = self.scales[product] / others if others else math.inf
        return [wanted if exponent == 1 else power(wanted, 1.0 / exponent)]

    def _shared_votes(self, node: int, near: _Near, own: Sequence[float]) -> Iterator[float]:
        """Scales with which a sum needs a multiple of a term that is there anyhow."""
        for (other, _), scale in zip(self.structure.terms[node], own):
            for size in self.needed[other]:
                yield size * scale
        places = self.structure.places[node]
        for other, size in near.steady:
            if other in places:
                yield size * own[places[other]]


def _apart(scales: Iterable[float]) -> list[float]:
    """Those that differ by more than rounding, sorted."""
    apart: list[float] = []
    last = 0.0
    for scale in sorted(scales):
        if scale > last * NEAR_SCALE:
            apart.append(scale)
        last = scale
    return apart


def _crowded(votes: list[float], least: int) -> list[tuple[float, float]]:
    """The bounds of all that have more than `least` votes within rounding."""
    if least < 0:
        return [(0.0, math.inf)]
    if len(votes) <= least:
        return []
    votes = sorted([vote for vote in votes if vote < math.inf])
    crowded: list[int] = []
    first = count = 0
    for place, vote in enumerate(votes):
        if count and vote <= votes[place - 1] * NEAR_SCALE:
            count += 1
        else:
            first, count = place, 1
        if count == least + 1:
            crowded.append(first)
    return [_bounds(votes, first) for first in crowded]


def _bounds(votes: Sequence[float], first: int) -> tuple[float, float]:
    last = first
    while last + 1 < len(votes) and votes[last + 1] <= votes[last] * NEAR_SCALE:
        last += 1
    return votes[first] / NEAR_SCALE, votes[last] * NEAR_SCALE


def _width(graph: Graph, node: int) -> int:
    """How many terms a sum has, a constant included."""
    inside = graph.nodes[node]
    return len(inside.terms) if isinstance(inside, Sum) else 0


def _groups(terms: Terms, sizes: Sequence[float], leave_out: int = -1) -> dict[float, int]:
    """By size the only term that is multiplied by it, or −1 for several."""
    groups: dict[float, int] = {}
    for place, size in enumerate(sizes):
        if size != 1.0 and place != leave_out:
            groups[size] = -1 if size in groups else terms[place][0]
    return groups
