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
    "step": lambda x, w=None: float(x >= 0) if w is None else (1 + np.tanh(x / w)) / 2,
    "ramp": lambda x, w=None: max(x, 0.0) if w is None else x / 2 + np.hypot(x, w) / 2,
    "clip": lambda x, a, b, w=None: min(max(x, a), b) if w is None else (
        a + (x - a + np.hypot(x - a, w)) / 2 - (x - b + np.hypot(x - b, w)) / 2
    ),
    "piecewise": lambda x, *f: f[2 * sum(bool(x >= place) for place in f[1::2])],
    "min": lambda *x: min(x), "max": lambda *x: max(x), "floor": np.floor, "ceil": np.ceil,
}  # fmt: skip


def symbolic() -> dict[str, Callable[..., Any]]:
    """The same functions by SymPy."""
    return {
        **{name: getattr(sympy, name) for name in NUMERIC if hasattr(sympy, name)},
        "abs": sympy.Abs, "min": sympy.Min, "max": sympy.Max,
        "step": lambda x, w=None: _where(x, 0, 0, 1) if w is None else 1 / (1 + sympy.exp(-2*x/w)),
        "ramp": lambda x, w=None: _where(x, 0, 0, x) if w is None else _half(x, w),
        "clip": lambda x, a, b, w=None: _where(x, a, a, _where(x, b, x, b)) if w is None else (
            a + _half(x - a, w) - _half(x - b, w)
        ),
        "piecewise": lambda x, *f: sympy.Piecewise(
            *((f[k], x < f[k + 1]) for k in range(0, len(f) - 1, 2)), (f[-1], True)
        ),
    }  # fmt: skip


def _where(x: Any, place: Any, before: Any, after: Any) -> Any:
    return sympy.Piecewise((before, x < place), (after, True))


def _half(x: Any, w: Any) -> Any:
    return x / 2 + sympy.sqrt(x**2 + w**2) / 2


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
