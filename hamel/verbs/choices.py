"""choices: the candidates for the quasi-velocities side by side, ranked as `auto` ranks them."""

from __future__ import annotations

import time as clock
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import hamel
from derive.choices.assessment import Assessed, comparison, conditions_along
from derive.choices.survey import survey_of
from derive.diagnostics import ModelError, listed
from derive.formulations import equations
from derive.formulations.fitness import check_determined
from derive.robots.reading import load
from derive.states.sampling import states
from hamel.build.files import write_text
from hamel.build.module import temporary_module
from hamel.build.stages import mechanics_of
from hamel.draw import Curve, Panel, draw
from hamel.engines import PROCESSES, engine
from hamel.records import Choices, Ranking
from hamel.show import refusals, shortened, table

if TYPE_CHECKING:
    from rich.console import Console

    from derive.mechanics.records import System

BATCH = 4_000  # states in one call that is measured
DRAWN = 7  # curves that can be told apart


def run(path: str | PathLike[str], time: bool, plot: Path | None, until: float) -> Choices:
    """The candidates in the order of their ranking; with `time` each is built and timed, with
    `plot` the best are drawn along a motion of `until` seconds.

    Raises ModelError where the plot is no .svg, AssumptionError where nothing determines some
    acceleration.
    """
    if plot is not None and plot.suffix.lower() != ".svg":
        raise ModelError(f"--plot {plot}: the file must end in .svg")
    model = load(path)
    mechanics = mechanics_of(model)
    check_determined(survey_of(mechanics))
    result = comparison(mechanics)
    names = [x.ranking.name for x in result.assessed]
    times = _times(path, names) if time else [None] * len(names)
    ranked = tuple(_ranking(x, ns) for x, ns in zip(result.assessed, times))
    if plot is not None:
        _draw(path, mechanics, [x.name for x in ranked][:DRAWN], plot, until)
    return Choices(model.name, model.choices[0].name, ranked, result.refused, plot)


def _ranking(x: Assessed, ns: float | None) -> Ranking:
    own = {"least_pivot": x.least_pivot, "violation": x.violation, "ns": ns}
    shared = {
        field.name: getattr(x.ranking, field.name)
        for field in fields(Ranking)
        if field.name not in own
    }
    return Ranking(**shared, **own)


def _times(path: str | PathLike[str], names: list[str]) -> list[float]:
    """Of every choice, one after the other in a process where nothing else runs."""
    with engine(PROCESSES, 1) as by:
        return list(by.executor.map(measured_in, [path] * len(names), names))


def measured_in(path: str | PathLike[str], choice: str) -> float:
    """ns per state of `dynamics` of a choice of a model file."""
    return measured(mechanics_of(load(path)), choice)


def measured(mechanics: System, choice: str) -> float:
    """ns per state of `dynamics` over a batch, the best of several calls."""
    result = equations(mechanics, choice)
    sampled = states(mechanics, 20)
    with temporary_module(result, functions=("dynamics", "state")) as module:
        p, z = np.split(sampled.p, [len(mechanics.own_parameters)], axis=1)
        qv = np.hstack([sampled.q, sampled.v, z])
        rows = np.resize(np.arange(len(sampled.t)), BATCH)
        x = np.array([module.state(*row) for row in zip(sampled.t, qv, sampled.u, p)])[rows]
        t, u, p = sampled.t[rows], sampled.u[rows], p[rows]
        return min(_seconds(lambda: module.dynamics(t, x, u, p)) for _ in range(20)) / BATCH * 1e9


def _seconds(call) -> float:
    start = clock.perf_counter()
    call()
    return clock.perf_counter() - start


def _draw(
    path: str | PathLike[str], mechanics: System, names: list[str], plot: Path, until: float
) -> None:
    """cond [A; B] along the motion of the file's first choice."""
    motion = hamel.simulate(path, time=until).motion
    t = np.asarray(motion["t"])
    q = np.array([motion[c.name] for c in mechanics.model.coordinates]).T
    curves = tuple(
        Curve(name, values.tolist())
        for name, values in conditions_along(mechanics, names, t, q).items()
    )
    write_text(
        plot,
        draw(
            f"{mechanics.model.name}: choices of quasi-velocities",
            "t (s)",
            t.tolist(),
            [Panel("cond [A; B] (1)", curves, True)],
        ),
    )


def recommendation(record: Choices) -> str:
    """Which choice to take, and why, in a sentence or two."""
    best = record.choices[0]
    if not best.rows:
        return "No freedom is left: there are no quasi-velocities to choose."
    text = (
        f"Take '{best.name}': over the states looked at the condition number of [A; B] is "
        f"{best.condition:.3g} in the median and at most {best.worst:.3g}, "
        f"for {best.operations} operations."
    )
    if best.name == record.default:
        return f"{text} It is what is built when no choice is given."
    own = next((x for x in record.choices if x.name == record.default), None)
    if own is None and record.default not in record.refused:  # it is one of these by another name
        return text
    if own is None:
        return f"{text} The default, '{record.default}', cannot be used here."
    cost = f"condition {own.condition:.3g}, at most {own.worst:.3g}, {own.operations} operations"
    return f"{text} The default, '{record.default}', has {cost}."


def show(record: Choices, console: Console) -> None:
    """The recommendation, a row per candidate, best first, the pivots of the first, then what was
    refused and why."""
    if record.choices:
        console.print(recommendation(record))
    timed = any(r.ns is not None for r in record.choices)
    rows = [
        (
            *(
                shortened(r.name or "none"),
                listed(r.rows),
                f"{r.condition:.3g}",
                f"{r.worst:.3g}",
                f"{r.least_pivot:.2g}",
                f"{r.violation:.1e}",
            ),
            *(str(r.operations), *([f"{r.ns:.0f}" if r.ns else "–"] if timed else []), r.verdict),
        )
        for r in record.choices
    ]
    head = (
        "choice",
        "speeds",
        "condition",
        "worst",
        "pivot",
        "violation",
        "operations",
        *(["ns"] if timed else []),
        "verdict",
    )
    table(console, head, rows, right=range(2, len(head) - 1))
    for pivot in record.choices[0].pivots if record.choices else ():
        console.print(f"{shortened(record.choices[0].name or 'none')}: {pivot}")
    refusals(record.refused, console)
    console.print(
        "violation: |φ| after a Runge–Kutta step that moves by 0.1, or the roundoff of A v − c "
        "where there is no φ"
    )
    console.print(f"{record.model}: '{record.default}' is built when no choice is given")
