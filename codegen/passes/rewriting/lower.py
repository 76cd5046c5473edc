"""lower: from n-ary sums and products to two-operand operations, with every sign and constant where
it costs least.

Each node is computed up to a factor of its own (its scale), chosen so that its users and its terms
together multiply by as few constants as possible. Signs are free inside sums: a term is added or
subtracted.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import cast

from codegen.passes.rewriting.graph import (
    ONE,
    Call,
    Graph,
    Input,
    Literal,
    Product,
    Reference,
    Sum,
    Work,
    power,
    snapped,
)
from codegen.passes.rewriting.scales import Starts, missing_size, scales, starts
from derive.diagnostics import AssumptionError

Operand = int | float  # the index of an operation, or a constant


@dataclass(frozen=True, slots=True)
class Operation:
    """`slot` is the argument's name and the entry of it, of the operation "input" alone."""

    name: str
    operands: tuple[Operand, ...] = ()
    slot: tuple[str, int] = ("", 0)


@dataclass
class Code:
    """Operations in an order that computes operands first, and by operation those it works on.
    Inputs and repeated operations occur once."""

    operations: list[Operation] = field(default_factory=list[Operation])
    inner: list[tuple[int, ...]] = field(default_factory=list[tuple[int, ...]])
    _places: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])

    def input(self, argument: str, entry: int) -> int:
        """The index of the operation that is an entry of an argument."""
        key = ("input", argument, entry)
        place = self._places.get(key)
        if place is None:
            place = self._append(key, Operation("input", slot=(argument, entry)), ())
        return place

    def put(self, name: str, *operands: Operand) -> int:
        """The index of an operation, appended when it is new."""
        if float in map(type, operands):
            return self._put_with_numbers(name, operands)
        if (name == "add" or name == "mul") and operands[0] > operands[1]:
            operands = operands[::-1]
        key = (name, operands)
        place = self._places.get(key)
        if place is None:
            place = self._append(key, Operation(name, operands), cast(tuple[int, ...], operands))
        return place

    def _put_with_numbers(self, name: str, operands: tuple[Operand, ...]) -> int:
        if name in ("add", "mul") and _comes_after(*operands):
            operands = operands[::-1]
        # Python takes operation 2 and the number 2.0 for the same
        key = (name, operands, *map(type, operands))
        place = self._places.get(key)
        if place is None:
            inner = tuple([operand for operand in operands if isinstance(operand, int)])
            place = self._append(key, Operation(name, operands), inner)
        return place

    def _append(self, key: tuple[object, ...], operation: Operation, inner: tuple[int, ...]) -> int:
        place = self._places[key] = len(self.operations)
        self.operations.append(operation)
        self.inner.append(inner)
        return place

    def reachable(self, roots: Iterable[Operand]) -> list[int]:
        """The operations that the roots need, the roots included, in increasing order."""
        inner = self.inner
        needed = bytearray(len(inner))
        for root in roots:
            if isinstance(root, int):
                needed[root] = 1
        for i in range(len(inner) - 1, -1, -1):
            if needed[i]:
                for operand in inner[i]:
                    needed[operand] = 1
        return [i for i, flag in enumerate(needed) if flag]


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

    @functools.cached_property
    def wanted(self) -> tuple[int, ...]:
        """The operations that the roots need, in increasing order."""
        return tuple(self.code.reachable(self.roots))


def lower(work: Work, loose: Sequence[int] = (), known: Starts | None = None) -> Lowered:
    """Operations for all roots; the roots numbered in `loose` may come out times a constant (they
    are only compared).

    Every value is computed as scale · node; a user that needs factor · node multiplies by factor /
    scale, or not at all where the two are equal. `known` are the starts for the scales, where they
    were looked at before. Raises AssumptionError where constants multiply to
    zero or infinity.
    """
    nodes = work.live
    factors = scales(known or starts(work, set(loose)))
    maker = _Maker(work.graph, factors)
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


def _comes_after(left: Operand, right: Operand) -> bool:
    """Numbers come before operations, each in increasing order."""
    if isinstance(left, float):
        return isinstance(right, float) and left > right
    return isinstance(right, float) or left > right


