"""One chart of several series over axes of their own, linear or logarithmic both ways: scattered
points, lines, fronts.

Narrower than the panels of panels.py, with the legend below: it stays readable on a phone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from hamel.draw.axis import Axis, linear, logarithmic, roomy
from hamel.draw.canvas import (
    COLOURS,
    ENTRY,
    Attribute,
    Frame,
    Point,
    document,
    element,
    finite,
    polyline,
    text,
)

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, COLUMNS = 500, 290, 50, 14, 34, 48, 2
APART = 10  # charts side by side
DASHES = ("", "6 3", "2 3")  # for the second and third round through the colours
FLOOR = 1e-18
ROOM = 33  # letters of a legend entry
GREY, SMALL, LARGE = "#bbb", 1.6, 2.6  # dots of no series, and radii of dots


@dataclass(frozen=True)
class Series:
    """`kind`: "line" with points on it, "curve" without, "dots" (grey, no entry in the legend), or
    "front" (stairs)."""

    label: str
    points: Sequence[Point]
    kind: str = "line"


def chart(
    title: str,
    abscissa: str,
    ordinate: str,
    series: Sequence[Series],
    log: tuple[bool, bool] = (True, True),
) -> str:
    """The document; `log` says which axes (x, y) are logarithmic. Points that are no numbers are
    left out."""
    series = [replace(one, points=finite(one.points)) for one in series]
    entries = [one for one in series if one.kind != "dots" and one.points]
    frame = _frame(series, log)
    parts = [text(LEFT, 16, title, "title")]
    parts += [*frame.rows(), *frame.columns(18), frame.border()]
    parts.append(text(frame.right, frame.bottom + 36, abscissa, anchor="end"))
    parts.append(text(LEFT, frame.bottom + 36, f"↑ {ordinate}"))
    for one in series:
        if one.kind == "dots":
            parts += _dots(frame.points(one.points), GREY, SMALL)
    for index, one in enumerate(entries):
        parts += _series(one, frame, index)
        parts += _entry(one, index)
    rows = -(-len(entries) // COLUMNS)
    return document(WIDTH, TOP + HEIGHT + BOTTOM + ENTRY * rows, parts)


def side_by_side(charts: Sequence[str], columns: int = 2) -> str:
    """Charts in one document, row after row; a row is as high as its highest."""
    columns = min(columns, len(charts))
    rows = [charts[i : i + columns] for i in range(0, len(charts), columns)]
    parts, top = [], 0
    for row in rows:
        for k, drawn in enumerate(row):
            parts.append(drawn.replace("<svg ", f'<svg x="{k * (WIDTH + APART)}" y="{top}" ', 1))
        top += max(map(_height, row)) + APART
    return document(columns * (WIDTH + APART), top, parts)


def _height(drawn: str) -> int:
    """Of a document, from its view box."""
    return int(drawn.split('viewBox="', 1)[1].split('"', 1)[0].split()[3])


def _frame(series: Sequence[Series], log: tuple[bool, bool]) -> Frame:
    along = _axis((x for one in series for x, _ in one.points), log[0])
    up = _axis((y for one in series for _, y in one.points), log[1])
    return Frame(LEFT, TOP, WIDTH - RIGHT - LEFT, HEIGHT, along, up)


def _axis(values: Iterable[float], log: bool) -> Axis:
    """Runs of a tenth of a millisecond, and errors of rounding, all stand at a decade."""
    return roomy(logarithmic(values, FLOOR)) if log else linear(values)


def _series(one: Series, frame: Frame, index: int) -> list[str]:
    style = _style(one, index)
    values = _stairs(sorted(one.points)) if one.kind == "front" else one.points
    points = frame.points(values)
    line = polyline(points, **style)
    return [line, *(_dots(points, str(style["stroke"]), LARGE) if one.kind == "line" else [])]


def _style(one: Series, index: int) -> dict[str, Attribute]:
    """Colours in turn; black is for the front."""
    if one.kind == "front":
        return {"stroke": COLOURS[-1], "style": "stroke-width:2.5;stroke-opacity:0.35"}
    usable = len(COLOURS) - 1
    dash = DASHES[index // usable % len(DASHES)]
    return {"stroke": COLOURS[index % usable], "stroke_dasharray": dash or None}


def _stairs(points: Sequence[Point]) -> list[Point]:
    """To the right at the height reached so far, then down: what can be had for at most x."""
    steps: list[Point] = []
    for x, y in points:
        if steps:
            steps.append((x, steps[-1][1]))
        steps.append((x, y))
    return steps


def _dots(points: Sequence[Point], colour: str, size: float) -> list[str]:
    """All dots as one path of strokes without length: a tenth of the text of as many circles."""
    if not points:
        return []
    path = "".join(f"M{x:.1f},{y:.1f}h0" for x, y in points)
    return [element("path", d=path, stroke=colour, stroke_width=2 * size, stroke_linecap="round")]


def _entry(one: Series, index: int) -> list[str]:
    """Of the legend."""
    left = 10 + (index % COLUMNS) * (WIDTH - 10) / COLUMNS
    y = TOP + HEIGHT + BOTTOM + ENTRY * (index // COLUMNS) + 8
    label = one.label if len(one.label) <= ROOM else one.label[: ROOM - 1] + "…"
    line = {"x1": left, "x2": left + 22, "y1": y - 4, "y2": y - 4}
    return [
        element("line", **line, **_style(one, index), stroke_width=2),
        text(left + 28, y, label),
    ]
