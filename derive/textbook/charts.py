"""Further choices that take over where this one is nearly singular: their speeds, their guards, and
the way to each and back."""

from __future__ import annotations

import casadi as ca

from derive.formulations.charts import BETTER, LOW
from derive.formulations.records import Equations, Function
from derive.textbook.author import Author
from derive.textbook.choice import power_of_ten, watched
from derive.textbook.records import Math, Text


def charts(a: Author) -> None:
    """Where there are several: which, when one is left for another, and x in each."""
    others = a.equations.charts
    if not others:
        return
    a.section("Charts")
    a.say(
        f"Together with the choice above, which is chart 0, the module holds {len(others) + 1} choices of quasi-velocities. "
        "They are charts of the same motion: $!q$ and $!v$ mean the same in all of them, and where one comes near a singular "
        "position, another takes over. The formulas on the rest of the page are those of chart 0; in another chart they are made "
        "in the same way with its own rows."
    )
    for k, chart in enumerate(others, 1):
        _chart(a, chart, k)
    _margins(a)


def _chart(a: Author, chart: Equations, k: int) -> None:
    """B of chart k, its guards, and the way there and back, which is checked with the chart's own
    functions."""
    B = next(x.value for x in chart.named if x.name == "B")
    a.say(
        f"Chart {k} is the choice “{{name}}”, with the quasi-velocities {{speeds}}:",
        name=chart.choice,
        speeds=", ".join(chart.w),
    )
    a.matrix(f"B({k})", rf"!B^{{({k})}}", f"B^{{({k})}}", B)
    guards = _function(chart, "dynamics").guards
    if guards:
        a.say("It is regular where these stay away from zero:")
    for i, guard in enumerate(guards, 1):
        watched(a, guard, f"D^{{({k})}}_{{{i}}}")
    a.say(f"The state is carried to chart {k} and back exactly, nothing is projected or fitted:")
    moving = "" if a.system.c.is_zero() else r" + !R\,!c"
    there = _there(a, chart)
    right = rf"!B^{{({k})}}\left(!S\,!w{moving}\right)" if moving else rf"!B^{{({k})}}!S\,!w"
    a.law(f"to chart {k}", rf"!w^{{({k})}}", right, there - ca.mtimes(B, a.named("v")))
    moving = "" if a.system.c.is_zero() else rf" + !R^{{({k})}}!c"
    a.law(
        f"back from chart {k}",
        r"!w",
        rf"!B\left(!S^{{({k})}}!w^{{({k})}}{moving}\right)",
        a.w_symbols - _back(a, chart, there),
    )
    a.mean(rf"!w^{{({k})}},\; !B^{{({k})}}", f"quasi-velocities of chart {k}, and their rows")
    tied = "" if a.system.c.is_zero() else rf",\; !R^{{({k})}}"
    a.mean(rf"!S^{{({k})}}{tied}", f"S{' and R' if tied else ''} of chart {k}")


def _there(a: Author, chart: Equations) -> ca.SX:
    """w of the chart, by its own function of (q, v), at the v of chart 0."""
    state = _function(chart, "state")
    assert state.x is not None  # (q, v)
    nq = len(a.q)
    value = state.result.value[nq:]
    return ca.substitute(value, state.x.symbols, ca.vertcat(a.system.q, a.named("v")))


def _back(a: Author, chart: Equations, w: ca.SX) -> ca.SX:
    """w of chart 0, from the velocities that the chart's own function gives at its w."""
    symbols = next(x.symbols for x in chart.arguments if x.name == "x")[len(a.q) :]
    v = ca.substitute(_function(chart, "velocity").result.value, symbols, w)
    return ca.mtimes(a.named("B"), v)


def _function(chart: Equations, name: str) -> Function:
    return next(function for function in chart.functions if function.name == name)


def _margins(a: Author) -> None:
    """The table of what each guard is compared with."""
    a.say(
        "The margin of a chart is the least of its $|D_i|/D_i^{\\max}$, where $D_i^{\\max}$ is the largest $|D_i|$ that was seen "
        f"at sampled states. A chart is left where its margin is below {LOW:g}, for one whose margin is {BETTER:g} times as "
        "large, so that no two charts take turns; where no guard is needed the margin is infinite."
    )
    rows = []
    for k, chart in enumerate((a.equations, *a.equations.charts)):
        guards = _function(chart, "dynamics").guards
        for i, (guard, whole) in enumerate(zip(guards, chart.largest), 1):
            symbol = f"D_{{{i}}}" if k == 0 else f"D^{{({k})}}_{{{i}}}"
            largest = Math(power_of_ten(guard.tolerance * whole))
            rows.append(
                ((Text(f"{k}, {chart.choice}"),), (Math(symbol),), (Text(guard.name),), (largest,))
            )
    if rows:
        a.table(("chart", "guard", "of", "largest"), rows)
