"""The report as one HTML page that needs no network, and as CSV and JSON."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from markupsafe import Markup, escape

from derive.diagnostics import counted
from derive.textbook.writing.pages import rendered
from hamel.records import ExtremeRow
from hamel.study.advice import advice
from hamel.study.comparison import verdict
from hamel.study.front import (
    LEVELS,
    MULTIPLIERS,
    Row,
    accuracy,
    cheapest,
    families,
    front,
    good,
    is_library,
    method,
)
from hamel.study.judgement import COLUMNS, told
from hamel.study.limits import COMPARED
from hamel.study.plan import Excluded
from hamel.study.plots import FIRST, error_charts, estimate_chart, extremes_chart, time_charts
from hamel.study.study import Study

HEADINGS = {
    "rtol": "rtol", "step": "step (s)", "phi": "|φ|", "velocity": "|A v − c|",
    "energy": "energy error", "ms": "ms",
    "operations": "operations of ẋ", "error_of_q": "error of q", "judged_by": "judged by",
    "fewest": "fewest steps", "scipy": "SciPy's Radau",
}  # fmt: skip


def page(
    studies: Sequence[Study],
    extremes: Sequence[ExtremeRow],
    version: str,
    figures: Sequence[str] = (),
    compare: Sequence[str] = (),
) -> str:
    """The recommendation for each model first; a section for each, which opens with what to take
    and its figure (SVG), the comparison of all, and the extreme cases. `compare` names two methods
    that are put side by side."""
    subjects = [study.model for study in studies]
    if extremes:
        subjects.append("extreme cases")
    return rendered(
        "hamel.study/page.html.j2",
        title=f"Error against run time: {', '.join(subjects)}",
        version=version,
        sections=[
            _section(study) | {"figure": Markup("".join(figures[k : k + 1]))}
            for k, study in enumerate(studies)
        ],
        pair=compare,
        verdicts=[verdict(study.rows, compare) if compare else [] for study in studies],
        heading=_heading,
        whole=whole,
        comparison=_comparison(studies),
        extremes=_extremes(extremes),
        extremes_chart=Markup(extremes_chart(extremes)),
        outcomes=outcomes(extremes),
    )


def _section(study: Study) -> dict[str, Any]:
    """What the template shows of a study."""
    rows = study.rows
    over_time = time_charts(study.model, study.tracks, study.reference.exchanged)
    return {
        "study": study,
        "advice": advice(rows, study.reference, study.unmade),
        "runs": counted(len(rows), "run"),
        "charts": [
            Markup(each)
            for each in (*error_charts(study.model, rows), estimate_chart(study.model, rows))
            if each
        ],
        "over_time": [Markup(each) for each in over_time],
        "front": table([*COLUMNS[1:12], "steps", "operations"], front(rows)),
        "levels": _levels(rows),
        "rows": table(COLUMNS[1:], [told(row) for row in rows]),
        "statuses": families([told(row) for row in rows], "status"),
        "reference": _reference(study),
        "left_out": _left_out(study.excluded),
    }


def whole(line: str) -> Markup:
    """A line of text whose numbers are not broken at their minus."""
    return Markup(re.sub(r"\d\S*e-\d+", r'<span class="number">\g<0></span>', str(escape(line))))


def _heading(name: str) -> str:
    return HEADINGS.get(name, name)


Cell = tuple[str, str]  # what is read, what is sorted by
Table = tuple[Sequence[str], list[list[Cell]]]


def table(names: Sequence[str], rows: Sequence[Row]) -> Table:
    """A head and rows of cells as text: of each row the entries called `names`."""
    return names, [[_cell(row[name]) for name in names] for row in rows]


def _cell(value: Any) -> Cell:
    if value is None:
        return "–", ""
    if isinstance(value, float):
        plain = value == 0 or 1e-3 <= abs(value) < 1e5
        return f"{value:.3g}" if plain else f"{value:.1e}", repr(value)
    return str(value), str(value)


def _levels(rows: Sequence[Row]) -> Table:
    """Per method and level of error the least time; methods that reach none are left out, the
    fastest come first."""
    names = ["method", *(f"{level:.0e}" for level in LEVELS)]
    methods = families(good(rows), "formulation", "choice", "enforcement", "integrator")
    lines = []
    for group in methods.values():
        best = [cheapest(group, level) for level in LEVELS]
        if any(best):
            times = [_cell(row["ms"] if row else None) for row in best]
            lines.append([_cell(method(group[0])), *times])
    lines.sort(key=_times)
    return names, lines


def _times(cells: Sequence[Cell]) -> list[float]:
    """By which methods are sorted: at 1e-8, then at 1e-6, then at 1e-4."""
    return [float(cells[k][1] or "inf") for k in (3, 2, 1)]


COMPARISON = (
    *("model", "kind", "formulation", "choice", "enforcement"),
    *("phi", "velocity", "energy", "error", "ms", "status"),
)


def _comparison(studies: Sequence[Study]) -> Table:
    """Quasi-velocity choices against traditional methods, everything else equal: the tables of the
    paper."""
    lines = []
    for study in studies:
        rtol = _compared(study.rows)
        for row in study.rows:
            if row["integrator"] == FIRST and row["rtol"] == rtol:
                kind = "traditional" if row["formulation"] in MULTIPLIERS else "quasi-velocities"
                named = {**row, "kind": kind}
                lines.append([_cell(named[name]) for name in COMPARISON])
    return COMPARISON, lines


EXTREMES = (
    *("model", "case", "method", "outcome", "error", "tolerance", "status", "judged_by"),
    *("steps", "fewest", "scipy", "constraints", "about"),
)


def _extremes(rows: Sequence[ExtremeRow]) -> Table:
    return table(EXTREMES, [{**asdict(row), "outcome": _outcome(row)} for row in rows])


def _outcome(row: ExtremeRow) -> str:
    return row.outcome if row.passed else f"{row.outcome}, not {row.expected}"


def outcomes(rows: Sequence[ExtremeRow]) -> str:
    """How many cases ended in each way."""
    counts: dict[str, int] = dict.fromkeys(("survived", "refused", "wrong"), 0)
    for row in rows:
        counts[row.outcome] = counts.get(row.outcome, 0) + 1
    text = ", ".join(f"{count} {name}" for name, count in counts.items())
    return f"{counted(len(rows), 'extreme case')}: {text}"


def _compared(rows: Sequence[Row]) -> float | None:
    """The tolerance of the comparison, or the next one to it that was run."""
    known = sorted(
        {row["rtol"] for row in rows if row["integrator"] == FIRST and row["rtol"]}, reverse=True
    )
    return next((rtol for rtol in known if rtol <= COMPARED), known[-1] if known else None)


def _left_out(excluded: Sequence[Excluded]) -> list[tuple[str, str]]:
    """Reasons that differ in numbers only are given once: (what, why)."""
    groups: dict[tuple[str, str, str], list[Excluded]] = {}
    for each in excluded:
        groups.setdefault(
            (each.enforcement, each.integrator, re.sub(r"[-+.\de]*\d", "", each.reason)), []
        ).append(each)
    return [(_what(group), group[0].reason) for group in groups.values()]


def _what(group: Sequence[Excluded]) -> str:
    """Formulations, enforcement and integrator that are left out for one reason."""
    names = [_equations(each) for each in group]
    parts = [
        ", ".join(dict.fromkeys(name for name in names if name)),
        group[0].enforcement,
        group[0].integrator,
    ]
    return "; ".join(part for part in parts if part)


def _equations(each: Excluded) -> str:
    return f"{each.formulation} ({each.choice})" if each.choice else each.formulation


def _reference(study: Study) -> str:
    by, bound = " and ".join(study.reference.by), study.reference.bound
    if study.reference.doubt:
        return study.reference.doubt
    return f"{by}; its own error is at most {bound:.0e}"


def as_csv(rows: Sequence[Row]) -> str:
    """A line of names, a line per row; numbers round-trip, what is not known is empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def summary(study: Study, compare: Sequence[str] = ()) -> Mapping[str, Any]:
    """What JSON says of a model besides its rows."""
    reference = study.reference
    return {
        "model": study.model,
        "file": str(study.file),
        "time": study.span,
        "reference": {"by": list(reference.by), "bound": reference.bound, "doubt": reference.doubt},
        "advice": advice(study.rows, reference, study.unmade),
        "compared": verdict(study.rows, compare) if compare else [],
        "front": [f"{method(row)}, {accuracy(row)}" for row in front(study.rows)],
        "libraries": sorted({row["integrator"] for row in study.rows if is_library(row)}),
        "excluded": [vars(each) for each in study.excluded],
        "seconds": study.seconds,
    }
