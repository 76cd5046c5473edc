"""Formulas of the model over any kind of number: the reference's own reading of the expression
trees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np
import sympy

from derive.expressions import tree

Leaf = Callable[[tree.Name | tree.Rate], Any]

NUMERIC: dict[str, Callable[..., Any]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos,
    "atan": np.arctan, "atan2": np.arctan2,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh,
    "atanh": np.arctanh,
    "exp": np.exp, "log": np.log, "ln": np.log, "sqrt": np.sqrt, "abs": np.abs, "sign": np.sign,
    "hypot": np.hypot,
    "min": lambda *x: min(x), "max": lambda *x: max(x), "floor": np.floor, "ceil": np.ceil,
}  # fmt: skip


def symbolic() -> dict[str, Callable[..., Any]]:
    """The same functions by SymPy."""
    return {
        **{name: getattr(sympy, name) for name in NUMERIC if hasattr(sympy, name)},
        "abs": sympy.Abs, "min": sympy.Min, "max": sympy.Max,
    }  # fmt: skip


def evaluated(
    expression: tree.Expression, leaf: Leaf, functions: Mapping[str, Callable[..., Any]]
) -> Any:
    """The value of a tree: `leaf` gives names and rates theirs, `functions` the calls; a vector
    becomes a list."""

    def walk(node: tree.Expression) -> Any:
        match node:
            case tree.Number():
                return node.value
            case tree.Name() | tree.Rate():
                return leaf(node)
            case tree.Sum():
                return sum((walk(term) for term in node.terms[1:]), walk(node.terms[0]))
            case tree.Product():
                return reduce(lambda a, b: a * b, map(walk, node.factors))
            case tree.Quotient():
                return walk(node.numerator) / walk(node.denominator)
            case tree.Power():
                return _power(walk(node.base), walk(node.exponent))
            case tree.Negative():
                return -walk(node.argument)
            case tree.Call():
                return functions[node.function](*map(walk, node.arguments))
            case tree.Vector():
                return [walk(entry) for entry in node.entries]

    return walk(expression)


def _power(base: Any, exponent: Any) -> Any:
    """Whole exponents stay whole: x**2.0 would be a complex-branch power for SymPy and a slow one
    for NumPy."""
    if isinstance(exponent, float) and exponent.is_integer():
        exponent = int(exponent)
    if isinstance(base, int | float) and isinstance(exponent, int | float):
        return float(np.float64(base) ** exponent)
    return base**exponent


def lookup(names: Mapping[str, Any], rates: Mapping[str, Any]) -> Leaf:
    """Leaves from two tables: names (coordinates, parameters, inputs, definitions, t) and rates
    der(q)."""
    return lambda node: rates[node.name] if isinstance(node, tree.Rate) else names[node.name]
