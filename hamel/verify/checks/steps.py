"""The steps of a module for controllers: against a step of the graph's ẋ that is written down here,
against the solution, and their derivatives against differences."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import numpy as np

from hamel.charts import in_chart
from hamel.verify.checks.check import Check
from hamel.verify.checks.compare import worst
from hamel.verify.checks.evidence import SHORT, Evidence, Row
from hamel.verify.reference.vectors import Array

METHODS = ("rk4", "rosenbrock")
SEEN = 5  # of the sampled states
# times the least condition of M, A and the choice: beyond, rounding of ẋ is more than is told apart
CLEAR = 1e2
MANY = 16  # steps of the solution, and half as many to know how good it is
# Of rounding: five evaluations of ẋ on either side, each with the condition of M and A in it.
EXACT = 1e-11
# Beyond ten times its own estimate; the solution itself is good to a hundredth of that.
NEAR = 1e-9
# Central differences over 1e-3 and half of it, extrapolated: 1e-12 by the fifth derivative, 1e-13
# of rounding over 1e-3; more where the condition of M and A is in both, or a formula bends sharply.
SLOPES = 1e-7
LENGTHS = (1e-3, 1e-4, 1e-5)  # of a difference, in the model's own units

Rates = Callable[[float, Array], Array]


def explicit(e: Evidence) -> float | None:
    """The step by rk4 against W. Kutta's formula on the graph, in one part and in three."""
    step = _function(e, "step")
    if step is None:
        return None
    errors = [
        _gap(e, step(*_with_length(row, h), substeps=n), _classical(rates, row, h, n), row)
        for row, h, rates in _rows(e, "step")
        for n in (1, 3)
    ]
    return worst(errors) if errors else None


def implicit(e: Evidence) -> float | None:
    """The linearly implicit step against the solution by short ones, where these agree."""
    step = _function(e, "step")
    if step is None:
        return None
    errors = [x for row in _rows(e, "step") for x in _beyond_estimate(e, step, *row)]
    return worst(errors) if errors else None


def slopes(e: Evidence) -> float | None:
    """The derivatives of the step along a random direction of (x, u), by both methods."""
    step, sensitivity = _function(e, "step"), _function(e, "step_sensitivity")
    if step is None or sensitivity is None or e.real.words:
        return None  # differences of less precise numbers say nothing
    rng = np.random.default_rng(6)
    errors = []
    for row, h, _ in _rows(e, "step_sensitivity"):
        t, x, u, p = row
        d = rng.normal(size=len(x) + len(u)) * np.append(e.units.x, np.ones(len(u)))
        for method in METHODS:
            ours = sensitivity(t, np.append(x, h), u, p, method=method) @ d
            wanted, doubt = _difference(step, row, h, d, method)
            errors.append(worst((ours - wanted) / (_scale(e, wanted) + doubt / SLOPES)))
    return worst(errors) if errors else None


def _function(e: Evidence, name: str) -> Callable[..., Array] | None:
    """Of a module that has it: one with a choice of methods."""
    function = None if e.module is None else in_chart(e.module, name, e.chart)
    return function if function is not None and hasattr(e.module, "step") else None


def _rows(e: Evidence, name: str) -> Iterator[tuple[Row, float, Rates]]:
    """States whose step is no question, with its length and ẋ."""
    step = _function(e, name)
    if step is None:
        return
    length = float(e.real.nearest(SHORT * e.units.time))
    most = CLEAR * min(e.conditions, default=1.0)
    rows = (row for row, c in zip(e.rows_of("dynamics"), e.conditions) if c <= most)
    for row in islice(rows, SEEN):
        t, x, u, p = row
        try:
            for method in METHODS:
                step(t, np.append(x, length), u, p, method=method)
        except FloatingPointError:
            continue
        yield row, length, lambda t, x, u=u, p=p: np.ravel(e.graph("dynamics", t, x, u, p))


def _with_length(row: Row, h: float) -> Row:
    return row[0], np.append(row[1], h), row[2], row[3]


def _classical(rates: Rates, row: Row, h: float, parts: int) -> Array:
    t, x, part = row[0], np.asarray(row[1], dtype=float), h / parts
    for n in range(parts):
        start = t + n * part
        k1 = rates(start, x)
        k2 = rates(start + part / 2, x + part / 2 * k1)
        k3 = rates(start + part / 2, x + part / 2 * k2)
        k4 = rates(start + part, x + part * k3)
        x = x + part / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def _beyond_estimate(
    e: Evidence, step: Callable[..., Any], row: Row, h: float, rates: Rates
) -> Iterator[float]:
    ours, estimate = step(*_with_length(row, h), method="rosenbrock", error=True)
    solution, coarse = (_classical(rates, row, h, n) for n in (MANY, MANY // 2))
    scale = _scale(e, solution)
    if worst((solution - coarse) / scale) <= e.real.rounding(0.01 * NEAR):
        yield worst(np.maximum(np.abs(ours - solution) - 10 * estimate, 0.0) / scale)


def _gap(e: Evidence, found: Array, wanted: Array, row: Row) -> float:
    return worst((found - wanted) / (_scale(e, wanted) + np.abs(wanted - row[1])))


def _scale(e: Evidence, x: Array) -> Array:
    return np.maximum(e.units.x, np.abs(x))


def _difference(
    step: Callable[..., Array], row: Row, h: float, d: Array, method: str
) -> tuple[Array, Array]:
    """The slope along d, and how far two of its kind are apart. Entries that bend within the usual
    length have a better slope over a shorter one."""
    t, x, u, p = row

    def central(part: float) -> Array:
        ends = [
            step(t, np.append(x + s * d[: len(x)], h), u + s * d[len(x) :], p, method=method)
            for s in (part, -part)
        ]
        return (ends[0] - ends[1]) / (2 * part)

    def extrapolated(part: float) -> Array:
        return (4 * central(part / 2) - central(part)) / 3

    found = [(extrapolated(part), extrapolated(part / 2)) for part in LENGTHS]
    values = np.array([fine for _, fine in found])
    doubts = np.array([np.abs(fine - coarse) for coarse, fine in found])
    best = np.argmin(doubts, axis=0)[None]
    slope, doubt = (np.take_along_axis(x, best, axis=0)[0] for x in (values, doubts))
    return slope, doubt


CHECKS = (
    Check("rk4 step = graph", EXACT, "the explicit step, written down again", explicit, True),
    Check("implicit step", NEAR, "the linearly implicit step beyond ten estimates", implicit, True),
    Check("step slopes", SLOPES, "the derivatives of the steps", slopes, True),
)
