"""Eigenvalues over a range as curves, in their plane, and stability over two names, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hamel.draw import Curve, Panel, draw
from hamel.draw.axis import Axis, linear
from hamel.linear.sweep import Sweep

STYLE = (
    "text{font:12px system-ui,sans-serif;fill:#333}.title{font-size:14px;font-weight:600}"
    ".frame{fill:none;stroke:#888}.axis{stroke:#444;stroke-dasharray:4 3}"
)
WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 560.0, 380.0, 70.0, 30.0, 46.0


def branches(spectra: np.ndarray) -> np.ndarray:
    """The columns sorted so that each follows one eigenvalue from row to row."""
    result = spectra.copy()
    for k in range(1, len(result)):
        ahead = result[k - 1] if k < 2 else 2 * result[k - 1] - result[k - 2]
        result[k] = result[k][_matched(ahead, result[k])]
    return result


def _matched(wanted: np.ndarray, found: np.ndarray) -> list[int]:
    """For each wanted value the nearest that is not taken, the surest first."""
    gaps = np.abs(wanted[:, np.newaxis] - found[np.newaxis, :])
    places = [0] * len(wanted)
    for _ in range(len(wanted)):
        i, j = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        places[int(i)] = int(j)
        gaps[i], gaps[:, j] = np.inf, np.inf
    return places


def over_range(sweep: Sweep) -> str:
    """Real and imaginary parts over the swept name."""
    tracked = branches(sweep.spectra)
    labels = [f"λ{k + 1}" for k in range(tracked.shape[1])]
    real = Panel(
        "real parts (1/s)", tuple(Curve(n, c.real.tolist()) for n, c in zip(labels, tracked.T))
    )
    imaginary = Panel(
        "imaginary parts (rad/s)",
        tuple(Curve(n, c.imag.tolist()) for n, c in zip(labels, tracked.T)),
    )
    return draw(
        f"eigenvalues over {sweep.names[0]}",
        sweep.names[0],
        sweep.values[:, 0].tolist(),
        [real, imaginary],
    )


def root_locus(sweep: Sweep) -> str:
    """The eigenvalues in their plane, from pale to dark as the swept value rises."""
    points = sweep.spectra.ravel()
    along, up = linear(points.real.tolist()), linear(points.imag.tolist())
    many = len(sweep.spectra)
    shade = np.repeat(np.arange(many) / max(many - 1, 1), sweep.spectra.shape[1])
    dots = [
        f'<circle cx="{_x(along, z.real):.1f}" cy="{_y(up, z.imag):.1f}" r="2" fill="{_mixed(s)}"/>'
        for z, s in zip(points, shade)
    ]
    axis = (
        [
            f'<line class="axis" x1="{_x(along, 0):.1f}" x2="{_x(along, 0):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>'
        ]
        if along.low < 0 < along.high
        else []
    )
    title = f"root locus: {sweep.names[0]} from {sweep.values[0, 0]:.4g} (pale) to {sweep.values[-1, 0]:.4g} (dark)"
    return _framed(title, "real part (1/s)", "imaginary part (rad/s)", along, up, [*axis, *dots])


def stability_map(sweep: Sweep) -> str:
    """The largest real part over two names: blue where all decays, from white to red where
    something grows."""
    growth = np.max(sweep.spectra.real, axis=1)
    columns = [np.unique(sweep.values[:, k]) for k in (0, 1)]
    along, up = (linear(c.tolist(), tight=True) for c in (columns[1], columns[0]))
    wide, high = (WIDTH - LEFT - 20) / len(columns[1]), (HEIGHT - TOP - BOTTOM) / len(columns[0])
    most = float(np.max(growth, initial=0.0)) or 1.0
    cells = []
    for (outer, inner), value, bad in zip(sweep.values, growth, sweep.unstable):
        i, j = np.searchsorted(columns[0], outer), np.searchsorted(columns[1], inner)
        colour = _warm(value / most) if bad else "#4a90c4"
        x, y = LEFT + j * wide, HEIGHT - BOTTOM - (i + 1) * high
        cells.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide + 0.3:.1f}" height="{high + 0.3:.1f}" fill="{colour}"/>'
        )
    share = f"{np.mean(~sweep.unstable):.0%} of the map without a growing mode"
    return _framed(
        f"{sweep.names[0]} and {sweep.names[1]}: {share}",
        sweep.names[1],
        sweep.names[0],
        along,
        up,
        cells,
    )


def _x(axis: Axis, value: float) -> float:
    return LEFT + axis.position(value) * (WIDTH - LEFT - 20)


def _y(axis: Axis, value: float) -> float:
    return HEIGHT - BOTTOM - axis.position(value) * (HEIGHT - TOP - BOTTOM)


def _mixed(part: float) -> str:
    return "#" + "".join(
        f"{round(a + (b - a) * part):02x}" for a, b in zip((170, 205, 235), (0, 40, 90))
    )


def _warm(part: float) -> str:
    part = min(max(part, 0.0), 1.0) ** 0.5
    return "#" + "".join(
        f"{round(a + (b - a) * part):02x}" for a, b in zip((255, 245, 235), (190, 40, 20))
    )


def _framed(
    title: str, below: str, beside: str, along: Axis, up: Axis, inside: Sequence[str]
) -> str:
    from html import escape

    parts = [f'<text x="{LEFT}" y="18" class="title">{escape(title)}</text>']
    for at, label in along.ticks:
        x = LEFT + at * (WIDTH - LEFT - 20)
        parts.append(
            f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{label}</text>'
        )
    for at, label in up.ticks:
        y = HEIGHT - BOTTOM - at * (HEIGHT - TOP - BOTTOM)
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
    frame = f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{WIDTH - LEFT - 20}" height="{HEIGHT - TOP - BOTTOM}"/>'
    names = f'<text x="{(LEFT + WIDTH) / 2:.1f}" y="{HEIGHT - 8}" text-anchor="middle">{escape(below)}</text>'
    turned = f"translate(14 {(TOP + HEIGHT - BOTTOM) / 2:.1f}) rotate(-90)"
    side = f'<text transform="{turned}" text-anchor="middle">{escape(beside)}</text>'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" width="{WIDTH:.0f}" role="img">'
    paper = '<rect width="100%" height="100%" fill="#fff"/>'
    return "\n".join(
        [head, f"<style>{STYLE}</style>", paper, *parts, *inside, frame, names, side, "</svg>"]
    )
