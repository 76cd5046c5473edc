"""Vectors and matrices of formulas: rotations and shifts that may hold parameters, with numbers
folded and zeros kept zero."""

from __future__ import annotations

import math

from derive.expressions.tree import ONE, ZERO, Expression, Negative, Number, Product, Quotient, Sum
from derive.model.records import Vector3

Rows = tuple[Vector3, Vector3, Vector3]
AXES = (0, 1, 2)
IDENTITY: Rows = ((ONE, ZERO, ZERO), (ZERO, ONE, ZERO), (ZERO, ZERO, ONE))


def negated(a: Expression) -> Expression:
    """−a; of a number a number, of −b again b."""
    if isinstance(a, Number):
        return constant(-a.value)
    return a.argument if isinstance(a, Negative) else Negative(a)


def constant(number: float) -> Expression:
    """Zero and one are always the same two nodes."""
    return ZERO if number == 0.0 else ONE if number == 1.0 else Number(number)


def times(*factors: Expression) -> Expression:
    """The product, numbers first and folded."""
    number = math.prod(factor.value for factor in factors if isinstance(factor, Number))
    rest = [factor for factor in factors if not isinstance(factor, Number)]
    if number == 0.0 or not rest:
        return constant(number)
    if abs(number) == 1.0:
        product = rest[0] if len(rest) == 1 else Product(tuple(rest))
        return product if number > 0 else negated(product)
    return Product((constant(number), *rest))


def plus(*terms: Expression) -> Expression:
    """The sum, numbers last and folded."""
    number = math.fsum(term.value for term in terms if isinstance(term, Number))
    rest: list[Expression] = [term for term in terms if not isinstance(term, Number)]
    if number != 0.0 or not rest:
        rest.append(constant(number))
    return rest[0] if len(rest) == 1 else Sum(tuple(rest))


def minus(a: Expression, b: Expression) -> Expression:
    """a − b, with numbers folded and zeros dropped as in `plus`."""
    return plus(a, negated(b))


def dot(a: Vector3, b: Vector3) -> Expression:
    """a · b of two vectors of formulas."""
    return plus(*(times(x, y) for x, y in zip(a, b)))


def rows(entry: list[list[Expression]]) -> Rows:
    """A matrix out of nested lists."""
    (a, b, c), (d, e, f), (g, h, i) = entry
    return ((a, b, c), (d, e, f), (g, h, i))


def transposed(a: Rows) -> Rows:
    """Aᵀ; of a rotation it is the inverse."""
    return rows([[a[j][i] for j in AXES] for i in AXES])


def product(a: Rows, b: Rows) -> Rows:
    """A B of 3 × 3 matrices of formulas."""
    if IDENTITY in (a, b):
        return b if a == IDENTITY else a
    columns = transposed(b)
    return rows([[dot(a[i], columns[j]) for j in AXES] for i in AXES])


def turned_tensor(R: Rows, tensor: Rows) -> Rows:
    """R I Rᵀ, exactly symmetric."""
    half = product(R, tensor)
    return rows([[dot(half[min(i, j)], R[max(i, j)]) for j in AXES] for i in AXES])


def over(vector: Vector3, divisor: Expression) -> Vector3:
    """a / b, numbers folded and zeros kept."""
    x, y, z = (_over(entry, divisor) for entry in vector)
    return (x, y, z)


def _over(a: Expression, b: Expression) -> Expression:
    if a == ZERO:
        return ZERO
    if isinstance(a, Number) and isinstance(b, Number):
        return constant(a.value / b.value)
    return Quotient(a, b)


def to_centre(tensor: Rows, mass: Expression, com: Vector3) -> Rows:
    """A tensor about the origin, moved to the centre of mass: I − m (c·c 1 − c cᵀ)."""
    square = dot(com, com)

    def entry(i: int, j: int) -> Expression:
        """Entry (i, j) of J − m (c·c 1 − c cᵀ): the parallel-axis theorem backwards, from a point
        to the centre of mass."""
        shift = minus(square if i == j else ZERO, times(com[i], com[j]))
        return minus(tensor[i][j], times(mass, shift))

    return rows([[entry(min(i, j), max(i, j)) for j in AXES] for i in AXES])
