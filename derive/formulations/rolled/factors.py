"""Columns of a table of links that parameters are in, as numbers by link times a few formulas of
parameters: m/(i + 1) at link i is 1/(i + 1) times m. The formulas are evaluated once a call, and
the table holds numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from derive.expressions.scalars import Scalar
from derive.formulations.limits import FACTORED, MOST_FACTORS, PIVOTAL, PLACES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Factored:
    """Entry i of a column is Σ_j numbers[i][j] formulas[j]; a formula of 1 is the number one."""

    formulas: tuple[Scalar, ...]
    numbers: tuple[tuple[float, ...], ...]


def factored(column: Sequence[Scalar], p: ca.SX, defaults: Sequence[float]) -> Factored | None:
    """Of as few of the entries themselves as span them all over the parameters; None where these
    are more than MOST_FACTORS.

    Entries are evaluated at PLACES values of the parameters and eliminated from each other as rows
    of a matrix. Half of the places take part, the others have to agree.
    """
    if all(isinstance(entry, float) for entry in column):
        return Factored((1.0,), tuple((float(entry),) for entry in column))
    values = _values(column, p, defaults)
    if not np.isfinite(values).all():
        return None
    sizes = np.maximum(np.abs(values).max(axis=1), np.finfo(float).tiny)
    half = values.shape[1] // 2
    found = _basis(values[:, :half] / sizes[:, None])
    if not found:
        return None
    rows, places = found
    numbers = _solved(values[np.ix_(rows, places)], values[:, places])
    spanned = sum(numbers[:, [k]] * values[rows[k]] for k in range(len(rows)))
    if np.abs((spanned - values) / sizes[:, None]).max() > FACTORED:
        return None
    formulas, scales = zip(*(_formula(column[row]) for row in rows))
    scaled = numbers * np.array(scales)
    return Factored(formulas, tuple(tuple(map(float, row)) for row in scaled))


def _formula(entry: Scalar) -> tuple[Scalar, float]:
    """An entry that is a number is that many times one."""
    return (entry, 1.0) if isinstance(entry, ca.SX) else (1.0, float(entry))


def _values(column: Sequence[Scalar], p: ca.SX, defaults: Sequence[float]) -> Array:
    """By entry its values near the defaults, where the model is a mechanism."""
    rng = np.random.default_rng(0)
    given = np.array(defaults)
    near = given * rng.uniform(0.7, 1.4, (PLACES, len(given)))
    places = np.where(given == 0.0, rng.uniform(0.3, 0.9, near.shape), near)
    evaluated = ca.Function("column", [p], [ca.vertcat(*map(ca.SX, column))])
    return np.array(evaluated(places.T), float)


def _basis(rows: Array) -> tuple[list[int], list[int]] | None:
    """Rows that span all, and columns where these are far from dependent. Early rows are preferred:
    those of the first links are the plainest."""
    left, chosen, places = rows.copy(), list[int](), list[int]()
    while np.abs(left).max() > FACTORED:
        if len(chosen) == MOST_FACTORS:
            return None
        sizes = np.abs(left).max(axis=1)
        row = int(np.argmax(sizes >= PIVOTAL * sizes.max()))
        place = int(np.argmax(np.abs(left[row])))
        chosen.append(row)
        places.append(place)
        left = left - (left[:, [place]] / left[row, place]) * left[row]
        left[row] = 0.0
    return chosen, places


def _solved(square: Array, wanted: Array) -> Array:
    """C with C S = W by elimination, entry by entry: the same bits on every machine."""
    size = len(square)
    S, W = square.copy(), wanted.copy()
    for k in range(size):  # columns of S become those of the unit matrix
        pivot = k + int(np.argmax(np.abs(S[k, k:])))
        S[:, [k, pivot]], W[:, [k, pivot]] = S[:, [pivot, k]], W[:, [pivot, k]]
        W[:, k] = W[:, k] / S[k, k]
        S[:, k] = S[:, k] / S[k, k]
        for j in (j for j in range(size) if j != k):
            W[:, j] = W[:, j] - S[k, j] * W[:, k]
            S[:, j] = S[:, j] - S[k, j] * S[:, k]
    return W
