"""Evaluation of a tree over any kind of number: floats, CasADi graphs.

A table of functions makes the difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import casadi as ca

from derive.expressions import tree
from derive.expressions.limits import objection, too_large
from derive.expressions.mistakes import FormulaError
from derive.expressions.pieces import pieces
from derive.expressions.tables import Table, spline
from derive.expressions.tree import Expression

Functions = Mapping[str, Callable[..., Any]]


def value(
    expression: Expression, names: Mapping[str, Any], rates: Mapping[str, Any], functions: Functions
) -> Any:
    """The value of a tree; `names` and `rates` (by coordinate) give the values of Name and Rate. A
    Vector gives a list."""
    match expression:
        case tree.Number(number):
            return number
        case tree.Name(name):
            return names[name]
        case tree.Rate(name):
            return rates[name]
        case tree.Power(base, exponent):
            return _power(value(base, names, rates, functions), exponent, names, rates, functions)
        case _:
            pass
    operands = [value(operand, names, rates, functions) for operand in tree.children(expression)]
    return _applied(expression, operands, functions)


def _applied(expression: Expression, operands: list[Any], functions: Functions) -> Any:
    match expression:
        case tree.Sum():
            return _sum(operands)
        case tree.Product():
            return _product(operands)
        case tree.Quotient():
            return operands[0] / operands[1]
        case tree.Negative():
            return -operands[0]
        case tree.Call(function):
            return functions[function](*operands)
        case _:
            pass
    return operands


def _sum(terms: Sequence[Any]) -> Any:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


def _product(factors: Sequence[Any]) -> Any:
    total = factors[0]
    for factor in factors[1:]:
        total = total * factor
    return total


def _power(
    base: Any,
    exponent: Expression,
    names: Mapping[str, Any],
    rates: Mapping[str, Any],
    functions: Functions,
) -> Any:
    if isinstance(exponent, tree.Number):
        if exponent.value == 0.5:
            return functions["sqrt"](base)
        if exponent.value.is_integer() and abs(exponent.value) < 2**31:
            return base ** int(exponent.value)  # x**2 is a square, x**2.0 a call of pow
    return base ** value(exponent, names, rates, functions)


def number(expression: Expression, names: Mapping[str, float], text: str = "") -> float:
    """The float value of a tree without rates. Raises FormulaError where it has none (1/0, a root
    of a negative number) or is too large, KeyError for a name that is not known."""
    try:
        result = value(expression, names, {}, float_functions())
    except (ArithmeticError, ValueError):
        result = math.nan
    return _bounded(result, text, expression)


def is_constant(expression: Expression) -> bool:
    """Whether the tree holds no names and no rates."""
    return not any(isinstance(node, tree.Name | tree.Rate) for node in tree.walk(expression))


def check_constants(expression: Expression, text: str) -> None:
    """Refuse constant parts such as 9**9**9, 1/0 or sqrt(-1) where they stand. All arithmetic is on
    floats."""
    stack: list[tuple[tree.Expression, float | None]] = []
    for node in tree.walk(expression):
        count = len(tree.children(node))
        operands = [known for _, known in stack[len(stack) - count :]] if count else []
        if count:
            del stack[len(stack) - count :]
        stack.append((node, _constant(node, operands, text)))


def _constant(node: Expression, operands: list[float | None], text: str) -> float | None:
    if isinstance(node, tree.Number):
        return node.value
    known = [operand for operand in operands if operand is not None]
    if isinstance(node, tree.Quotient) and operands[1] == 0.0:
        raise FormulaError(
            "division by zero", text, node.denominator.at, "a denominator that is not zero"
        )
    if isinstance(node, tree.Vector) or len(known) < len(operands) or not operands:
        return None
    if isinstance(node, tree.Call) and node.function not in float_functions():
        return None
    return _folded(node, known, text)


def _folded(node: Expression, operands: list[float], text: str) -> float:
    try:
        power = isinstance(node, tree.Power)
        result = (
            operands[0] ** operands[1] if power else _applied(node, operands, float_functions())
        )
    except (ArithmeticError, ValueError):
        result = math.nan
    return _bounded(result, text, node)


def _bounded(result: Any, text: str, node: Expression) -> float:
    """A value as a float; FormulaError where it is complex, infinite or too large."""
    real = float(result) if isinstance(result, float | int) else math.nan
    if too_large(real):
        problem, expected = objection(real) or ("", "")
        raise FormulaError(problem, text, node.at, expected)
    return real


def _sign(x: float) -> float:
    return float((x > 0) - (x < 0))


_FLOAT: dict[str, Callable[..., Any]] = {
    name: getattr(math, name)
    for name in (
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "atan2",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "log",
        "sqrt",
    )
} | {
    **{"abs": abs, "min": min, "max": max, "sign": _sign},
    **pieces(lambda a, b, x, y: x if a < b else y, math.tanh, math.sqrt),
}


def float_functions() -> Functions:
    """The table for Python floats."""
    return _FLOAT


# what CasADi calls as we do
_SAME_NAME = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "log",
    "sqrt", "sign",
)  # fmt: skip


def casadi_functions() -> Functions:
    """The table for casadi.SX."""
    return {name: getattr(ca, name) for name in _SAME_NAME} | {
        "abs": ca.fabs,
        "min": _over_all(ca.fmin),
        "max": _over_all(ca.fmax),
        **pieces(lambda a, b, x, y: _either(a < b, x, y), ca.tanh, ca.sqrt),
    }


def casadi_tables(tables: Iterable[Table]) -> Functions:
    """Those of a model for casadi.SX."""
    return {table.name: spline(table, ca.fmin, ca.fmax) for table in tables}


def float_tables(tables: Iterable[Table]) -> Functions:
    """Those of a model for Python floats."""
    return {table.name: spline(table, min, max) for table in tables}


def _either(condition: Any, x: Any, y: Any) -> Any:
    return ca.if_else(condition, x, y)  # pyright: ignore[reportUnknownMemberType,reportAttributeAccessIssue,reportUnknownVariableType]


def _over_all(function: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """A function of two arguments as one of any number, from left to right."""

    def folded(*arguments: Any) -> Any:
        """f(f(f(a, b), c), …) for a function of two arguments such as min."""
        result = arguments[0]
        for argument in arguments[1:]:
            result = function(result, argument)
        return result

    return folded
