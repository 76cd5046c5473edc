"""lower: from n-ary sums and products to two-operand operations, with every sign and constant where
it costs least.

Each node is computed up to a factor of its own (its scale), chosen so that its users and its terms
together multiply by as few constants as possible. Signs are free inside sums: a term is added or
subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from codegen.passes.graph import ONE, Graph, Reference, Work, snapped
from codegen.passes.scales import free_scale, scales

Operand = (
    int | float
)  # the index of an operation, or a constant; of "input" the argument's name and the index


@dataclass(frozen=True, slots=True)
class Operation:
    name: str
    operands: tuple[Any, ...]


@dataclass
class Code:
    """Operations in an order that computes operands first. `inputs` and repeated operations occur
    once."""

    operations: list[Operation] = field(default_factory=list)
    index: dict[tuple[object, ...], int] = field(default_factory=dict)

    def put(self, name: str, *operands: Any) -> int:
        """The index of an operation, appended when it is new."""
        if name in ("add", "mul") and _order(operands[0]) > _order(operands[1]):
            operands = operands[::-1]
        key = (
            name,
            *operands,
            *map(type, operands),
        )  # Python takes operation 2 and the number 2.0 for the same
        if key not in self.index:
            self.index[key] = len(self.operations)
            self.operations.append(Operation(name, operands))
        return self.index[key]


@dataclass(frozen=True)
class Lowered:
    """`roots` are the values asked for; for those in `loose` the factor that is missing stands in
    `factors`.

    `places` says where a node's value is: (operand, scale).
    """

    code: Code
    roots: tuple[Operand, ...]
    factors: tuple[float, ...]
    places: dict[int, tuple[Operand, float]]


def lower(work: Work, loose: Sequence[int] = ()) -> Lowered:
    """Operations for all roots; the roots numbered in `loose` may come out times a constant (they
    are only compared)."""
    nodes = work.live
    found = scales(work, nodes, set(loose))
    maker = _Maker(work.graph, found)
    for node in nodes:
        maker.make(node)
    roots = [
        maker.loose(root) if i in loose else (maker.value(root), 1.0)
        for i, root in enumerate(work.roots)
    ]
    return Lowered(
        maker.code,
        tuple(value for value, _ in roots),
        tuple(factor for _, factor in roots),
        maker.places,
    )


def _order(operand: Operand) -> tuple[int, float]:
    return (0, operand) if isinstance(operand, float) else (1, operand)


def _partners(graph: Graph, known: dict[int, float]) -> dict[int, int]:
    """For products with a constant: the factor to multiply by it first, where that is of use to
    several products."""
    sizes: dict[int, float] = {}
    where: dict[tuple[float, int], list[int]] = {}
    for product in sorted(known):
        kind, *rest = graph.nodes[product]
        if kind == "product":
            sizes[product] = abs(snapped(known[product] / free_scale(rest[0], known)))
            for node, exponent in rest[0] if sizes[product] != 1.0 else ():
                if exponent == 1:
                    where.setdefault((sizes[product], node), []).append(product)
    partners: dict[int, int] = {}
    for (_, node), products in sorted(where.items(), key=lambda item: (-len(item[1]), item[0])):
        fresh = [product for product in products if product not in partners]
        if len(fresh) > 1:
            partners.update(dict.fromkeys(fresh, node))
    return partners


# ---- the operations themselves


class _Maker:
    """Appends the operations of one node after another."""

    def __init__(self, graph: Graph, scales: dict[int, float]) -> None:
        self.graph = graph
        self.scales = scales
        self.code = Code()
        self.places: dict[int, tuple[Operand, float]] = {ONE: (1.0, 1.0)}
        self.partners = _partners(graph, scales)

    def make(self, node: int) -> None:
        kind, *rest = self.graph.nodes[node]
        if kind == "sum":
            self.places[node] = self._sum(rest[0], self.scales[node])
        elif kind == "product":
            self.places[node] = (self._product(node, rest[0], self.scales[node]), self.scales[node])
        elif kind == "call":
            self.places[node] = (
                self.code.put(rest[0], *(self.value(operand) for operand in rest[1])),
                1.0,
            )
        elif kind == "input":
            self.places[node] = (self.code.put("input", *rest), 1.0)
        else:
            self.places[node] = (float(rest[0]), 1.0)

    def value(self, reference: Reference) -> Operand:
        """The operand that equals factor · node."""
        if reference[1] == ONE:
            return reference[0]
        operand, scale = self.places[reference[1]]
        return self._times(snapped(reference[0] / scale), operand)

    def loose(self, reference: Reference) -> tuple[Operand, float]:
        """The operand that equals factor · node up to a constant, and the constant: value =
        constant · operand."""
        if reference[1] == ONE:
            return reference[0], 1.0
        operand, scale = self.places[reference[1]]
        return operand, reference[0] / scale

    def _times(self, factor: float, operand: Operand) -> Operand:
        if factor == 1.0:
            return operand
        if isinstance(operand, float):
            return factor * operand
        return (
            self.code.put("neg", operand)
            if factor == -1.0
            else self.code.put("mul", factor, operand)
        )

    def _sum(self, terms: Sequence[tuple[int, float]], scale: float) -> tuple[Operand, float]:
        """The value and its scale; the sign of the scale may have turned where all terms are
        subtracted."""
        groups: dict[float, list[tuple[float, Operand]]] = {}
        for node, factor in terms:
            size, sign, operand = self._term(node, snapped(scale * factor))
            groups.setdefault(size, []).append((sign, operand))
        signed: list[tuple[float, Operand]] = groups.pop(1.0, [])
        for size, members in groups.items():
            sign, operand = self._add(members)
            signed.append((sign, self._times(size, operand)))
        sign, operand = self._add(signed)
        return operand, sign * scale

    def _term(self, node: int, factor: float) -> tuple[float, float, Operand]:
        """A term of a sum as size, sign and operand."""
        if node == ONE:
            return 1.0, (1.0 if factor > 0 else -1.0), abs(factor)
        operand, scale = self.places[node]
        ratio = snapped(factor / scale)
        return abs(ratio), (1.0 if ratio > 0 else -1.0), operand

    def _add(self, signed: Sequence[tuple[float, Operand]]) -> tuple[float, Operand]:
        """Add signed operands as a balanced tree; returns the sign that is left over and the
        sum."""
        if len(signed) == 1:
            return signed[0]
        half = (len(signed) + 1) // 2 if len(signed) > 3 else len(signed) - 1
        (sign, left), (other, right) = self._add(signed[:half]), self._add(signed[half:])
        if sign == other:
            return sign, self.code.put("add", left, right)
        return 1.0, self.code.put("sub", left, right) if sign > 0 else self.code.put(
            "sub", right, left
        )

    def _product(self, product: int, factors: Sequence[tuple[int, int]], scale: float) -> Operand:
        above, below = [], []
        for node, exponent in factors:
            operand, own = self.places[node]
            scale /= own**exponent
            if node == self.partners.get(product):
                size = abs(snapped(self.scales[product] / free_scale(factors, self.scales)))
                operand, scale = self._times(size, operand), scale / size
            (above if exponent > 0 else below).append((operand, abs(exponent)))
        return self._quotient(above, below, snapped(scale))

    def _quotient(
        self, above: list[tuple[Operand, int]], below: list[tuple[Operand, int]], factor: float
    ) -> Operand:
        if not above:
            return self.code.put("div", factor, self._multiply(below))
        top = self._multiply(above)
        if not below:
            return self._times(factor, top)
        return self._times(factor, self.code.put("div", top, self._multiply(below)))

    def _multiply(self, factors: Sequence[tuple[Operand, int]]) -> Operand:
        values = [self._power(operand, exponent) for operand, exponent in factors]
        while len(values) > 1:
            values = [
                self.code.put("mul", *values[i : i + 2]) if i + 1 < len(values) else values[i]
                for i in range(0, len(values), 2)
            ]
        return values[0]

    def _power(self, operand: Operand, exponent: int) -> Operand:
        if exponent == 1:
            return operand
        half = self._power(operand, exponent // 2)
        square = self.code.put("mul", half, half)
        return self.code.put("mul", square, operand) if exponent % 2 else square
