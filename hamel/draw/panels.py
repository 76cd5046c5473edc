"""Panels of curves over one common abscissa, written as a self-contained SVG document."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from hamel.draw.axis import Axis, linear, logarithmic
from hamel.draw.canvas import COLOURS, ENTRY, Frame, document, element, polyline, text

WIDTH, HEIGHT, LEFT, RIGHT, TOP, GAP = 760, 150, 74, 150, 52, 46
MOST_POINTS = 1500


@dataclass(frozen=True)
class Curve:
    """Values over the common abscissa."""

    label: str
    values: Sequence[float]


@dataclass(frozen=True)
class Panel:
    """Curves with one ordinate; `about` names it with its unit."""

    about: str
    curves: tuple[Curve, ...]
    log: bool = False


def draw(title: str, abscissa: str, x: Sequence[float], panels: Sequence[Panel]) -> str:
    """The document: panels below each other, all over `x`."""
    along = linear(x, tight=True)
    height = TOP + len(panels) * (HEIGHT + GAP)
    parts = [text(LEFT, 22, title, "title")]
    for index, panel in enumerate(panels):
        parts += _panel(panel, x, along, TOP + index * (HEIGHT + GAP))
    parts.append(text((LEFT + WIDTH - RIGHT) / 2, height - 8, abscissa, anchor="middle"))
    return document(WIDTH, height, parts)


def _panel(panel: Panel, x: Sequence[float], along: Axis, top: int) -> list[str]:
    values = [float(v) for curve in panel.curves for v in curve.values]
    up = logarithmic(values) if panel.log else linear(values)
    frame = Frame(LEFT, top, WIDTH - RIGHT - LEFT, HEIGHT, along, up)
    return [
        *frame.rows(),
        *frame.columns(15, grid=False),
        frame.border(),
        text(LEFT, top - 6, panel.about),
        *_curves(panel, x, frame),
        *_legend(panel, frame),
    ]


def _curves(panel: Panel, x: Sequence[float], frame: Frame) -> list[str]:
    """Thinned to what can be seen, the end among it."""
    every, lines = max(1, len(x) // MOST_POINTS), []
    for index, curve in enumerate(panel.curves):
        for run in _runs(x, curve.values):
            rows = [*run[:-1:every], run[-1]]
            points = frame.points((x[k], float(curve.values[k])) for k in rows)
            lines.append(polyline(points, stroke=_colour(index)))
    return lines


def _runs(x: Sequence[float], values: Sequence[float]) -> list[list[int]]:
    """Rows that follow each other and are numbers: no line is drawn across others."""
    there = [math.isfinite(a) and math.isfinite(b) for a, b in zip(x, values)]
    groups = groupby(range(len(there)), key=there.__getitem__)
    return [[*rows] for known, rows in groups if known]


def _legend(panel: Panel, frame: Frame) -> list[str]:
    """What does not fit is counted, not drawn over the next panel."""
    room = HEIGHT // ENTRY
    left, parts = WIDTH - RIGHT + 10, []
    for index, curve in enumerate(panel.curves[:room]):
        y = int(frame.top) + 14 + ENTRY * index
        line = {"x1": left, "x2": left + 20, "y1": y - 4, "y2": y - 4}
        parts.append(element("line", **line, stroke=_colour(index), stroke_width=2))
        parts.append(text(left + 26, y, curve.label))
    if len(panel.curves) > room:
        more = f"and {len(panel.curves) - room} more"
        parts.append(text(left + 26, frame.bottom + 14, more))
    return parts


def _colour(index: int) -> str:
    return COLOURS[index % len(COLOURS)]
