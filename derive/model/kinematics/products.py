"""Numbers and vectors made of vectors: distance, norm, dot, cross."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from derive.expressions import tree
from derive.expressions.tree import ZERO, Call, Expression, Name
from derive.model.kinematics.arguments import Arguments, Parts, Rewritten
from derive.model.quantities import minus, plus, times
from derive.model.records import GROUND

Vectors = Callable[[Expression], Parts]  # of what an argument says
Product = Callable[[Arguments, Call, Vectors], Rewritten]


def distance(of: Arguments, node: Call, vector: Vectors) -> Expression:
    """Between two points: |r₂ − r₁|."""
    arguments = list(node.arguments)
    ends = [_end(of, arguments, node, vector) for _ in range(2)]
    if arguments:
        raise of.fault("distance() does not take this", arguments[0], "two points")
    if ends[0] == ends[1]:
        raise of.fault("a length that is always zero", node, "two points that differ")
    return _size(of, tuple(minus(b, a) for a, b in zip(*ends)), node)


def _end(of: Arguments, arguments: list[Expression], node: Call, vector: Vectors) -> Parts:
    if not arguments:
        raise of.fault("distance() takes two points", node, "distance(a, b)")
    if isinstance(arguments[0], Name):
        return of.vector_of("position", of.spot(arguments), GROUND, node)
    return vector(arguments.pop(0))


def _size(of: Arguments, parts: Parts, node: Call) -> Expression:
    """|a|. Raises FormulaError where it is zero at every position."""
    square = plus(*(tree.Power(x, tree.Number(2.0)) for x in parts if x != ZERO))
    if square == ZERO:
        raise of.fault("a length that is always zero", node, "two points that differ")
    return Call("sqrt", (square,), node.at)


def norm(of: Arguments, node: Call, vector: Vectors) -> Expression:
    """|a|."""
    return _size(of, vector(node.arguments[0]), node)


def dot(_: Arguments, node: Call, vector: Vectors) -> Expression:
    """a · b."""
    a, b = (vector(argument) for argument in node.arguments)
    return plus(*(times(x, y) for x, y in zip(a, b)))


def cross(of: Arguments, node: Call, vector: Vectors) -> Rewritten:
    """a × b; in a plane its component along the normal."""
    a, b = (vector(argument) for argument in node.arguments)

    def entry(i: int, j: int) -> Expression:
        """aᵢ bⱼ − aⱼ bᵢ."""
        return minus(times(a[i], b[j]), times(a[j], b[i]))

    if of.space.plane:
        return entry(0, 1)
    return (entry(1, 2), entry(2, 0), entry(0, 1))


PRODUCTS: Mapping[str, Product] = {
    "distance": distance,
    "dot": dot,
    "cross": cross,
    "norm": norm,
}
