"""Surfaces by formulas of x, y, z: value, slope and curvature by SymPy, as numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import sympy

from derive.expressions import tree
from hamel.verify.reference.formulas import evaluated, lookup, symbolic
from hamel.verify.reference.states import State
from hamel.verify.reference.vectors import Array


def surface_at(
    surface: tree.Expression, state: State
) -> Callable[[Array], tuple[float, Array, Array]]:
    """f, ∇f and ∇∇f at a point in the frame of the body that carries the surface."""
    names = tuple(sorted(name for name in _used(surface) if name not in tuple("xyz")))
    compiled, values = _compiled(surface, names), [state.names[name] for name in names]

    def at(point: Array) -> tuple[float, Array, Array]:
        f, *derivatives = compiled(point, values)
        gradient, hessian = derivatives[:3], derivatives[3:]
        return float(f), np.array(gradient, float), np.array(hessian, float).reshape(3, 3)

    return at


def _used(expression: tree.Expression) -> set[str]:
    return {node.name for node in tree.walk(expression) if isinstance(node, tree.Name)}


@cache
def _compiled(expression: tree.Expression, names: tuple[str, ...]) -> Any:
    X = sympy.symbols("X:3", real=True)
    others = sympy.symbols(f"N:{len(names)}", real=True) if names else ()
    known: dict[str, Any] = dict(zip("xyz", X)) | dict(zip(names, others))
    f = sympy.sympify(evaluated(expression, lookup(known, {}), symbolic()))
    gradient = [sympy.diff(f, x) for x in X]
    hessian = [sympy.diff(a, x) for a in gradient for x in X]
    return sympy.lambdify([X, others], [f, *gradient, *hessian], modules="numpy", cse=True)
