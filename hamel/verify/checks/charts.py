"""Modules of several charts: the same state in another chart, there and back, without a change of
v."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from derive.formulations.evaluate import Evaluator, evaluator
from hamel.charts import in_chart
from hamel.verify.checks.check import Check
from hamel.verify.checks.code import NEARLY
from hamel.verify.checks.compare import worst
from hamel.verify.checks.evidence import Evidence, margins
from hamel.verify.checks.samples import Sample
from hamel.verify.reference.saddle import row_condition
from hamel.verify.reference.vectors import Array


def transformation(e: Evidence) -> float | None:
    """For every ordered pair of charts: x_b = (q, B_b v), v of x_b is that of the reference, and
    back is where it was."""
    equations = e.graph.equations
    if e.module is None or not equations.charts:
        return None
    charts = [e.graph, *(evaluator(chart) for chart in equations.charts)]
    return worst(
        [
            error
            for a, b in permutations(range(len(charts)), 2)
            for error in _errors(e, charts, a, b)
        ]
    )


def _errors(e: Evidence, charts: list[Evaluator], a: int, b: int) -> Iterator[float]:
    conditions = [_conditions(e, charts[k]) for k in (a, b)]
    states = [e.states_of(charts[k]) for k in (a, b)]
    regular = [_regular(e, charts[k], states_) for k, states_ in zip((a, b), states)]
    for s, x, y, good, also, *growth in zip(e.samples, *states, *regular, *conditions):
        if good and also:
            yield worst(_gap(e, s, x, y, a, b)) / max(growth)


def _regular(e: Evidence, chart: Evaluator, states: tuple[Array, ...]) -> Array:
    """Where the guards of v let a state pass, in the precision of the module."""
    return (
        margins(chart, "velocity", [(s.t, x, s.u, s.p) for s, x in zip(e.samples, states)], e.real)
        > NEARLY
    )


def _conditions(e: Evidence, chart: Evaluator) -> list[float]:
    """cond [A; B] of the chart alone: how much roundoff may grow."""
    return [max(1.0, row_condition(Y)) for Y in e.named("Y", chart) or [np.eye(1)] * len(e.samples)]


def _gap(e: Evidence, s: Sample, x: Array, y: Array, a: int, b: int) -> Array:
    velocity = in_chart(e.module, "velocity", b)
    assert e.module is not None and velocity is not None  # every chart has one
    try:
        there = e.module.transform(a, b, s.t, x, s.u, s.p)
        back = e.module.transform(b, a, s.t, there, s.u, s.p)
        v = velocity(s.t, there, s.u, s.p)
    except FloatingPointError:
        return np.array([np.inf])
    pairs = ((there, y), (back, x), (v, s.v))
    return np.concatenate([(ours - wanted) / (1.0 + worst(wanted)) for ours, wanted in pairs])


CHECKS = (
    Check(
        "transform",
        1e-13,
        "from chart to chart and back, and v with it; per cond [A; B]",
        transformation,
        True,
    ),
)
