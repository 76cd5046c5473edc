"""Tables, a second time: the cubic of each interval from the second derivatives at its ends (C2) or
in Hermite's form (C1), found by a search; derivatives by hand, for SymPy too."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import sympy

from derive.expressions.tables import Table
from hamel.verify.reference.vectors import Array

ORDERS = 4  # derivatives that are known; the fourth and all after it are zero inside


def numeric(tables: Iterable[Table]) -> dict[str, Callable[..., Any]]:
    """Each table as a function of a number, by name; NAME__k is its k-th derivative."""
    functions: dict[str, Callable[..., Any]] = {}
    for table in tables:
        cubics = _cubics(table)
        for order in range(ORDERS + 1):
            name = f"{table.name}__{order}" if order else table.name
            functions[name] = _at(table, cubics, order)
    return functions


def symbolic(tables: Iterable[Table]) -> dict[str, Callable[..., Any]]:
    """Each table as a function of SymPy whose derivative is NAME__1, and so on."""
    return {table.name: _class(table.name, 0) for table in tables}


def _class(name: str, order: int) -> Any:
    def fdiff(self: Any, argindex: int = 1) -> Any:
        """The function one order up."""
        return _class(name, order + 1)(self.args[0])

    if order > ORDERS:
        return lambda x: sympy.Integer(0)
    called = f"{name}__{order}" if order else name
    return type(called, (sympy.Function,), {"nargs": 1, "fdiff": fdiff})


def _at(table: Table, cubics: Array, order: int) -> Callable[[Any], Any]:
    x = np.array(table.x)

    def value(at: float) -> float:
        """The derivative of that order; the straight lines of the ends outside."""
        clipped = min(max(float(at), x[0]), x[-1])
        k = int(np.clip(np.searchsorted(x, clipped, side="right") - 1, 0, len(x) - 2))
        inside = [np.polyval(np.polyder(cubics[k], n), clipped - x[k]) for n in range(order + 1)]
        if clipped == float(at):
            return float(inside[order])
        slope = float(np.polyval(np.polyder(cubics[k], 1), clipped - x[k]))
        return (float(inside[0]) + slope * (float(at) - clipped), slope, 0.0, 0.0, 0.0)[order]

    return value


def _cubics(table: Table) -> Array:
    """Coefficients of each interval's cubic in x − xₖ, the highest first."""
    x, y = np.array(table.x), np.array(table.y)
    h = np.diff(x)
    if table.smooth == "C2":
        bend = _moments(x, y)
        first = np.diff(y) / h - h * (2.0 * bend[:-1] + bend[1:]) / 6.0
        return np.array([np.diff(bend) / (6.0 * h), bend[:-1] / 2.0, first, y[:-1]]).T
    rise = _rises(x, y)
    cubics = []
    for k in range(len(h)):
        matrix = np.array([[h[k] ** 3, h[k] ** 2], [3.0 * h[k] ** 2, 2.0 * h[k]]])
        right = [y[k + 1] - y[k] - rise[k] * h[k], rise[k + 1] - rise[k]]
        cubics.append([*np.linalg.solve(matrix, right), rise[k], y[k]])
    return np.array(cubics)


def _moments(x: Array, y: Array) -> Array:
    """Second derivatives at the points: zero at the ends, and slopes alike from both sides."""
    h, n = np.diff(x), len(x)
    bend = np.zeros(n)
    if n > 2:
        inner = np.diag((h[:-1] + h[1:]) / 3.0)
        inner += np.diag(h[1:-1] / 6.0, 1) + np.diag(h[1:-1] / 6.0, -1)
        bend[1:-1] = np.linalg.solve(inner, np.diff(np.diff(y) / h))
    return bend


def _rises(x: Array, y: Array) -> Array:
    """Slopes of Fritsch and Butland: the harmonic mean weighted by the longer way, or zero."""
    chords = np.diff(y) / np.diff(x)
    rise = np.concatenate([chords[:1], np.zeros(len(x) - 2), chords[-1:]])
    for k in range(1, len(x) - 1):
        left, right = x[k] - x[k - 1], x[k + 1] - x[k]
        weight = (left + 2.0 * right) / (3.0 * (left + right))
        before, after = chords[k - 1], chords[k]
        if before * after > 0.0:
            rise[k] = 1.0 / ((1.0 - weight) / after + weight / before)
    return rise
