"""Eigenvalues over a range as curves, in their plane, and stability over two names, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hamel.draw import Curve, Panel, draw, linear
from hamel.draw.axis import Axis
from hamel.draw.canvas import STYLE, Frame, document, element, text
from hamel.linear.sweep import Sweep

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560, 380, 70, 20, 30, 46
AXIS = ".axis{stroke:#444;stroke-dasharray:4 3}"
DECAYING = "#4a90c4"  # of a map where no mode grows
NO_MOTION = "#d0d0d0"  # of a map where no motion is steady
PALE, DARK = (170, 205, 235), (0, 40, 90)  # the first and the last value of a range
FAINT, STRONG = (255, 245, 235), (190, 40, 20)  # modes that hardly grow, and the one that does most


def branches(spectra: np.ndarray) -> np.ndarray:
    """The columns sorted so that each follows one eigenvalue from row to row."""
    result = spectra.copy()
    for k in range(1, len(result)):
        ahead = result[k - 1] if k < 2 else 2 * result[k - 1] - result[k - 2]
        result[k] = result[k][_matched(ahead, result[k])]
    return result


def _matched(expected: np.ndarray, values: np.ndarray) -> list[int]:
    """For each expected value the nearest that is not taken, the surest first."""
    gaps = np.abs(expected[:, np.newaxis] - values[np.newaxis, :])
    places = [0] * len(expected)
    for _ in range(len(expected)):
        i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        places[int(i)] = int(j)
        gaps[i], gaps[:, j] = np.inf, np.inf
    return places


def over_range(sweep: Sweep) -> str:
    """Real and imaginary parts over the swept name."""
    name = sweep.names[0]
    x, columns = _curves(sweep)
    panels = [
        _panel("real parts (1/s)", columns.real),
        _panel("imaginary parts (rad/s)", columns.imag),
    ]
    return draw(f"eigenvalues over {name}", sweep.labels[0], x.tolist(), panels)


def _curves(sweep: Sweep) -> tuple[np.ndarray, np.ndarray]:
    """Values and eigenvalues (k × N), course by course, with what is no number between them."""
    gap = np.full((1, sweep.spectra.shape[1]), complex(np.nan, np.nan))
    x = [np.append(course.values, np.nan) for course in sweep.courses]
    spectra = [np.vstack([branches(course.spectra), gap]) for course in sweep.courses]
    return np.concatenate(x), np.concatenate(spectra).T


def _panel(about: str, columns: np.ndarray) -> Panel:
    curves = [Curve(f"λ{k}", column.tolist()) for k, column in enumerate(columns, 1)]
    return Panel(about, tuple(curves))


def root_locus(sweep: Sweep) -> str:
    """The eigenvalues in their plane, from pale to dark as the swept value rises."""
    there = np.setdiff1d(np.arange(len(sweep.spectra)), sweep.absent)
    points = sweep.spectra[there].ravel()
    frame = _frame(linear(points.real.tolist()), linear(points.imag.tolist()))
    rows, columns = sweep.spectra.shape
    shades = np.repeat(there / max(rows - 1, 1), columns)
    parts = []
    if frame.along.low < 0 < frame.along.high:
        zero = frame.x(0)
        parts.append(
            element("line", class_="axis", x1=zero, x2=zero, y1=frame.top, y2=frame.bottom)
        )
    for z, shade in zip(points, shades):
        place = {"cx": frame.x(z.real), "cy": frame.y(z.imag)}
        parts.append(element("circle", **place, r=2, fill=_between(PALE, DARK, shade)))
    first, last = sweep.values[0, 0], sweep.values[-1, 0]
    title = f"root locus: {sweep.names[0]} from {first:.4g} (pale) to {last:.4g} (dark)"
    return _drawing(frame, title, ("real part (1/s)", "imaginary part (rad/s)"), parts)


def stability_map(sweep: Sweep) -> str:
    """The largest real part over two names: blue where all decays, from white to red where
    something grows."""
    outer, inner = sweep.names
    there = np.setdiff1d(np.arange(len(sweep.values)), sweep.absent)
    calm = np.sum(~sweep.grows[there]) / len(sweep.values)
    share = f"{calm:.0%} of the map without a growing mode"
    if sweep.absent:
        none = len(sweep.absent) / len(sweep.values)
        share = f"{calm:.0%} no growing mode, {none:.0%} no motion (grey)"
    up, along = (np.unique(sweep.values[:, k]) for k in (0, 1))
    frame = _frame(linear(along.tolist(), tight=True), linear(up.tolist(), tight=True))
    width, height = frame.width / len(along), frame.height / len(up)
    parts = []
    for (y, x), colour in zip(sweep.values, _colours(sweep)):
        place = {
            "x": frame.left + int(np.searchsorted(along, x)) * width,
            "y": frame.bottom - (int(np.searchsorted(up, y)) + 1) * height,
        }
        # a little wider than its share, so that no line shows between two cells
        parts.append(element("rect", **place, width=width + 0.3, height=height + 0.3, fill=colour))
    return _drawing(
        frame, f"{outer} and {inner}: {share}", (sweep.labels[1], sweep.labels[0]), parts
    )


def _colours(sweep: Sweep) -> list[str]:
    """One for each row of the sweep."""
    growth = np.nan_to_num(np.max(sweep.spectra.real, axis=1), nan=0.0)
    most = float(np.max(growth, initial=0.0)) or 1.0
    warm = [_between(FAINT, STRONG, np.clip(x / most, 0, 1) ** 0.5) for x in growth]
    colours = [x if grows else DECAYING for x, grows in zip(warm, sweep.grows)]
    for k in sweep.absent:
        colours[k] = NO_MOTION
    return colours


def _between(first: Sequence[int], last: Sequence[int], part: float) -> str:
    """A colour between two, by its red, green and blue."""
    return "#" + "".join(f"{round(a + (b - a) * part):02x}" for a, b in zip(first, last))


def _frame(along: Axis, up: Axis) -> Frame:
    return Frame(LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM, along, up)


def _drawing(frame: Frame, title: str, names: tuple[str, str], inside: Sequence[str]) -> str:
    """`names` stand below and beside the frame."""
    below, beside = names
    turned = f"translate(14 {(TOP + frame.bottom) / 2:.1f}) rotate(-90)"
    side = text(0, 0, beside, anchor="middle")
    parts = [
        text(LEFT, 18, title, "title"),
        *frame.columns(19, grid=False),
        *frame.rows(grid=False),
        *inside,
        frame.border(),
        text((LEFT + WIDTH) / 2, HEIGHT - 8, below, anchor="middle"),
        element("g", side, transform=turned),
    ]
    return document(WIDTH, HEIGHT, parts, STYLE + AXIS)
