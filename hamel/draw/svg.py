"""Panels of curves over one common abscissa, written as a self-contained SVG document."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

from hamel.draw.axis import Axis, linear, logarithmic

# Okabe and Ito's colours: told apart by every kind of colour vision.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, GAP = 760, 150, 74, 150, 52, 46
MOST_POINTS = 1500

STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#333}.title{font-size:15px;font-weight:600}.grid{stroke:#ddd}"
    ".frame{fill:none;stroke:#888}polyline{fill:none;stroke-width:1.5;stroke-linejoin:round}"
)


@dataclass(frozen=True)
class Curve:
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
    across = linear(x, tight=True)
    height = TOP + len(panels) * (HEIGHT + GAP)
    parts = [text(LEFT, 22, title, "title")]
    for index, panel in enumerate(panels):
        parts += _panel(panel, x, across, TOP + index * (HEIGHT + GAP))
    parts.append(text((LEFT + WIDTH - RIGHT) / 2, height - 8, abscissa, anchor="middle"))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" role="img">'
    body = "\n".join(parts)
    return f'{head}\n<style>{STYLE}</style>\n<rect width="100%" height="100%" fill="#fff"/>\n{body}\n</svg>\n'


def _panel(panel: Panel, x: Sequence[float], across: Axis, top: float) -> list[str]:
    values = [float(v) for curve in panel.curves for v in curve.values]
    up = logarithmic(values) if panel.log else linear(values)
    return [
        *_grid(across, up, top),
        text(LEFT, top - 6, panel.about),
        *_curves(panel, x, across, up, top),
        *_legend(panel, top),
    ]


def _grid(across: Axis, up: Axis, top: float) -> list[str]:
    parts = []
    for at, label in up.ticks:
        y = top + HEIGHT * (1 - at)
        parts.append(
            f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        parts.append(text(LEFT - 6, y + 4, label, anchor="end"))
    for at, label in across.ticks:
        parts.append(text(_across(at), top + HEIGHT + 15, label, anchor="middle"))
    frame = f'<rect class="frame" x="{LEFT}" y="{top}" width="{WIDTH - RIGHT - LEFT}" height="{HEIGHT}"/>'
    return [*parts, frame]


def _curves(panel: Panel, x: Sequence[float], across: Axis, up: Axis, top: float) -> list[str]:
    every = max(1, len(x) // MOST_POINTS)
    shown = [*range(0, len(x) - 1, every), len(x) - 1]
    places = [_across(across.position(x[k])) for k in shown]
    return [
        _polyline(
            [
                (place, top + HEIGHT * (1 - up.position(float(curve.values[k]))))
                for place, k in zip(places, shown)
            ],
            index,
        )
        for index, curve in enumerate(panel.curves)
    ]


def _polyline(points: list[tuple[float, float]], index: int) -> str:
    """A line through the points that are numbers (y − y is 0 only for those)."""
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points if y - y == 0)
    return f'<polyline stroke="{COLOURS[index % len(COLOURS)]}" points="{places}"/>'


def _legend(panel: Panel, top: float) -> list[str]:
    # One entry per 18 pixels; what does not fit is counted, not drawn over the next panel.
    room = HEIGHT // 18
    parts = []
    for index, curve in enumerate(panel.curves[:room]):
        y = top + 14 + 18 * index
        colour = COLOURS[index % len(COLOURS)]
        left = WIDTH - RIGHT + 10
        parts.append(
            f'<line x1="{left}" x2="{left + 20}" y1="{y - 4}" y2="{y - 4}" stroke="{colour}" stroke-width="2"/>'
        )
        parts.append(text(left + 26, y, curve.label))
    if len(panel.curves) > room:
        parts.append(
            text(WIDTH - RIGHT + 36, top + HEIGHT + 14, f"and {len(panel.curves) - room} more")
        )
    return parts


def _across(at: float) -> float:
    return LEFT + at * (WIDTH - RIGHT - LEFT)


def text(x: float, y: float, words: str, style: str = "", anchor: str = "start") -> str:
    kind = f' class="{style}"' if style else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{kind}>{html.escape(words)}</text>'
