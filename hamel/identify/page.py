"""The page of an identification: values with deviations, forces measured and predicted, what is
left."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

import hamel
from derive.textbook.writing.pages import rendered
from hamel.draw import Series, chart
from hamel.identify.estimate import Rows
from hamel.identify.fit import Fit, residuals
from hamel.records import Identified

HEADS = ("ordinary", "weighted", "deviation", "consistent")
POINTS = 600  # of a curve
FORCES = {"rad/s": "N m", "1/s": "N m", "m/s": "N"}  # by the unit of the speed they act along


def page(found: Fit, record: Identified) -> str:
    """HTML, figures inside, no script."""
    rows = [
        (
            x.name,
            *_cells(x.ordinary, x.weighted),
            *_cells(x.deviation, digits=3),
            *_cells(x.consistent),
            x.unit,
            x.sum,
        )
        for x in record.base
    ]
    standard = [
        (x.name, f"{x.value:.6g}", f"{x.file:.6g}", x.unit)
        for x in record.standard
        if x.value is not None
    ]
    return rendered(
        "hamel.identify/page.html.j2",
        title=f"{record.model}: {len(record.base)} base parameters",
        subtitle=f"from {record.rows} rows of {record.data}, condition {record.condition:.3g}",
        version=hamel.__version__,
        notes=record.notes,
        heads=HEADS,
        base=rows,
        figures=[Markup(figure) for figure in _figures(found)],
        standard=standard,
    )


def _cells(*values: float | None, digits: int = 6) -> list[str]:
    return ["–" if value is None else f"{value:.{digits}g}" for value in values]


def _figures(found: Fit) -> list[str]:
    figures = _of_rows(found, found.rows, "")
    return (
        figures if found.fresh is None else figures + _of_rows(found, found.fresh, ", not fitted")
    )


def _of_rows(found: Fit, rows: Rows, about: str) -> list[str]:
    predicted, left = rows.A @ found.values, residuals(rows, found.values)
    every = max(1, len(rows.t) // POINTS)
    figures: list[str] = []
    units = found.equations.argument("x").units[found.equations.speeds]
    for k, (name, unit) in enumerate(zip(found.equations.w, units)):
        lines = {"measured": rows.y, "predicted": predicted, "left": left}
        series = [Series(n, _points(rows.t, y[:, k], every), "curve") for n, y in lines.items()]
        title = f"force over {name}{about}"
        figures.append(chart(title, "t (s)", FORCES.get(unit, "N or N m"), series, (False, False)))
    return figures


def _points(t: np.ndarray, y: np.ndarray, every: int) -> list[tuple[float, float]]:
    return list(zip(t[::every].tolist(), y[::every].tolist()))