def _partners(graph: Graph, known: dict[int, float]) -> dict[int, int]:
    """For products with a constant: the factor to multiply by it first, where that is of use to
    several products."""
    where: dict[tuple[float, int], list[int]] = {}
    for product in sorted(known):
        inside = graph.nodes[product]
        if not isinstance(inside, Product):
            continue
        size = missing_size(product, inside.factors, known)
        for node, exponent in inside.factors if size != 1.0 else ():
            if exponent == 1:
                where.setdefault((size, node), []).append(product)
    partners: dict[int, int] = {}
    for (_, node), products in sorted(where.items(), key=lambda item: (-len(item[1]), item[0])):
        fresh = [product for product in products if product not in partners]
        if len(fresh) > 1:
            partners.update(dict.fromkeys(fresh, node))
    return partners


def _representable(factor: float) -> float:
    """The factor. Raises AssumptionError where it is no number to multiply by."""
    if factor == 0.0 or not math.isfinite(factor):
        raise AssumptionError(
            "constants of this model multiply to more, or less, than a double can hold",
            "choose units in which the numbers of the model are nearer to one",
        )
    return factor


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
        """Append the operations of a node, whose operands have theirs, and note its place: the
        value there is scale · node. Only sums and products have a scale other than 1."""
        inside = self.graph.nodes[node]
        if isinstance(inside, Sum):
            self.places[node] = self._sum(inside.terms, self.scales[node])
        elif isinstance(inside, Product):
            scale = self.scales[node]
            self.places[node] = self._product(node, inside.factors, scale), scale
        elif isinstance(inside, Call):
            operands = [self.value(operand) for operand in inside.operands]
            self.places[node] = self.code.put(inside.function, *operands), 1.0
        elif isinstance(inside, Input):
            self.places[node] = self.code.input(inside.argument, inside.index), 1.0
        elif isinstance(inside, Literal):
            self.places[node] = float(inside.text), 1.0

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
        if factor == -1.0:
            return self.code.put("neg", operand)
        return self.code.put("mul", _representable(factor), operand)

    def _sum(self, terms: Sequence[tuple[int, float]], scale: float) -> tuple[Operand, float]:
        """The value and its scale; the sign of the scale may have turned where all terms are
        subtracted."""
        # terms of the same size are added first and multiplied once
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
        # a minus is never an operation here: it turns an addition into a subtraction, and the sign
        # that is left over goes to whoever uses the sum
        if sign == other:
            return sign, self.code.put("add", left, right)
        if sign < 0:
            left, right = right, left
        return 1.0, self.code.put("sub", left, right)

    def _product(self, product: int, factors: Sequence[tuple[int, int]], scale: float) -> Operand:
        """scale · Π node^exponent: what the factors' own scales contribute is divided out of the
        constant, and a factor that several products share takes it in."""
        above: list[tuple[Operand, int]] = []
        below: list[tuple[Operand, int]] = []
        partner = self.partners.get(product)
        for node, exponent in factors:
            operand, own = self.places[node]
            if own != 1.0:
                scale /= power(own, exponent)
            if node == partner:
                size = missing_size(product, tuple(factors), self.scales)
                operand, scale = self._times(size, operand), scale / size
            (above if exponent > 0 else below).append((operand, abs(exponent)))
        return self._quotient(above, below, snapped(_representable(scale)))

    def _quotient(
        self, above: list[tuple[Operand, int]], below: list[tuple[Operand, int]], factor: float
    ) -> Operand:
        """One division whatever stands below: factor · Π above / Π below."""
        if not above:
            return self.code.put("div", factor, self._multiply(below))
        top = self._multiply(above)
        if not below:
            return self._times(factor, top)
        return self._times(factor, self.code.put("div", top, self._multiply(below)))

    def _multiply(self, factors: Sequence[tuple[Operand, int]]) -> Operand:
        """Pairs, then pairs of pairs: a tree waits for fewer multiplications than a chain."""
        values = [self._power(operand, exponent) for operand, exponent in factors]
        while len(values) > 1:
            values = [
                self.code.put("mul", *values[i : i + 2]) if i + 1 < len(values) else values[i]
                for i in range(0, len(values), 2)
            ]
        return values[0]

    def _power(self, operand: Operand, exponent: int) -> Operand:
        """By repeated squaring; powers of one operand share their squares, for equal operations are
        one."""
        if exponent == 1:
            return operand
        half = self._power(operand, exponent // 2)
        square = self.code.put("mul", half, half)
        return self.code.put("mul", square, operand) if exponent % 2 else square
