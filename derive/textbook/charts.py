"""Further choices that take over where this one is nearly singular: their speeds, their guards, and
the way to each and back."""

from __future__ import annotations

import casadi as ca

from derive.formulations.limits import BETTER, LOW
from derive.formulations.records import Equations, Function
from derive.textbook.choice import power_of_ten, watch
from derive.textbook.manuscript import Manuscript
from derive.textbook.names import words
from derive.textbook.records import Math, Runs, Text


def charts(doc: Manuscript) -> None:
    """Where there are several: which, when one is left for another, and x in each."""
    others = doc.equations.charts
    if not others:
        return
    doc.section("Charts")
    same = "$!q$, $!v$ and $!z$" if doc.system.model.states else "$!q$ and $!v$"
    doc.say(
        f"Together with the choice above, which is chart 0, the module holds {len(others) + 1} "
        f"choices of quasi-velocities. They are charts of the same motion: {same} mean the "
        "same in all of them, and where one comes near a singular position, another takes over. "
        "The formulas on the rest of the page are those of chart 0; in another chart they are "
        "made in the same way with its own rows."
    )
    for k, chart in enumerate(others, 1):
        _chart(doc, chart, k)
    _margins(doc)


def _chart(doc: Manuscript, chart: Equations, k: int) -> None:
    """B of chart k, its guards, and the way there and back."""
    doc.say(
        f"Chart {k} is the choice “{{name}}”, with the quasi-velocities {{speeds}}:",
        name=chart.choice,
        speeds=", ".join(chart.w),
    )
    doc.matrix(f"B({k})", rf"!B^{{({k})}}", f"B^{{({k})}}", _rows(chart))
    guards = _function(chart, "dynamics").guards
    if guards:
        doc.say("It is regular where these stay away from zero:")
    watch(doc, guards, lambda i: f"D^{{({k})}}_{{{i}}}")
    _transfer(doc, chart, k)
    doc.mean(rf"!w^{{({k})}},\; !B^{{({k})}}", f"quasi-velocities of chart {k}, and their rows")
    if doc.system.c.is_zero():
        doc.mean(rf"!S^{{({k})}}", f"$!S$ of chart {k}")
    else:
        doc.mean(rf"!S^{{({k})}},\; !R^{{({k})}}", f"$!S$ and $!R$ of chart {k}")


def _rows(chart: Equations) -> ca.SX:
    """B of a chart."""
    return chart.term("B")


def _transfer(doc: Manuscript, chart: Equations, k: int) -> None:
    """The way to chart k and back, checked with the chart's own functions."""
    doc.say(f"The state is carried to chart {k} and back exactly, nothing is projected or fitted:")
    there = _there(doc, chart)
    if doc.system.c.is_zero():
        v, v_of_chart = r"!S\,!w", rf"!S^{{({k})}}!w^{{({k})}}"
    else:
        v = r"\left(!S\,!w + !R\,!c\right)"
        v_of_chart = rf"!S^{{({k})}}!w^{{({k})}} + !R^{{({k})}}!c"
    residual = there - ca.mtimes(_rows(chart), doc.terms.named("v"))
    doc.law(f"to chart {k}", rf"!w^{{({k})}}", rf"!B^{{({k})}}{v}", residual)
    residual = doc.terms.w - _back(doc, chart, there)
    doc.law(f"back from chart {k}", r"!w", rf"!B\left({v_of_chart}\right)", residual)


def _there(doc: Manuscript, chart: Equations) -> ca.SX:
    """w of the chart, by its own function of (q, v), at the v of chart 0."""
    state = _function(chart, "state")
    assert state.x is not None  # (q, v)
    nq = len(doc.q)
    value = state.result.value[nq : nq + len(chart.w), 0]
    moving = ca.vertcat(doc.system.q, doc.terms.named("v"), doc.system.z)
    return ca.substitute(value, state.x.symbols, moving)


def _back(doc: Manuscript, chart: Equations, w: ca.SX) -> ca.SX:
    """w of chart 0, from the velocities that the chart's own function gives at its w."""
    symbols = chart.argument("x").symbols[chart.speeds]
    v = ca.substitute(_function(chart, "velocity").result.value, symbols, w)
    return ca.mtimes(doc.terms.named("B"), v)


def _function(chart: Equations, name: str) -> Function:
    return chart.function(name)


def _margins(doc: Manuscript) -> None:
    """The table of what each guard is compared with."""
    doc.say(
        "The margin of a chart is the least of its $|D_i|/D_i^{\\max}$, where $D_i^{\\max}$ is the "
        "largest $|D_i|$ that was seen "
        f"at sampled states. A chart is left where its margin is below {LOW:g}, for one whose "
        f"margin is {BETTER:g} times as large, so that no two charts take turns; where no guard is "
        "needed the margin is infinite."
    )
    rows: list[tuple[Runs, ...]] = []
    for k, chart in enumerate((doc.equations, *doc.equations.charts)):
        guards = _function(chart, "dynamics").guards
        for i, (guard, whole) in enumerate(zip(guards, chart.largest), 1):
            symbol = f"D_{{{i}}}" if k == 0 else f"D^{{({k})}}_{{{i}}}"
            largest = Math(power_of_ten(guard.tolerance * whole))
            rows.append(
                (
                    (Text(f"{k}, {chart.choice}"),),
                    (Math(symbol),),
                    (Text(words(guard.name)),),
                    (largest,),
                )
            )
    if rows:
        doc.table(("chart", "guard", "of", "largest"), rows)
