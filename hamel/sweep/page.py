"""sweep.html: of each kept quantity its distribution, a line or map over the grids, Sobol indices,
and the motions at its ends with the command that makes each again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

import hamel
from derive.diagnostics import counted
from derive.textbook.writing.pages import rendered
from hamel.draw import Axis, Series, chart, decades, linear
from hamel.draw.canvas import STYLE, Frame, document, element, text
from hamel.records import KeptColumn, Swept
from hamel.sweep.plan import Plan

PAGE = "sweep.html"
CELLS = 150  # of a map, each way
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, KEY = 575, 400, 70, 105, 30, 46, 14
COLD, PALE, WARM = (0, 90, 160), (245, 240, 230), (190, 40, 20)
FAILED = "#ffffff"
SEAM = 0.3  # pixels that cells overlap, or paper shines through between them

Columns = dict[str, np.ndarray]


def page(plan: Plan, record: Swept, columns: Columns | None) -> str:
    """HTML of a complete sweep; `columns` are its rows, None where they are too many or none."""
    failed = [(n, why) for why, n in record.statuses.items()]
    bad = [pair for pair in failed if pair[1] not in ("ok", "stopped by an event")]
    return rendered(
        "hamel.sweep/page.html.j2",
        title=f"{record.model}: {counted(record.motions, 'motion')}",
        subtitle=_subtitle(plan, record),
        version=hamel.__version__,
        columns=[_section(plan, record, each, columns) for each in record.kept],
        elsewhere=elsewhere(record) if record.moved else "",
        moved=[(each.motion, record.commands[str(each.motion)]) for each in record.moves],
        failures=bad,
        failed=[(k, record.commands[str(k)]) for k, _ in record.reasons],
    )


def elsewhere(record: Swept) -> str:
    """In how many motions the start is another one, and how it is in the first of them."""
    motions = counted(record.moved, "motion begins", "motions begin")
    first = record.moves[0]
    unit = f" {first.unit}" if first.unit else ""
    return (
        f"{motions} elsewhere, as the constraints do not allow the start: motion {first.motion} "
        f"at {first.name} = {first.used:.6g}{unit}, not {first.given:.6g}{unit}"
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
    over = _over_grids(plan, each, columns)
    figures = [(figure, _caption(plan)) for figure in over] + [(_distribution(each), "")]
    ends = [*each.lowest[:3], *reversed(each.highest[:3])]
    return {
        "title": each.name + unit,
        "name": each.name,
        "figures": [(Markup(figure), words) for figure, words in figures if figure],
        "numbers": [
            ("motions", str(each.count)),
            ("mean", f"{each.mean:.6g}"),
            ("deviation", f"{each.deviation:.4g}"),
            *((f"{100 * float(q):g} %", f"{x:.4g}") for q, x in each.quantiles.items()),
        ],
        "sensitivities": [(n, f"{first:.3f}", f"{total:.3f}") for n, first, total in order],
        "ends": [(f"{x:.8g}", record.commands[str(k)]) for x, k in dict.fromkeys(ends)],
    }


def _caption(plan: Plan) -> str:
    """What stands at a place of the grids, where it is not the only motion there."""
    samples = plan.design.samples
    return f"The mean of the {samples} samples at each place of the grid." if samples > 1 else ""


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
    series = [Series(counted(each.count, "motion"), points, "curve")]
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


def _map(each: KeptColumn, values: np.ndarray, grids: list[np.ndarray], labels: list[str]) -> str:
    """Colours over two grids, the second along; thinned to what can be seen."""
    ups, alongs = (_Cells.of(grid) for grid in grids)
    shown = values[np.ix_(ups.places, alongs.places)]
    frame = Frame(LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM, alongs.axis, ups.axis)
    x, y = [
        [one(edge) for edge in cells.edges] for one, cells in ((frame.x, alongs), (frame.y, ups))
    ]
    finite = shown[np.isfinite(shown)]
    low, high = _colours(finite)
    parts = []
    for i, row in enumerate(shown):
        for j, value in enumerate(row):
            size = {"width": x[j + 1] - x[j] + SEAM, "height": y[i] - y[i + 1] + SEAM}
            colour = _colour(float(value), low, high)
            parts.append(element("rect", x=x[j], y=y[i + 1], **size, fill=colour))
    turned = f"translate(14 {(TOP + frame.bottom) / 2:.1f}) rotate(-90)"
    below = text((LEFT + frame.right) / 2, HEIGHT - 8, labels[1], anchor="middle")
    beside = element("g", text(0, 0, labels[0], anchor="middle"), transform=turned)
    title = text(LEFT, 18, each.name, "title")
    around = [title, *frame.columns(16, grid=False), *frame.rows(grid=False)]
    parts += [*_key(frame, finite, low, high), frame.border(), below, beside]
    return document(WIDTH, HEIGHT, [*around, *parts], STYLE)


def _colours(finite: np.ndarray) -> tuple[float, float]:
    """The numbers between which colours change: of many a hundredth may be beyond at each end."""
    if not len(finite):
        return 0.0, 1.0
    low = np.quantile(finite, 0.01, method="lower")
    high = np.quantile(finite, 0.99, method="higher")
    return float(low), float(high)


def _key(frame: Frame, finite: np.ndarray, low: float, high: float) -> list[str]:
    """What the colours stand for."""
    parts = []
    for k in range(11):
        x, y = WIDTH - RIGHT + 16, frame.bottom - (k + 1) * KEY
        colour = _colour(low + (high - low) * k / 10, low, high)
        parts.append(element("rect", x=float(x), y=y, width=KEY, height=KEY, fill=colour))
    least, most = ("≤ " if (finite < low).any() else ""), ("≥ " if (finite > high).any() else "")
    parts.append(text(WIDTH - RIGHT + 34, frame.bottom, f"{least}{low:.3g}"))
    parts.append(text(WIDTH - RIGHT + 34, frame.bottom - 10 * KEY, f"{most}{high:.3g}"))
    return parts


@dataclass(frozen=True)
class _Cells:
    """Of a map along one grid: places of the values that are shown, the edges around each, halfway
    to its neighbours, and the axis; `edges` and `places` in the order of the values."""

    places: np.ndarray
    edges: list[float]
    axis: Axis

    @staticmethod
    def of(grid: np.ndarray) -> _Cells:
        """Of a grid as it was given: in any order, some values more than once."""
        values, places = np.unique(grid, return_index=True)
        seen = np.unique(np.linspace(0, len(values) - 1, min(len(values), CELLS)).astype(int))
        log = _is_geometric(values)
        edges = _edges(np.log(values[seen]) if log else values[seen])
        edges = np.exp(edges) if log else edges
        first, last = float(edges[0]), float(edges[-1])
        axis = decades(first, last) if log else linear((first, last), tight=True)
        return _Cells(places[seen], edges.tolist(), axis)


def _edges(centres: np.ndarray) -> np.ndarray:
    """Halfway between centres, and as far beyond the outer ones."""
    if len(centres) == 1:
        return centres[0] + np.array([-0.5, 0.5]) * (abs(centres[0]) or 1.0)
    between = (centres[1:] + centres[:-1]) / 2
    first, last = 2 * centres[0] - between[0], 2 * centres[-1] - between[-1]
    return np.concatenate([[first], between, [last]])


def _is_geometric(values: np.ndarray) -> bool:
    """Whether ascending values grow by one factor and not by one step."""
    if len(values) < 3 or not values[0] > 0:
        return False
    factors = np.diff(np.log(values))
    return bool(np.ptp(factors) < 1e-6 * factors[0])


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
