"""ẋ = f(t, x) by Taylor series of high order in fixed-point numbers: as many digits as asked
for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log2

import casadi as ca
import numpy as np

from codegen.runtime.simulation import Simulation, Status, Stopped
from hamel.simulate.exact.series import Fixed, Graph, Series
from hamel.simulate.limits import (
    FINE,
    FIRST,
    FORESEEN,
    LOOKS_FOR_KINKS,
    MOST_EXACT_STEPS,
    TOO_LONG,
)

GROWTH, SMALLEST = 8.0, 2.0**-200


@dataclass(frozen=True)
class Problem:
    """ẋ = dynamics(t, x, u, p) from x at t = 0; `kinks` change their signs where it goes on to
    another piece."""

    dynamics: ca.Function
    x: tuple[Fraction, ...]
    u: tuple[Fraction, ...]
    p: tuple[Fraction, ...]
    kinks: ca.Function | None = None


def integrated(
    problem: Problem, times: Sequence[float], digits: int, order: int, bits: int
) -> Simulation:
    """x at rising `times`, as fractions; the last terms of every step are below 10⁻ᵈⁱᵍⁱᵗˢ. A step
    ends just behind a kink: every series is one of a single piece.

    Raises Stopped where the motion cannot go on, NotAnalytic where there is no series.
    """
    fixed = Fixed(bits)
    state, now, step = [fixed.of(value) for value in problem.x], Fraction(0), FIRST
    rows: list[list[Fraction]] = []
    steps = 0
    for time in map(Fraction, times):
        while now < time:
            steps += 1
            if steps > MOST_EXACT_STEPS or _too_many(steps, now, times[-1]):
                why = f"a motion of more than {MOST_EXACT_STEPS} steps"
                raise Stopped(why, _simulation(times, rows, steps, Status.MORE))
            series = _terms(problem, fixed, now, step, state, order)
            share = _share(fixed, series, digits)
            if share < SMALLEST:
                why = "a motion that comes to a singular position"
                raise Stopped(why, _simulation(times, rows, steps, Status.SINGULAR_POSITION))
            length = min(_rounded(min(share, 1.0)) * step, time - now)
            length = _up_to_kink(problem, fixed, (now, step), series, length)
            state = [_value(fixed, x, length / step) for x in series]
            now, step = now + length, _rounded(min(share, GROWTH)) * step
        rows.append([fixed.fraction(value) for value in state])
    return _simulation(times, rows, steps, Status.OK)


def _too_many(steps: int, now: Fraction, end: float) -> bool:
    """Whether steps as long as those so far are far too many: a stiff motion says so at once."""
    return steps == FORESEEN and now * MOST_EXACT_STEPS < FORESEEN * Fraction(end) / Fraction(
        TOO_LONG
    )


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


def _up_to_kink(
    problem: Problem,
    fixed: Fixed,
    begin: tuple[Fraction, Fraction],
    series: Sequence[Sequence[int]],
    length: Fraction,
) -> Fraction:
    """How far a step may go that begins at (now, step): to just behind the first kink on its way.
    Where the motion begins on one, the first step goes just off it."""
    kinks = problem.kinks
    if kinks is None:
        return length
    now, step = begin
    across = Fraction(1, 2 ** (fixed.bits // 2)) * step

    def signs(along: Fraction) -> list[int]:
        """Of all kinks so far on the step."""
        place = [Series([_value(fixed, x, along / step)]) for x in series]
        values = [[fixed.of(x) for x in part] for part in (problem.u, problem.p)]
        constants = [[Series([x], True) for x in part] for part in values]
        graph = Graph(kinks, fixed, [[Series([fixed.of(now + along)])], place, *constants])
        graph.grow(0)
        return [(x[0] > 0) - (x[0] < 0) for x in graph.outputs[0]]

    before, low = signs(Fraction(0)), Fraction(0)
    if now == 0 and 0 in before:
        return min(length, across)
    for k in range(1, LOOKS_FOR_KINKS + 1):
        high = length * k / LOOKS_FOR_KINKS
        after = signs(high)
        changed = [i for i, (a, b) in enumerate(zip(before, after)) if a * b < 0]
        if changed:
            return min(_bisected(signs, (low, high), before, i, across) for i in changed)
        before, low = [b or a for a, b in zip(before, after)], high
    return length


def _bisected(
    signs: Callable[[Fraction], list[int]],
    between: tuple[Fraction, Fraction],
    before: Sequence[int],
    i: int,
    fine: Fraction,
) -> Fraction:
    """Where kink i has its new sign, and less than `fine` before that its old one or none."""
    low, high = between
    while high - low > fine:
        middle = (low + high) / 2
        if signs(middle)[i] * before[i] < 0:
            high = middle
        else:
            low = middle
    return high


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
