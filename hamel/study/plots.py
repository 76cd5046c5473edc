"""The charts of a report: error against run time three ways, and violations over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from codegen.integrators import INTEGRATORS
from hamel.draw import Series, chart
from hamel.records import ExtremeRow
from hamel.study.front import Row, cheapest, families, front, good, is_library, is_traditional
from hamel.study.judgement import LEAST
from hamel.study.plan import DEFAULT

FIRST = INTEGRATORS[0].name


def error_charts(model: str, rows: Sequence[Row]) -> list[str]:
    """Per family: integrators and library solvers; formulations and choices; enforcements. The
    front is that of all runs."""
    base = _base(rows)
    if base is None:
        return []
    where = base["choice"] or base["formulation"]
    charts = {
        f"{model}: integrators, {where}": _by_integrator(rows, base),
        f"{model}: formulations and choices, {FIRST}": _by_equations(rows, base),
        f"{model}: enforcements, {FIRST}": _by_enforcement(rows, base),
    }
    return [_error_chart(title, rows, lines) for title, lines in charts.items()]


def _by_integrator(rows: Sequence[Row], base: Row) -> list[Series]:
    """Our own on the equations of the base, libraries on all of theirs."""
    own = [row for row in rows if not is_library(row)]
    own = _alike(own, base, "formulation", "choice", "enforcement")
    libraries = [row for row in rows if is_library(row)]
    return _lines(own, "integrator") + _lines(libraries, "integrator", "formulation")


def _by_equations(rows: Sequence[Row], base: Row) -> list[Series]:
    return _lines(_alike(_of_first(rows), base, "enforcement"), "formulation", "choice")


def _by_enforcement(rows: Sequence[Row], base: Row) -> list[Series]:
    """On the equations of the base, and on the augmented ones."""
    first = _of_first(rows)
    own = _lines(_alike(first, base, "formulation", "choice"), "enforcement")
    augmented = [row for row in first if row["formulation"] == "augmented"]
    return own + _lines(augmented, "formulation", "enforcement")


def _of_first(rows: Sequence[Row]) -> list[Row]:
    """Runs of the first integrator."""
    return [row for row in rows if row["integrator"] == FIRST]


def _alike(rows: Sequence[Row], base: Row, *names: str) -> list[Row]:
    """Those that agree with the base in these columns."""
    return [row for row in rows if all(row[name] == base[name] for name in names)]


def _base(rows: Sequence[Row]) -> Row | None:
    """The method most lines are drawn of: the best one in quasi-velocities with the first
    integrator."""
    first = _of_first(good(rows))
    first = [row for row in first if not is_traditional(row)] or first
    for level in (1e-8, 1e-6, 1e-4, 1.0):
        if row := cheapest(first, level):
            return row
    return None


def _lines(rows: Sequence[Row], *names: str) -> list[Series]:
    return [
        Series(_label(key), _points(group)) for key, group in families(good(rows), *names).items()
    ]


def _points(rows: Sequence[Row]) -> list[tuple[float, float]]:
    return [(row["ms"], row["error"]) for row in rows]


def _label(key: Sequence[str]) -> str:
    """A choice of quasi-velocities stands for itself."""
    parts = [part for part in key if part]
    head, *rest = parts[1:] if parts[0] == DEFAULT and len(parts) > 1 else parts
    return f"{head} ({', '.join(rest)})" if rest else head


def _error_chart(title: str, rows: Sequence[Row], lines: Sequence[Series]) -> str:
    dots = Series("", _points(good(rows)), "dots")
    best = Series("front of all runs", _points(front(rows)), "front")
    return chart(title, "run time (ms) →", "error at the end", [dots, best, *lines])


def estimate_chart(model: str, rows: Sequence[Row]) -> str:
    """What motions say of their own error beside what it is: dots above the lower line are no less,
    below the upper one at most thirty times."""
    both = [(row["error_of_q"], row["estimate"]) for row in good(rows) if row["estimate"]]
    if not both:
        return ""
    ends = [min(x for x, _ in both), max(x for x, _ in both)]
    lines = [
        Series("", both, "dots"),
        Series("as large as the error", [(x, x) for x in ends], "curve"),
        Series("thirty times", [(x, 30 * x) for x in ends], "curve"),
    ]
    title = f"{model}: estimate of the error, and the error"
    return chart(title, "error of the coordinates at the end →", "estimate", lines)


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
        "phi": (f"{model}: position violation over time", "|φ| (SI)"),
        "velocity": (f"{model}: velocity violation over time", "|A v − c| (SI)"),
        "balance": (f"{model}: energy error over time", "|energy error| (relative)"),
    }
    charts = [
        _time_chart(title, about, _tracks(name, tracks, exchanged if name == "balance" else 0.0))
        for name, (title, about) in titles.items()
    ]
    return [each for each in charts if each]


def _tracks(name: str, tracks: Sequence[Mapping[str, Any]], exchanged: float) -> list[Series]:
    """One for each track that is not zero throughout, relative to the energy that was exchanged."""
    scale = exchanged if exchanged > 0 else 1.0
    lines = []
    for track in tracks:
        if any(track[name]):
            values = [max(y / scale, LEAST * 1e-3) for y in track[name][1:]]
            lines.append(Series(track["about"], list(zip(track["t"][1:], values)), "curve"))
    return lines


def _time_chart(title: str, about: str, lines: Sequence[Series]) -> str:
    return chart(title, "t (s) →", about, lines, (False, True)) if lines else ""
