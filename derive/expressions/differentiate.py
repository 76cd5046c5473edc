"""The rate of a formula along the motion, by the chain rule over its tree."""

from __future__ import annotations

from collections.abc import Callable

from derive.expressions.mistakes import FormulaError
from derive.expressions.tree import (
    ONE,
    ZERO,
    Call,
    Expression,
    Name,
    Negative,
    Number,
    Power,
    Product,
    Quotient,
    Rate,
    Sum,
    Vector,
)

TWO = Number(2.0)
Leaf = Callable[[Name | Rate], Expression]


def rate(expression: Expression, leaf: Leaf, text: str = "") -> Expression:
    """d/dt of a formula; `leaf` gives the rates of names and of der(q). Zeros are dropped on the
    way. Raises FormulaError at a function that has no derivative everywhere."""
    match expression:
        case Number():
            return ZERO
        case Name() | Rate():
            return leaf(expression)
        case Sum(terms, at):
            return _sum([rate(term, leaf, text) for term in terms], at)
        case Negative(argument, at):
            inner = rate(argument, leaf, text)
            return ZERO if inner == ZERO else Negative(inner, at)
        case Product(factors, at):
            return _product_rate(factors, [rate(x, leaf, text) for x in factors], at)
        case Quotient():
            return _quotient_rate(expression, leaf, text)
        case Power():
            return _power_rate(expression, leaf, text)
        case Call():
            return _call_rate(expression, leaf, text)
        case Vector():
            raise FormulaError("der() of a list", text, expression.at, "a number")


def _sum(terms: list[Expression], at: int) -> Expression:
    rest = tuple(term for term in terms if term != ZERO)
    if len(rest) < 2:
        return rest[0] if rest else ZERO
    return Sum(rest, at)


def _times(*factors: Expression) -> Expression:
    if ZERO in factors:
        return ZERO
    rest = tuple(factor for factor in factors if factor != ONE)
    if len(rest) < 2:
        return rest[0] if rest else ONE
    return Product(rest)


def _product_rate(factors: tuple[Expression, ...], rates: list[Expression], at: int) -> Expression:
    """Σ fᵢ' Π of the others."""
    terms = [_times(x, *factors[:i], *factors[i + 1 :]) for i, x in enumerate(rates)]
    return _sum(terms, at)


def _quotient_rate(node: Quotient, leaf: Leaf, text: str) -> Expression:
    """a'/b − a b'/b²."""
    above = rate(node.numerator, leaf, text)
    below = rate(node.denominator, leaf, text)
    first = ZERO if above == ZERO else Quotient(above, node.denominator)
    product = _times(node.numerator, below)
    squared = Power(node.denominator, TWO)
    second = ZERO if product == ZERO else Negative(Quotient(product, squared))
    return _sum([first, second], node.at)


def _power_rate(node: Power, leaf: Leaf, text: str) -> Expression:
    """n bⁿ⁻¹ b' of a constant power; bᵉ (e' log b + e b'/b) of any other."""
    base, exponent = rate(node.base, leaf, text), rate(node.exponent, leaf, text)
    if isinstance(node.exponent, Number):
        n = node.exponent.value
        lower = node.base if n == 2.0 else Power(node.base, Number(n - 1.0))
        return _times(Number(n), lower, base)
    grown = _times(exponent, Call("log", (node.base,)))
    scaled = _times(node.exponent, base)
    ratio = ZERO if scaled == ZERO else Quotient(scaled, node.base)
    return _times(node, _sum([grown, ratio], node.at))


def _call_rate(node: Call, leaf: Leaf, text: str) -> Expression:
    rates = [rate(argument, leaf, text) for argument in node.arguments]
    if all(x == ZERO for x in rates):
        return ZERO
    if node.function == "atan2":
        return _atan2_rate(node, rates)
    if node.function not in SLOPES:
        raise FormulaError(
            f"der() of {node.function}(), which is not smooth", text, node.at, "a smooth formula"
        )
    return _times(SLOPES[node.function](node.arguments[0]), rates[0])


def _atan2_rate(node: Call, rates: list[Expression]) -> Expression:
    """(x y' − y x')/(x² + y²)."""
    y, x = node.arguments
    across = _sum([_times(x, rates[0]), Negative(_times(y, rates[1]))], node.at)
    return Quotient(across, Sum((Power(x, TWO), Power(y, TWO))))


def _one_minus(x: Expression) -> Expression:
    return Sum((ONE, Negative(Power(x, TWO))))


def _root(x: Expression) -> Expression:
    return Call("sqrt", (x,))


# f'(x) as a tree
SLOPES: dict[str, Callable[[Expression], Expression]] = {
    "sin": lambda x: Call("cos", (x,)),
    "cos": lambda x: Negative(Call("sin", (x,))),
    "tan": lambda x: Sum((ONE, Power(Call("tan", (x,)), TWO))),
    "asin": lambda x: Quotient(ONE, _root(_one_minus(x))),
    "acos": lambda x: Negative(Quotient(ONE, _root(_one_minus(x)))),
    "atan": lambda x: Quotient(ONE, Sum((ONE, Power(x, TWO)))),
    "sinh": lambda x: Call("cosh", (x,)),
    "cosh": lambda x: Call("sinh", (x,)),
    "tanh": lambda x: _one_minus(Call("tanh", (x,))),
    "exp": lambda x: Call("exp", (x,)),
    "log": lambda x: Quotient(ONE, x),
    "sqrt": lambda x: Quotient(ONE, Product((TWO, _root(x)))),
    "abs": lambda x: Call("sign", (x,)),
}
