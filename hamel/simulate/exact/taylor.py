"""ẋ = f(t, x) by Taylor series of high order in fixed-point numbers: as many digits as asked
for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log2

import casadi as ca
import numpy as np

from codegen.runtime.simulation import Simulation, Status, Stopped
from hamel.simulate.exact.series import Fixed, Graph, Series
from hamel.simulate.limits import FINE, FIRST, MOST_EXACT_STEPS

GROWTH, SMALLEST = 8.0, 2.0**-200


@dataclass(frozen=True)
class Problem:
    """ẋ = dynamics(t, x, u, p) from x at t = 0."""

    dynamics: ca.Function
    x: tuple[Fraction, ...]
    u: tuple[Fraction, ...]
    p: tuple[Fraction, ...]


def integrated(
    problem: Problem, times: Sequence[float], digits: int, order: int, bits: int
) -> Simulation:
    """x at rising `times`, as fractions; the last terms of every step are below 10⁻ᵈⁱᵍⁱᵗˢ.

    Raises Stopped where the motion cannot go on, NotAnalytic where there is no series.
    """
    fixed = Fixed(bits)
    state, now, step = [fixed.of(value) for value in problem.x], Fraction(0), FIRST
    rows: list[list[Fraction]] = []
    steps = 0
    for time in map(Fraction, times):
        while now < time:
            steps += 1
            if steps > MOST_EXACT_STEPS:
                why = f"a motion of more than {MOST_EXACT_STEPS} steps"
                raise Stopped(why, _simulation(times, rows, steps, Status.MORE))
            series = _terms(problem, fixed, now, step, state, order)
            share = _share(fixed, series, digits)
            if share < SMALLEST:
                why = "a motion that comes to a singular position"
                raise Stopped(why, _simulation(times, rows, steps, Status.SINGULAR_POSITION))
            length = min(_rounded(min(share, 1.0)) * step, time - now)
            state = [_value(fixed, x, length / step) for x in series]
            now, step = now + length, _rounded(min(share, GROWTH)) * step
        rows.append([fixed.fraction(value) for value in state])
    return _simulation(times, rows, steps, Status.OK)


def _simulation(
    times: Sequence[float], rows: Sequence[Sequence[Fraction]], steps: int, status: Status
) -> Simulation:
    """The rows that there are, as exact fractions; nobody asks for the work of forces."""
    t, x = np.array(times[: len(rows)]), np.array(rows, dtype=object)
    return Simulation(t, x, np.full(len(rows), np.nan), steps, 0, 0, 0.0, 0.0, status=status)


def _terms(
    problem: Problem, fixed: Fixed, now: Fraction, step: Fraction, state: Sequence[int], order: int
) -> list[list[int]]:
    """The series of x over one step."""
    t, x = Series([fixed.of(now), fixed.of(step)]), [Series([value]) for value in state]
    constants = [
        [Series([fixed.of(value)], True) for value in values] for values in (problem.u, problem.p)
    ]
    graph = Graph(problem.dynamics, fixed, [[t], x, *constants])
    rates, length = graph.outputs[0], fixed.of(step)
    for k in range(order):
        graph.grow(k)
        for entry, rate in zip(x, rates):
            # over one step s runs from 0 to 1, so dx/ds = h f and xₖ₊₁ = h fₖ/(k + 1)
            entry.terms.append((length * rate[k] >> fixed.bits) // (k + 1))
    return [entry.terms for entry in x]


def _share(fixed: Fixed, series: Sequence[Sequence[int]], digits: int) -> float:
    """The part of the step (or more than it) at which the last two terms come down to 10⁻ᵈⁱᵍⁱᵗˢ."""
    order, wanted = len(series[0]) - 1, fixed.bits - digits * log2(10)
    excess = [
        (max(abs(x[k]) for x in series).bit_length() - wanted) / k for k in (order - 1, order)
    ]
    return 2.0 ** -min(max(*excess, -200.0), 900.0)


def _rounded(share: float) -> Fraction:
    """A little less, with few bits, so that times stay short numbers."""
    scale = 2.0 ** round(log2(share))
    return Fraction(int(share / scale * FINE) or 1, FINE) * Fraction(scale)


def _value(fixed: Fixed, terms: Sequence[int], share: Fraction) -> int:
    """The polynomial at a part of the step."""
    s, result = fixed.of(share), 0
    for term in reversed(terms):
        result = (result * s >> fixed.bits) + term
    return result
