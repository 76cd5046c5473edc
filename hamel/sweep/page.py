"""sweep.html: of each kept quantity its distribution, a line or map over the grids, Sobol indices,
and the motions at its ends with the command that makes each again."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

import hamel
from derive.textbook.pages import rendered
from hamel.draw import Series, chart, linear
from hamel.draw.canvas import STYLE, Frame, document, element, text
from hamel.records import KeptColumn, Swept
from hamel.sweep.plan import Plan

PAGE = "sweep.html"
CELLS = 150  # of a map, each way
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, KEY = 560, 400, 70, 90, 30, 46, 14
COLD, PALE, WARM = (0, 90, 160), (245, 240, 230), (190, 40, 20)
FAILED = "#ffffff"

Columns = dict[str, np.ndarray]


def page(plan: Plan, record: Swept, columns: Columns | None) -> str:
    """HTML of a complete sweep; `columns` are its rows, None where they are too many or none."""
    failed = [(n, why) for why, n in record.statuses.items()]
    bad = [pair for pair in failed if pair[1] not in ("ok", "stopped by an event")]
    return rendered(
        "hamel.sweep/page.html.j2",
        title=f"{record.model}: {record.motions} motions",
        subtitle=_subtitle(plan, record),
        version=hamel.__version__,
        columns=[_section(plan, record, each, columns) for each in record.kept],
        failures=bad,
        failed=[(k, record.commands[str(k)]) for k, _ in record.reasons],
    )


def _subtitle(plan: Plan, record: Swept) -> str:
    design = plan.design
    over = [f"{axis.name} ({axis.size})" for axis in (*design.methods, *design.grids)]
    over += [f"{n} (rows of {t.file})" for t in design.tables for n in t.names]
    over += [
        f"{d.name} ({d.kind}, {design.samples} by {design.kind})" for d in design.distributions
    ]
    failed = f"; {record.failed} of them failed" if record.failed else ""
    return f"over {', '.join(over)}{failed}"


def _section(
    plan: Plan, record: Swept, each: KeptColumn, columns: Columns | None
) -> dict[str, Any]:
    unit = f" ({each.unit})" if each.unit else ""
    indices = record.sensitivities.get(each.name)
    order = (
        sorted(zip(indices["names"], indices["first"], indices["total"]), key=lambda x: -x[2])
        if indices
        else ()
    )
    figures = [*_over_grids(plan, each, columns), _distribution(each)]
    ends = [*each.lowest[:3], *reversed(each.highest[:3])]
    return {
        "title": each.name + unit,
        "name": each.name,
        "figures": [Markup(figure) for figure in figures],
        "numbers": [
            ("motions", str(each.count)),
            ("mean", f"{each.mean:.6g}"),
            ("deviation", f"{each.deviation:.4g}"),
            *((f"{100 * float(q):g} %", f"{x:.4g}") for q, x in each.quantiles.items()),
        ],
        "sensitivities": [(n, f"{first:.3f}", f"{total:.3f}") for n, first, total in order],
        "ends": [(f"{x:.8g}", record.commands[str(k)]) for x, k in dict.fromkeys(ends)],
    }


def _distribution(each: KeptColumn) -> str:
    """The histogram as a density."""
    edges, counts = each.histogram
    if not counts:
        return ""
    width = edges[1] - edges[0]
    points = [(edges[0], 0.0)]
    for k, count in enumerate(counts):
        height = count / each.count / width
        points += [(edges[k], height), (edges[k + 1], height)]
    points.append((edges[-1], 0.0))
    unit = f" ({each.unit})" if each.unit else ""
    series = [Series(f"{each.count} motions", points, "curve")]
    return chart(
        f"distribution of {each.name}", each.name + unit, "density", series, (False, False)
    )


def _over_grids(plan: Plan, each: KeptColumn, columns: Columns | None) -> list[str]:
    """A line over one grid, a map over two; the mean of the samples at each place."""
    design = plan.design
    grids = [grid for grid in design.grids if grid.size > 1]
    others = [a for a in (*design.methods, *design.tables) if a.size > 1]
    if columns is None or others or len(grids) not in (1, 2):
        return []
    shape = (*(grid.size for grid in grids), design.samples)
    values = columns[each.name].reshape(shape)
    with np.errstate(all="ignore"):
        finite = np.isfinite(values)
        total = np.where(finite, values, 0.0).sum(axis=-1)
        mean = np.where(finite.any(axis=-1), total / np.maximum(finite.sum(axis=-1), 1), np.nan)
    labels = [
        f"{g.name} ({plan.units[g.name]})" if plan.units.get(g.name) else g.name for g in grids
    ]
    axes = [np.array(grid.values, dtype=float) for grid in grids]
    if len(grids) == 1:
        unit = f" ({each.unit})" if each.unit else ""
        points = list(zip(axes[0].tolist(), mean.tolist()))
        title = f"{each.name} over {grids[0].name}"
        series = [Series(each.name, points, "curve")]
        return [chart(title, labels[0], each.name + unit, series, (False, False))]
    return [_map(each, mean, axes, labels)]


def _map(each: KeptColumn, values: np.ndarray, axes: list[np.ndarray], labels: list[str]) -> str:
    """Colours over two grids, the second along; thinned to what can be seen."""
    rows, columns = (
        np.unique(np.linspace(0, n - 1, min(n, CELLS)).astype(int)) for n in values.shape
    )
    shown = values[np.ix_(rows, columns)]
    up, along = linear(axes[0].tolist(), tight=True), linear(axes[1].tolist(), tight=True)
    frame = Frame(LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM, along, up)
    width, height = frame.width / len(columns), frame.height / len(rows)
    finite = shown[np.isfinite(shown)]
    low, high = (float(np.quantile(finite, q)) for q in (0.01, 0.99)) if len(finite) else (0.0, 1.0)
    falling = (axes[0][0] > axes[0][-1], axes[1][0] > axes[1][-1])
    parts = []
    for i, row in enumerate(shown[:: -1 if falling[0] else 1]):
        for j, value in enumerate(row[:: -1 if falling[1] else 1]):
            place = {"x": frame.left + j * width, "y": frame.bottom - (i + 1) * height}
            colour = _colour(float(value), low, high)
            parts.append(
                element("rect", **place, width=width + 0.3, height=height + 0.3, fill=colour)
            )
    for k in range(11):
        x, y = WIDTH - RIGHT + 16, frame.bottom - (k + 1) * KEY
        colour = _colour(low + (high - low) * k / 10, low, high)
        parts.append(element("rect", x=float(x), y=y, width=KEY, height=KEY, fill=colour))
    parts.append(text(WIDTH - RIGHT + 34, frame.bottom, f"{low:.3g}"))
    parts.append(text(WIDTH - RIGHT + 34, frame.bottom - 10 * KEY, f"{high:.3g}"))
    turned = f"translate(14 {(TOP + frame.bottom) / 2:.1f}) rotate(-90)"
    below = text((LEFT + frame.right) / 2, HEIGHT - 8, labels[1], anchor="middle")
    beside = element("g", text(0, 0, labels[0], anchor="middle"), transform=turned)
    title = text(LEFT, 18, each.name, "title")
    around = [title, *frame.columns(16, grid=False), *frame.rows(grid=False)]
    return document(WIDTH, HEIGHT, [*around, *parts, frame.border(), below, beside], STYLE)


def _colour(value: float, low: float, high: float) -> str:
    """Blue below, red above; about zero where the values have both signs."""
    if not np.isfinite(value):
        return FAILED
    if low < 0 < high:
        part = value / (-low if value < 0 else high)
    else:
        part = 2 * (value - low) / ((high - low) or 1.0) - 1
    part = float(np.clip(part, -1, 1))
    end = WARM if part > 0 else COLD
    return "#" + "".join(f"{round(a + (b - a) * abs(part) ** 0.7):02x}" for a, b in zip(PALE, end))
