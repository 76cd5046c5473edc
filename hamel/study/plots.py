"""The charts of a report: error against run time three ways, and violations over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codegen.integrators import INTEGRATORS
from hamel.draw import Series, chart
from hamel.records import ExtremeRow
from hamel.study.front import Row, cheapest, families, front, good, is_library, is_traditional
from hamel.study.judging import LEAST
from hamel.study.plan import DEFAULT

FIRST = INTEGRATORS[0].name


def error_charts(model: str, rows: Sequence[Row]) -> list[str]:
    """Per family: integrators and library solvers; formulations and choices; enforcements. The
    front is that of all runs."""
    base = _base(rows)
    if base is None:
        return []
    formulation, choice, enforcement = base["formulation"], base["choice"], base["enforcement"]
    own, libraries = (
        [row for row in rows if not is_library(row)],
        [row for row in rows if is_library(row)],
    )
    same = [
        row
        for row in own
        if (row["formulation"], row["choice"], row["enforcement"])
        == (formulation, choice, enforcement)
    ]
    by_integrator = _lines(same, "integrator") + _lines(libraries, "integrator", "formulation")
    first = [row for row in rows if row["integrator"] == FIRST]
    by_form = _lines(
        [row for row in first if row["enforcement"] == enforcement], "formulation", "choice"
    )
    by_enforcement = _lines(
        [row for row in first if (row["formulation"], row["choice"]) == (formulation, choice)],
        "enforcement",
    )
    by_enforcement += _lines(
        [row for row in first if row["formulation"] == "augmented"], "formulation", "enforcement"
    )
    where = choice or formulation
    titles = [
        f"{model}: integrators, {where}",
        f"{model}: formulations and choices, {FIRST}",
        f"{model}: enforcements, {FIRST}",
    ]
    return [
        _error_chart(title, rows, lines)
        for title, lines in zip(titles, (by_integrator, by_form, by_enforcement))
    ]


def _base(rows: Sequence[Row]) -> Row | None:
    """The method most lines are drawn of: the best one in quasi-velocities with the first
    integrator."""
    first = [row for row in good(rows) if row["integrator"] == FIRST]
    first = [row for row in first if not is_traditional(row)] or first
    return next((row for level in (1e-8, 1e-6, 1e-4, 1.0) if (row := cheapest(first, level))), None)


def _lines(rows: Sequence[Row], *names: str) -> list[Series]:
    found = families(good(rows), *names)
    return [
        Series(_label(key), [(row["ms"], row["error"]) for row in group])
        for key, group in found.items()
    ]


def _label(key: Sequence[str]) -> str:
    """A choice of quasi-velocities stands for itself."""
    parts = [part for part in key if part]
    head, *rest = parts[1:] if parts[0] == DEFAULT and len(parts) > 1 else parts
    return f"{head} ({', '.join(rest)})" if rest else head


def _error_chart(title: str, rows: Sequence[Row], lines: Sequence[Series]) -> str:
    dots = Series("", [(row["ms"], row["error"]) for row in good(rows)], "dots")
    best = Series("front of all runs", [(row["ms"], row["error"]) for row in front(rows)], "front")
    return chart(title, "run time (ms) →", "error at the end", [dots, best, *lines])


def extremes_chart(rows: Sequence[ExtremeRow]) -> str:
    """The extreme cases that have an error, from the largest on, each below the tolerance that its
    file states."""
    judged = sorted(
        (row for row in rows if row.error is not None), key=lambda row: -(row.error or 0.0)
    )
    if not judged:
        return ""
    errors = [(float(k), max(row.error or 0.0, LEAST * 1e-3)) for k, row in enumerate(judged, 1)]
    bounds = [(float(k), row.tolerance) for k, row in enumerate(judged, 1) if row.tolerance]
    lines = [Series("error at the end", errors), Series("tolerance of the case", bounds)]
    return chart(
        "extreme cases: error and tolerance",
        "cases, the largest error first →",
        "error at the end",
        lines,
        (False, True),
    )


def time_charts(model: str, tracks: Sequence[Mapping[str, Any]], exchanged: float) -> list[str]:
    """|φ|, |A v − c| and the energy error over time; what is zero throughout has no line."""
    titles = {
        "phi": (f"{model}: position violation over time", "|φ|"),
        "velocity": (f"{model}: velocity violation over time", "|A v − c|"),
        "balance": (f"{model}: energy error over time", "|energy error|, relative"),
    }
    made = [
        _time_chart(title, about, name, tracks, exchanged)
        for name, (title, about) in titles.items()
    ]
    return [each for each in made if each]


def _time_chart(
    title: str, about: str, name: str, tracks: Sequence[Mapping[str, Any]], exchanged: float
) -> str:
    scale = exchanged if name == "balance" and exchanged > 0 else 1.0
    lines = [
        Series(
            track["about"],
            [(t, max(y / scale, LEAST * 1e-3)) for t, y in zip(track["t"][1:], track[name][1:])],
            "curve",
        )
        for track in tracks
        if any(track[name])
    ]
    return chart(title, "t (s) →", about, lines, (False, True)) if lines else ""
