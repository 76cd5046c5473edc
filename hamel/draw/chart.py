"""One chart of several series over axes of their own, linear or logarithmic both ways: scattered
points, lines, fronts.

Narrower than the panels of svg.py, with the legend below: it stays readable on a phone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hamel.draw.axis import Axis, linear, logarithmic
from hamel.draw.svg import COLOURS, STYLE, text

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, ENTRY, COLUMNS = 500, 290, 50, 14, 34, 48, 18, 2
DASHES = ("", "6 3", "2 3")  # for the second and third round through the colours
FLOOR = 1e-18
ROOM = 33  # letters of a legend entry

Point = tuple[float, float]


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
    finite = [[(x, y) for x, y in one.points if x - x == 0 and y - y == 0] for one in series]
    across, up = _axes(finite, log)
    named = [(one, points) for one, points in zip(series, finite) if one.kind != "dots" and points]
    height = TOP + HEIGHT + BOTTOM + ENTRY * -(-len(named) // COLUMNS)
    parts = [text(LEFT, 16, title, "title"), *_grid(across, up)]
    parts.append(text(WIDTH - RIGHT, TOP + HEIGHT + 36, abscissa, anchor="end"))
    parts.append(text(LEFT, TOP + HEIGHT + 36, f"↑ {ordinate}"))
    for one, points in zip(series, finite):
        if one.kind == "dots":
            parts += _marks(points, across, up, "#bbb", 1.6)
    for index, (one, points) in enumerate(named):
        parts += _series(one, points, across, up, index)
        parts += _entry(one, index)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" role="img">'
    body = "\n".join(parts)
    return f'{head}\n<style>{STYLE}</style>\n<rect width="100%" height="100%" fill="#fff"/>\n{body}\n</svg>\n'


def _axes(series: Sequence[Sequence[Point]], log: tuple[bool, bool]) -> tuple[Axis, Axis]:
    xs, ys = ([point[k] for points in series for point in points] for k in (0, 1))
    return _axis(xs, log[0]), _axis(ys, log[1])


def _axis(values: Sequence[float], log: bool) -> Axis:
    return logarithmic(values, FLOOR) if log else linear(values)


def _grid(across: Axis, up: Axis) -> list[str]:
    parts = []
    for at, label in up.ticks:
        y = TOP + HEIGHT * (1 - at)
        parts.append(
            f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>'
        )
        parts.append(text(LEFT - 6, y + 4, label, anchor="end"))
    for at, label in across.ticks:
        x = _x(at)
        parts.append(
            f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{TOP}" y2="{TOP + HEIGHT}"/>'
        )
        parts.append(text(x, TOP + HEIGHT + 18, label, anchor="middle"))
    return [
        *parts,
        f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{WIDTH - RIGHT - LEFT}" height="{HEIGHT}"/>',
    ]


def _series(one: Series, points: Sequence[Point], across: Axis, up: Axis, index: int) -> list[str]:
    colour, dash = _style(one, index)
    if one.kind == "front":
        points = _stairs(sorted(points))
    places = [_place(point, across, up) for point in points]
    line = f'<polyline stroke="{colour}"{dash} points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}"/>'
    return [line, *(_marks(points, across, up, colour, 2.6) if one.kind == "line" else [])]


def _style(one: Series, index: int) -> tuple[str, str]:
    """Colours in turn; black is for the front."""
    if one.kind == "front":
        return COLOURS[-1], ' style="stroke-width:2.5;stroke-opacity:0.35"'
    usable = len(COLOURS) - 1
    dash = DASHES[index // usable % len(DASHES)]
    return COLOURS[index % usable], f' stroke-dasharray="{dash}"' if dash else ""


def _stairs(points: Sequence[Point]) -> list[Point]:
    """To the right at the height reached so far, then down: what can be had for at most x."""
    steps: list[Point] = []
    for x, y in points:
        if steps:
            steps.append((x, steps[-1][1]))
        steps.append((x, y))
    return steps


def _marks(points: Sequence[Point], across: Axis, up: Axis, colour: str, size: float) -> list[str]:
    """All dots as one path of strokes without length: a tenth of the text of as many circles."""
    dots = "".join(
        f"M{x:.1f},{y:.1f}h0" for x, y in (_place(point, across, up) for point in points)
    )
    return (
        [f'<path d="{dots}" stroke="{colour}" stroke-width="{2 * size}" stroke-linecap="round"/>']
        if dots
        else []
    )


def _place(point: Point, across: Axis, up: Axis) -> Point:
    return _x(across.position(point[0])), TOP + HEIGHT * (1 - up.position(point[1]))


def _x(at: float) -> float:
    return LEFT + at * (WIDTH - RIGHT - LEFT)


def _entry(one: Series, index: int) -> list[str]:
    colour, dash = _style(one, index)
    left = 10 + (index % COLUMNS) * (WIDTH - 10) / COLUMNS
    y = TOP + HEIGHT + BOTTOM + ENTRY * (index // COLUMNS) + 8
    label = one.label if len(one.label) <= ROOM else one.label[: ROOM - 1] + "…"
    line = f'<line x1="{left:.1f}" x2="{left + 22:.1f}" y1="{y - 4}" y2="{y - 4}" stroke="{colour}"{dash} stroke-width="2"/>'
    return [line, text(left + 28, y, label)]
