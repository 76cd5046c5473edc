"""The report as one HTML page that needs no network, and as CSV and JSON."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any

from hamel.records import ExtremeRow
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
from hamel.study.judging import COLUMNS
from hamel.study.plan import Excluded
from hamel.study.plots import FIRST, error_charts, extremes_chart, time_charts
from hamel.study.study import Study
from hamel.study.words import advice

COMPARED = 1e-8  # tolerance of the comparison of formulations and enforcements
HEADINGS = {
    "rtol": "rtol", "step": "step (s)", "phi": "|φ|", "velocity": "|A v − c|",
    "energy": "energy error", "ms": "ms",
    "operations": "operations of ẋ", "judged_by": "judged by", "fewest": "fewest steps",
    "scipy": "SciPy's Radau",
}  # fmt: skip


def page(studies: Sequence[Study], extremes: Sequence[ExtremeRow], version: str) -> str:
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        undefined=StrictUndefined, autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        files("hamel.study").joinpath("page.html.j2").read_text("utf-8")
    )
    sections = [_section(study, Markup) for study in studies]
    title = ", ".join(
        [*(study.model for study in studies), *(["extreme cases"] if extremes else [])]
    )
    tables = {
        "comparison": _comparison(studies),
        "extremes": _extremes(extremes),
        "outcomes": outcomes(extremes),
    }
    drawn = Markup(extremes_chart(extremes))
    return template.render(
        title=title,
        version=version,
        sections=sections,
        heading=_heading,
        extremes_chart=drawn,
        **tables,
    )


def _section(study: Study, markup: Any) -> dict[str, Any]:
    rows = study.rows
    return {
        "study": study,
        "advice": advice(rows, study.reference),
        "charts": [markup(each) for each in error_charts(study.model, rows)],
        "over_time": [
            markup(each)
            for each in time_charts(study.model, study.tracks, study.reference.exchanged)
        ],
        "front": table([*COLUMNS[1:12], "steps", "operations"], front(rows)),
        "levels": _levels(rows),
        "rows": table(COLUMNS[1:], rows),
        "statuses": families(rows, "status"),
        "reference": _reference(study),
        "left_out": _left_out(study.excluded),
    }


def _heading(name: str) -> str:
    return HEADINGS.get(name, name)


Cell = tuple[str, str]  # what is read, what is sorted by
Table = tuple[Sequence[str], list[list[Cell]]]


def table(names: Sequence[str], rows: Sequence[Row]) -> Table:
    return names, [[_cell(row[name]) for name in names] for row in rows]


def _cell(value: Any) -> Cell:
    if value is None:
        return "–", ""
    if isinstance(value, float):
        return (f"{value:.3g}" if 1e-3 <= abs(value) < 1e5 or value == 0 else f"{value:.1e}"), repr(
            value
        )
    return str(value), str(value)


def _levels(rows: Sequence[Row]) -> Table:
    """Per method and level of error the least time; methods that reach none are left out, the
    fastest come first."""
    names = ["method", *(f"{level:.0e}" for level in LEVELS)]
    made = []
    for group in families(
        good(rows), "formulation", "choice", "enforcement", "integrator"
    ).values():
        best = [cheapest(group, level) for level in LEVELS]
        if any(best):
            made.append(
                [_cell(method(group[0])), *(_cell(row["ms"] if row else None) for row in best)]
            )
    made.sort(
        key=lambda cells: [float(cell[1] or "inf") for cell in (cells[3], cells[2], cells[1])]
    )
    return names, made


def _comparison(studies: Sequence[Study]) -> Table:
    """Quasi-velocity choices against traditional methods, everything else equal: the tables of the
    paper."""
    names = [
        "model",
        "kind",
        "formulation",
        "choice",
        "enforcement",
        "phi",
        "velocity",
        "energy",
        "error",
        "ms",
        "status",
    ]
    made = []
    for study in studies:
        wanted = [
            row
            for row in study.rows
            if row["integrator"] == FIRST and row["rtol"] == _compared(study.rows)
        ]
        for row in wanted:
            kind = "traditional" if row["formulation"] in MULTIPLIERS else "quasi-velocities"
            made.append([_cell({**row, "kind": kind}[name]) for name in names])
    return names, made


EXTREMES = (
    *("model", "case", "method", "outcome", "error", "tolerance", "status", "judged_by"),
    *("steps", "fewest", "scipy", "constraints", "about"),
)


def _extremes(rows: Sequence[ExtremeRow]) -> Table:
    marked = [
        {
            **asdict(row),
            "outcome": row.outcome if row.passed else f"{row.outcome}, not {row.expected}",
        }
        for row in rows
    ]
    return table(EXTREMES, marked)


def outcomes(rows: Sequence[ExtremeRow]) -> str:
    counts = {
        name: sum(row.outcome == name for row in rows) for name in ("survived", "refused", "wrong")
    }
    counts |= {row.outcome: sum(other.outcome == row.outcome for other in rows) for row in rows}
    return f"{len(rows)} extreme cases: " + ", ".join(
        f"{count} {name}" for name, count in counts.items()
    )


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
    units = [
        f"{each.formulation} ({each.choice})" if each.choice else each.formulation for each in group
    ]
    return "; ".join(
        filter(
            None,
            [
                ", ".join(dict.fromkeys(filter(None, units))),
                group[0].enforcement,
                group[0].integrator,
            ],
        )
    )


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


def summary(study: Study) -> Mapping[str, Any]:
    """What JSON says of a model besides its rows."""
    reference = study.reference
    return {
        "model": study.model,
        "file": study.file,
        "time": study.span,
        "reference": {"by": list(reference.by), "bound": reference.bound, "doubt": reference.doubt},
        "advice": advice(study.rows, reference),
        "front": [f"{method(row)}, {accuracy(row)}" for row in front(study.rows)],
        "libraries": sorted({row["integrator"] for row in study.rows if is_library(row)}),
        "excluded": [vars(each) for each in study.excluded],
        "seconds": study.seconds,
    }
